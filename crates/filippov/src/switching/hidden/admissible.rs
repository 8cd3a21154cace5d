//! All modes in which a motion can leave an intersection, or stay on it.

use std::borrow::Cow;

use smallvec::{smallvec, SmallVec};

use crate::cube::{stable_roots_within, zero_between, Bilinear, Lap, NormalFields, Vector};
use crate::mode::Mode;
use crate::patience::Patience;
use crate::switching::incoming::with_multipliers;
use crate::switching::resolution::Continuation;
use crate::tolerances::MOST_MEETING;

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
    let parts = fields.independent_parts();
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

fn attracting_together(fields: &NormalFields, patience: Patience) -> (Vec<Admissible>, f64) {
    let m = fields.m();
    let corners = fields.values();
    let corner = |pattern: usize| &corners[pattern * m..][..m];
    let mut listing = Listing::new(fields);
    let mut mode: SmallVec<[i8; 4]> = smallvec![-1; m];
    loop {
        let bit = |i: usize| usize::from(mode[i] > 0) << i;
        let pattern: usize = (0..m).map(bit).sum();
        let mut slid_on = (0..m).filter(|&i| mode[i] == 0);
        match (slid_on.next(), slid_on.next()) {
            (None, _) => listing.note(&mode, &[], corner(pattern), f64::INFINITY),
            (Some(i), None) => {
                listing.look_at_edge(&mode, i, corner(pattern), corner(pattern | 1 << i));
            }
            _ => listing.look_at_face(&mode, fields, patience),
        }
        // The next mode in counting order.
        let Some(i) = mode.iter().position(|&k| k < 1) else {
            break;
        };
        mode[i] += 1;
        mode[..i].fill(-1);
    }
    if m == 2 && Lap::around(fields, [-1, -1]).is_some_and(|lap| lap.gamma > 1.0) {
        listing.found.push(Admissible {
            continuation: Continuation::OutwardSpiral,
            multipliers: Vec::new(),
        });
    }
    (listing.found, listing.margin)
}

/// The attracting modes among those that were looked at.
struct Listing {
    found: Vec<Admissible>,
    /// As in [`attracting`].
    margin: f64,
    /// The largest normal components.
    sizes: Vector,
}

impl Listing {
    fn new(fields: &NormalFields) -> Self {
        Listing {
            found: Vec::new(),
            margin: f64::INFINITY,
            sizes: (0..fields.m()).map(|j| fields.row_size(j)).collect(),
        }
    }

    /// A face of one multiplier, between two corners.
    fn look_at_edge(&mut self, mode: &[i8], i: usize, below: &[f64], above: &[f64]) {
        let pull = below[i].min(-above[i]);
        let slides = pull / self.sizes[i];
        if pull <= 0.0 {
            self.margin = self.margin.min(slides.abs());
            return;
        }
        let lambda = zero_between(below[i], above[i]);
        let between = |(b, a): (&f64, &f64)| 0.5 * ((1.0 - lambda) * b + (1.0 + lambda) * a);
        let g: Vector = below.iter().zip(above).map(between).collect();
        self.note(mode, &[lambda], &g, slides);
    }

    /// A face of two multipliers or more. No closed form says how clearly one of three or more has a root.
    fn look_at_face(&mut self, mode: &[i8], fields: &NormalFields, patience: Patience) {
        let slides_on_all = mode.iter().all(|&k| k == 0);
        let face = match slides_on_all {
            true => Cow::Borrowed(fields),
            false => Cow::Owned(fields.restrict(mode)),
        };
        let slides = match face.m() {
            2 => Bilinear::of_fields(&face).root_margin(),
            _ => f64::INFINITY,
        };
        let roots = stable_roots_within(&face, patience);
        if roots.is_empty() {
            self.margin = self.margin.min(slides.abs());
        }
        for multipliers in roots {
            let g: Vector = match slides_on_all {
                true => smallvec![0.0; mode.len()],
                false => fields.interpolate(&with_multipliers(mode, &multipliers)),
            };
            self.note(mode, &multipliers, &g, slides);
        }
    }

    /// A point of the face at which the motion stays on the surfaces slid on, so clearly, with the normal components there.
    fn note(&mut self, mode: &[i8], multipliers: &[f64], g: &[f64], slides: f64) {
        let leaves = smallest_departure(g, mode, &self.sizes);
        self.margin = self.margin.min(leaves.min(slides).abs());
        if leaves > 0.0 {
            self.found.push(Admissible {
                continuation: Continuation::mode(mode),
                multipliers: multipliers.to_vec(),
            });
        }
    }
}

/// How clearly these normal components leave the surfaces that the mode does not slide on, by the one least left.
fn smallest_departure(g: &[f64], mode: &[i8], sizes: &[f64]) -> f64 {
    let left = (0..mode.len()).filter(|&i| mode[i] != 0);
    // All fields may be tangent to a surface; that is not left.
    left.map(|i| f64::from(mode[i]) * g[i] / sizes[i].max(f64::MIN_POSITIVE))
        .fold(f64::INFINITY, f64::min)
}
