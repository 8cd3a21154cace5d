//! The root leaves the square through a side: Figure 4.6.

use super::{Corners, Frame, Leaf, Refused};
use filippov::switching::{Bilinear, Continuation};

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
pub fn leave_at_side(corners: &Corners, lambda: [f64; 2]) -> Result<Leaf, Refused> {
    let exchange = lambda[1].abs() > lambda[0].abs();
    let leaving = lambda[usize::from(exchange)];
    let on_side = (leaving.abs() - 1.0).abs() <= 1e-6;
    if !on_side {
        return Err(Refused::NotAnExit);
    }
    let frame = Frame {
        exchange,
        reflect: [leaving < 0.0, false],
    };
    let bilinear = frame.corners(corners).canopy();
    let [_, [g21, g22]] = bilinear.jacobian(frame.of(lambda));
    let (leaf, k) = if g22 < 0.0 {
        ("Xa/sliding", [1, 0])
    } else if g21 > 0.0 {
        ("Xa/down", [1, -1])
    } else {
        ("Xa/up", [1, 1])
    };
    let continuation = Continuation::mode(&frame.back(k));
    Ok(Leaf::sure(leaf, continuation))
}
