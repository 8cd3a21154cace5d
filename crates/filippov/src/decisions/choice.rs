//! Points where several continuations are Filippov solutions: which is taken, and who is told.

use filippov_expr::sort_few;

use super::point::{Notes, Point};
use crate::mode::Mode;
use crate::options::NonUnique;
use crate::status::{Stop, Warning, WarningCode};

/// The candidate that [`crate::Options::choices`] asks for at the next non-unique point: none inside if it is not among
/// them, none at all if no choice is left.
pub(super) fn asked<'c>(
    at: &Point,
    notes: &Notes,
    candidates: &'c [Mode],
) -> Option<Option<&'c Mode>> {
    let choice = at.policy.choices.get(notes.n_choices)?;
    let is_meant = |candidate: &&Mode| candidate.entries().starts_with(choice.entries());
    Some(candidates.iter().find(is_meant))
}

/// The continuation that is taken among several: the one asked for; else `preferred`, or none at all if the
/// policy is to stop.
pub(super) fn choose(
    at: &Point,
    notes: &mut Notes,
    surfaces: &[usize],
    preferred: Mode,
    candidates: Vec<Mode>,
) -> Result<Mode, Stop> {
    let asked = asked(at, notes, &candidates);
    notes.n_choices += 1;
    notes.candidates.clone_from(&candidates);
    let chosen = match asked {
        Some(asked) => asked.cloned(),
        None if at.policy.nonunique == NonUnique::Error => None,
        None => Some(preferred),
    };
    let Some(chosen) = chosen else {
        return Err(Stop::NonUnique {
            surfaces: surfaces.to_vec(),
            candidates,
        });
    };
    notes
        .warnings
        .push(non_unique(at, surfaces, &chosen, candidates));
    Ok(chosen)
}

fn non_unique(at: &Point, surfaces: &[usize], chosen: &Mode, mut candidates: Vec<Mode>) -> Warning {
    let modes: Vec<String> = candidates.iter().map(|m| format!("({m})")).collect();
    let names = surfaces.iter().map(|&j| at.system.surface_name(j) + " = 0");
    let names: Vec<String> = names.collect();
    let names = names.join(", ");
    let text = match &modes[..] {
        [_] => format!(
            "the continuation at {names} may not be unique: ({chosen}) was chosen and no other was found, but not \
             every scaling of the surfaces (kappa=) was seen to lead to it"
        ),
        modes => format!(
            "the continuation at {names} is not unique: {}; ({chosen}) was chosen",
            modes.join(", ")
        ),
    };
    // The chosen one first, the others in their order.
    sort_few(&mut candidates, |a, b| a == chosen && b != chosen);
    Warning {
        t: at.t,
        code: WarningCode::NonUnique,
        surfaces: surfaces.to_vec(),
        text,
        candidates,
        rule: "",
    }
}
