//! Hidden dynamics of one surface.

use super::Outcome;
use crate::cube::NormalFields;
use crate::mode::Mode;

/// g is affine between -1 and 1: u moves in one direction until the first zero of g, or for ever.
pub(super) fn limit(fields: &NormalFields, u: f64) -> Outcome {
    let (minus, plus) = (fields.at(0)[0], fields.at(1)[0]);
    let velocity = fields.interpolate(&[u.clamp(-1.0, 1.0)])[0];
    let side = if velocity > 0.0 { 1 } else { -1 };
    let ahead = if side > 0 { plus } else { minus };
    if minus > 0.0 && plus < 0.0 {
        Outcome::Sliding {
            mode: Mode::new(vec![0]),
            multipliers: vec![(minus + plus) / (minus - plus)],
            oscillates: false,
        }
    } else if velocity == 0.0 || ahead == 0.0 {
        Outcome::AtRest
    } else {
        Outcome::Region(Mode::new(vec![side]))
    }
}
