//! Which modes can follow at a point: those that are consistent with their own signs, and all of whose guards begin positive.

use super::blow_up::beginnings;
use super::coinciding::{parting, Parallels, Touch};
use super::consistency::{consistency, Consistency};
use super::germ::{Germ, MotionSeries};
use super::look_ahead::{try_mode, Trial};
use super::point::{Cause, Left, Lefts, Notes, Point};
use super::rule::{How, Meeting};
use smallvec::smallvec;

use crate::error::FieldError;
use crate::field::{eval_on_side, normal, Guard, MeetingFields, RootEnd, Tie};
use crate::mode::Mode;
use crate::switching::{
    first_nonzero, is_undetermined, roots_in_cube, stable_roots_with_border, Leading, NormalFields,
    TwoFold, TwoFoldMotion,
};
use crate::system::dot;
use crate::tolerances::{AT_SIDE, DOUBTFUL, MOST_MEETING, ONE_DIRECTION, SURFACE_NOISE, TANGENT};

/// A mode in which a motion can go on.
#[derive(Clone, Debug)]
pub(super) struct Viable {
    pub mode: Mode,
    /// What vanishes at its start.
    pub left: Lefts,
    /// Of the surfaces that it slides on.
    pub multipliers: Vec<f64>,
    /// Do the equations of the multipliers vanish at the point?
    pub is_given: bool,
    /// On one surface, the motion that slides from a two-fold.
    pub two_fold: Option<TwoFoldMotion>,
    /// Does no guard stay zero?
    pub is_strict: bool,
    /// Does the field beyond a surface on which the motion stays press it there? Then it may as well slide.
    pub is_pressed: bool,
}

impl Viable {
    /// All guards grow.
    fn strictly(mode: Mode, left: Lefts) -> Self {
        Viable {
            mode,
            left,
            multipliers: Vec::new(),
            is_given: false,
            two_fold: None,
            is_strict: true,
            is_pressed: false,
        }
    }
}

/// All modes at a point.
#[derive(Clone, Debug, Default)]
pub(super) struct Survey {
    pub viable: Vec<Viable>,
    /// The others, each with a guard that begins negative.
    pub failing: Vec<(Mode, Guard)>,
    /// Modes about which derivatives at the point do not decide, nor a trial.
    pub open: Vec<Mode>,
    /// Modes that would slide between fields that differ in the signs of these functions too.
    pub between: Vec<(Mode, Vec<usize>)>,
}

impl Survey {
    /// The functions that jump on what could be slid on.
    pub fn jumping(self) -> Vec<usize> {
        let mut jumping: Vec<usize> = self.between.into_iter().flat_map(|(_, j)| j).collect();
        jumping.sort_unstable();
        jumping.dedup();
        jumping
    }
}

enum Verdict {
    Viable(Viable),
    Fails(Guard),
    Open,
}

/// Looks at all modes on the surfaces of `meeting`.
pub(super) fn survey(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
) -> Result<Option<Survey>, FieldError> {
    let m = meeting.surfaces.len();
    if m > MOST_MEETING {
        return Ok(None);
    }
    let corners = at.corners(notes, meeting.surfaces, meeting.mode)?;
    let Ok(fields) = corners.normal_fields() else {
        return Ok(None);
    };
    let pace = corners.pace(|i| at.scale.size(i, at.x[i]));
    let noise = noise_of(at, meeting, &fields)?;
    let touching = Parallels::of(at, meeting.surfaces, meeting.mode)?.touching;
    // Then derivatives at the point are not those where the surfaces touch.
    let is_beside = touching.iter().any(|touch| !touch.is_exact);
    let mut found = Survey::default();
    for index in 0..3_usize.pow(m as u32) {
        let entries = (0..m).map(|i| 1 - (index / 3_usize.pow(i as u32) % 3) as i8);
        if at.patience.is_over() {
            return Ok(None);
        }
        let entries = Mode::new(entries.collect());
        if !corners
            .ties()
            .iter()
            .all(|tie| tie.allows(entries.entries()))
        {
            continue;
        }
        let (mode, vanishing) = match consistency(at, notes, meeting, &entries)? {
            Consistency::Agrees { mode, vanishing } => (mode, vanishing),
            Consistency::Contradicts(j) => {
                let guard = Guard::Surface(j);
                found.failing.push((meeting.on_all(&entries), guard));
                continue;
            }
            Consistency::Between(jumping) => {
                found.between.push((meeting.on_all(&entries), jumping));
                continue;
            }
        };
        let others;
        // Normals, and signs of other functions, are those of the mode.
        let fields = match at.system.has_nested_signs() {
            true => match at.corners(notes, meeting.surfaces, &mode)?.normal_fields() {
                Ok(fields) => {
                    others = fields;
                    &others
                }
                Err(_) => return Ok(None),
            },
            false => &fields,
        };
        let candidate = Candidate {
            meeting,
            fields,
            noise: &noise,
            pace,
            entries: &entries,
            mode: &mode,
            guarded: &vanishing,
            corners: &corners,
        };
        let slides_on = |touch: &&Touch| touch.pair.iter().all(|&i| entries.entries()[i] == 0);
        let verdict = if has_ended(at, meeting, &mode) {
            Verdict::Fails(at.arrival.functions()[0])
        } else if let Some(touch) = touching.iter().find(slides_on) {
            match together(at, notes, &candidate, touch.pair)? {
                Together::Never => Verdict::Fails(Guard::Surface(meeting.surfaces[touch.pair[1]])),
                // Other rules may know.
                Together::Perhaps => continue,
                Together::By(fields) => {
                    let fields = &fields;
                    of_sliding(
                        at,
                        notes,
                        &Candidate {
                            fields,
                            ..candidate
                        },
                    )?
                }
            }
        } else if is_beside {
            Verdict::Open
        } else if entries.codimension() == 0 {
            of_region(at, &candidate)?
        } else {
            of_sliding(at, notes, &candidate)?
        };
        match verdict {
            Verdict::Viable(viable) => found.viable.push(viable),
            Verdict::Fails(guard) => found.failing.push((mode, guard)),
            Verdict::Open => match try_mode(at, notes, &mode, meeting.surfaces, SURFACE_NOISE)? {
                Trial::Leaves(left) => found.viable.push(Viable::strictly(mode, left)),
                Trial::Ends => found
                    .failing
                    .push((mode, guard_of(meeting, fields, &entries))),
                Trial::WithinRounding if is_beside => {}
                Trial::WithinRounding => found.open.push(mode),
            },
        }
    }
    Ok(Some(found))
}

/// A mode that agrees with all switching functions.
#[derive(Clone, Copy)]
struct Candidate<'c> {
    meeting: &'c Meeting<'c>,
    fields: &'c NormalFields,
    noise: &'c [f64],
    /// The rate at which the fields around the point change the state.
    pace: f64,
    /// On the surfaces of the meeting.
    entries: &'c Mode,
    mode: &'c Mode,
    /// Of which surfaces of the meeting is the function a guard: does it vanish here?
    guarded: &'c [bool],
    corners: &'c MeetingFields,
}

/// Is this the mode of a motion that one of its own exit functions has just ended?
fn has_ended(at: &Point, meeting: &Meeting, mode: &Mode) -> bool {
    let is_touch = matches!(at.arrival.cause, Cause::Event { touch: true, .. });
    meeting.is_exit() && !is_touch && mode == meeting.mode && !at.arrival.functions().is_empty()
}

/// Do multipliers hold a motion on two surfaces that touch?
enum Together {
    /// Whatever they are, it parts the surfaces.
    Never,
    Perhaps,
    /// They solve the equations with these normal components: those of the second surface are divided by their power.
    By(NormalFields),
}

/// Sliding on two surfaces that touch: to first order they are one, and the equation of the second is that of what they have
/// in common beside the point.
fn together(
    at: &Point,
    notes: &mut Notes,
    candidate: &Candidate,
    [i, k]: [usize; 2],
) -> Result<Together, FieldError> {
    let Candidate {
        meeting,
        entries,
        mode,
        ..
    } = *candidate;
    let pair = [i, k].map(|i| meeting.surfaces[i]);
    let Some((normal, is_odd)) = parting(at, pair, mode)? else {
        return Ok(Together::Perhaps);
    };
    let mut corners = at.corners(notes, meeting.surfaces, mode)?;
    corners.set_normal(k, &normal);
    let Ok(fields) = corners.normal_fields() else {
        return Ok(Together::Perhaps);
    };
    let end = 1.0 + ONE_DIRECTION;
    let face = fields.restrict(entries.entries());
    let face = (0..face.m()).fold(face, |face, axis| face.on_range(axis, [-end, end]));
    let noise = DOUBTFUL * face.size();
    let ranges: Vec<[f64; 2]> = (0..face.m()).map(|row| face.row_range(row)).collect();
    if ranges
        .iter()
        .any(|[low, high]| *low > noise || *high < -noise)
    {
        return Ok(Together::Never);
    }
    if ranges.iter().any(|[low, high]| high - low <= noise) {
        return Ok(Together::Perhaps);
    }
    let roots = roots_in_cube(&face);
    Ok(match roots.complete && roots.points.is_empty() {
        true => Together::Never,
        // After an even power no region lies between the surfaces on one side.
        false if !is_odd => Together::Perhaps,
        false => Together::By(fields),
    })
}

fn of_region(at: &Point, candidate: &Candidate) -> Result<Verdict, FieldError> {
    let Candidate {
        meeting,
        fields,
        noise,
        entries,
        mode,
        guarded,
        corners,
        ..
    } = *candidate;
    let signs = mode.signs();
    let g = match at.system.has_nested_signs() {
        true => components_in(at, meeting, &signs)?.into(),
        false => fields.in_region(entries.entries()),
    };
    let is_tangent = (0..noise.len()).any(|i| guarded[i] && g[i].abs() <= noise[i]);
    let series = is_tangent
        .then(|| MotionSeries::of(at, mode, &[], candidate.pace))
        .flatten();
    let mut viable = Viable::strictly(mode.clone(), Lefts::new());
    for (i, &j) in meeting.surfaces.iter().enumerate() {
        if !guarded[i] {
            continue;
        }
        let side = mode.entries()[j];
        if let Some(tie) = corners.ties().iter().find(|tie| tie.follower == i) {
            let leader = meeting.surfaces[tie.leader];
            let [one, other] = [leader, j].map(|j| normal(at.system, (at.t, at.x), j, &signs));
            let (one, other) = (one?, other?);
            let ratio = dot(&one, &other) / dot(&one, &one);
            let of_leader = viable.left.iter().find_map(|left| match left {
                Left::Surface(k, leading) if *k == leader => Some(*leading),
                _ => None,
            });
            viable
                .left
                .extend(of_leader.map(|Leading { order, value }| {
                    let value = ratio * value;
                    Left::Surface(j, Leading { order, value })
                }));
            continue;
        }
        let leading = match (g[i].abs() > noise[i], &series) {
            (true, _) if g[i] * f64::from(side) < 0.0 => {
                return Ok(Verdict::Fails(Guard::Surface(j)));
            }
            (true, _) | (false, None) => {
                let known = usize::from(g[i].abs() <= noise[i]);
                first_nonzero(at.system, j, side, known, at.t, at.x, &signs)?
            }
            (false, Some(series)) => match series.of_surface(at, j)? {
                Germ::Begins(leading) => leading,
                Germ::Zero => Leading {
                    order: 0,
                    value: 0.0,
                },
                Germ::Unknown => first_nonzero(at.system, j, side, 1, at.t, at.x, &signs)?,
            },
        };
        if leading.order == 0 {
            let corner: Vec<f64> = entries.entries().iter().map(|&k| f64::from(k)).collect();
            viable.is_pressed |= is_pressed(fields, noise, &corner, i);
            viable.is_strict = false;
        } else if leading.sign() != side {
            return Ok(Verdict::Fails(Guard::Surface(j)));
        }
        viable.left.push(Left::Surface(j, leading));
    }
    Ok(Verdict::Viable(viable))
}

/// The components normal to the surfaces of the meeting in one region, with its own normals: those of functions that contain
/// signs of others bend. Where a motion slides it needs none of its own, as it is tangent to what they differ by.
fn components_in(at: &Point, meeting: &Meeting, signs: &[f64]) -> Result<Vec<f64>, FieldError> {
    let (mut field, mut normal) = (vec![0.0; at.x.len()], vec![0.0; at.x.len()]);
    eval_on_side(at.system, at.t, at.x, signs, &mut field)?;
    let components = meeting.surfaces.iter().map(|&j| {
        let of_time = at.system.gradient(j, at.t, at.x, signs, &mut normal)?;
        Ok(of_time + dot(&normal, &field))
    });
    components.collect()
}

fn of_sliding(at: &Point, notes: &mut Notes, candidate: &Candidate) -> Result<Verdict, FieldError> {
    let Candidate {
        meeting,
        fields,
        noise,
        entries,
        ..
    } = *candidate;
    let face = fields.restrict(entries.entries());
    let is_silent = silent_rows((fields, noise), entries.entries());
    if entries.sliding_set().any(|i| is_silent[i]) {
        return match entries.sliding() {
            Some(place) => of_two_fold(at, candidate, place),
            None => of_blown_up(at, notes, candidate, &is_silent),
        };
    }
    if is_undetermined(&face) {
        return Ok(Verdict::Open);
    }
    let mut verdict = Verdict::Fails(guard_of(meeting, fields, entries));
    for lambda in stable_roots_with_border(&face, at.patience) {
        match at_root(at, candidate, &lambda)? {
            Verdict::Viable(viable) => return Ok(Verdict::Viable(viable)),
            Verdict::Open => verdict = Verdict::Open,
            Verdict::Fails(guard) => {
                if !matches!(verdict, Verdict::Open) {
                    verdict = Verdict::Fails(guard);
                }
            }
        }
    }
    Ok(verdict)
}

/// The guard of a mode that slides and has no stable root: on one surface the end of the multiplier whose field points away.
fn guard_of(meeting: &Meeting, fields: &NormalFields, entries: &Mode) -> Guard {
    let Some(place) = entries.sliding() else {
        return Guard::Root(RootEnd::Stability);
    };
    let on_side = |side| fields.in_region(entries.with(place, side).entries())[place];
    let end = if on_side(-1) <= 0.0 { -1 } else { 1 };
    Guard::Multiplier {
        surface: meeting.surfaces[place],
        end,
    }
}

/// A motion with these multipliers and sides stays on surface i of the meeting. Does the field beyond the surface press it
/// there? Then it slides.
fn is_pressed(fields: &NormalFields, noise: &[f64], lambda: &[f64], i: usize) -> bool {
    let mut beyond = lambda.to_vec();
    beyond[i] = -lambda[i];
    lambda[i] * fields.interpolate(&beyond)[i] > noise[i]
}

/// Are all fields around the surfaces slid on, and on both sides of surface i of the meeting, tangent to that? Only then
/// does a motion on it keep the sign of its mode.
fn is_neutral(fields: &NormalFields, noise: &[f64], entries: &[i8], i: usize) -> bool {
    [-1, 1].into_iter().all(|side| {
        let mut around = entries.to_vec();
        around[i] = side;
        silent_rows((fields, noise), &around)[i]
    })
}

/// To which surfaces of the meeting are all fields around the surfaces slid on tangent?
pub(super) fn silent_rows((fields, noise): (&NormalFields, &[f64]), entries: &[i8]) -> Vec<bool> {
    let slid: Vec<usize> = (0..entries.len()).filter(|&i| entries[i] == 0).collect();
    let mut is_silent = vec![true; fields.m()];
    let mut region = entries.to_vec();
    for pattern in 0..1_usize << slid.len() {
        for (bit, &i) in slid.iter().enumerate() {
            region[i] = if pattern >> bit & 1 == 1 { 1 } else { -1 };
        }
        let rows = is_silent.iter_mut().zip(noise);
        for ((is_silent, noise), value) in rows.zip(fields.in_region(&region).iter()) {
            *is_silent &= value.abs() <= *noise;
        }
    }
    is_silent
}

/// Sliding on one surface to which both fields are tangent.
fn of_two_fold(at: &Point, candidate: &Candidate, place: usize) -> Result<Verdict, FieldError> {
    let Candidate {
        meeting,
        fields,
        entries,
        mode,
        guarded,
        ..
    } = *candidate;
    let slid = meeting.surfaces[place];
    let mut two_fold = TwoFold::new(at.system, slid, 1, (at.t, at.x), &mode.signs());
    if matches!(meeting.how, How::Event(_)) {
        two_fold = two_fold.located();
    }
    let mut verdict = Verdict::Fails(guard_of(meeting, fields, entries));
    for motion in two_fold.motions()? {
        let mut is_open = motion.minus.order == 0 || motion.plus.order == 0;
        let [minus, plus] = Guard::ends(slid);
        let mut left: Lefts = smallvec![
            Left::Exit(minus, motion.minus),
            Left::Exit(plus, motion.plus),
        ];
        let mut failing = None;
        if motion.minus.sign() < 0 || motion.plus.sign() > 0 {
            failing = Some(if motion.minus.sign() < 0 { minus } else { plus });
        }
        for (i, &j) in meeting.surfaces.iter().enumerate() {
            let side = entries.entries()[i];
            if side == 0 || !guarded[i] || failing.is_some() {
                continue;
            }
            let leading = two_fold.first_along(j, &motion)?;
            is_open |= leading.order == 0;
            if leading.sign() == -side {
                failing = Some(Guard::Surface(j));
            }
            left.push(Left::Surface(j, leading));
        }
        match (failing, &verdict) {
            (Some(_), Verdict::Open) => {}
            (Some(guard), _) => verdict = Verdict::Fails(guard),
            (None, _) if is_open => verdict = Verdict::Open,
            (None, _) => {
                return Ok(Verdict::Viable(Viable {
                    multipliers: vec![motion.multiplier()],
                    is_given: true,
                    two_fold: Some(motion),
                    ..Viable::strictly(mode.clone(), left)
                }))
            }
        }
    }
    Ok(verdict)
}

/// Sliding on several surfaces where equations of the multipliers vanish.
fn of_blown_up(
    at: &Point,
    notes: &mut Notes,
    candidate: &Candidate,
    is_silent: &[bool],
) -> Result<Verdict, FieldError> {
    let Candidate {
        meeting,
        fields,
        entries,
        mode,
        guarded,
        ..
    } = *candidate;
    let mut verdict = None;
    for beginning in beginnings(at, notes, meeting, mode, is_silent)? {
        let mut left = Lefts::new();
        let mut failing = None;
        let largest = beginning
            .rates
            .iter()
            .fold(0.0_f64, |most, rate| most.max(rate.abs()));
        let is_end = |lambda: &f64| 1.0 - lambda.abs() <= AT_SIDE;
        let mut is_open = beginning.multipliers.iter().any(is_end);
        for (i, &j) in meeting.surfaces.iter().enumerate() {
            let side = f64::from(entries.entries()[i]);
            let value = beginning.rates[i];
            if side == 0.0 || !guarded[i] {
                continue;
            }
            if value.abs() <= DOUBTFUL * largest {
                is_open = true;
            } else if side * value < 0.0 {
                failing = Some(Guard::Surface(j));
            }
            let order = 1 + usize::from(is_silent[i]);
            left.push(Left::Surface(j, Leading { order, value }));
        }
        match (failing, is_open) {
            (Some(guard), _) => verdict = verdict.or(Some(Verdict::Fails(guard))),
            (None, true) => verdict = Some(Verdict::Open),
            (None, false) => {
                return Ok(Verdict::Viable(Viable {
                    multipliers: beginning.multipliers,
                    is_given: true,
                    ..Viable::strictly(mode.clone(), left)
                }));
            }
        }
    }
    // No way to begin is stable.
    Ok(verdict.unwrap_or(Verdict::Fails(guard_of(meeting, fields, entries))))
}

fn at_root(at: &Point, candidate: &Candidate, lambda: &[f64]) -> Result<Verdict, FieldError> {
    let Candidate {
        meeting,
        fields,
        noise,
        entries,
        mode,
        guarded,
        corners,
        ..
    } = *candidate;
    let mut next = lambda.iter();
    let held = entries.entries().iter();
    let full: Vec<f64> = held
        .map(|&k| {
            if k == 0 {
                next.next().copied().unwrap_or(0.0)
            } else {
                f64::from(k)
            }
        })
        .collect();
    let g = fields.interpolate(&full);
    let (mut left, mut tangent) = (Lefts::new(), Vec::new());
    for (i, &j) in meeting.surfaces.iter().enumerate() {
        let side = f64::from(entries.entries()[i]);
        if side == 0.0 || !guarded[i] {
            continue;
        }
        if g[i].abs() <= noise[i] {
            tangent.push(j);
        } else if side * g[i] < 0.0 {
            return Ok(Verdict::Fails(Guard::Surface(j)));
        } else {
            left.push(Left::Surface(
                j,
                Leading {
                    order: 1,
                    value: g[i],
                },
            ));
        }
    }
    let ends: Vec<usize> = (0..2 * lambda.len())
        .filter(|index| {
            let end = if index % 2 == 0 { 1.0 } else { -1.0 };
            1.0 + end * lambda[index / 2] <= AT_SIDE
        })
        .collect();
    let mut viable = Viable {
        multipliers: lambda.to_vec(),
        ..Viable::strictly(mode.clone(), left)
    };
    if tangent.is_empty() && ends.is_empty() {
        return Ok(Verdict::Viable(viable));
    }
    if let ([tie], [], 2) = (corners.ties(), &tangent[..], lambda.len()) {
        return at_tied_end(at, candidate, viable, *tie);
    }
    let Some(series) = MotionSeries::of(at, mode, lambda, candidate.pace) else {
        return Ok(Verdict::Open);
    };
    for j in tangent {
        let side = mode.entries()[j];
        let i = meeting.surfaces.iter().position(|&k| k == j).unwrap_or(0);
        match series.of_surface(at, j)? {
            Germ::Begins(leading) if leading.sign() == side => {
                viable.left.push(Left::Surface(j, leading))
            }
            Germ::Begins(_) => return Ok(Verdict::Fails(Guard::Surface(j))),
            Germ::Zero
                if !corners.depends_on(i) || is_neutral(fields, noise, entries.entries(), i) =>
            {
                viable.is_strict = false;
                viable.left.push(Left::Surface(
                    j,
                    Leading {
                        order: 0,
                        value: 0.0,
                    },
                ));
            }
            // It slides, with a multiplier at its end.
            Germ::Zero if is_pressed(fields, noise, &full, i) => {
                return Ok(Verdict::Fails(Guard::Surface(j)));
            }
            Germ::Zero | Germ::Unknown => return Ok(Verdict::Open),
        }
    }
    let slid = entries.sliding_set().map(|i| meeting.surfaces[i]);
    let guards: Vec<Guard> = slid.flat_map(Guard::ends).collect();
    for index in ends {
        let function = guards[index];
        match series.of_exit(index) {
            Germ::Begins(leading) if leading.value > 0.0 => {
                if leading.order > 0 {
                    viable.left.push(Left::Exit(function, leading));
                }
            }
            Germ::Begins(_) => return Ok(Verdict::Fails(function)),
            // The multiplier stays at its end.
            Germ::Zero => viable.is_strict = false,
            Germ::Unknown => return Ok(Verdict::Open),
        }
    }
    Ok(Verdict::Viable(viable))
}

/// Sliding on two surfaces in one place that begins with multipliers at their ends: the motion is that of one region, which
/// has to lead back to the surfaces.
fn at_tied_end(
    at: &Point,
    candidate: &Candidate,
    mut viable: Viable,
    tie: Tie,
) -> Result<Verdict, FieldError> {
    let Candidate {
        meeting,
        fields,
        entries,
        mode,
        ..
    } = *candidate;
    let side: i8 = if viable.multipliers[0] < 0.0 { -1 } else { 1 };
    let sides = [(tie.leader, 1), (tie.follower, tie.sense)];
    let (mut region, mut beyond) = (mode.clone(), entries.clone());
    for (i, sense) in sides {
        region.set(meeting.surfaces[i], sense * side);
        beyond.set(i, -sense * side);
    }
    let Some(series) = MotionSeries::of(at, &region, &[], candidate.pace) else {
        return Ok(Verdict::Open);
    };
    let held = fields.in_region(beyond.entries())[tie.leader];
    match series.of_surface(at, meeting.surfaces[tie.leader])? {
        Germ::Unknown => return Ok(Verdict::Open),
        Germ::Zero => viable.is_strict = false,
        Germ::Begins(leading) => {
            let order = leading.order - 1;
            let value = 2.0 * leading.value.abs() / held.abs();
            for (i, sense) in sides {
                let (surface, end) = (meeting.surfaces[i], sense * side);
                let guard = Guard::Multiplier { surface, end };
                if leading.sign() == side {
                    return Ok(Verdict::Fails(guard));
                }
                if order > 0 {
                    viable
                        .left
                        .push(Left::Exit(guard, Leading { order, value }));
                }
            }
        }
    }
    Ok(Verdict::Viable(viable))
}

/// What a normal component may be without being clear of zero, for each surface: the error of the fields at a located event,
/// and what the rounding of time and state makes of zero.
pub(super) fn noise_of(
    at: &Point,
    meeting: &Meeting,
    fields: &NormalFields,
) -> Result<Vec<f64>, FieldError> {
    let mut gradient = vec![0.0; at.x.len()];
    let mut noise = Vec::with_capacity(meeting.surfaces.len());
    for (i, &j) in meeting.surfaces.iter().enumerate() {
        let mut largest = DOUBTFUL * fields.row_size(i);
        for side in [-1, 1] {
            let signs = meeting.mode.with(j, side).signs();
            let partials = at
                .system
                .rate_gradient(j, at.t, at.x, &signs, &mut gradient)?;
            let parts = gradient.iter().zip(at.x).enumerate();
            let size: f64 = parts
                .map(|(i, (g, x))| g.abs() * at.scale.size(i, *x))
                .filter(|part| part.is_finite())
                .sum();
            largest = largest.max(TANGENT * (size + (partials.time * at.t).abs()));
        }
        noise.push(largest);
    }
    Ok(noise)
}
