//! One surface, from its normal components alone: Figures 4.1 and 4.2.

use super::normal_fields::NormalFields;
use super::resolution::{Continuation, Resolution, Signs, Undecided};

/// A motion from region `side` reaches the surface: it crosses if the field on the other side leads
/// on, and slides otherwise.
pub(super) fn arrive(fields: &NormalFields, side: i8) -> Result<Resolution, Undecided> {
    let size = size(fields)?;
    let mut signs = Signs::new();
    let towards = |k: i8| -f64::from(side) * fields.in_region(&[k])[0] / size;
    if !signs.positive(towards(side)) {
        return Err(Undecided::NotArriving { surface: 0 });
    }
    let resolution = if signs.positive(towards(-side)) {
        Resolution::sure("F4.1/cross", Continuation::mode(&[-side]))
    } else {
        Resolution::sure("F4.1/slide", Continuation::mode(&[0]))
    };
    Ok(signs.settle(resolution))
}

/// The multiplier of sliding has reached `lambda` = -1 or +1. Sliding ends, unless the normal
/// component that vanishes there changes at a rate (`drift`) that restores its sign.
pub(super) fn leave(
    fields: &NormalFields,
    lambda: f64,
    drift: Option<f64>,
) -> Result<Resolution, Undecided> {
    size(fields)?;
    let side = if lambda < 0.0 { -1 } else { 1 };
    let mut signs = Signs::new();
    let outwards = drift.is_none_or(|rate| signs.positive(f64::from(side) * rate));
    let resolution = if !outwards {
        Resolution::sure("F4.2/stay", Continuation::mode(&[0]))
    } else if side < 0 {
        Resolution::sure("F4.2/minus", Continuation::mode(&[-1]))
    } else {
        Resolution::sure("F4.2/plus", Continuation::mode(&[1]))
    };
    Ok(signs.settle(resolution))
}

fn size(fields: &NormalFields) -> Result<f64, Undecided> {
    match fields.size() {
        0.0 => Err(Undecided::Tangent { surface: 0 }),
        size => Ok(size),
    }
}
