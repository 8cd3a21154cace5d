//! The order of the surfaces of a graph: those that no motion crosses come last.

use std::sync::Arc;

use crate::graph::Graph;
use crate::node::Node;

impl Graph {
    /// Renumbers the surfaces so that those whose function contains neither t nor a state come last, but for those in
    /// `kept`; returns the new number of each surface.
    ///
    /// The order is the same otherwise. Nodes keep their numbers.
    ///
    /// # Example
    ///
    /// ```
    /// use filippov_expr::Graph;
    ///
    /// let mut graph = Graph::new();
    /// let (gear, x) = (graph.parameter(0), graph.state(0));
    /// let (of_gear, of_x) = (graph.sign(gear), graph.sign(x));
    /// assert_eq!(graph.put_standing_surfaces_last(&[]), [1, 0]);
    /// assert_eq!(graph.surface(0), x);
    /// assert_eq!((graph.sign(gear), graph.sign(x)), (of_gear, of_x));
    /// ```
    pub fn put_standing_surfaces_last(&mut self, kept: &[u32]) -> Vec<u32> {
        let n = self.n_surfaces() as u32;
        let stands = |j: &u32| !kept.contains(j) && !self.depends_on_motion(self.surface(*j));
        let (last, first): (Vec<u32>, Vec<u32>) = (0..n).partition(stands);
        let order = [first, last].concat();
        let mut number = vec![0; order.len()];
        for (new, &old) in order.iter().enumerate() {
            number[old as usize] = new as u32;
        }
        if order.is_sorted() {
            return number;
        }
        for node in &mut self.nodes {
            if let Node::Sign(surface) | Node::Select { surface, .. } = node {
                *surface = number[*surface as usize];
            }
        }
        let ids = self.ids.values().copied();
        self.ids = ids.map(|id| (self.nodes[id.index()], id)).collect();
        Arc::make_mut(&mut self.surfaces).renumber(&order, &number);
        number
    }
}
