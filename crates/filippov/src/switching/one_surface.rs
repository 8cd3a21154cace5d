//! The decision at one surface: the motion crosses it, slides on it, or leaves it at a tangency.
//!
//! A field is tangent where the first derivative of h along it vanishes. If the next one leads to the own side of the field the
//! fold is visible, else invisible; at a cusp it vanishes too. All that counts is the sign of the first one that does not.

use smallvec::{smallvec, SmallVec};

use super::stick::decide_sticking;
use super::surface_decision::{Arrival, Decision};
use crate::error::FieldError;
use crate::mode::Signs;
use crate::motion::{first_nonzero, first_nonzero_of_both, Leading, TwoFold, TwoFoldMotion};
use crate::system::{dot_magnitude, BothSides, PiecewiseSystem, Place};
use crate::tolerances::TANGENT;

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
/// components vanish (their case IV, a two-fold) the sliding motions have their own series, see [`TwoFold`].
///
/// A field all of whose derivatives vanish, as at an equilibrium on the surface, keeps the motion on it for ever: that
/// is a solution whatever the other field does. Where this presses the motion onto the surface, s = 0 counts as pointing
/// to it, and the motion slides with lambda = -1 or +1; elsewhere it is in the region of the field that keeps it.
///
/// # Errors
/// If a function of the user raises.
pub fn decide(
    system: &dyn PiecewiseSystem,
    j: usize,
    arrival: Arrival,
    place: &Place<'_>,
) -> Result<Decision, FieldError> {
    if system.sticks_at(j) {
        return decide_sticking(system, j, arrival, place);
    }
    let exits = [Arrival::ExitMinus, Arrival::ExitPlus];
    let is_known = |exit: Arrival| arrival == exit || arrival == Arrival::TwoFold;
    let vanishing = match arrival {
        Arrival::Flat(_, vanishing) => vanishing,
        _ => exits.map(|exit| usize::from(is_known(exit))),
    };
    let firsts = first_nonzero_of_both(system, j, vanishing, place)?;
    let [minus, plus] = without_rounding(system, j, (arrival, firsts), place)?;
    let mut candidates = SmallVec::new();
    if minus.sign() < 0 || stays(minus, plus, -1) {
        candidates.push(-1);
    }
    let at_two_fold = || {
        let at = TwoFold::new(system, j, vanishing[0].min(vanishing[1]), *place);
        match arrival {
            Arrival::Start => at,
            _ => at.located(),
        }
    };
    let (motions, slides) = if minus.order == 1 || plus.order == 1 {
        (SmallVec::new(), minus.sign() >= 0 && plus.sign() <= 0)
    } else {
        let motions = at_two_fold().motions()?;
        let attracts = motions.iter().any(TwoFoldMotion::attracts);
        (motions, attracts)
    };
    let attracting = motions.iter().find(|motion| motion.attracts());
    let mut two_fold = attracting.or(motions.first()).copied().map(Box::new);
    if slides {
        candidates.push(0);
    }
    if plus.sign() > 0 || stays(plus, minus, 1) {
        candidates.push(1);
    }
    if minus.order == 0 && plus.order == 0 {
        // Neither field leaves the surface: the motion stays on it, and if they differ, any combination
        // of them is a Filippov solution.
        let agree = fields_agree(system, j, place)?;
        candidates = if agree { smallvec![] } else { smallvec![-1, 1] };
        two_fold = None;
    }
    let entry = match candidates[..] {
        [only] => only,
        _ => choose(at_two_fold, arrival, &candidates, [minus, plus], &motions)?,
    };
    if candidates.is_empty() {
        candidates.push(entry);
    }
    Ok(Decision {
        entry,
        candidates,
        two_fold,
        minus,
        plus,
    })
}

/// The same derivatives, where those of first order are more than the rounding of t and x makes of them. Looked at where
/// nothing is known of the point but that it is on the surface.
fn without_rounding(
    system: &dyn PiecewiseSystem,
    j: usize,
    (arrival, mut firsts): (Arrival, [Leading; 2]),
    place: &Place<'_>,
) -> Result<[Leading; 2], FieldError> {
    if arrival != Arrival::Start || system.lie_tolerance(2) > TANGENT {
        return Ok(firsts);
    }
    for (index, side) in [-1, 1].into_iter().enumerate() {
        let Leading { order, value } = firsts[index];
        if order != 1 {
            continue;
        }
        let mut signs = Signs::from_slice(place.signs);
        signs[j] = f64::from(side);
        let on_side = place.with_signs(&signs);
        let mut gradient = vec![0.0; place.x.len()];
        let partials = system.rate_gradient(j, &on_side, &mut gradient)?;
        let size = dot_magnitude(&gradient, place.x) + (partials.time * place.t).abs();
        if value.abs() <= TANGENT * size {
            firsts[index] = first_nonzero(system, j, side, 1, &on_side)?;
        }
    }
    Ok(firsts)
}

/// Does the field of this side keep the motion on the surface, where the other one does not press it there?
fn stays(own: Leading, other: Leading, side: i8) -> bool {
    let is_pressed = other.order == 1 && other.sign() == side;
    own.order == 0 && !is_pressed
}

/// Do both sides have the same field here, up to rounding?
fn fields_agree(
    system: &dyn PiecewiseSystem,
    j: usize,
    place: &Place<'_>,
) -> Result<bool, FieldError> {
    let mut sides = BothSides::new(place.x.len(), place.signs.len());
    system.both_sides(j, place, &mut sides)?;
    let pairs = || sides.f_minus.iter().zip(&sides.f_plus);
    let size = pairs().fold(0.0_f64, |m, (a, b)| m.max(a.abs()).max(b.abs()));
    Ok(pairs().all(|(a, b)| (a - b).abs() <= TANGENT * size))
}

/// Among several candidates: the side that the motion comes from; at a start the one that the regularised field moves to
/// from the middle of the transition, lambda = 0; where this does not tell, one that leads away before one at rest.
fn choose<'s>(
    at_two_fold: impl FnOnce() -> TwoFold<'s>,
    arrival: Arrival,
    candidates: &[i8],
    sides: [Leading; 2],
    motions: &[TwoFoldMotion],
) -> Result<i8, FieldError> {
    let preferred = match arrival {
        Arrival::Region(side) | Arrival::Flat(side, _) => Some(side),
        Arrival::ExitMinus => Some(-1),
        Arrival::ExitPlus => Some(1),
        Arrival::TwoFold => {
            // Sliding goes on, and repels: the motion leaves to the side whose field has the larger share.
            let repelling = motions.iter().find(|motion| motion.repels());
            repelling.map(|motion| if motion.weight < 0.5 { -1 } else { 1 })
        }
        Arrival::Start => from_the_middle(at_two_fold, sides, motions)?,
    };
    let is_candidate = |entry: &i8| candidates.contains(entry);
    if candidates.is_empty() {
        return Ok(preferred.filter(|&entry| entry != 0).unwrap_or(1));
    }
    if let Some(preferred) = preferred.filter(is_candidate) {
        return Ok(preferred);
    }
    let away = [(1, sides[1]), (-1, sides[0])].map(|(side, leading)| (side, leading.order > 0));
    let leaving = away
        .into_iter()
        .filter_map(|(side, leaves)| leaves.then_some(side));
    let first = leaving.chain([0, 1]).find(is_candidate);
    Ok(first.unwrap_or(candidates[0]))
}

/// Where the regularised motion goes from the middle of the transition, to -1 or +1 or onto the surface at a two-fold. It
/// follows the mean of both fields at first.
fn from_the_middle<'s>(
    at_two_fold: impl FnOnce() -> TwoFold<'s>,
    sides: [Leading; 2],
    motions: &[TwoFoldMotion],
) -> Result<Option<i8>, FieldError> {
    let first = sides.map(|side| if side.order == 1 { side.value } else { 0.0 });
    let mut rate = first[0] + first[1];
    if rate.abs() <= TANGENT * (first[0].abs() + first[1].abs()) {
        rate = at_two_fold().rate_of_mean()?;
    }
    let between = |motion: &TwoFoldMotion| motion.attracts() && motion.multiplier() * rate >= 0.0;
    Ok(match motions.iter().any(between) {
        true => Some(0),
        false if rate == 0.0 => None,
        false => Some(if rate < 0.0 { -1 } else { 1 }),
    })
}
