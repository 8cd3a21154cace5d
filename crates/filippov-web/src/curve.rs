//! The curve of a run as points: few of them, and near the curve between them.

use filippov::{FieldError, Mode, PiecewiseSystem, Segment, Side, Solution};

/// A piece of constant mode: its first and its last point.
pub struct CurvePiece {
    pub mode: Mode,
    pub first: usize,
    pub last: usize,
}

/// Points of a run, and its pieces.
#[derive(Default)]
pub struct Curve {
    pub t: Vec<f64>,
    /// The states, one after the other.
    pub y: Vec<f64>,
    pub pieces: Vec<CurvePiece>,
}

/// Where in a part of a step the chord is compared with the curve. Uneven: a wave with several turns in it is not hit in its
/// zeros alone.
const TRIED: [f64; 3] = [0.211, 0.5, 0.773];
/// A step is halved at most so many times.
const MOST_HALVINGS: u32 = 12;
/// The least extent that counts for a state, as a share of its size: rounding is not drawn.
const LEAST_EXTENT: f64 = 1e-9;

/// The curve of a run. The polyline through its points is within `tolerance` of the curve, as a share of the extent of each state
/// over the run, in the time series of every state, and so in every projection.
pub fn curve(
    system: &dyn PiecewiseSystem,
    solution: &Solution,
    tolerance: f64,
) -> Result<Curve, FieldError> {
    let sampler = Sampler {
        system,
        solution,
        // Half of it for the refinement, the other half for leaving out points.
        allowed: extents(solution)
            .map(|extent| 0.5 * tolerance * extent)
            .collect(),
    };
    let mut curve = Curve::default();
    for (index, segment) in solution.segments.iter().enumerate() {
        let points = sampler.points_of(&segment, index)?;
        let first = curve.t.len();
        for place in sampler.thinned(&points) {
            curve.t.push(points.t[place]);
            curve.y.extend_from_slice(sampler.state(&points, place));
        }
        curve.pieces.push(CurvePiece {
            mode: segment.mode,
            first,
            last: curve.t.len() - 1,
        });
    }
    Ok(curve)
}

/// The extent of each state over the ends of the steps and the switches.
fn extents(solution: &Solution) -> impl Iterator<Item = f64> + '_ {
    (0..solution.n_states).map(move |i| {
        let ends = solution.y.iter().copied().skip(i);
        let ends = ends.step_by(solution.n_states);
        let switches = solution.switches.iter();
        let switches = switches.flat_map(move |s| [s.y_before[i], s.y_after[i]]);
        let last = solution.last_state().get(i).copied();
        let all = ends.chain(switches).chain(last).filter(|y| y.is_finite());
        let (low, high, size) = all.fold(
            (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64),
            |(low, high, size), y| (low.min(y), high.max(y), size.max(y.abs())),
        );
        (high - low).max(LEAST_EXTENT * size.max(f64::MIN_POSITIVE))
    })
}

/// Points in the order of time.
#[derive(Default)]
struct Points {
    t: Vec<f64>,
    y: Vec<f64>,
}

struct Sampler<'a> {
    system: &'a dyn PiecewiseSystem,
    solution: &'a Solution,
    /// By how much each state may be off.
    allowed: Vec<f64>,
}

impl Sampler<'_> {
    fn n(&self) -> usize {
        self.allowed.len()
    }

    fn state<'p>(&self, points: &'p Points, place: usize) -> &'p [f64] {
        let n = self.n();
        &points.y[place * n..][..n]
    }

    fn evaluate(&self, t: f64, side: Side) -> Result<Vec<f64>, FieldError> {
        let mut y = vec![f64::NAN; self.n()];
        self.solution.evaluate(self.system, t, side, &mut y)?;
        Ok(y)
    }

    /// Points of a segment, as many as the curvature needs: at least its two ends.
    fn points_of(&self, segment: &Segment, index: usize) -> Result<Points, FieldError> {
        let mut points = Points::default();
        let mut add = |t: f64, y: &[f64]| {
            points.t.push(t);
            points.y.extend_from_slice(y);
        };
        if segment.t_end <= segment.t_start {
            let y = self.instant(segment, index)?;
            add(segment.t_start, &y);
            add(segment.t_end, &y);
            return Ok(points);
        }
        let mut knots = self.solution.knots_of(segment);
        let mut left = knots.next().unwrap_or(segment.t_start);
        let mut y_left = self.evaluate(left, Side::Right)?;
        add(left, &y_left);
        // Right ends that are still to be reached, the nearest last, with the number of halvings.
        let mut pending: Vec<(f64, Vec<f64>, u32)> = Vec::new();
        for knot in knots {
            pending.push((knot, self.evaluate(knot, Side::Left)?, 0));
            while let Some((right, y_right, halvings)) = pending.pop() {
                let middle = left + 0.5 * (right - left);
                let can_halve = halvings < MOST_HALVINGS && left < middle && middle < right;
                if can_halve && !self.is_straight((left, &y_left), (right, &y_right))? {
                    let y_middle = self.evaluate(middle, Side::Left)?;
                    pending.push((right, y_right, halvings + 1));
                    pending.push((middle, y_middle, halvings + 1));
                    continue;
                }
                add(right, &y_right);
                (left, y_left) = (right, y_right);
            }
        }
        Ok(points)
    }

    /// The state of a segment without duration.
    fn instant(&self, segment: &Segment, index: usize) -> Result<Vec<f64>, FieldError> {
        let t = segment.t_start;
        let mut begins = self.solution.switches.iter();
        let begins = begins.find(|s| s.t == t && s.mode_after == segment.mode);
        match begins {
            Some(switch) => Ok(switch.y_after.to_vec()),
            None if index == 0 => self.evaluate(t, Side::Left),
            None => self.evaluate(t, Side::Right),
        }
    }

    /// Is the curve near the chord between two of its points?
    fn is_straight(
        &self,
        (left, y_left): (f64, &[f64]),
        (right, y_right): (f64, &[f64]),
    ) -> Result<bool, FieldError> {
        for share in TRIED {
            let y = self.evaluate(left + share * (right - left), Side::Left)?;
            let is_near = (0..y.len()).all(|i| {
                let chord = y_left[i] + share * (y_right[i] - y_left[i]);
                // A state that is not finite is not refined.
                let distance = (y[i] - chord).abs();
                distance <= self.allowed[i] || distance.is_nan()
            });
            if !is_near {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The places of the points that are kept: a line from one to the next passes those between within what is allowed.
    fn thinned(&self, points: &Points) -> Vec<usize> {
        let n = self.n();
        let count = points.t.len();
        let mut kept = vec![0];
        let (mut anchor, mut doors) = (0, vec![(f64::NEG_INFINITY, f64::INFINITY); n]);
        for place in 1..count {
            let from_anchor = |anchor: usize, i: usize| {
                let dt = points.t[place] - points.t[anchor];
                (
                    self.state(points, place)[i] - self.state(points, anchor)[i],
                    dt,
                )
            };
            let passes = |anchor: usize, doors: &[(f64, f64)]| {
                doors.iter().enumerate().all(|(i, &(low, high))| {
                    let (dy, dt) = from_anchor(anchor, i);
                    dt > 0.0 && low <= dy / dt && dy / dt <= high
                })
            };
            if place > anchor + 1 && !passes(anchor, &doors) {
                anchor = place - 1;
                kept.push(anchor);
                doors.fill((f64::NEG_INFINITY, f64::INFINITY));
            }
            for (i, (low, high)) in doors.iter_mut().enumerate() {
                let (dy, dt) = from_anchor(anchor, i);
                *low = low.max((dy - self.allowed[i]) / dt);
                *high = high.min((dy + self.allowed[i]) / dt);
            }
        }
        if count > 1 {
            kept.push(count - 1);
        }
        kept
    }
}
