//! The equations of an itinerary: legs that follow one another, what happens at their ends, and that they close.
//!
//! The unknowns are the states at the starts of the legs, then how long they last, and maybe the time at which the first one starts.
//! Reference: Thota, Dankowicz, SIAM J. Appl. Dyn. Syst. 7 (2008) 1283 (itineraries as boundary-value problems).

use super::leg::{leg, Leg, LegError, Over};
use crate::derivative::{ActionAt, Extended, HeldMotion};
use crate::error::{Error, FieldError};
use crate::integrate::Reached;
use crate::mode::Mode;
use crate::motion::Guard;
use crate::options::Options;
use crate::record::Gradient;
use crate::system::{Actions, PiecewiseSystem, TracedSystem};
use crate::tolerances::AT_SIDE;
use crate::vectors::dot;

/// A leg of an itinerary.
#[derive(Clone, Debug)]
pub struct ItineraryLeg {
    /// Its mode.
    pub mode: Mode,
    /// The discrete states.
    pub q: Vec<f64>,
    /// What ends it.
    pub end: LegEnd,
    /// The actions that are done there.
    pub acts: Vec<usize>,
}

/// What ends a leg.
#[derive(Clone, Copy, Debug)]
pub enum LegEnd {
    /// The period is over, and nothing happens.
    Open,
    /// The next leg goes on with the motion; this one lasts so many times as long as that.
    Cut(f64),
    /// A guard vanishes.
    Guard(Guard),
    /// A known time comes.
    Time(f64),
}

/// A leg with what happens at its end.
#[derive(Debug)]
pub struct Passage {
    /// The time of its end.
    pub t: f64,
    /// The motion.
    pub leg: Leg,
    /// The equation of its end: a value that vanishes there.
    pub value: f64,
    /// Its derivatives by the time, the states and the parameters; none if nothing ends the leg.
    pub row: Option<Vec<f64>>,
    /// The state behind the end.
    pub after: Vec<f64>,
    /// Its derivatives by the time, the state before and the parameters; none if no action changes it.
    pub map: Option<Vec<Vec<f64>>>,
    /// The discrete states behind the end.
    pub q: Vec<f64>,
    /// The guards and their rates before the end and behind it, if they are asked for and something ends the leg.
    pub sides: Option<[GuardRates; 2]>,
}

/// The values of the guards of a motion, and their derivatives along it.
pub type GuardRates = (Vec<f64>, Vec<f64>);

/// A place at which a guard of a leg is less than beside it.
#[derive(Clone, Copy, Debug)]
pub struct Dip {
    /// The leg.
    pub leg: usize,
    /// The number of its guard.
    pub guard: usize,
    /// Which minimum of the guard this is.
    pub number: usize,
    /// The times before it, of it, and behind it.
    pub times: [f64; 3],
}

/// The equations at a point.
#[derive(Debug)]
pub struct Equations {
    /// For each leg by how much its end is not the start of the next one, and the equation of its end.
    pub residual: Vec<f64>,
    /// Its derivatives, a row for each entry: by the unknowns, then by the parameters.
    pub jacobian: Vec<f64>,
    /// The legs.
    pub passages: Vec<Passage>,
    /// The derivative of the state after all legs by that at the start, both at fixed times, a row after the other.
    pub monodromy: Vec<f64>,
    /// Where guards may touch zero on the way, if their places are asked for.
    pub dips: Vec<Dip>,
}

/// Where the legs start and how long they last.
#[derive(Clone, Copy, Debug)]
pub struct Unknowns<'s> {
    /// The state at the start of each, one after the other.
    pub starts: &'s [f64],
    /// How long each lasts.
    pub durations: &'s [f64],
    /// When the first one starts.
    pub t0: f64,
    /// Is that unknown too?
    pub is_free_in_time: bool,
    /// At how many places in each step all guards are evaluated.
    pub places: usize,
}

/// Follows the legs of an itinerary, and returns its equations; `interrupt` is asked every few steps of each leg.
///
/// # Errors
/// If a mode does not fit the system, a leg cannot be followed, or a function of the user raises.
///
/// # Example
///
/// ```
/// use filippov::derivative::Extension;
/// use filippov::{equations, ItineraryLeg, LegEnd, Mode, Options, Rules, TracedSystem, Unknowns};
/// use filippov_expr::{Backend, Graph, Names};
///
/// // x' = -x for one unit of time, from x = 2.
/// let mut graph = Graph::new();
/// let x = graph.state(0);
/// let field = vec![graph.neg(x)];
/// let names = Names { states: Vec::new(), parameters: Vec::new() };
/// let system = TracedSystem::new(graph, field, Vec::new(), names, Backend::Interpreter)?;
///
/// let none = filippov::action::Actions::none();
/// let extension = Extension::new(&system, &Rules::default(), &[])?;
/// let extended = extension.at(system.parameters(), &none)?.expect("no map is called");
/// let leg = ItineraryLeg { mode: Mode::new(Vec::new()), q: Vec::new(), end: LegEnd::Open, acts: Vec::new() };
/// let at = Unknowns { starts: &[2.0], durations: &[1.0], t0: 0.0, is_free_in_time: false, places: 0 };
/// let options = Options { rtol: 1e-12, ..Options::default() };
/// let found = equations((&system, &extended, &none), &options, &[leg], at, &mut |_| false).unwrap();
/// assert!((found.monodromy[0] - (-1.0_f64).exp()).abs() < 1e-11);
/// assert!((found.residual[0] - 2.0 * (found.monodromy[0] - 1.0)).abs() < 1e-11);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn equations(
    (system, extended, actions): (&TracedSystem, &Extended, &Actions),
    options: &Options,
    legs: &[ItineraryLeg],
    at: Unknowns,
    interrupt: &mut dyn FnMut(Reached) -> bool,
) -> Result<Equations, LegError> {
    check(system, actions, legs, at)?;
    let impacts = extended.impacts();
    let motion = |leg: &ItineraryLeg, q: &[f64]| {
        HeldMotion::new((system, extended), &impacts, options, &leg.mode, q)
    };
    let mut motions: Vec<HeldMotion> = legs.iter().map(|leg| motion(leg, &leg.q)).collect();
    let n = at.starts.len() / legs.len();
    let mut t = at.t0;
    let mut passages = Vec::with_capacity(legs.len());
    for (i, (start, &duration)) in at.starts.chunks_exact(n).zip(at.durations).enumerate() {
        let over = Over {
            span: (t, (t + duration).max(t.next_up())),
            start,
            places: at.places,
            ending: None,
        };
        let held = Actions {
            list: actions.list.clone(),
            discrete: legs[i].q.clone(),
        };
        let of = (system, extended, &held);
        let mut passage = pass(
            of,
            options,
            (&legs[i], &mut motions[i]),
            over,
            t + duration,
            interrupt,
        )?;
        if at.places > 0 && !goes_on(&legs[i]) {
            let next = (i + 1) % legs.len();
            let before = rates(&mut motions[i], passage.t, &passage.leg.x)?;
            let mut other = (passage.q != legs[next].q).then(|| motion(&legs[next], &passage.q));
            let following = other.as_mut().unwrap_or(&mut motions[next]);
            let behind = rates(following, passage.t, &passage.after)?;
            passage.sides = Some([before, behind]);
        }
        t = passage.t;
        passages.push(passage);
    }
    let (residual, jacobian) = assemble(legs, at, &passages, extended.n_parameters());
    Ok(Equations {
        residual,
        jacobian,
        monodromy: monodromy(&passages),
        dips: (0..legs.len())
            .flat_map(|i| dips(legs, &passages, i))
            .collect(),
        passages,
    })
}

fn check(
    system: &TracedSystem,
    actions: &Actions,
    legs: &[ItineraryLeg],
    at: Unknowns,
) -> Result<(), Error> {
    let wrong = |name, found, expected| Error::WrongCount {
        name,
        found,
        expected,
    };
    let (m, n) = (legs.len(), system.n_states());
    if m == 0 || at.durations.len() != m {
        return Err(wrong("durations", at.durations.len(), m));
    }
    if at.starts.len() != m * n {
        return Err(wrong("starts", at.starts.len(), m * n));
    }
    let mut modes = legs.iter().map(|leg| leg.mode.entries().len());
    if let Some(found) = modes.find(|found| *found != system.n_surfaces()) {
        return Err(wrong("mode", found, system.n_surfaces()));
    }
    let acts = legs.iter().flat_map(|leg| &leg.acts);
    match acts.copied().find(|act| *act >= actions.list.len()) {
        Some(act) => Err(wrong("actions", actions.list.len(), act + 1)),
        None => Ok(()),
    }
}

/// Follows a leg, and does what happens at its end.
fn pass(
    of: (&TracedSystem, &Extended, &Actions),
    options: &Options,
    (own, motion): (&ItineraryLeg, &mut HeldMotion),
    mut over: Over,
    t: f64,
    interrupt: &mut dyn FnMut(Reached) -> bool,
) -> Result<Passage, LegError> {
    let (_, extended, actions) = of;
    if let LegEnd::Guard(guard) = own.end {
        let place = motion.guards().iter().position(|known| *known == guard);
        over.ending = Some(place.ok_or(LegError::NoGuard)?);
    }
    let found = leg(of, options, motion, over, interrupt)?;
    let act = |index: usize, x: &[f64], q: &[f64]| -> Result<ActionAt, FieldError> {
        extended.act((actions, index), &own.mode, (t, x, q))
    };
    let (value, row) = match (own.end, &found.ending) {
        (LegEnd::Open, _) => (0.0, None),
        (LegEnd::Guard(_), Some(guard)) => (guard.value, Some(guard.gradient.by_all())),
        (end, _) => {
            let mut clock = None;
            for &index in &own.acts {
                clock = clock.or(act(index, &found.x, &own.q)?.clock);
            }
            let mut unit = vec![0.0; 1 + over.start.len() + extended.n_parameters()];
            unit[0] = 1.0;
            match (clock, end) {
                // It ticks where this comes to a whole number.
                (Some((value, gradient)), _) => {
                    (value - value.round_ties_even(), Some(gradient.by_all()))
                }
                (None, LegEnd::Time(known)) => (t - known, Some(unit)),
                (None, _) => (0.0, Some(unit)),
            }
        }
    };
    let (mut after, mut q, mut map) = (found.x.clone(), own.q.clone(), None);
    for &index in &own.acts {
        let done = act(index, &after, &q)?;
        if let Some(rows) = &done.rows {
            map = Some(chained(rows, &done.by_time, map));
        }
        (after, q) = (done.x, done.q);
    }
    Ok(Passage {
        t,
        leg: found,
        value,
        row,
        after,
        map,
        q,
        sides: None,
    })
}

/// The guards of a motion at a place, and their derivatives along it.
fn rates(motion: &mut HeldMotion, t: f64, x: &[f64]) -> Result<GuardRates, FieldError> {
    let velocity = motion.velocity(t, x)?;
    let found = motion.guards_at(t, x)?.into_iter();
    let rate = |gradient: &Gradient| gradient.time + dot(&gradient.state, &velocity);
    Ok(found
        .map(|guard| (guard.value, rate(&guard.gradient)))
        .unzip())
}

/// The derivatives of what an action makes of a state, by the time, the state before all actions and the parameters.
fn chained(rows: &[Vec<f64>], by_time: &[f64], before: Option<Vec<Vec<f64>>>) -> Vec<Vec<f64>> {
    let n = by_time.len();
    let all = rows.iter().zip(by_time);
    all.map(|(row, by_time)| {
        let (by_state, by_parameters) = row.split_at(n);
        let mut found = match &before {
            None => [&[0.0], by_state, &vec![0.0; by_parameters.len()]].concat(),
            Some(before) => combined(by_state, before),
        };
        found[0] += by_time;
        let own = found[1 + n..].iter_mut().zip(by_parameters);
        own.for_each(|(entry, own)| *entry += own);
        found
    })
    .collect()
}

/// The sum of rows with these weights.
fn combined(weights: &[f64], rows: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; rows[0].len()];
    for (weight, row) in weights.iter().zip(rows) {
        let entries = sum.iter_mut().zip(row);
        entries.for_each(|(entry, other)| *entry += weight * other);
    }
    sum
}

/// The derivatives of a function of the end of a motion, by the states and the time at its start, its duration and the parameters.
/// `row` has its derivatives by the time, the states and the parameters at the end, `end` those of the states there.
fn along(row: &[f64], end: &[Vec<f64>]) -> Vec<f64> {
    let n = end.len();
    let mut found = combined(&row[1..=n], end);
    let own = [row[0], row[0]]
        .into_iter()
        .chain(row[1 + n..].iter().copied());
    let entries = found[n..].iter_mut().zip(own);
    entries.for_each(|(entry, own)| *entry += own);
    found
}

/// The equations of all legs and their derivatives, without those of the period and of the phase.
fn assemble(
    legs: &[ItineraryLeg],
    at: Unknowns,
    passages: &[Passage],
    n_parameters: usize,
) -> (Vec<f64>, Vec<f64>) {
    let (m, n) = (legs.len(), at.starts.len() / legs.len());
    let size = m * (n + 1) + usize::from(at.is_free_in_time);
    let width = size + n_parameters;
    let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * width]);
    for (i, passage) in passages.iter().enumerate() {
        let next = (i + 1) % m;
        let (first, last, duration) = (i * (n + 1), i * (n + 1) + n, m * n + i);
        for r in 0..n {
            residual[first + r] = passage.after[r] - at.starts[next * n + r];
        }
        residual[last] = passage.value;
        let end = passage.leg.rows();
        let behind = passage.map.as_ref();
        let behind = behind.map(|map| map.iter().map(|row| along(row, &end)).collect());
        let ending = passage.row.as_ref().map(|row| along(row, &end));
        for (r, row) in behind.unwrap_or(end).iter().chain(&ending).enumerate() {
            let own = &mut jacobian[(first + r) * width..][..width];
            own[i * n..(i + 1) * n].copy_from_slice(&row[..n]);
            own[m * n..duration].fill(row[n]);
            own[duration] = row[n + 1];
            own[m * (n + 1)..size].fill(row[n]);
            own[size..].copy_from_slice(&row[n + 2..]);
            if r < n {
                own[next * n + r] -= 1.0;
            }
        }
        if let LegEnd::Cut(share) = legs[i].end {
            residual[last] = at.durations[i] - share * at.durations[next];
            let own = &mut jacobian[last * width..][..width];
            own.fill(0.0);
            (own[duration], own[m * n + next]) = (1.0, -share);
        }
    }
    (residual, jacobian)
}

/// The derivative of the state after all legs by that at the start, both at fixed times. It is infinite where a leg ends without speed.
fn monodromy(passages: &[Passage]) -> Vec<f64> {
    let n = passages[0].after.len();
    // Changes of the state for each change at the start, and of the time at which a leg starts.
    let mut states: Vec<Vec<f64>> = (0..n)
        .map(|c| (0..n).map(|r| f64::from(u8::from(r == c))).collect())
        .collect();
    let mut times = vec![0.0; n];
    for passage in passages {
        let [at_start, at_end] = &passage.leg.velocities;
        let by_state = passage.leg.by_state();
        for (state, time) in states.iter_mut().zip(&mut times) {
            // At a fixed time.
            let start: Vec<f64> = state
                .iter()
                .zip(at_start)
                .map(|(x, v)| x - v * *time)
                .collect();
            let end = by_state.chunks_exact(n).zip(&start);
            state.fill(0.0);
            for (column, start) in end {
                let entries = state.iter_mut().zip(column);
                entries.for_each(|(entry, by)| *entry += by * start);
            }
            let Some(row) = &passage.row else { continue };
            let normal = &row[1..=n];
            *time = -dot(normal, state) / (row[0] + dot(normal, at_end));
            let entries = state.iter_mut().zip(at_end);
            entries.for_each(|(entry, v)| *entry += v * *time);
            if let Some(map) = &passage.map {
                *state = map
                    .iter()
                    .map(|row| dot(&row[1..=n], state) + row[0] * *time)
                    .collect();
            }
        }
        if passage.row.is_none() {
            times.fill(0.0);
        }
    }
    let first = &passages[0].leg.velocities[0];
    for (state, time) in states.iter_mut().zip(&times) {
        let entries = state.iter_mut().zip(first);
        entries.for_each(|(entry, v)| *entry -= v * time);
    }
    (0..n)
        .flat_map(|r| states.iter().map(move |state| state[r]))
        .collect()
}

/// Does the motion of a leg go on in the next one?
fn goes_on(leg: &ItineraryLeg) -> bool {
    matches!(leg.end, LegEnd::Open | LegEnd::Cut(_))
}

/// Where the guards of a leg have minima near zero, by their values at some places and their rates at the ends.
fn dips(legs: &[ItineraryLeg], passages: &[Passage], i: usize) -> Vec<Dip> {
    let (m, passage) = (legs.len(), &passages[i]);
    let own = passage.leg.samples.iter();
    let mut samples: Vec<(f64, &[f64])> = own.map(|(t, values)| (*t, &values[..])).collect();
    if goes_on(&legs[i]) {
        let beside = &passages[(i + 1) % m].leg.samples;
        if let [first, second, ..] = &beside[..] {
            samples.push((passage.t + second.0 - first.0, &second.1));
        }
    }
    let (Some(&first), Some(&last)) = (samples.first(), samples.last()) else {
        return Vec::new();
    };
    // A minimum between the first two places, or the last two, shows by the rate at the end beside it.
    let at_start = passages[(i + m - 1) % m]
        .sides
        .as_ref()
        .map(|sides| &sides[1].1);
    let at_end = passage.sides.as_ref().map(|sides| &sides[0].1);
    let mut found = Vec::new();
    for guard in 0..first.1.len() {
        let size = samples.iter().map(|sample| sample.1[guard].abs());
        let size = size.fold(0.0, f64::max);
        // The rate of a guard that begins or ends at zero may be rounding.
        let is_clear = |(_, values): (f64, &[f64])| values[guard] > AT_SIDE * size;
        let falls = is_clear(first) && at_start.is_some_and(|rates| rates[guard] < 0.0);
        let rises = is_clear(last) && at_end.is_some_and(|rates| rates[guard] > 0.0);
        let mut places = samples.clone();
        if falls {
            places.insert(0, first);
        }
        if rises {
            places.push(last);
        }
        let is_first = |k: usize| k == 0 && falls;
        let minima = places.windows(3).enumerate().filter(|(k, three)| {
            let [before, here, behind] = [0, 1, 2].map(|k| three[k].1[guard]);
            (here < before || is_first(*k)) && here <= behind
        });
        // Far from zero, it is not near it whatever the parameter does next.
        let near = minima
            .map(|(_, three)| three)
            .enumerate()
            .filter(|(_, three)| three[1].1[guard].abs() <= 0.5 * size);
        found.extend(near.map(|(number, three)| Dip {
            leg: i,
            guard,
            number,
            times: [0, 1, 2].map(|k| three[k].0),
        }));
    }
    found
}
