//! Which of the surfaces that vanish at a point matter there.

use super::PiecewiseSystem;
use crate::mode::Mode;
use crate::tolerances::MOST_MEETING;

/// Those of the vanishing surfaces that the field of the mode depends on, on some of their sides.
pub(crate) fn surfaces_that_matter(
    system: &dyn PiecewiseSystem,
    mode: &Mode,
    zeros: Vec<usize>,
) -> Vec<usize> {
    let mut matters = vec![false; system.n_surfaces()];
    let mut active = matters.clone();
    // Few surfaces: all patterns; many: each alone.
    let all = zeros.len() <= MOST_MEETING;
    let patterns = if all {
        1_usize << zeros.len()
    } else {
        zeros.len() + 1
    };
    for pattern in 0..patterns {
        let mut tried = mode.clone();
        for (bit, &j) in zeros.iter().enumerate() {
            let up = if all {
                pattern >> bit & 1 == 1
            } else {
                pattern == bit
            };
            tried.set(j, if up { 1 } else { -1 });
        }
        let sliding: Vec<usize> = tried.sliding_set().collect();
        system.active(&tried.signs(), &sliding, &mut active);
        matters.iter_mut().zip(&active).for_each(|(m, a)| *m |= a);
    }
    zeros.into_iter().filter(|&j| matters[j]).collect()
}
