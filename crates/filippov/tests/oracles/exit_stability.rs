//! The root is no longer stable for any scaling: Figures 4.8 and 4.9.

use super::{Corners, Frame, Leaf, Refused};
use filippov::switching::{Bilinear, Continuation};

/// Decides what follows where one diagonal entry of G vanishes at the root `lambda` and the other one
/// is positive.
///
/// In the frame where G11 = 0 < G22, G12 > 0 and f_1^{--} < 0 < f_1^{-+}, the equation g_1 = 0 has
/// become (C + D x)(y - lambda_2) = 0. Without a zero of C + D x in the square (Figure 4.8:
/// f_1^{++} > 0):
///
/// | f_2^{++} | f_2^{--} | continuation | leaf |
/// |---|---|---|---|
/// | < 0 | > 0 | outward spiral | `Xc8/spiral` |
/// | > 0 | > 0 | (+, +) | `Xc8/up` |
/// | < 0 | < 0 | (-, -) | `Xc8/down` |
/// | > 0 | < 0 | either, from every neighbourhood of the root | `Xc8/two` |
///
/// and with one, x = xa (Figure 4.9), with f_2^{a+} = g_2(xa, 1):
///
/// | f_2^{a+} | f_2^{--} | continuation | leaf |
/// |---|---|---|---|
/// | < 0 | > 0 | (+, -) | `Xc9/escape` |
/// | > 0 | > 0 | (0, +) * | `Xc9/up` |
/// | < 0 | < 0 | (-, -) * | `Xc9/down` |
/// | > 0 | < 0 | either * | `Xc9/two` |
///
/// (*) If h_1 is scaled much larger than h_2, the hidden dynamics is squeezed onto the line x = xa and
/// escapes to its right: (+, -) if f_2^{+-} < 0, else (+, 0). The candidates list this mode.
///
/// Reference: Guglielmi, Hairer (2022), section 4.3.3.
///
/// # Errors
/// If no diagonal entry of G vanishes, or the other one is not positive.
pub fn leave_where_unstable(corners: &Corners, lambda: [f64; 2]) -> Result<Leaf, Refused> {
    let frame = normal_frame(corners, lambda).ok_or(Refused::NotAnExit)?;
    let seen = frame.corners(corners);
    let resolution = if seen.at([1, 1])[0] > 0.0 {
        without_asymptote(frame, &seen)
    } else {
        with_asymptote(frame, &seen)
    };
    Ok(resolution)
}

fn normal_frame(corners: &Corners, lambda: [f64; 2]) -> Option<Frame> {
    let jacobian = corners.canopy().jacobian(lambda);
    let exchange = jacobian[1][1].abs() < jacobian[0][0].abs();
    let fits = |frame: &Frame| {
        let seen = frame.corners(corners);
        let [[g11, g12], [_, g22]] = seen.canopy().jacobian(frame.of(lambda));
        let vanishes = g11.abs() <= 1e-2 * g22;
        vanishes && g12 > 0.0 && seen.at([-1, -1])[0] < 0.0 && seen.at([-1, 1])[0] > 0.0
    };
    Frame::all()
        .filter(|frame| frame.exchange == exchange)
        .find(fits)
}

/// Figure 4.8. If neither region is open, f_2^{+-} < 0 < f_2^{-+} and gamma > 1 follow.
fn without_asymptote(frame: Frame, seen: &Corners) -> Leaf {
    let (up, down) = (mode(frame, [1, 1]), mode(frame, [-1, -1]));
    let up_is_open = seen.at([1, 1])[1] > 0.0;
    let down_is_open = seen.at([-1, -1])[1] < 0.0;
    match (up_is_open, down_is_open) {
        (false, false) => Leaf::sure("Xc8/spiral", Continuation::OutwardSpiral),
        (true, false) => Leaf::sure("Xc8/up", up),
        (false, true) => Leaf::sure("Xc8/down", down),
        (true, true) => Leaf::among("Xc8/two", None, vec![up, down]),
    }
}

/// Figure 4.9.
fn with_asymptote(frame: Frame, seen: &Corners) -> Leaf {
    let (up, down) = (mode(frame, [0, 1]), mode(frame, [-1, -1]));
    let [left, right] = [seen.at([-1, 1])[0], seen.at([1, 1])[0]];
    let asymptote = (left + right) / (left - right);
    let above = seen.canopy().value([asymptote, 1.0])[1];
    let up_is_open = above > 0.0;
    let down_is_open = seen.at([-1, -1])[1] < 0.0;
    if !(up_is_open || down_is_open) {
        // f_2^{+-} < 0 follows.
        return Leaf::sure("Xc9/escape", mode(frame, [1, -1]));
    }
    let escape_is_free = seen.at([1, -1])[1] < 0.0;
    let escape = mode(frame, [1, if escape_is_free { -1 } else { 0 }]);
    let among = Leaf::among;
    match (up_is_open, down_is_open) {
        (true, true) => among("Xc9/two", None, vec![up, down, escape]),
        (true, false) => among("Xc9/up", Some(up.clone()), vec![up, escape]),
        _ => among("Xc9/down", Some(down.clone()), vec![down, escape]),
    }
}

fn mode(frame: Frame, k: [i8; 2]) -> Continuation {
    Continuation::mode(&frame.back(k))
}
