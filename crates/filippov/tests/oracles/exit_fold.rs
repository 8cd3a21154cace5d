//! The root meets the saddle and both disappear: Figure 4.7.

use super::{Corners, Frame, Leaf, Refused};
use filippov::switching::{Bilinear, Continuation};

/// Decides what follows where the two roots of sliding on two surfaces coalesce at `lambda`.
///
/// The curves g_1 = 0 and g_2 = 0 touch at the double root. In the frame where they rise there and,
/// after they have parted, that of g_2 lies above that of g_1:
///
/// | G11, G22 | test | continuation | leaf |
/// |---|---|---|---|
/// | -, + | f_1^{--} > 0 | (0, -) | `Xb/a1` |
/// | -, + | f_1^{--} < 0 | (-, -) | `Xb/a2` |
/// | -, - | f_1^{++} < 0 | (0, +) | `Xb/b1` |
/// | -, - | f_1^{++} > 0 > f_2^{++} | (+, 0) | `Xb/b3` |
/// | -, - | f_1^{++} > 0, f_2^{++} > 0 | (+, +) | `Xb/b2` |
/// | +, - | f_2^{--} > 0 | (-, 0) | `Xb/c1` |
/// | +, - | f_2^{--} < 0 | (-, -) | `Xb/c2` |
///
/// The strip between the curves, and the half strip that follows it, are invariant under the hidden
/// dynamics.
///
/// Reference: Guglielmi, Hairer (2022), section 4.3.2, with the signs of
/// `docs/theory/intersections.md`.
///
/// # Errors
/// If the root was not stable for any scaling (G11 > 0 and G22 > 0).
pub fn leave_at_fold(corners: &Corners, lambda: [f64; 2]) -> Result<Leaf, Refused> {
    let frame = normal_frame(&corners.canopy(), lambda);
    let seen = frame.corners(corners);
    let [[g11, _], [_, g22]] = seen.canopy().jacobian(frame.of(lambda));
    let (low, high) = (seen.at([-1, -1]), seen.at([1, 1]));
    let (leaf, k) = match (g11 < 0.0, g22 < 0.0) {
        (true, false) if low[0] > 0.0 => ("Xb/a1", [0, -1]),
        (true, false) => ("Xb/a2", [-1, -1]),
        (true, true) if high[0] < 0.0 => ("Xb/b1", [0, 1]),
        (true, true) if high[1] < 0.0 => ("Xb/b3", [1, 0]),
        (true, true) => ("Xb/b2", [1, 1]),
        (false, true) if low[1] > 0.0 => ("Xb/c1", [-1, 0]),
        (false, true) => ("Xb/c2", [-1, -1]),
        (false, false) => return Err(Refused::NotAnExit),
    };
    let continuation = Continuation::mode(&frame.back(k));
    Ok(Leaf::sure(leaf, continuation))
}

/// The frame in which the common tangent rises and the curve g_2 = 0 stays above g_1 = 0.
///
/// Around the root, curve j is y = -(G_j1/G_j2) x + (G_j1 d_j/G_j2^2) x^2 + ... The frame is found from
/// these coefficients: a reflection of h_1 turns the tangent, a rotation by 180 degrees the order.
fn normal_frame(bilinear: &Bilinear, lambda: [f64; 2]) -> Frame {
    let jacobian = bilinear.jacobian(lambda);
    let steeper = |row: [f64; 2]| row[0].abs().min(row[1].abs());
    // Both rows are parallel; the one whose entries are farther from zero has the safer signs.
    let row = if steeper(jacobian[0]) > steeper(jacobian[1]) {
        jacobian[0]
    } else {
        jacobian[1]
    };
    let rises = -row[0] * row[1] > 0.0;
    let curvature = |j: usize| {
        let [along_x, along_y] = jacobian[j];
        along_x * bilinear.rows()[j][3] / (along_y * along_y)
    };
    // A reflection of h_1 leaves x^2, and with it the order of the curves, as it is.
    let in_order = curvature(1) - curvature(0) > 0.0;
    Frame {
        exchange: false,
        reflect: [rises != in_order, !in_order],
    }
}
