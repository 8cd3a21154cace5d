//! Kinks: the switches at which the field is continuous.

use super::{Side, Solution};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::switch::{Kind, Switch};
use crate::system::{eval_on_side, move_inside, PiecewiseSystem, Setting};
use crate::tolerances::{EPS, JUMP_AT_KINK, KINK_OFFSET, MOST_SLID_ON_AT_KINK};

impl Solution {
    /// Is the field continuous at this switch, as that of `abs` or `maximum` is? Then the motion has a kink in its derivative and
    /// nothing else happens. Only crossings and touches can be kinks.
    ///
    /// The structure of the signs answers, if it excludes a jump. Otherwise the fields of both sides are compared at the point
    /// of the switch: their difference is a jump unless it is far below what the fields change by a little further inside.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn is_kink(&self, system: &dyn PiecewiseSystem, s: &Switch) -> Result<bool, FieldError> {
        if !matches!(s.kind, Kind::Crossing | Kind::Grazing) || s.y_before != s.y_after {
            return Ok(false);
        }
        let discrete = |side| Some(self.segment_at(s.t, side)?.discrete);
        let (Some(q), Some(q_after)) = (discrete(Side::Left), discrete(Side::Right)) else {
            return Ok(false);
        };
        let slid_on: Vec<usize> = s.mode_before.sliding_set().collect();
        if s.surfaces.is_empty() || !s.mode_after.sliding_set().eq(slid_on.iter().copied()) {
            return Ok(false);
        }
        // A touch leaves the mode as it is; the surface has another side all the same.
        let mut beyond = s.mode_after.clone();
        if s.kind == Kind::Grazing {
            for &j in &s.surfaces {
                beyond.set(j, -beyond.entries()[j]);
            }
        }
        let entries = s.mode_before.entries().iter().zip(beyond.entries());
        let changed = entries.enumerate().filter(|(_, (a, b))| a != b);
        let mut changed = changed.map(|(j, _)| j).peekable();
        if changed.peek().is_none() {
            return Ok(false);
        }
        let signs = s.mode_before.signs();
        if q == q_after && changed.all(|j| !system.jumps_across(j, &signs, &slid_on)) {
            return Ok(true);
        }
        if slid_on.len() > MOST_SLID_ON_AT_KINK {
            return Ok(false);
        }
        for pattern in 0..1_usize << slid_on.len() {
            let sides = [(&s.mode_before, &q), (&beyond, &q_after)];
            let modes = sides.map(|(mode, q)| (mode.on_sides(&slid_on, pattern), q));
            if jumps(system, (s.t, &s.y_before), &modes)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Do the fields of two regions differ at a common point of theirs by more than the rounding of the point explains?
fn jumps(
    system: &dyn PiecewiseSystem,
    (t, x): (f64, &[f64]),
    regions: &[(Mode, &Vec<f64>); 2],
) -> Result<bool, FieldError> {
    let n = x.len();
    let offset = KINK_OFFSET * x.iter().fold(1.0_f64, |most, v| most.max(v.abs()));
    let mut fields = [vec![0.0; n], vec![0.0; n]];
    let mut change = vec![0.0; n];
    let mut inside = vec![0.0; n];
    for (field, (mode, q)) in fields.iter_mut().zip(regions) {
        let signs = mode.signs();
        let place = Setting::new(&signs, q).at(t, x);
        eval_on_side(system, &place, field)?;
        let (t, moved) = move_inside(system, &place, offset, offset)?;
        system.field(&place.moved(t, &moved), &mut inside)?;
        let pairs = inside.iter().zip(field.iter());
        let pairs = change.iter_mut().zip(pairs);
        pairs.for_each(|(change, (inside, here))| *change += (inside - here).abs());
    }
    let [before, after] = &fields;
    let mut components = before.iter().zip(after).zip(&change);
    Ok(!components.all(|((a, b), change)| {
        // Not finite is a jump.
        (a - b).abs() <= JUMP_AT_KINK * change + 16.0 * EPS * (a.abs() + b.abs())
    }))
}
