//! The motion that follows an exit of sliding on one and two surfaces, in closed form: the multipliers reach a side, or meet the
//! other root. It is the same for every scaling of the surfaces for which the root was stable.

use super::incoming::ExitKind;
use super::resolution::{Continuation, Resolution};
use crate::cube::{Bilinear, NormalFields};
use crate::error::Undecided;
use crate::tolerances::AT_SIDE;

/// What follows an exit at a side or at a fold of one or two surfaces.
///
/// Reference: N. Guglielmi, E. Hairer (2022), Figures 4.6 and 4.7; the rules without a normal frame are those of
/// `docs/theory/intersections.md`.
pub(super) fn leave(
    fields: &NormalFields,
    kind: ExitKind,
    lambda: &[f64],
    drift: Option<&[f64]>,
) -> Result<Resolution, Undecided> {
    let (entries, margin) = match (kind, lambda) {
        (ExitKind::Side, _) => at_side(fields, lambda, drift)?,
        (ExitKind::Fold, &[x, y]) => at_fold(fields, [x, y])?,
        _ => return Err(Undecided::NotAnExit),
    };
    let mut resolution = Resolution::sure("exit", Continuation::mode(&entries));
    resolution.margin = margin;
    Ok(resolution)
}

/// Through lambda_i = e the motion leaves to k_i = e. The other surface j is slid on further if G_jj < 0, and else left to
/// the side -e sign G_ji. Of one surface the component that vanishes shows whether the multiplier comes back.
fn at_side(
    fields: &NormalFields,
    lambda: &[f64],
    drift: Option<&[f64]>,
) -> Result<(Vec<i8>, f64), Undecided> {
    let i = usize::from(lambda.len() == 2 && lambda[1].abs() > lambda[0].abs());
    if 1.0 - lambda[i].abs() > AT_SIDE {
        return Err(Undecided::NotAnExit);
    }
    let e = sign(lambda[i]);
    if lambda.len() == 1 {
        let comes_back = drift.is_some_and(|rate| lambda[0] * rate[0] <= 0.0);
        return Ok((vec![if comes_back { 0 } else { e }], f64::INFINITY));
    }
    let (jacobian, j) = (fields.jacobian(lambda), 1 - i);
    let [own, other] = [jacobian[(j, j)], jacobian[(j, i)]];
    let mut entries = vec![e; 2];
    let mut margin = own.abs();
    if own < 0.0 {
        entries[j] = 0;
    } else {
        entries[j] = -e * sign(other);
        margin = margin.min(other.abs());
    }
    Ok((entries, margin / fields.row_size(j)))
}

/// The slow motion follows the curve g_i = 0 with G_ii < 0, away from the other one, to a corner of the square. Where the field
/// beyond leads back it slides.
fn at_fold(fields: &NormalFields, root: [f64; 2]) -> Result<(Vec<i8>, f64), Undecided> {
    let canopy = Bilinear::of_fields(fields);
    let g = canopy.jacobian(root);
    let i = usize::from(g[1][1] < 0.0);
    let j = 1 - i;
    if g[i][i] >= 0.0 {
        return Err(Undecided::NotAnExit);
    }
    let [own, other] = [canopy.rows()[i][3], canopy.rows()[j][3]];
    let bend = g[j][i] * own - other * g[i][i];
    let mut entries = vec![0; 2];
    entries[j] = sign(g[i][j] * bend);
    entries[i] = sign(g[i][j]) * entries[j];
    let sizes = [fields.row_size(0), fields.row_size(1)];
    let f = fields.in_region(&entries);
    let returns = |s: usize| g[s][s] < 0.0 && f64::from(entries[s]) * f[s] < 0.0;
    let slides = [i, j].into_iter().find(|&s| returns(s));
    let decisive = [
        g[i][j] / sizes[i],
        bend / (sizes[0] * sizes[1]),
        f[i] / sizes[i],
    ];
    let margin = decisive
        .into_iter()
        .map(f64::abs)
        .fold(f64::INFINITY, f64::min);
    slides.into_iter().for_each(|s| entries[s] = 0);
    Ok((entries, margin))
}

fn sign(value: f64) -> i8 {
    if value > 0.0 {
        1
    } else {
        -1
    }
}
