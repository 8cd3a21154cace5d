//! An expression that is identically zero in some region, in pieces: a comparison with zero is decided there by the number 0,
//! and elsewhere by what the expression is on the sides of the surfaces inside of it.

use super::{is_zero, Kind, Regions};
use crate::linear::LinearForm;
use crate::node::NodeId;

/// The sign of an expression, by the sides of the surfaces inside of it.
#[derive(Debug, Clone, PartialEq)]
pub enum Pieces {
    /// Here the sign is known: 0 where the expression is identically zero.
    Known(f64),
    /// Here the expression contains discrete states alone, and is zero for some values of them.
    Held(NodeId),
    /// Here it is this expression, whose sign is open; it may have more surfaces inside.
    Open(NodeId),
    /// On the two sides of a surface: where its function is positive, and where it is negative.
    Sides(u32, Box<[Pieces; 2]>),
}

impl Pieces {
    fn has_zero(&self) -> bool {
        match self {
            Pieces::Known(sign) => *sign == 0.0,
            Pieces::Held(_) => true,
            Pieces::Open(_) => false,
            Pieces::Sides(_, sides) => sides.iter().any(Pieces::has_zero),
        }
    }
}

impl Regions {
    /// The pieces of an expression. Where it is nowhere identically zero it is one open piece, unless `in_full`. `None` if that
    /// was not found out by looking at `most` combinations of signs.
    ///
    /// # Example
    /// ```
    /// use filippov_expr::{Graph, Pieces, Regions};
    ///
    /// let mut graph = Graph::new();
    /// let (x, one, zero) = (graph.state(0), graph.constant(1.0), graph.constant(0.0));
    /// let beyond = graph.sub(x, one);
    /// let excess = graph.maximum(beyond, zero);
    /// // maximum(x - 1, 0) is positive beyond the surface x - 1 = 0, and zero before it.
    /// let found = Regions::new(graph, Vec::new(), Vec::new()).pieces(excess, 100, false);
    /// let sides = [Pieces::Known(1.0), Pieces::Known(0.0)];
    /// assert_eq!(found, Some(Pieces::Sides(0, Box::new(sides))));
    /// ```
    pub fn pieces(&mut self, node: NodeId, most: usize, in_full: bool) -> Option<Pieces> {
        if !in_full {
            let split = self.split(node, most, false);
            let has_zero = split.regions.iter().any(|region| region.kind == Kind::Zero);
            if !split.is_complete || !has_zero {
                return split.is_complete.then_some(Pieces::Open(node));
            }
        }
        let (signs, mut budget) = (vec![None; self.graph.n_surfaces()], most);
        self.pieces_at(node, &signs, in_full, &mut budget)
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
        if !self.graph.facts(value).has_sign || is_zero(&form) {
            let (region, _) = self.region(value, &form, signs.to_vec());
            return Some(match region.kind {
                Kind::Zero if region.value == Some(0.0) => Pieces::Known(0.0),
                Kind::Zero => Pieces::Held(value),
                Kind::Positive => Pieces::Known(1.0),
                Kind::Negative => Pieces::Known(-1.0),
                Kind::Varies => Pieces::Open(value),
            });
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
        Some(match (&plus, &minus) {
            (Pieces::Known(a), Pieces::Known(b)) if a == b => plus,
            _ if in_full || plus.has_zero() || minus.has_zero() => {
                Pieces::Sides(k as u32, Box::new([plus, minus]))
            }
            _ => Pieces::Open(value),
        })
    }
}
