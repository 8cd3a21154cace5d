//! From sliding on one surface into the intersection with another: Figures 4.3 to 4.5.

use super::{Bilinear, Corners, Frame};
use crate::switching::resolution::{Continuation, Resolution, Signs, Undecided};

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
pub fn enter(corners: &Corners, mode: [i8; 2]) -> Result<Resolution, Undecided> {
    if mode.iter().filter(|&&k| k == 0).count() != 1 {
        return Err(Undecided::NotArriving { surface: 0 });
    }
    let mut signs = Signs::new();
    let (frame, corners, x0) = normal_frame(corners, mode, &mut signs)?;
    let bilinear = Bilinear::of(&corners);
    if bilinear.is_undetermined() {
        return Err(Undecided::Proportional);
    }
    let mut entry = Entry {
        frame,
        corners,
        bilinear,
        x0,
        signs,
    };
    let resolution = entry.decide();
    Ok(entry.signs.settle(resolution))
}

/// The frame of the tree, the corners in it, and the stable zero x0 of g_1(., -1).
fn normal_frame(
    corners: &Corners,
    mode: [i8; 2],
    signs: &mut Signs,
) -> Result<(Frame, Corners, f64), Undecided> {
    let mut frame = Frame {
        exchange: mode[0] != 0,
        reflect: [false, false],
    };
    frame.reflect[1] = frame.of(mode)[1] > 0;
    let seen = frame.corners(corners);
    let [minus, plus] = [seen.at([-1, -1]), seen.at([1, -1])];
    if !(signs.positive(minus[0]) && signs.negative(plus[0])) {
        return Err(Undecided::NotArriving {
            surface: usize::from(frame.exchange),
        });
    }
    if !signs.positive(minus[0] * plus[1] - plus[0] * minus[1]) {
        return Err(Undecided::NotArriving {
            surface: usize::from(!frame.exchange),
        });
    }
    let [left, right] = [seen.at([-1, 1])[0], seen.at([1, 1])[0]];
    frame.reflect[0] = !signs.positive(left * plus[0] - right * minus[0]);
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
    signs: Signs,
}

impl Entry {
    fn decide(&mut self) -> Resolution {
        let case_a = self.signs.positive(self.corners.at([-1, -1])[1]);
        let Some([_, y]) = self.root_on_the_left() else {
            return self.without_root(case_a);
        };
        let leaf = |a: &'static str, b: &'static str| if case_a { a } else { b };
        if self.signs.negative(self.bilinear.value([1.0, y])[1]) {
            return self.stays(leaf("E.A/root/trap", "E.B/root/trap"));
        }
        if case_a {
            return self.stays("E.A/root/turn");
        }
        self.around_the_root()
    }

    fn root_on_the_left(&mut self) -> Option<[f64; 2]> {
        let Some(root) = self.bilinear.root() else {
            // Where the roots have only just become complex, this is in doubt.
            let lost = self.bilinear.extended_root()?;
            if lost.iter().all(|v| v.abs() < 1.0) && lost[0] < self.x0 {
                self.signs.positive(self.bilinear.discriminant());
            }
            return None;
        };
        // Distances to the border, as far as each decides whether the root counts.
        let [x, y] = root.point;
        let inside = [1.0 - x.abs(), 1.0 - y.abs(), self.x0 - x];
        let counts = inside.map(|distance| self.signs.positive(distance));
        counts.iter().all(|&c| c).then_some([x, y])
    }

    fn without_root(&mut self, case_a: bool) -> Resolution {
        let leaf = |a: &'static str, b: &'static str| if case_a { a } else { b };
        let [f1, f2] = self.corners.at([-1, 1]);
        if self.signs.positive(f1) {
            self.goes(leaf("E.A/none/top", "E.B/none/top"), [0, 1])
        } else if self.signs.positive(f2) {
            self.goes(leaf("E.A/none/classical", "E.B/none/classical"), [-1, 1])
        } else {
            // In case B this cannot happen: g_2 < 0 along the whole left side, and there is a root.
            self.goes(leaf("E.A/none/left", "E.B/none/left"), [-1, 0])
        }
    }

    /// Case B with g_2(1, P.y) > 0: the motion may pass around the root. Can it reach another mode?
    fn around_the_root(&mut self) -> Resolution {
        let [f1, f2] = self.corners.at([-1, 1]);
        let (leaf, other) = if self.signs.negative(f1) {
            if self.signs.negative(f2) {
                return self.stays("E.B/root/closed-left");
            }
            ("E.B/amb/classical", [-1, 1])
        } else {
            let right = self.corners.at([1, 1])[0];
            let top = (f1 + right) / (f1 - right);
            if self.signs.negative(self.bilinear.value([top, 1.0])[1]) {
                return self.stays("E.B/root/closed-top");
            }
            ("E.B/amb/top", [0, 1])
        };
        if self.has_barrier() {
            return self.stays("E.B/root/barrier");
        }
        let mode = |k: [i8; 2]| Continuation::mode(&self.frame.back(k));
        let stays = mode([0, 0]);
        Resolution::among(leaf, Some(stays.clone()), vec![stays, mode(other)])
    }

    /// Is there a height at which g_2 < 0 for all x in [-1, x0]?
    fn has_barrier(&mut self) -> bool {
        let bottom = self.bilinear.value([self.x0, -1.0])[1];
        let top = self.bilinear.value([self.x0, 1.0])[1];
        if !self.signs.negative(top) {
            return false;
        }
        let height = (bottom + top) / (bottom - top);
        self.signs.negative(self.bilinear.value([-1.0, height])[1])
    }

    fn stays(&self, leaf: &'static str) -> Resolution {
        self.goes(leaf, [0, 0])
    }

    fn goes(&self, leaf: &'static str, k: [i8; 2]) -> Resolution {
        Resolution::sure(leaf, Continuation::mode(&self.frame.back(k)))
    }
}
