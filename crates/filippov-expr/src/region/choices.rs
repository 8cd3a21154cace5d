//! Sums of choices between two numbers each, as counts and weighted votes are: can they be zero?

use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::Node;
use crate::region::discrete::common_divisor;

/// Sums of more choices are not enumerated: half of them are, twice.
const MOST_ENUMERATED: usize = 24;

/// Sums are told from zero by this share of the sum of all magnitudes.
const ROUNDING: f64 = 1e-12;

/// Whether a sum is made of such choices and no combination of them, whether a point has it or not, is zero.
///
/// The sum is `low + sum_k d_k` over the choices that are taken, with d_k > 0. It is not zero if its range does not contain
/// zero, if `low` is no multiple of what all d_k are multiples of, or if an enumeration finds none.
pub(super) fn are_never_zero(graph: &Graph, form: &LinearForm) -> bool {
    let (mut low, mut size, mut steps) = (form.constant, form.constant.abs(), Vec::new());
    for &(atom, c) in &form.terms {
        let (a, b) = match *graph.node(atom) {
            Node::Sign(_) => (-1.0, 1.0),
            Node::Select { plus, minus, .. } => {
                match (graph.as_constant(plus), graph.as_constant(minus)) {
                    (Some(a), Some(b)) => (a, b),
                    _ => return false,
                }
            }
            _ => return false,
        };
        let (a, b) = (c * a, c * b);
        low += a.min(b);
        size += a.abs() + b.abs();
        steps.push((a - b).abs());
    }
    let high: f64 = low + steps.iter().sum::<f64>();
    let rounding = ROUNDING * size;
    if low > rounding || high < -rounding {
        return true;
    }
    let divisor = steps
        .iter()
        .try_fold(0.0, |g, &step| common_divisor(g, step));
    if let Some(divisor) = divisor.filter(|&g| g > 0.0) {
        let off = |value: f64| (value / divisor - (value / divisor).round()).abs();
        let rounding = ROUNDING * (1.0 + size / divisor);
        if steps.iter().all(|&step| off(step) <= rounding) {
            return off(low) > rounding;
        }
    }
    steps.len() <= MOST_ENUMERATED && !have_sum(&steps, -low, rounding)
}

/// Whether some of the steps have this sum, up to rounding: the sums of one half are looked for among those of the other.
fn have_sum(steps: &[f64], wanted: f64, rounding: f64) -> bool {
    let (first, second) = steps.split_at(steps.len() / 2);
    let mut known = sums(first);
    known.sort_unstable_by(f64::total_cmp);
    sums(second).into_iter().any(|sum| {
        let missing = wanted - sum;
        let next = known.partition_point(|&value| value < missing - rounding);
        known
            .get(next)
            .is_some_and(|&value| value <= missing + rounding)
    })
}

fn sums(steps: &[f64]) -> Vec<f64> {
    let mut found = vec![0.0];
    for step in steps {
        let longer: Vec<f64> = found.iter().map(|sum| sum + step).collect();
        found.extend(longer);
    }
    found
}
