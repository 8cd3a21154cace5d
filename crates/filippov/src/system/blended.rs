//! The field around several surfaces as an expression in the multipliers of sliding on them.

use filippov_expr::{Gradient, Graph, NodeId};

/// Derivatives by signs: position of the surface among those slid on, and node.
pub(super) type BySign = Vec<(usize, NodeId)>;

/// The field as a function of the multipliers, and the rates of the surfaces slid on.
pub(super) struct Blended {
    pub values: Vec<NodeId>,
    pub by_sign: Vec<BySign>,
    /// Each with its derivatives.
    pub rates: Vec<(NodeId, BySign)>,
}

impl Blended {
    /// `None` if the field is not multilinear in the signs of these surfaces.
    pub fn new(graph: &mut Graph, field: &[NodeId], sliding: &[usize]) -> Option<Blended> {
        if sliding.is_empty() {
            return Some(Blended {
                values: field.to_vec(),
                by_sign: vec![Vec::new(); field.len()],
                rates: Vec::new(),
            });
        }
        let surfaces: Vec<u32> = sliding.iter().map(|&j| j as u32).collect();
        let dependence = graph.sign_dependence(field, &surfaces);
        if dependence.surfaces != surfaces {
            return None;
        }
        let position = |j: u32| surfaces.binary_search(&j).ok();
        let by_sign: Vec<BySign> = dependence
            .derivatives
            .iter()
            .map(|all| all.iter().filter_map(|&(j, d)| Some((position(j)?, d))))
            .map(Iterator::collect)
            .collect();
        let mut rates = Vec::with_capacity(sliding.len());
        for &j in &surfaces {
            let Gradient { time, states } = graph.gradient(graph.surface(j));
            let mut nodes = vec![time];
            nodes.extend(states.iter().map(|entry| entry.1));
            let found = graph.sign_dependencies(&nodes, &[]);
            if sliding.iter().any(|&j| found.get(j) == Some(&true)) {
                return None;
            }
            let mut rate = time;
            let mut changes = vec![None; sliding.len()];
            for (i, partial) in states {
                let term = graph.mul(partial, dependence.values[i as usize]);
                rate = graph.add(rate, term);
                for &(k, derivative) in &by_sign[i as usize] {
                    let term = graph.mul(partial, derivative);
                    changes[k] = Some(match changes[k] {
                        Some(sum) => graph.add(sum, term),
                        None => term,
                    });
                }
            }
            let changes = changes.into_iter().enumerate();
            let changes = changes.filter_map(|(k, change)| Some((k, change?)));
            rates.push((rate, changes.collect()));
        }
        Some(Blended {
            values: dependence.values,
            by_sign,
            rates,
        })
    }
}
