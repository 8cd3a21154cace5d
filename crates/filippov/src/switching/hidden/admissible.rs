//! All modes in which a motion can leave an intersection, or stay on it.

use std::borrow::Cow;

use smallvec::{smallvec, SmallVec};

use crate::cube::{stable_roots_within, Bilinear, Lap, Matrix, NormalFields, Vector};
use crate::mode::Mode;
use crate::patience::Patience;
use crate::switching::incoming::with_multipliers;
use crate::switching::resolution::Continuation;
use crate::tolerances::{MOST_MEETING, PROPORTIONAL};

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
    attracting_together(fields, patience).0
}

/// As [`admissible_within`], with the distance of the fields to others that have another list, as a fraction of their size:
/// the smallest of all modes, each as far from this as the condition that it fails most clearly, or fulfils
/// least. Neither the stability of roots nor roots of three and more multipliers count.
///
/// Surfaces in parts that do not act on one another are looked at part by part: the list is then that of all combinations.
/// `None` for more than [`MOST_MEETING`] surfaces in one part, or for more combinations than these have modes.
pub(in crate::switching) fn attracting(
    fields: &NormalFields,
    patience: Patience,
) -> Option<(Vec<Admissible>, f64)> {
    let m = fields.m();
    if m <= 2 {
        return Some(attracting_together(fields, patience));
    }
    let parts = independent_parts(fields);
    if parts.iter().any(|part| part.len() > MOST_MEETING) {
        return None;
    }
    let mut whole = vec![(vec![0; m], vec![0.0; m])];
    let mut margin = f64::INFINITY;
    for part in parts {
        let mut held = vec![-1; m];
        part.iter().for_each(|&i| held[i] = 0);
        let (found, own_margin) = attracting_together(&fields.restrict(&held), patience);
        margin = margin.min(own_margin);
        let combined = found.iter().flat_map(|one| {
            let entries = one.continuation.as_mode().map_or(&[][..], Mode::entries);
            let lambda = with_multipliers(entries, &one.multipliers);
            let part = &part;
            whole.iter().map(move |(mode, multipliers)| {
                let (mut mode, mut multipliers) = (mode.clone(), multipliers.clone());
                for ((&i, &entry), &value) in part.iter().zip(entries).zip(&lambda) {
                    (mode[i], multipliers[i]) = (entry, value);
                }
                (mode, multipliers)
            })
        });
        whole = combined.collect();
        if whole.len() > 3_usize.pow(MOST_MEETING as u32) {
            return None;
        }
    }
    let found = whole.into_iter().map(|(mode, lambda)| Admissible {
        multipliers: (0..m)
            .filter(|&i| mode[i] == 0)
            .map(|i| lambda[i])
            .collect(),
        continuation: Continuation::mode(&mode),
    });
    Some((found.collect(), margin))
}

/// The surfaces in parts of which none acts on another one's rates.
fn independent_parts(fields: &NormalFields) -> Vec<Vec<usize>> {
    let mut acts = Matrix::zeros(fields.m());
    let sizes: Vec<f64> = (0..fields.m()).map(|j| fields.row_size(j)).collect();
    for p in 0..fields.m() {
        for (j, value) in fields.columns(p).flat_map(|c| c.into_iter().enumerate()) {
            // An entry that is rounding of its row does not act.
            if value.abs() > PROPORTIONAL * sizes[j] {
                (acts[(j, p)], acts[(p, j)]) = (1.0, 1.0);
            }
        }
    }
    acts.strong_parts()
}

fn attracting_together(fields: &NormalFields, patience: Patience) -> (Vec<Admissible>, f64) {
    let m = fields.m();
    let sizes: Vector = (0..m).map(|j| fields.row_size(j)).collect();
    let (mut found, mut margin) = (Vec::new(), f64::INFINITY);
    let mut mode: SmallVec<[i8; 4]> = smallvec![-1; m];
    loop {
        let (points, slides) = roots_of_mode(fields, &mode, &sizes, patience);
        if points.is_empty() {
            margin = margin.min(slides.abs());
        }
        for MeetingPoint { multipliers, g } in points {
            let leaves = smallest_departure(&g, &mode, &sizes);
            margin = margin.min(leaves.min(slides).abs());
            if leaves > 0.0 {
                found.push(Admissible {
                    continuation: Continuation::mode(&mode),
                    multipliers,
                });
            }
        }
        // The next mode in counting order.
        let Some(i) = mode.iter().position(|&k| k < 1) else {
            break;
        };
        mode[i] += 1;
        mode[..i].fill(-1);
    }
    if m == 2 && Lap::around(fields, [-1, -1]).is_some_and(|lap| lap.gamma > 1.0) {
        found.push(Admissible {
            continuation: Continuation::OutwardSpiral,
            multipliers: Vec::new(),
        });
    }
    (found, margin)
}

/// A point of the cube at which a mode may move.
struct MeetingPoint {
    /// Of the surfaces slid on.
    multipliers: Vec<f64>,
    /// The normal components there.
    g: Vector,
}

/// Finds the stable roots on the face of a mode, and says how clearly a face of one or two multipliers has a root. On larger
/// faces no closed form says that, and the margin is infinite. A corner is its own root.
fn roots_of_mode(
    fields: &NormalFields,
    mode: &[i8],
    sizes: &[f64],
    patience: Patience,
) -> (SmallVec<[MeetingPoint; 1]>, f64) {
    let mut slid_on = (0..mode.len()).filter(|&i| mode[i] == 0);
    let (first, second) = (slid_on.next(), slid_on.next());
    let Some(i) = first else {
        let corner = MeetingPoint {
            multipliers: Vec::new(),
            g: Vector::from_slice(&fields.in_region(mode)),
        };
        return (smallvec![corner], f64::INFINITY);
    };
    if second.is_none() {
        let [below, above] = fields.on_both_sides(mode, i);
        let slides = below[i].min(-above[i]);
        let root = (slides > 0.0).then(|| {
            let lambda = (below[i] + above[i]) / (below[i] - above[i]);
            let between = |(b, a): (&f64, &f64)| 0.5 * ((1.0 - lambda) * b + (1.0 + lambda) * a);
            MeetingPoint {
                multipliers: vec![lambda],
                g: below.iter().zip(&*above).map(between).collect(),
            }
        });
        return (root.into_iter().collect(), slides / sizes[i]);
    }
    let slides_on_all = mode.iter().all(|&k| k == 0);
    let face = match slides_on_all {
        true => Cow::Borrowed(fields),
        false => Cow::Owned(fields.restrict(mode)),
    };
    let slides = match face.m() {
        2 => Bilinear::of_fields(&face).root_margin(),
        _ => f64::INFINITY,
    };
    let roots = stable_roots_within(&face, patience).into_iter();
    let points = roots.map(|multipliers| MeetingPoint {
        g: match slides_on_all {
            true => smallvec![0.0; mode.len()],
            false => fields.interpolate(&with_multipliers(mode, &multipliers)),
        },
        multipliers,
    });
    (points.collect(), slides)
}

/// How clearly these normal components leave the surfaces that the mode does not slide on, by the one least left.
fn smallest_departure(g: &[f64], mode: &[i8], sizes: &[f64]) -> f64 {
    let left = (0..mode.len()).filter(|&i| mode[i] != 0);
    // All fields may be tangent to a surface; that is not left.
    left.map(|i| f64::from(mode[i]) * g[i] / sizes[i].max(f64::MIN_POSITIVE))
        .fold(f64::INFINITY, f64::min)
}
