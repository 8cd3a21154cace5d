//! The motions of lower codimension around an intersection: do they come to it, or leave it?

use super::{sign_of, weights};
use crate::cube::NormalFields;
use crate::mode::Mode;
use crate::options::SlidingRule;

/// A motion of lower codimension next to the intersection.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbour {
    /// Its mode, one entry per surface of the intersection.
    pub mode: Mode,
    /// Positive as long as the motion does not leave the intersection: either it comes to it, or there is no such
    /// motion. In units of the largest normal components.
    pub margin: f64,
}

/// All motions of lower codimension with their margins.
///
/// A region k leaves if k_i f_i^k > 0 for all i; sliding on some of the surfaces leaves if it exists and k_i f_i > 0
/// along it for all other surfaces i. The margin is the largest violation of these inequalities, a continuous
/// function of the fields for regions and for sliding on one surface.
pub fn neighbours(rule: SlidingRule, fields: &NormalFields) -> Vec<Neighbour> {
    let m = fields.m();
    let mut entries = vec![-1_i8; m];
    let mut found = Vec::new();
    loop {
        if entries.iter().any(|&k| k != 0) {
            found.push(Neighbour {
                margin: margin(rule, fields, &entries),
                mode: Mode::new(entries.clone()),
            });
        }
        let Some(i) = entries.iter().position(|&k| k < 1) else {
            return found;
        };
        entries[i] += 1;
        entries[..i].fill(-1);
    }
}

fn margin(rule: SlidingRule, fields: &NormalFields, entries: &[i8]) -> f64 {
    let m = fields.m();
    let sliding: Vec<usize> = (0..m).filter(|&j| entries[j] == 0).collect();
    let patterns =
        |k: &usize| (0..m).all(|j| entries[j] == 0 || sign_of(*k, j) == f64::from(entries[j]));
    let face: Vec<usize> = (0..fields.n_patterns()).filter(patterns).collect();
    let (mut margin, shares) = match (sliding.as_slice(), face.as_slice()) {
        ([], _) => (f64::NEG_INFINITY, vec![1.0]),
        (&[j], &[minus, plus]) => {
            let (minus, plus) = (fields.at(minus)[j], fields.at(plus)[j]);
            let sum = minus.abs() + plus.abs();
            if sum == 0.0 {
                return 1.0;
            }
            let violation = (-minus).max(plus) / fields.row_size(j);
            (violation, vec![-plus / sum, minus / sum])
        }
        // The projected field of Dieci and Lopez is not known from normal components.
        _ if rule == SlidingRule::DieciLopez => return 1.0,
        _ => match weights(rule, &fields.restrict(entries)) {
            Ok(weights) if weights.iter().all(|w| *w >= 0.0) => (f64::NEG_INFINITY, weights),
            _ => return 1.0,
        },
    };
    for i in (0..m).filter(|&i| entries[i] != 0) {
        let components = face.iter().zip(&shares);
        let component: f64 = components.map(|(&k, w)| w * fields.at(k)[i]).sum();
        margin = margin.max(-f64::from(entries[i]) * component / fields.row_size(i));
    }
    margin
}
