//! Surfaces that both fields cross at the same rate: to stay on one, a motion has to keep that rate at zero too.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::NodeId;

/// The rate of a switching function on its own surface, along the fields of both sides.
#[derive(Debug, Clone, PartialEq)]
pub enum RateOnSurface {
    /// It is not the same for both.
    Jumps,
    /// It is the same all over the surface, and constant.
    Constant,
    /// It is the same all over the surface: this rate, and the field on the surface.
    Same(NodeId, Vec<NodeId>),
}

impl Graph {
    /// The rate g of switching function `index` on its own surface.
    ///
    /// On the surface h is zero in whatever contains it: `sqrt(abs(h)) * sign(h)` is zero, and the field loses its slope there.
    /// A motion that stays on the surface has h = g = 0, and slides on g = 0 with this field.
    ///
    /// # Example
    /// ```
    /// use filippov_expr::{Graph, RateOnSurface};
    /// let mut g = Graph::new();
    /// let (x, v) = (g.state(0), g.state(1));
    /// let sign = g.sign(x);
    /// let push = g.neg(sign);
    /// assert_eq!(g.rate_on_surface(&[v, push], 0), RateOnSurface::Same(v, vec![v, push]));
    /// assert_eq!(g.rate_on_surface(&[push, v], 0), RateOnSurface::Jumps);
    /// ```
    pub fn rate_on_surface(&mut self, field: &[NodeId], index: u32) -> RateOnSurface {
        let h = self.surface(index);
        let field = self.where_zero(field, h);
        let mut signs = vec![None; self.n_surfaces()];
        let rates = [-1.0, 1.0].map(|side| {
            signs[index as usize] = Some(side);
            let field = self.at_signs(&field, &signs);
            let rate = self.directional(h, &field);
            self.where_zero(&[rate], h)[0]
        });
        let differ = LinearForm::of_sum(self, &[(rates[0], 1.0), (rates[1], -1.0)], 0.0);
        match differ.is_zero() {
            false => RateOnSurface::Jumps,
            true if self.depends_on_motion(rates[1]) => RateOnSurface::Same(rates[1], field),
            true => RateOnSurface::Constant,
        }
    }

    /// Whether an expression is zero where switching function `index` is, being a multiple of it.
    pub fn is_multiple_of_surface(&self, node: NodeId, index: u32) -> bool {
        let [own, other] = [node, self.surface(index)].map(|id| LinearForm::of(self, id).key());
        matches!((own, other), (Some((own, _)), Some((other, _))) if own.matches(&other))
    }

    /// The same graph with another switching function.
    ///
    /// # Panics
    /// If there are not so many surfaces.
    #[must_use]
    pub fn with_surface(mut self, index: u32, function: NodeId) -> Self {
        Arc::make_mut(&mut self.surfaces).functions[index as usize] = function;
        self
    }

    /// The values where `h` is zero: it, and every multiple of it, becomes 0.
    fn where_zero(&mut self, roots: &[NodeId], h: NodeId) -> Vec<NodeId> {
        let Some((key, _)) = LinearForm::of(self, h).key() else {
            return roots.to_vec();
        };
        let zero = self.constant(0.0);
        let mut image: FxHashMap<NodeId, NodeId> = FxHashMap::default();
        for id in self.all_below(roots) {
            let moved = |operand: NodeId| image.get(&operand).copied().unwrap_or(operand);
            let form = LinearForm::of(self, id).key();
            let new = if form.is_some_and(|(form, _)| form.matches(&key)) {
                zero
            } else if self.node(id).operands().any(|a| moved(a) != a) {
                self.with_operands(id, moved)
            } else {
                continue;
            };
            image.insert(id, new);
        }
        let image = |root: &NodeId| image.get(root).copied().unwrap_or(*root);
        roots.iter().map(image).collect()
    }
}
