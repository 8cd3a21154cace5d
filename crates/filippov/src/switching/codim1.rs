//! The decision at one surface.

use smallvec::{smallvec, SmallVec};

use super::lie::{first_nonzero_of_both, normal_component, Leading};
use super::stick::decide_sticking;
use crate::error::FieldError;
use crate::field::eval_on_side;
use crate::system::PiecewiseSystem;
use crate::tolerances::{OF_ROUNDING, TANGENT};

/// How the motion came to the surface, and which normal components are known to vanish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// From the region with this sign (+1 or -1).
    Region(i8),
    /// From the region with this sign to a multiple zero of h: so many derivatives are known to vanish along f- and f+.
    Flat(i8, [usize; 2]),
    /// Sliding, with the normal component of f- known to vanish.
    ExitMinus,
    /// Sliding, with the normal component of f+ known to vanish.
    ExitPlus,
    /// Sliding, with both normal components known to vanish.
    TwoFold,
    /// The run starts here.
    Start,
}

/// The decision at one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The new entry of the mode: -1, 0 (sliding) or +1.
    pub entry: i8,
    /// All entries that are Filippov continuations; more than one where the point is not unique.
    pub candidates: SmallVec<[i8; 3]>,
    /// First non-vanishing derivative of h along f-.
    pub minus: Leading,
    /// First non-vanishing derivative of h along f+.
    pub plus: Leading,
}

impl Decision {
    /// Is the surface left with no more than rounding of what the field beyond has?
    pub fn leaves_with_rounding(&self) -> bool {
        let (leaving, other) = match self.entry {
            -1 => (self.minus, self.plus),
            1 => (self.plus, self.minus),
            _ => return false,
        };
        leaving.order == 1 && leaving.value.abs() <= OF_ROUNDING * other.value.abs()
    }

    /// Is there no continuation? Both fields turn back to the surface, as at a two-fold that is invisible from both sides.
    pub fn turns_back(&self) -> bool {
        let leading = match self.entry {
            -1 => self.minus,
            1 => self.plus,
            _ => return false,
        };
        leading.sign() == -self.entry
    }
}

/// Decides what follows at a point of h_j = 0.
///
/// Let s- and s+ be the signs of the first non-vanishing derivatives of h along f- and f+. A motion
/// in R- leaves the surface if s- < 0, one in R+ if s+ > 0, and sliding is possible if s- > 0 > s+,
/// because the normal component of f- along the sliding motion has the same first non-vanishing
/// derivative as along f- as long as that of f+ does not vanish. So
///
/// | s-, s+ | continuation |
/// |---|---|
/// | +, + | R+ |
/// | -, - | R- |
/// | +, - | sliding |
/// | -, + | R- or R+, not unique: the motion stays on its side |
///
/// which contains the cases I to III of Dieci and Lopez (2009), section 3. Where both normal
/// components vanish (their case IV, a two-fold) the sliding motion has its own test, see
/// `two_fold_slides`.
///
/// # Errors
/// If a function of the user raises.
pub fn decide(
    system: &dyn PiecewiseSystem,
    j: usize,
    arrival: Arrival,
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<Decision, FieldError> {
    if system.sticks_at(j) {
        return decide_sticking(system, j, arrival, (t, x), signs);
    }
    let exits = [Arrival::ExitMinus, Arrival::ExitPlus];
    let is_known = |exit: Arrival| arrival == exit || arrival == Arrival::TwoFold;
    let vanishing = match arrival {
        Arrival::Flat(_, vanishing) => vanishing,
        _ => exits.map(|exit| usize::from(is_known(exit))),
    };
    let [minus, plus] = first_nonzero_of_both(system, j, vanishing, t, x, signs)?;
    let mut candidates = SmallVec::new();
    if minus.sign() < 0 {
        candidates.push(-1);
    }
    let known = vanishing[0].min(vanishing[1]);
    if slides(system, j, (minus, plus, known), t, x, signs)? {
        candidates.push(0);
    }
    if plus.sign() > 0 {
        candidates.push(1);
    }
    if minus.order == 0 && plus.order == 0 {
        // Neither field leaves the surface: the motion stays on it, and if they differ, any combination
        // of them is a Filippov solution.
        let agree = fields_agree(system, j, t, x, signs)?;
        candidates = if agree { smallvec![] } else { smallvec![-1, 1] };
    }
    let entry = choose(system, j, arrival, &candidates, t, x, signs)?;
    if candidates.is_empty() {
        candidates.push(entry);
    }
    Ok(Decision {
        entry,
        candidates,
        minus,
        plus,
    })
}

/// Do both sides have the same field here, up to rounding?
fn fields_agree(
    system: &dyn PiecewiseSystem,
    j: usize,
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<bool, FieldError> {
    let side = |s: f64| -> Result<Vec<f64>, FieldError> {
        let mut signs = signs.to_vec();
        signs[j] = s;
        let mut f = vec![0.0; x.len()];
        eval_on_side(system, t, x, &signs, &mut f)?;
        Ok(f)
    };
    let (minus, plus) = (side(-1.0)?, side(1.0)?);
    let size = minus
        .iter()
        .chain(&plus)
        .fold(0.0_f64, |m, v| m.max(v.abs()));
    Ok(minus
        .iter()
        .zip(&plus)
        .all(|(a, b)| (a - b).abs() <= TANGENT * size))
}

fn slides(
    system: &dyn PiecewiseSystem,
    j: usize,
    (minus, plus, vanishing): (Leading, Leading, usize),
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<bool, FieldError> {
    if minus.order == 0 && plus.order == 0 {
        return Ok(false);
    }
    if minus.order <= 1 || plus.order <= 1 {
        // A side whose derivatives all vanish keeps the motion on the surface: lambda = -1 or +1.
        return Ok(minus.sign() >= 0 && plus.sign() <= 0);
    }
    // Where the second derivatives vanish, what is left of them by rounding says nothing.
    Ok(vanishing < 2 && two_fold_slides(system, j, t, x, signs)?
        || (minus.order == plus.order
            && minus.order > 2
            && attracts_along_all_motions(system, j, (vanishing, minus.order), t, x, signs)?))
}

/// Do both normal components vanish to this order less 1 (`vanishing` of these derivatives are known to do so) along every motion, whatever mixture of both fields it follows, and
/// point to the surface afterwards? So do those that share a factor like (t - 1)^2.
fn attracts_along_all_motions(
    system: &dyn PiecewiseSystem,
    j: usize,
    (vanishing, order): (usize, usize),
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<bool, FieldError> {
    for length in 2.max(vanishing + 1)..=order {
        let tolerance = system.lie_tolerance(length);
        for letters in 0..1_u32 << length {
            let word: SmallVec<[i8; 8]> = (0..length)
                .map(|k| if letters >> k & 1 == 0 { -1 } else { 1 })
                .collect();
            let lie = system.lie_derivative(j, j, &word, t, x, signs)?;
            let is_zero = lie.value.abs() <= tolerance * lie.magnitude;
            // The first letter says whose normal component it is.
            let attracts = !is_zero && lie.value * f64::from(word[0]) < 0.0;
            if !(if length < order { is_zero } else { attracts }) {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Does sliding start at a two-fold, where both normal components vanish? It needs a motion that is slid along with
/// B- > 0 > B+ (Dieci, Lopez 2009, case IV).
fn two_fold_slides(
    system: &dyn PiecewiseSystem,
    j: usize,
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<bool, FieldError> {
    let motions = two_fold_motions(system, j, t, x, signs)?;
    Ok(motions
        .iter()
        .any(|&[_, minus, plus]| minus > 0.0 && plus < 0.0))
}

/// The weight of f+ in the motion through a two-fold along which the normal components stay nearest to zero.
///
/// # Errors
/// If a function of the user raises.
pub fn weight_at_two_fold(
    system: &dyn PiecewiseSystem,
    j: usize,
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<Option<f64>, FieldError> {
    let motions = two_fold_motions(system, j, t, x, signs)?;
    let rate = |motion: &[f64; 3]| motion[1].abs() + motion[2].abs();
    let slowest = motions.iter().min_by(|a, b| rate(a).total_cmp(&rate(b)));
    Ok(slowest.map(|&[weight, ..]| weight))
}

/// The sliding motions through a two-fold: the weight w of f+ in (0, 1), and the rates at which the normal components
/// grow along the motion.
///
/// With the derivatives p = L-L-h, q = L+L-h, r = L-L+h, s = L+L+h these rates are B- = p + w (q - p) and
/// B+ = r + w (s - r), and w = B- / (B- - B+) must hold: a quadratic in w.
fn two_fold_motions(
    system: &dyn PiecewiseSystem,
    j: usize,
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<SmallVec<[[f64; 3]; 2]>, FieldError> {
    let lie = |word: [i8; 2]| -> Result<f64, FieldError> {
        Ok(system.lie_derivative(j, j, &word, t, x, signs)?.value)
    };
    // Words are applied from the left: [-1, 1] is L+ L- h.
    let (p, q, r, s) = (lie([-1, -1])?, lie([-1, 1])?, lie([1, -1])?, lie([1, 1])?);
    // w (p - r + w (q - p - s + r)) = p + w (q - p)
    let (a, b, c) = (q - p - s + r, p - r - (q - p), -p);
    let roots = if a.abs() <= f64::EPSILON * (b.abs() + c.abs()) {
        [-c / b, f64::NAN]
    } else {
        let d = (b * b - 4.0 * a * c).sqrt();
        let k = -0.5 * (b + d.copysign(b));
        [k / a, c / k]
    };
    let inside = roots.into_iter().filter(|&w| w > 0.0 && w < 1.0);
    let rounding = TANGENT * (p.abs() + q.abs() + r.abs() + s.abs());
    let rate = |value: f64| if value.abs() > rounding { value } else { 0.0 };
    Ok(inside
        .map(|w| [w, rate(p + w * (q - p)), rate(r + w * (s - r))])
        .collect())
}

/// Among several candidates: the side that the motion comes from; at a start the one that the
/// regularised field moves to from the middle of the transition, lambda = 0.
fn choose(
    system: &dyn PiecewiseSystem,
    j: usize,
    arrival: Arrival,
    candidates: &[i8],
    t: f64,
    x: &[f64],
    signs: &[f64],
) -> Result<i8, FieldError> {
    if let [only] = candidates {
        return Ok(*only);
    }
    let preferred = match arrival {
        Arrival::Region(side) | Arrival::Flat(side, _) => side,
        Arrival::ExitMinus => -1,
        Arrival::ExitPlus => 1,
        Arrival::TwoFold => {
            // Sliding goes on, and repels: the motion leaves to the side whose field has the larger share.
            let motions = two_fold_motions(system, j, t, x, signs)?;
            let repels = |motion: &&[f64; 3]| motion[1] < 0.0 && motion[2] > 0.0;
            match motions.iter().find(repels) {
                Some([weight, ..]) if *weight < 0.5 => -1,
                _ => 1,
            }
        }
        Arrival::Start => {
            let minus = normal_component(system, j, j, -1, t, x, signs)?.value;
            let plus = normal_component(system, j, j, 1, t, x, signs)?.value;
            if minus + plus < 0.0 {
                -1
            } else {
                1
            }
        }
    };
    Ok(match candidates {
        [] => preferred,
        _ if candidates.contains(&preferred) => preferred,
        _ => candidates[0],
    })
}
