//! An expression that is identically zero in some region, in pieces: a comparison with zero is decided there by the number 0,
//! and elsewhere by what the expression is on the sides of the surfaces inside of it.

use super::{Kind, Numbers, Regions};
use crate::linear::LinearForm;
use crate::node::NodeId;

/// Combinations of signs that are looked at where an expression is nowhere identically zero.
const MOST_OF_NO_ZERO: usize = 64;

/// An expression, by the sides of the surfaces inside of it.
#[derive(Debug, Clone, PartialEq)]
pub enum Pieces {
    /// Here it is this expression.
    Part(NodeId, PartSign),
    /// On the two sides of a surface: where its function is positive, and where it is negative.
    Sides(u32, Box<[Pieces; 2]>),
}

/// What is known of the sign of a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PartSign {
    /// It is this; 0 where the part is identically zero.
    Known(f64),
    /// The part contains discrete states alone, and is zero for some values of them.
    Held,
    /// Nothing.
    Open,
}

impl Pieces {
    /// The pieces on the sides of a surface. A part that they have in common on one side of another one stands alone there:
    /// the surface ends at that one.
    fn on_sides(surface: u32, plus: Pieces, minus: Pieces, by_value: bool) -> Pieces {
        let are_same = |a: &Pieces, b: &Pieces| {
            a == b || !by_value && a.known_sign().is_some() && a.known_sign() == b.known_sign()
        };
        match (&plus, &minus) {
            (Pieces::Sides(k, above), Pieces::Sides(l, below)) if k == l => {
                let [of_plus, of_minus] = [0, 1].map(|side| {
                    let sides = [above[side].clone(), below[side].clone()];
                    match are_same(&sides[0], &sides[1]) {
                        true => Ok(sides[0].clone()),
                        false => Err(Pieces::Sides(surface, Box::new(sides))),
                    }
                });
                if of_plus.is_ok() || of_minus.is_ok() {
                    let [a, b] = [of_plus, of_minus].map(|side| side.unwrap_or_else(|sides| sides));
                    return Pieces::Sides(*k, Box::new([a, b]));
                }
            }
            _ => {}
        }
        Pieces::Sides(surface, Box::new([plus, minus]))
    }

    fn has_zero(&self) -> bool {
        match self {
            Pieces::Part(_, PartSign::Known(sign)) => *sign == 0.0,
            Pieces::Part(_, sign) => *sign == PartSign::Held,
            Pieces::Sides(_, sides) => sides.iter().any(Pieces::has_zero),
        }
    }

    fn has_open(&self) -> bool {
        match self {
            Pieces::Part(_, sign) => *sign == PartSign::Open,
            Pieces::Sides(_, sides) => sides.iter().any(Pieces::has_open),
        }
    }

    fn known_sign(&self) -> Option<f64> {
        match self {
            Pieces::Part(_, PartSign::Known(sign)) => Some(*sign),
            _ => None,
        }
    }
}

impl Regions {
    /// The pieces of an expression. If it is nowhere identically zero, and its sign is open in some of them, it is one open piece,
    /// unless `in_full`. `None` if they were not found out by looking at `most` combinations of signs.
    ///
    /// # Example
    /// ```
    /// use filippov_expr::{Graph, PartSign, Pieces, Regions};
    ///
    /// let mut graph = Graph::new();
    /// let (x, one, zero) = (graph.state(0), graph.constant(1.0), graph.constant(0.0));
    /// let beyond = graph.sub(x, one);
    /// let excess = graph.maximum(beyond, zero);
    /// // maximum(x - 1, 0) is positive beyond the surface x - 1 = 0, and zero before it.
    /// let found = Regions::new(graph, Vec::new(), Vec::new()).pieces(excess, 100, false);
    /// let part = |value, sign| Pieces::Part(value, PartSign::Known(sign));
    /// let sides = [part(beyond, 1.0), part(zero, 0.0)];
    /// assert_eq!(found, Some(Pieces::Sides(0, Box::new(sides))));
    /// ```
    pub fn pieces(&mut self, node: NodeId, most: usize, in_full: bool) -> Option<Pieces> {
        if !in_full {
            let split = self.split(node, most, false);
            let has_zero = split.regions.iter().any(|region| region.kind == Kind::Zero);
            if !split.is_complete {
                return None;
            }
            if !has_zero {
                let depends = self.graph.sign_dependencies(&[node], &[]);
                let n_inner = depends.into_iter().filter(|depends| *depends).count();
                if 1 << n_inner.min(31) > MOST_OF_NO_ZERO && !self.graph.is_stepwise(node) {
                    return Some(Pieces::Part(node, PartSign::Open));
                }
                let before = (self.used_parameters, self.is_at_border);
                let pieces = self.all_pieces(node, MOST_OF_NO_ZERO.min(most), false);
                let pieces = pieces.unwrap_or(Pieces::Part(node, PartSign::Open));
                if pieces.has_open() {
                    // For other parameters it may be left in one piece as well.
                    (self.used_parameters, self.is_at_border) = before;
                }
                return Some(pieces);
            }
        }
        self.all_pieces(node, most, in_full)
    }

    fn all_pieces(&mut self, node: NodeId, mut most: usize, in_full: bool) -> Option<Pieces> {
        let signs = vec![None; self.graph.n_surfaces()];
        self.pieces_at(node, &signs, in_full, &mut most)
    }

    fn pieces_at(
        &mut self,
        value: NodeId,
        signs: &[Option<f64>],
        in_full: bool,
        budget: &mut usize,
    ) -> Option<Pieces> {
        *budget = budget.checked_sub(1)?;
        let form = LinearForm::of(&self.graph, value);
        if !self.graph.facts(value).has_sign || form.is_zero() {
            // All parts of an expression are to be those for all parameters.
            let numbers = match in_full {
                true => Numbers::Constants,
                false => Numbers::All,
            };
            let (region, _) = self.region(value, &form, signs.to_vec(), numbers);
            let sign = match region.kind {
                Kind::Zero if region.value == Some(0.0) => PartSign::Known(0.0),
                Kind::Zero => PartSign::Held,
                Kind::Positive => PartSign::Known(1.0),
                Kind::Negative => PartSign::Known(-1.0),
                Kind::Varies => PartSign::Open,
            };
            return Some(Pieces::Part(value, sign));
        }
        let depends = self.graph.sign_dependencies(&[value], &[]);
        let k = depends.iter().position(|&depends| depends)?;
        let mut sides = Vec::new();
        for sign in [1.0, -1.0] {
            let mut signs = signs.to_vec();
            signs[k] = Some(sign);
            if self.is_possible(&signs, None) {
                let value = self.graph.at_signs(&[value], &signs)[0];
                sides.push(self.pieces_at(value, &signs, in_full, budget)?);
            }
        }
        let minus = sides.pop()?;
        let Some(plus) = sides.pop() else {
            return Some(minus);
        };
        let same = plus
            .known_sign()
            .filter(|sign| minus.known_sign() == Some(*sign));
        if let (Some(sign), false) = (same, in_full) {
            return Some(Pieces::Part(value, PartSign::Known(sign)));
        }
        let is_open = plus.has_open() || minus.has_open();
        if in_full || !is_open || plus.has_zero() || minus.has_zero() {
            return Some(Pieces::on_sides(k as u32, plus, minus, in_full));
        }
        Some(Pieces::Part(value, PartSign::Open))
    }
}
