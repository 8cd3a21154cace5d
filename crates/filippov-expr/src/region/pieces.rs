//! An expression that is identically zero in some region, in pieces: a comparison with zero is decided there by the number 0,
//! and elsewhere by what the expression is on the sides of the surfaces inside of it.

use super::{is_zero, Kind, Regions};
use crate::linear::LinearForm;
use crate::node::NodeId;

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
    fn has_zero(&self) -> bool {
        match self {
            Pieces::Part(_, PartSign::Known(sign)) => *sign == 0.0,
            Pieces::Part(_, sign) => *sign == PartSign::Held,
            Pieces::Sides(_, sides) => sides.iter().any(Pieces::has_zero),
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
    /// The pieces of an expression. Where it is nowhere identically zero it is one open piece, unless `in_full`. `None` if that
    /// was not found out by looking at `most` combinations of signs.
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
            if !split.is_complete || !has_zero {
                return split
                    .is_complete
                    .then_some(Pieces::Part(node, PartSign::Open));
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
        if in_full || plus.has_zero() || minus.has_zero() {
            return Some(Pieces::Sides(k as u32, Box::new([plus, minus])));
        }
        let same = plus
            .known_sign()
            .filter(|sign| minus.known_sign() == Some(*sign));
        Some(Pieces::Part(
            value,
            same.map_or(PartSign::Open, PartSign::Known),
        ))
    }
}
