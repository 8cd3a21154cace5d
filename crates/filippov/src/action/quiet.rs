//! Actions that need no decision: knots of tables, and ticks of clocks that only the field reads.

use smallvec::SmallVec;

use crate::error::FieldError;
use crate::motion::Run;
use crate::system::Setting;
use crate::tolerances::CLEAR_OF_SURFACE;

/// The discrete states after these actions, if they change nothing else and no surface is near: then the motion stays in its
/// region. `None` if more may follow from them.
///
/// The switching functions are looked at with the discrete states before and after. Each has to be on the side of the mode, and
/// clear of zero.
///
/// # Errors
/// If a function of the user raises.
pub(crate) fn quiet_change(run: &Run, due: &[usize]) -> Result<Option<Vec<f64>>, FieldError> {
    let (actions, motion, t) = (run.actions, &run.motion, run.t);
    let is_quiet = |index: &usize| {
        let action = &actions.list[*index];
        action.kind.is_none() && !action.map.moves_state()
    };
    let is_region = motion.mode.codimension() == 0 && motion.resting.is_empty();
    let mut all = due.iter().copied().chain(actions.after_jumps());
    if !is_region || !all.all(|index| is_quiet(&index)) {
        return Ok(None);
    }
    let mut x: SmallVec<[f64; 8]> = SmallVec::from_slice(&run.x);
    let mut q = motion.discrete.clone();
    for index in due.iter().copied().chain(actions.after_jumps()) {
        let map = actions.list[index].map;
        map.apply(t, &mut x, &motion.signs, &mut q)?;
    }
    let settings = [motion.setting(), Setting::new(&motion.signs, &q)];
    let mut values: [SmallVec<[f64; 8]>; 2] = Default::default();
    for (setting, h) in settings.iter().zip(&mut values) {
        h.resize(motion.signs.len(), f64::NAN);
        run.system.surfaces(&setting.at(t, &run.x), h)?;
    }
    for (j, sign) in motion.signs.iter().enumerate() {
        let least = CLEAR_OF_SURFACE * run.system.surface_size(j, &settings[1].at(t, &run.x))?;
        // What is not a number is not clear.
        if !values.iter().all(|h| h[j] * sign > least) {
            return Ok(None);
        }
    }
    Ok(Some(q))
}
