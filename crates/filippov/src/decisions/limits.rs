//! Limits of infinitely many switches or impacts in finite time, and what follows there.

use super::point::{Decided, Lefts, Next, Notes, Point, Values};
use super::rule::Meeting;
use crate::cube::least_multipliers;
use crate::error::FieldError;
use crate::error::Undecided;
use crate::mode::Mode;
use crate::motion::{ContactField, Motion};
use crate::status::Stop;
use crate::switch::Kind;
use crate::switch::Switch;
use crate::switching::admissible_within;
use crate::system::dot_magnitude;
use crate::tolerances::{
    ACCUMULATION_AGREEMENT, FAST_SHRINKING, LONGEST_TURN, MOST_MEETING, NEAREST_ACCUMULATION,
    ROUNDING, SLOW_SHRINKING, UNRESOLVED_FLIGHT,
};

/// The limit of accumulating switches or impacts.
pub(crate) struct Limit {
    pub t: f64,
    pub x: Vec<f64>,
    /// The surfaces that meet there; the one at which the impacts are.
    pub surfaces: Vec<usize>,
    /// Do impacts end there?
    pub is_rest: bool,
}

impl Limit {
    /// The limit of the rest of a geometric series of which the last four members are known.
    fn of(turns: [&Switch; 4], surfaces: Vec<usize>) -> Option<Limit> {
        let ratios = ratios_of(turns)?;
        // Between impacts other bodies go on freely, by squares of the time.
        let is_corrected = turns[3].kind == Kind::Reset && ratios[1] <= SLOW_SHRINKING;
        let limit_of = |series: [f64; 3]| limit_of_series(series, ratios, is_corrected);
        let states = turns[3].y_after.iter().enumerate();
        let states = states.map(|(i, y)| limit_of([turns[1].y_after[i], turns[2].y_after[i], *y]));
        Some(Limit {
            t: limit_of([turns[1].t, turns[2].t, turns[3].t]),
            x: states.collect(),
            surfaces,
            is_rest: false,
        })
    }
}

/// The two quotients of the intervals between four members of a series, if they agree and are those of a geometric series.
fn ratios_of(turns: [&Switch; 4]) -> Option<[f64; 2]> {
    let [a, b, c] = [1, 2, 3].map(|k| turns[k].t - turns[k - 1].t);
    let ratios = [b / a, c / b];
    let noise = ROUNDING * turns[3].t.abs() / c;
    let shrinks = shrinks_by(ratios).is_some() && is_no_power(ratios, noise);
    shrinks.then_some(ratios)
}

/// The limit of a series whose steps shrink by the ratio r, from its last members and the last two quotients of its steps: up to a
/// multiple of r^(2n), or with the difference of two such limits of r^(3n).
fn limit_of_series(
    [first, before, last]: [f64; 3],
    [earlier, ratio]: [f64; 2],
    is_corrected: bool,
) -> f64 {
    let limit = last + ratio / (1.0 - ratio) * (last - before);
    if !is_corrected {
        return limit;
    }
    let limit_before = before + earlier / (1.0 - earlier) * (before - first);
    limit + ratio * ratio / (1.0 - ratio * ratio) * (limit - limit_before)
}

/// The second of these ratios, if both lie between 0 and 1 and agree.
fn shrinks_by([first, second]: [f64; 2]) -> Option<f64> {
    let near = ACCUMULATION_AGREEMENT * second.min(1.0 - second);
    let is_between = |r: f64| r > 0.0 && r < 1.0;
    let agree = is_between(first) && is_between(second) && (first - second).abs() <= near;
    agree.then_some(second)
}

/// Are these the ratios of a geometric series, and not of one that shrinks like a power of the number of its members, and takes for
/// ever? Those of such a series tend to 1, by a part of the square of their distance from it at each member. `noise` is the
/// rounding of a ratio: where it hides the difference, nothing is known.
fn is_no_power([first, second]: [f64; 2], noise: f64) -> bool {
    let distance = 1.0 - second;
    (first - second).abs().max(noise) <= ACCUMULATION_AGREEMENT * distance * distance
}

/// Does a later switch repeat an earlier one?
pub(super) fn repeats(a: &Switch, b: &Switch) -> bool {
    a.surfaces == b.surfaces && a.mode_before == b.mode_before && a.mode_after == b.mode_after
}

/// The limit that the last switches tend to: turns of equally many switches, each turn shorter and nearer to
/// an intersection than the one before by the same ratio (`docs/theory/intersections.md`).
/// The last turns have `turn` switches each, if there are any.
pub(crate) fn limit_of_switches(
    at: &Point,
    turn: Option<usize>,
) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches;
    if let Some(limit) = limit_of_unresolved_flights(at)? {
        return Ok(Some(limit));
    }
    let Some(turn) = turn else {
        return Ok(None);
    };
    let last = switches.len() - 1;
    let turns = [3, 2, 1, 0].map(|k| &switches[last - k * turn]);
    if ratios_of(turns).is_none() {
        return Ok(None);
    }
    let Some(meeting) = meeting_of(at, &switches[last + 1 - turn..]) else {
        return Ok(None);
    };
    let (mut distances, reach) = ([0.0; 3], Reach::at(at));
    for (found, switch) in distances.iter_mut().zip(&turns[1..]) {
        *found = reach.distance(at, &meeting, switch)?;
    }
    // Time and distance may shrink by different powers of one ratio, as they do where a field is a root of the distance.
    let [a, b, c] = distances;
    let ratios = [b / a, c / b];
    if meeting.len() == 1 && ratios[0].max(ratios[1]) > FAST_SHRINKING {
        // At one surface slow turns need not be those of a geometric series.
        return Ok(None);
    }
    let is_geometric = shrinks_by(ratios).is_some() && is_no_power(ratios, 0.0);
    let limit = is_geometric.then(|| Limit::of(turns, meeting)).flatten();
    let Some(mut limit) = limit.filter(|limit| c < 1.0 && limit.t > at.t) else {
        return Ok(None);
    };
    project(at, &mut limit)?;
    Ok(is_on_all(at, &limit)?.then_some(limit))
}

/// The limit of crossings of one surface, to and fro, or of impacts there, at rates that shrink, where the last flight between
/// two of them was shorter than the tolerance. Further flights would be rounding and error: they are as a geometric series
/// would have them. On the two sides of the surface flights may shrink differently: a series is that of every second one, or of all.
pub(crate) fn limit_of_unresolved_flights(at: &Point) -> Result<Option<Limit>, FieldError> {
    for flights in [2, 1] {
        let limit = limit_of_flights(at, flights)?;
        if limit.is_some() {
            return Ok(limit);
        }
    }
    Ok(None)
}

/// The same of a series whose members are so many flights.
fn limit_of_flights(at: &Point, flights: usize) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches;
    let Some(earlier) = switches.len().checked_sub(2 * flights + 1) else {
        return Ok(None);
    };
    let (earlier, turns) = switches.split_at(earlier);
    let [second, third, last] = [0, flights, 2 * flights].map(|k| &turns[k]);
    let &[j] = &last.surfaces[..] else {
        return Ok(None);
    };
    let is_same = |s: &Switch| s.kind == last.kind && s.surfaces == last.surfaces;
    let is_passage = matches!(last.kind, Kind::Crossing | Kind::Reset);
    if !is_passage || !turns.iter().all(is_same) {
        return Ok(None);
    }
    let Some(reduced) = at.system.reduced(&[j]) else {
        return Ok(None);
    };
    let [b, c] = [third.t - second.t, last.t - third.t];
    let s = c / b;
    let noise = ROUNDING * last.t.abs() / c;
    let first = earlier.len().checked_sub(flights).map(|k| &earlier[k..]);
    let shrinks = match first.filter(|before| before.iter().all(is_same)) {
        Some(before) => {
            let r = b / (second.t - before[0].t);
            r.max(s) <= FAST_SHRINKING || shrinks_by([r, s]).is_some() && is_no_power([r, s], noise)
        }
        None => s <= FAST_SHRINKING * FAST_SHRINKING,
    };
    if !shrinks {
        return Ok(None);
    }
    let mut h = vec![0.0; at.system.n_surfaces()];
    let mut rate = |s: &Switch| -> Result<f64, FieldError> {
        let signs = s.mode_after.signs();
        reduced.surfaces(&at.place_at(s.t, &s.y_after, &signs), &mut h)?;
        Ok(h[j].abs())
    };
    let rates = [rate(second)?, rate(third)?, rate(last)?];
    // How far the next flight leads from the surface.
    let height = rates[2] * c * s;
    let place = at.place(at.arrival.signs);
    let is_unresolved = height <= at.system.tolerance(j, &place, at.scale)?;
    if !is_unresolved || rates[1] >= rates[0] || rates[2] >= rates[1] {
        return Ok(None);
    }
    let (before, share) = (third, s / (1.0 - s));
    let states = last.y_after.iter().zip(&before.y_after);
    let mut limit = Limit {
        t: last.t + share * c,
        x: states.map(|(y, before)| y + share * (y - before)).collect(),
        surfaces: vec![j],
        is_rest: false,
    };
    project(at, &mut limit)?;
    Ok(is_on_all(at, &limit)?.then_some(limit))
}

/// Where and when the last impacts end, if the speed after them is below what the tolerance resolves: the limit of the
/// series, and this point if the flights do not rise above rounding. `before` is the number of switches before this
/// instant, in which the body departs in mode `after`.
pub(crate) fn limits_of_impacts(
    at: &Point,
    before: usize,
    after: &Mode,
) -> Result<[Option<Limit>; 2], FieldError> {
    let Some((earlier, [last])) = at.arrival.switches.split_at_checked(before) else {
        return Ok([None, None]);
    };
    let &[j] = &last.surfaces[..] else {
        return Ok([None, None]);
    };
    let triggers = at.triggers();
    let side = after.entries()[j];
    let departs = side == triggers.side(j, None) && at.arrival.mode == after;
    if last.kind != Kind::Reset || !departs || !triggers.is_only_trigger(j) {
        return Ok([None, None]);
    }
    let signs = after.signs();
    let mut row = vec![0.0; at.x.len()];
    let rate = at.system.rate_gradient(j, &at.place(&signs), &mut row)?;
    let falls = at
        .system
        .lie_derivative(j, j, &[side, side], &at.place(&signs))?;
    if falls.value * f64::from(side) >= 0.0 {
        return Ok([None, None]);
    }
    let height = 0.5 * rate.rate * rate.rate / falls.value.abs();
    let size = at.system.surface_size(j, &at.place(&signs))?;
    let is_unresolved = height <= UNRESOLVED_FLIGHT * ROUNDING * size;
    if !is_unresolved && Reach::at(at).to(rate.rate, &row) >= 1.0 {
        return Ok([None, None]);
    }
    let same = |s: &Switch| {
        s.kind == last.kind && s.surfaces == last.surfaces && s.mode_after == last.mode_after
    };
    let series = match earlier {
        [.., a, b, c] if [a, b, c].into_iter().all(same) => Limit::of([a, b, c, last], vec![j]),
        _ => None,
    };
    let here = is_unresolved.then(|| Limit {
        t: at.t,
        x: at.x.to_vec(),
        surfaces: vec![j],
        is_rest: true,
    });
    let mut limits = [series, here];
    let (contact, sides) = (after.with(j, 0), at.arrival.sides);
    let mut field = ContactField::new(at.system, at.actions, &contact, sides, at.q);
    for limit in limits.iter_mut().flatten() {
        limit.is_rest = true;
        if let Some(field) = &mut field {
            field.project(limit.t, &mut limit.x)?;
        }
    }
    Ok(limits)
}

/// Where and when impacts on several surfaces end whose sequence repeats itself, faster by the same factor each time: the limit of one
/// whole round, at which all of these surfaces are in contact. `after` is the mode in which the bodies depart now.
pub(crate) fn limit_of_impact_rounds(
    at: &Point,
    after: &Mode,
) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches;
    let Some(round) = round_of(switches) else {
        return Ok(None);
    };
    let last = switches.len() - 1;
    let mut surfaces: Vec<usize> = switches[last + 1 - round..]
        .iter()
        .flat_map(|s| s.surfaces.iter().copied())
        .collect();
    surfaces.sort_unstable();
    surfaces.dedup();
    let triggers = at.triggers();
    if surfaces.len() < 2 || !surfaces.iter().all(|&j| triggers.is_only_trigger(j)) {
        return Ok(None);
    }
    let signs = after.signs();
    let reach = Reach::at(at);
    let mut h = vec![0.0; at.system.n_surfaces()];
    at.system.surfaces(&at.place(&signs), &mut h)?;
    let mut row = vec![0.0; at.x.len()];
    for &j in &surfaces {
        let rate = at.system.rate_gradient(j, &at.place(&signs), &mut row)?;
        if reach.to(rate.rate, &row) >= 1.0 {
            return Ok(None);
        }
        at.system.gradient(j, &at.place(&signs), &mut row)?;
        if reach.to(h[j], &row) >= 1.0 {
            return Ok(None);
        }
    }
    let turns = [3, 2, 1, 0].map(|k| &switches[last - k * round]);
    let mut contact = after.clone();
    surfaces.iter().for_each(|&j| contact.set(j, 0));
    let limit = Limit::of(turns, surfaces).filter(|limit| limit.t > at.t);
    let Some(mut limit) = limit else {
        return Ok(None);
    };
    limit.is_rest = true;
    let sides = at.arrival.sides;
    if let Some(mut field) = ContactField::new(at.system, at.actions, &contact, sides, at.q) {
        field.project(limit.t, &mut limit.x)?;
    }
    Ok(Some(limit))
}

/// How many switches a round of impacts has, with those in which contact begins and ends, if the last three rounds repeat one
/// another.
fn round_of(switches: &[Switch]) -> Option<usize> {
    let last = switches.len().checked_sub(1)?;
    let is_impact = |s: &Switch| matches!(s.kind, Kind::Reset | Kind::Accumulation);
    let repeats_after = |round: usize| {
        let mut back = 0..2 * round;
        last >= 3 * round
            && back.all(|k| repeats(&switches[last - k], &switches[last - k - round]))
            && switches[last + 1 - round..].iter().all(is_impact)
    };
    (2..=LONGEST_TURN).find(|&round| repeats_after(round))
}

/// Moves the state of a limit onto its surfaces.
pub(super) fn project(at: &Point, limit: &mut Limit) -> Result<(), FieldError> {
    let mut projector = at.projector();
    let setting = at.setting(at.arrival.signs);
    projector.project_onto_rates(at.system, &limit.surfaces, limit.t, &mut limit.x, setting)
}

/// Do the surfaces meet at the limit? Three lines in a plane need not.
pub(super) fn is_on_all(at: &Point, limit: &Limit) -> Result<bool, FieldError> {
    let mut h = vec![0.0; at.system.n_surfaces()];
    let place = at.place_at(limit.t, &limit.x, at.arrival.signs);
    for system in [Some(at.system), at.system.reduced(&limit.surfaces)] {
        let Some(system) = system else { continue };
        system.surfaces(&place, &mut h)?;
        for &j in &limit.surfaces {
            if h[j].abs() > ROUNDING * system.surface_size(j, &place)? {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// The current point as a limit: crossings of the surfaces `meeting` follow one another without any progress of time, as the
/// last turns of a spiral do that shrinks a thousandfold with each.
pub(crate) fn limit_here(at: &Point, meeting: &[usize]) -> Result<Option<Limit>, FieldError> {
    let switches = at.arrival.switches.iter().rev();
    let mut now = switches.take_while(|s| s.t == at.t);
    let only_crosses = now.all(|s| matches!(s.kind, Kind::Crossing | Kind::Grazing));
    if !only_crosses || !may_be_limit(at, meeting) {
        return Ok(None);
    }
    let mut limit = Limit {
        t: at.t,
        x: at.x.to_vec(),
        surfaces: meeting.to_vec(),
        is_rest: false,
    };
    project(at, &mut limit)?;
    Ok(Some(limit))
}

/// The motion that stays on all surfaces of a meeting, if there is one; why it cannot be known.
pub(super) fn stay_on_all(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Decided>, FieldError> {
    let (mode, meeting) = (meeting.mode, meeting.surfaces);
    let fields = at.corners(notes, meeting, mode)?;
    let telling = fields.telling();
    let silent = (0..meeting.len()).find(|place| !telling.contains(place));
    if let Some(surface) = silent {
        if !stays_tangent(at, notes, mode, meeting, &telling)? {
            return Ok(Some(Err(Stop::Intersection {
                surfaces: meeting.to_vec(),
                failing: Vec::new(),
                reason: Undecided::Tangent { surface },
            })));
        }
    }
    let stays = fields.normal_fields().is_ok_and(|fields| {
        if silent.is_some() {
            return least_multipliers(&fields, &telling).is_some();
        }
        let found = admissible_within(&fields, at.patience);
        let mut modes = found
            .iter()
            .filter_map(|found| found.continuation.as_mode());
        modes.any(|mode| mode.codimension() == meeting.len())
    });
    let mut after = mode.clone();
    meeting.iter().for_each(|&j| after.set(j, 0));
    Ok(stays.then(|| Ok(Next::new(after, Lefts::new()))))
}

/// Do the equations that say nothing at the limit say nothing either a moment later, along the motion on all surfaces?
fn stays_tangent(
    at: &Point,
    notes: &mut Notes,
    mode: &Mode,
    meeting: &[usize],
    telling: &[usize],
) -> Result<bool, FieldError> {
    let mut after = mode.clone();
    meeting.iter().for_each(|&j| after.set(j, 0));
    let velocity = at.velocity(notes, &after, &[])?;
    let moment = at.moment(notes, &after.signs(), &velocity)?;
    let mut ahead = at.along(&velocity, moment);
    let t = at.t + moment;
    let mut projector = at.projector();
    projector.project_onto(
        at.system,
        meeting,
        t,
        &mut ahead,
        at.setting(&after.signs()),
    )?;
    let later = at.moved(t, &ahead).corners(notes, meeting, &after)?;
    Ok(later.telling() == telling)
}

/// From where a limit is known to the tolerance: its error is a multiple of the square of the distance.
pub(super) struct Reach {
    /// The sizes of the states, lately.
    sizes: Vec<f64>,
    tolerances: Vec<f64>,
}

impl Reach {
    pub fn at(at: &Point) -> Self {
        let first = at.arrival.switches.len().saturating_sub(LONGEST_TURN);
        let lately = &at.arrival.switches[first..];
        let size = |(i, x): (usize, &f64)| {
            let states = lately.iter().filter_map(|switch| switch.y_after.get(i));
            let size = states.fold(x.abs(), |most, y| most.max(y.abs()));
            Some(at.scale.size(i, size)).filter(|size| size.is_finite())
        };
        let sizes =
            at.x.iter()
                .enumerate()
                .map(|state| size(state).unwrap_or(0.0));
        let tolerance = |(i, x): (usize, &f64)| at.scale.tolerance(i, *x, *x);
        Reach {
            sizes: sizes.collect(),
            tolerances: at.x.iter().enumerate().map(tolerance).collect(),
        }
    }

    /// How far a function with this value and gradient is from zero: 1 at the border.
    #[inline(never)]
    fn to(&self, value: f64, gradient: &[f64]) -> f64 {
        let along = |parts: &[f64]| dot_magnitude(gradient, parts);
        let (size, tolerance) = (along(&self.sizes), along(&self.tolerances));
        value.abs() / (size * tolerance.max(NEAREST_ACCUMULATION * size)).sqrt()
    }

    /// How far a switch is from the surfaces that it is said to accumulate at, and from their rates for one of a higher relative
    /// degree.
    pub fn distance(
        &self,
        at: &Point,
        meeting: &[usize],
        switch: &Switch,
    ) -> Result<f64, FieldError> {
        let signs = switch.mode_after.signs();
        let mut h = vec![0.0; at.system.n_surfaces()];
        let mut gradient = vec![0.0; switch.y_after.len()];
        let place = at.place_at(switch.t, &switch.y_after, &signs);
        let mut square = 0.0;
        for system in [Some(at.system), at.system.reduced(meeting)] {
            let Some(system) = system else { continue };
            system.surfaces(&place, &mut h)?;
            for &j in meeting {
                system.gradient(j, &place, &mut gradient)?;
                square += self.to(h[j], &gradient).powi(2);
            }
        }
        Ok(square.sqrt())
    }
}

/// Can switches of these surfaces accumulate where all of them meet? At one alone they can if its rate vanishes there too.
fn may_be_limit(at: &Point, meeting: &[usize]) -> bool {
    match meeting.len() {
        0 => false,
        1 => at.system.reduced(meeting).is_some(),
        n => n <= MOST_MEETING,
    }
}

/// Triggers that a jump to a limit passed.
pub(crate) struct Passed {
    pub triggers: Vec<usize>,
    /// The point moved back onto them, and the functions there.
    pub x: Vec<f64>,
    pub h: Values,
}

/// The triggers beside `surface` that the jump to the limit there passed, for a motion in the mode `before`.
pub(crate) fn passed_beside(
    at: &Point,
    notes: &mut Notes,
    before: &Mode,
    surface: usize,
) -> Result<Option<Passed>, FieldError> {
    let (signs, triggers) = (before.signs(), at.triggers());
    let h = at.surface_values(notes, &signs)?;
    let passed = (0..h.len()).filter(|&k| {
        let side = before.entries()[k];
        k != surface
            && triggers.is_only_trigger(k)
            && h[k] * f64::from(side) < 0.0
            && triggers.side(k, None) == side
    });
    let passed: Vec<usize> = passed.collect();
    if passed.is_empty() {
        return Ok(None);
    }
    let met: Vec<usize> = passed.iter().copied().chain([surface]).collect();
    let mut x = at.x.to_vec();
    let mut projector = at.projector();
    projector.project_onto(at.system, &met, at.t, &mut x, at.setting(&signs))?;
    let h = at.moved(at.t, &x).surface_values(notes, &signs)?;
    Ok(Some(Passed {
        triggers: passed,
        x,
        h,
    }))
}

/// How many switches a turn has, if the last three turns repeat.
pub(crate) fn turn_of(switches: &[Switch]) -> Option<usize> {
    let last = switches.last()?;
    let earlier = switches.iter().rev().skip(1).take(LONGEST_TURN);
    let turn = earlier
        .take_while(|s| !matches!(s.kind, Kind::Accumulation | Kind::Reset | Kind::Clock))
        .position(|s| repeats(s, last))?
        + 1;
    let index = switches.len() - 1;
    let again = |k: usize| {
        index
            .checked_sub(k * turn)
            .is_some_and(|i| repeats(&switches[i], last))
    };
    (again(2) && again(3)).then_some(turn)
}

/// The surfaces of a turn, with those slid on all along, if switches can accumulate there.
pub(super) fn meeting_of(at: &Point, turn: &[Switch]) -> Option<Vec<usize>> {
    let mut meeting: Vec<usize> = turn
        .iter()
        .flat_map(|s| s.surfaces.iter().copied())
        .collect();
    let (first, rest) = turn.split_first()?;
    let always = first.mode_after.sliding_set();
    meeting.extend(always.filter(|&j| rest.iter().all(|s| s.mode_after.entries()[j] == 0)));
    meeting.sort_unstable();
    meeting.dedup();
    may_be_limit(at, &meeting).then_some(meeting)
}

#[cfg(test)]
mod tests {
    use super::shrinks_by;

    #[test]
    fn ratios_that_agree_are_a_limit() {
        assert_eq!(shrinks_by([0.5, 0.51]), Some(0.51));
        assert_eq!(shrinks_by([0.5, 0.56]), None, "uneven");
        assert_eq!(shrinks_by([1.1, 1.1]), None, "growing");
        assert_eq!(shrinks_by([0.98, 0.981]), Some(0.981));
        assert_eq!(shrinks_by([0.97, 0.98]), None, "the sum is not known");
        assert_eq!(shrinks_by([f64::NAN, 0.5]), None);
    }
}
