//! From sliding on one surface into the intersection with another: Figures 4.3 to 4.5.

use super::{Corners, Frame, Leaf, Refused};
use filippov::switching::{Bilinear, Continuation};

/// Decides what follows where sliding in `mode`, one entry of which is 0, reaches the other surface.
///
/// The tree is stated for entry from (0, -), with g_1 < 0 just above the entry point x0 (left turning):
/// x < x0 is then invariant under the hidden dynamics, so a continuation with k_1 = + is impossible.
///
/// | root P with P.x < x0 | test | continuation | leaf |
/// |---|---|---|---|
/// | none | f_1^{-+} > 0 | (0, +) | `none/top` |
/// | none | f_1^{-+} < 0 < f_2^{-+} | (-, +) | `none/classical` |
/// | none | f_1^{-+} < 0, f_2^{-+} < 0 | (-, 0) | `none/left` |
/// | yes | g_2(1, P.y) < 0 | (0, 0) | `root/trap` |
/// | yes | f_2^{--} > 0 | (0, 0) | `root/turn` |
/// | yes | neither, and no other mode can be reached | (0, 0) | `root/closed-*`, `root/barrier` |
/// | yes | otherwise: depends on the scaling | (0, 0) or another | `amb/*` |
///
/// Leaves start with `E.A` where f_2^{--} > 0 (Figure 4.4) and with `E.B` otherwise (Figure 4.5).
///
/// Reference: Guglielmi, Hairer (2022), section 4.2; `docs/theory/intersections.md`.
///
/// # Errors
/// If there is no attractive sliding in this mode, if it does not arrive, or if the normal
/// components of the surfaces are proportional.
pub fn enter(corners: &Corners, mode: [i8; 2]) -> Result<Leaf, Refused> {
    if mode.iter().filter(|&&k| k == 0).count() != 1 {
        return Err(Refused::NotArriving(0));
    }
    let (frame, corners, x0) = normal_frame(corners, mode)?;
    let bilinear = corners.canopy();
    if bilinear.is_undetermined() {
        return Err(Refused::Proportional);
    }
    let entry = Entry {
        frame,
        corners,
        bilinear,
        x0,
    };
    Ok(entry.decide())
}

/// The frame of the tree, the corners in it, and the stable zero x0 of g_1(., -1).
fn normal_frame(corners: &Corners, mode: [i8; 2]) -> Result<(Frame, Corners, f64), Refused> {
    let mut frame = Frame {
        exchange: mode[0] != 0,
        reflect: [false, false],
    };
    frame.reflect[1] = frame.of(mode)[1] > 0;
    let seen = frame.corners(corners);
    let [minus, plus] = [seen.at([-1, -1]), seen.at([1, -1])];
    if !(minus[0] > 0.0 && plus[0] < 0.0) {
        return Err(Refused::NotArriving(usize::from(frame.exchange)));
    }
    if minus[0] * plus[1] - plus[0] * minus[1] <= 0.0 {
        return Err(Refused::NotArriving(usize::from(!frame.exchange)));
    }
    let [left, right] = [seen.at([-1, 1])[0], seen.at([1, 1])[0]];
    frame.reflect[0] = left * plus[0] - right * minus[0] <= 0.0;
    let seen = frame.corners(corners);
    let [minus, plus] = [seen.at([-1, -1])[0], seen.at([1, -1])[0]];
    Ok((frame, seen, (minus + plus) / (minus - plus)))
}

/// An entry from (0, -), left turning.
struct Entry {
    frame: Frame,
    corners: Corners,
    bilinear: Bilinear,
    x0: f64,
}

impl Entry {
    fn decide(&self) -> Leaf {
        let case_a = self.corners.at([-1, -1])[1] > 0.0;
        let Some([_, y]) = self.root_on_the_left() else {
            return self.without_root(case_a);
        };
        let leaf = |a: &'static str, b: &'static str| if case_a { a } else { b };
        if self.bilinear.value([1.0, y])[1] < 0.0 {
            return self.stays(leaf("E.A/root/trap", "E.B/root/trap"));
        }
        if case_a {
            return self.stays("E.A/root/turn");
        }
        self.around_the_root()
    }

    fn root_on_the_left(&self) -> Option<[f64; 2]> {
        let root = self.bilinear.root()?;
        (root.in_square() && root.point[0] < self.x0).then_some(root.point)
    }

    fn without_root(&self, case_a: bool) -> Leaf {
        let leaf = |a: &'static str, b: &'static str| if case_a { a } else { b };
        let [f1, f2] = self.corners.at([-1, 1]);
        if f1 > 0.0 {
            self.goes(leaf("E.A/none/top", "E.B/none/top"), [0, 1])
        } else if f2 > 0.0 {
            self.goes(leaf("E.A/none/classical", "E.B/none/classical"), [-1, 1])
        } else {
            // In case B this cannot happen: g_2 < 0 along the whole left side, and there is a root.
            self.goes(leaf("E.A/none/left", "E.B/none/left"), [-1, 0])
        }
    }

    /// Case B with g_2(1, P.y) > 0: the motion may pass around the root. Can it reach another mode?
    fn around_the_root(&self) -> Leaf {
        let [f1, f2] = self.corners.at([-1, 1]);
        let (leaf, other) = if f1 < 0.0 {
            if f2 < 0.0 {
                return self.stays("E.B/root/closed-left");
            }
            ("E.B/amb/classical", [-1, 1])
        } else {
            let right = self.corners.at([1, 1])[0];
            let top = (f1 + right) / (f1 - right);
            if self.bilinear.value([top, 1.0])[1] < 0.0 {
                return self.stays("E.B/root/closed-top");
            }
            ("E.B/amb/top", [0, 1])
        };
        if self.has_barrier() {
            return self.stays("E.B/root/barrier");
        }
        let mode = |k: [i8; 2]| Continuation::mode(&self.frame.back(k));
        let stays = mode([0, 0]);
        Leaf::among(leaf, Some(stays.clone()), vec![stays, mode(other)])
    }

    /// Is there a height at which g_2 < 0 for all x in [-1, x0]?
    fn has_barrier(&self) -> bool {
        let bottom = self.bilinear.value([self.x0, -1.0])[1];
        let top = self.bilinear.value([self.x0, 1.0])[1];
        if top >= 0.0 {
            return false;
        }
        let height = (bottom + top) / (bottom - top);
        self.bilinear.value([-1.0, height])[1] < 0.0
    }

    fn stays(&self, leaf: &'static str) -> Leaf {
        self.goes(leaf, [0, 0])
    }

    fn goes(&self, leaf: &'static str, k: [i8; 2]) -> Leaf {
        Leaf::sure(leaf, Continuation::mode(&self.frame.back(k)))
    }
}
