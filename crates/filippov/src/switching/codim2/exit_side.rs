//! The root leaves the square through a side: Figure 4.6.

use super::{Bilinear, Corners, Frame};
use crate::switching::resolution::{Continuation, Resolution, Signs, Undecided};
use crate::tolerances::AT_SIDE;

/// Decides what follows where a multiplier of sliding on two surfaces reaches -1 or +1.
///
/// In the frame where lambda_1 = +1, with G at the root:
///
/// | test | continuation | leaf |
/// |---|---|---|
/// | G22 < 0 | (+, 0), lambda_2 as it was | `Xa/sliding` |
/// | G22 > 0, G21 > 0 | (+, -) | `Xa/down` |
/// | G22 > 0, G21 < 0 | (+, +) | `Xa/up` |
///
/// Reference: Guglielmi, Hairer (2022), section 4.3.1.
///
/// # Errors
/// If neither multiplier is -1 or +1.
pub fn leave_at_side(corners: &Corners, lambda: [f64; 2]) -> Result<Resolution, Undecided> {
    let exchange = lambda[1].abs() > lambda[0].abs();
    let leaving = lambda[usize::from(exchange)];
    let on_side = (leaving.abs() - 1.0).abs() <= AT_SIDE;
    if !on_side {
        return Err(Undecided::NotAnExit);
    }
    let frame = Frame {
        exchange,
        reflect: [leaving < 0.0, false],
    };
    let bilinear = Bilinear::of(&frame.corners(corners));
    let [_, [g21, g22]] = bilinear.jacobian(frame.of(lambda));
    let mut signs = Signs::new();
    let (leaf, k) = if signs.negative(g22) {
        ("Xa/sliding", [1, 0])
    } else if signs.positive(g21) {
        ("Xa/down", [1, -1])
    } else {
        ("Xa/up", [1, 1])
    };
    let continuation = Continuation::mode(&frame.back(k));
    Ok(signs.settle(Resolution::sure(leaf, continuation)))
}
