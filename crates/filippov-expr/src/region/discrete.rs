//! Values of expressions of discrete states: can they be zero?

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::region::{kind_of, Kind};

/// Which values a discrete state takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Discrete {
    /// Whole numbers.
    Whole,
    /// -1 and +1.
    Side,
    /// Any numbers.
    Real,
}

/// What an expression of discrete states takes as values.
pub(super) struct Found {
    pub kind: Kind,
    /// Its only value.
    pub value: Option<f64>,
    /// The distance of its values.
    pub step: Option<f64>,
    /// Whether it contains no discrete state.
    pub is_number: bool,
}

/// Whole numbers up to this magnitude are tried where the expression is not linear.
const LARGEST_TRIED: i32 = 16;

/// More combinations of them are not tried.
const MOST_TRIED: usize = 5_000;

/// Multiples are told apart by this share of the step.
const SAME_MULTIPLE: f64 = 1e-9;

/// The values of an expression of discrete states, which are the parameters from index `first` on; none if they are not known.
pub(super) fn values(
    graph: &mut Graph,
    node: NodeId,
    first: usize,
    discrete: &[Discrete],
) -> Option<Found> {
    let form = LinearForm::of(graph, node);
    let index = |graph: &Graph, atom: NodeId| match *graph.node(atom) {
        Node::Parameter(k) => (k as usize).checked_sub(first),
        _ => None,
    };
    let states: Option<Vec<(Discrete, f64)>> = form
        .terms
        .iter()
        .map(|&(atom, c)| Some((*discrete.get(index(graph, atom)?)?, c)))
        .collect();
    match states {
        Some(states) => linear(&states, form.constant),
        None => nonlinear(graph, node, first, discrete),
    }
}

/// `sum_k c_k d_k + constant` takes multiples of a step, moved by a constant.
fn linear(states: &[(Discrete, f64)], constant: f64) -> Option<Found> {
    if states.is_empty() {
        return Some(Found {
            kind: kind_of(constant),
            value: Some(constant),
            step: None,
            is_number: true,
        });
    }
    let (mut step, mut offset, mut span) = (0.0, constant, 0.0);
    for &(state, c) in states {
        match state {
            Discrete::Whole => {
                step = common_divisor(step, c.abs())?;
                span = f64::INFINITY;
            }
            Discrete::Side => {
                step = common_divisor(step, 2.0 * c.abs())?;
                offset += c;
                span += c.abs();
            }
            Discrete::Real => return None,
        }
    }
    let rest = offset / step - (offset / step).round();
    let kind = if constant > span * (1.0 + SAME_MULTIPLE) {
        Kind::Positive
    } else if -constant > span * (1.0 + SAME_MULTIPLE) {
        Kind::Negative
    } else if rest.abs() <= SAME_MULTIPLE * (1.0 + (offset / step).abs()) {
        Kind::Zero
    } else {
        Kind::Varies
    };
    Some(Found {
        kind,
        value: None,
        step: Some(step),
        is_number: false,
    })
}

/// The largest number of which both are multiples, by Euclid's algorithm; none if they have none in common.
pub(super) fn common_divisor(a: f64, b: f64) -> Option<f64> {
    let (mut large, mut small) = (a.max(b), a.min(b));
    let least = SAME_MULTIPLE * large;
    while small > least {
        let rest = large % small;
        let rest = if small - rest < least { 0.0 } else { rest };
        (large, small) = (small, rest);
    }
    (large > 1e3 * least).then_some(large)
}

/// Zero is looked for among small whole numbers.
fn nonlinear(
    graph: &mut Graph,
    node: NodeId,
    first: usize,
    discrete: &[Discrete],
) -> Option<Found> {
    let mut used: Vec<usize> = Vec::new();
    for id in graph.all_below(&[node]) {
        if let Node::Parameter(k) = *graph.node(id) {
            used.push((k as usize).checked_sub(first)?);
        }
    }
    let mut points: Vec<Vec<(usize, f64)>> = vec![Vec::new()];
    for k in used {
        let tried: Vec<f64> = match discrete.get(k)? {
            Discrete::Side => vec![-1.0, 1.0],
            Discrete::Whole => (-LARGEST_TRIED..=LARGEST_TRIED).map(f64::from).collect(),
            Discrete::Real => return None,
        };
        if points.len() * tried.len() > MOST_TRIED {
            return None;
        }
        points = points
            .iter()
            .flat_map(|point| {
                let longer = |&value: &f64| [point.as_slice(), &[(first + k, value)]].concat();
                tried.iter().map(longer)
            })
            .collect();
    }
    let is_zero = points.into_iter().any(|point| {
        let at = |k: usize| point.iter().find(|entry| entry.0 == k).map(|entry| entry.1);
        let value = graph.at_parameters(node, at);
        graph.as_constant(value) == Some(0.0)
    });
    Some(Found {
        kind: if is_zero { Kind::Zero } else { Kind::Varies },
        value: None,
        step: None,
        is_number: false,
    })
}
