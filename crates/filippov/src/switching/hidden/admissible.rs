//! All modes in which a motion can leave an intersection, or stay on it.

use crate::mode::Mode;
use crate::switching::codim2::Lap;
use crate::switching::normal_fields::NormalFields;
use crate::switching::patience::Patience;
use crate::switching::resolution::Continuation;
use crate::switching::roots::stable_roots_within;

/// A continuation that is possible without regard to the past.
#[derive(Clone, Debug, PartialEq)]
pub struct Admissible {
    /// The continuation.
    pub continuation: Continuation,
    /// lambda of the surfaces that its mode slides on.
    pub multipliers: Vec<f64>,
}

/// Lists the attracting continuations: for each mode k the root lambda of its face that is stable
/// for some scaling, if the field there leaves every other surface i on the side k_i,
///
/// ```text
/// k_i g_i(lambda) > 0 for all i with k_i != 0,
/// ```
///
/// and for two surfaces with rotating fields and gamma > 1 the outward spiral. Several entries mean
/// that the Filippov solution from such a point is not unique. For three and more surfaces, spirals
/// around two of them while a third one is left are not looked for.
pub fn admissible(fields: &NormalFields) -> Vec<Admissible> {
    admissible_within(fields, Patience::endless())
}

/// As [`admissible`]; some of them when the caller has waited long enough.
pub fn admissible_within(fields: &NormalFields, patience: Patience) -> Vec<Admissible> {
    let mut found = Vec::new();
    let mut mode = vec![-1_i8; fields.m()];
    loop {
        found.extend(in_mode(fields, &mode, patience));
        // The next mode in counting order.
        let Some(i) = mode.iter().position(|&k| k < 1) else {
            break;
        };
        mode[i] += 1;
        mode[..i].fill(-1);
    }
    if fields.m() == 2 && Lap::around(fields, [-1, -1]).is_some_and(|lap| lap.gamma > 1.0) {
        found.push(Admissible {
            continuation: Continuation::OutwardSpiral,
            multipliers: Vec::new(),
        });
    }
    found
}

fn in_mode(fields: &NormalFields, mode: &[i8], patience: Patience) -> Vec<Admissible> {
    let leaves = |multipliers: &Vec<f64>| {
        let mut next = multipliers.iter();
        let held = |&k: &i8| {
            if k == 0 {
                next.next().copied()
            } else {
                Some(f64::from(k))
            }
        };
        let lambda: Vec<f64> = mode.iter().filter_map(held).collect();
        let g = fields.interpolate(&lambda);
        mode.iter()
            .zip(g)
            .all(|(&k, g)| k == 0 || f64::from(k) * g > 0.0)
    };
    let roots = stable_roots_within(&fields.restrict(mode), patience);
    let admissible = |multipliers| Admissible {
        continuation: Continuation::Mode(Mode::new(mode.to_vec())),
        multipliers,
    };
    roots.into_iter().filter(leaves).map(admissible).collect()
}
