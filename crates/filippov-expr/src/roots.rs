//! Roots of what is a number in some region: `sqrt(maximum(x, 0))` is the root of x, or 0.
//!
//! Its derivative by the rule for roots is 0/0 where x < 0. So the function is written as a choice, by the signs in its argument.

use crate::graph::Graph;
use crate::node::NodeId;

/// Signs in an argument, of which all combinations are looked at.
const MOST_SIGNS: usize = 3;

impl Graph {
    /// A root of an argument that stands still for some signs in it, as a choice; `None` if there are no such signs, or many.
    pub(crate) fn root_by_regions(
        &mut self,
        argument: NodeId,
        root: impl Fn(&mut Graph, NodeId) -> NodeId,
    ) -> Option<NodeId> {
        if !self.facts(argument).has_sign {
            return None;
        }
        let depends = self.sign_dependencies(&[argument], &[]);
        let surfaces = (0..depends.len()).filter(|&j| depends[j]);
        let surfaces: Vec<usize> = surfaces.take(MOST_SIGNS + 1).collect();
        if surfaces.len() > MOST_SIGNS {
            return None;
        }
        let mut signs = vec![None; depends.len()];
        let mut stands_still = false;
        for pattern in 0..1_usize << surfaces.len() {
            for (bit, &j) in surfaces.iter().enumerate() {
                signs[j] = Some(if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 });
            }
            let value = self.at_signs(&[argument], &signs)[0];
            stands_still |= !self.facts(value).varies;
        }
        if !stands_still {
            return None;
        }
        signs.fill(None);
        let first = surfaces[0];
        let sides = [1.0, -1.0].map(|sign| {
            signs[first] = Some(sign);
            let value = self.at_signs(&[argument], &signs)[0];
            root(self, value)
        });
        Some(self.select(first as u32, 1.0, sides[0], sides[1]))
    }
}
