//! Sliding where some equations of the multipliers vanish at the point: they are divided by the time since then.
//!
//! If the normal components a_i^k of all fields vanish at the point, the equation g_i(lambda) = 0 holds for all lambda there. A
//! moment tau later, along the motion with velocity v, they are tau (d_t a_i^k + grad a_i^k . v). So the multipliers
//! with which sliding begins solve
//!
//! ```text
//! g_i(lambda) = 0                                                    for the equations that do not vanish,
//! sum over k of w_k(lambda) (d_t a_i^k + grad a_i^k . v(lambda)) = 0     for those that do,
//! v(lambda) = sum over k of w_k(lambda) f^k
//! ```
//!
//! On one surface this is the quadratic equation of a two-fold, for which more is known: [`crate::motion::TwoFold`].

use super::point::{Notes, Point};
use super::rule::Meeting;
use crate::cube::{scaling_margin, Matrix, NormalFields};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{product_weights, MeetingFields};
use crate::system::dot;
use crate::tolerances::{
    AT_SIDE, BLOW_UP_STARTS, FAR_FROM_THE_CUBE, NEWTON_STEPS, SAME_ROOT, TANGENT,
};

/// Sliding with multipliers that the divided equations determine.
pub(super) struct Beginning {
    pub multipliers: Vec<f64>,
    /// Of every surface of the meeting: how fast h, or its rate if that vanishes in all fields, grows.
    pub rates: Vec<f64>,
}

/// The fields around the surfaces slid on, with the normal components to all surfaces of a meeting.
struct Around {
    /// The surfaces slid on, counted within the meeting.
    slid: Vec<usize>,
    fields: MeetingFields,
    /// Of every pattern: one row per surface of the meeting.
    patterns: Vec<Vec<Row>>,
    n_states: usize,
    /// The surfaces of the meeting to which all fields are tangent.
    is_silent: Vec<bool>,
}

/// A normal component, and how it changes.
struct Row {
    value: f64,
    time: f64,
    gradient: Vec<f64>,
}

impl Row {
    fn mean(&self, other: &Row) -> Row {
        let pairs = self.gradient.iter().zip(&other.gradient);
        Row {
            value: 0.5 * (self.value + other.value),
            time: 0.5 * (self.time + other.time),
            gradient: pairs.map(|(a, b)| 0.5 * (a + b)).collect(),
        }
    }
}

/// All ways in which sliding in `mode`, on the surfaces of the meeting whose entry is 0, can begin.
pub(super) fn beginnings(
    at: &Point,
    notes: &mut Notes,
    meeting: &Meeting,
    mode: &Mode,
    is_silent: &[bool],
) -> Result<Vec<Beginning>, FieldError> {
    let Some(around) = Around::new(at, notes, meeting, mode, is_silent)? else {
        return Ok(Vec::new());
    };
    let mut found: Vec<Beginning> = Vec::new();
    for start in starts(around.slid.len()) {
        let Some(multipliers) = around.root_from(start) else {
            continue;
        };
        let is_same = |other: &Beginning| distance(&other.multipliers, &multipliers) <= SAME_ROOT;
        if found.iter().any(is_same) {
            continue;
        }
        let Ok(divided) = around.divided(&multipliers) else {
            continue;
        };
        if around.is_stable(&divided.jacobian(&multipliers)) {
            let rates = around.rates(&multipliers);
            found.push(Beginning { multipliers, rates });
        }
    }
    Ok(found)
}

impl Around {
    /// `None` if the caller does not wait.
    fn new(
        at: &Point,
        notes: &mut Notes,
        meeting: &Meeting,
        mode: &Mode,
        is_silent: &[bool],
    ) -> Result<Option<Self>, FieldError> {
        let slid: Vec<usize> = (0..meeting.surfaces.len())
            .filter(|&i| mode.entries()[meeting.surfaces[i]] == 0)
            .collect();
        let surfaces: Vec<usize> = slid.iter().map(|&i| meeting.surfaces[i]).collect();
        let mut fields = MeetingFields::of_all_patterns(at.system, &surfaces);
        notes.n_field_evaluations +=
            fields.evaluate(at.system, &at.place(&mode.signs()), at.policy.law.units)?;
        let mut patterns = Vec::with_capacity(1 << slid.len());
        for pattern in 0..1_usize << slid.len() {
            if at.patience.is_over() {
                return Ok(None);
            }
            let signs = mode.on_sides(&surfaces, pattern).signs();
            let mut rows = Vec::with_capacity(meeting.surfaces.len());
            for &j in meeting.surfaces {
                let mut gradient = vec![0.0; at.x.len()];
                let rate = at
                    .system
                    .rate_gradient(j, &at.place(&signs), &mut gradient)?;
                rows.push(Row {
                    value: rate.rate,
                    time: rate.time,
                    gradient,
                });
            }
            patterns.push(rows);
        }
        let mut around = Around {
            slid,
            fields,
            patterns,
            n_states: at.x.len(),
            is_silent: is_silent.to_vec(),
        };
        around.tie();
        Ok(Some(around))
    }

    /// Fills in the rows of regions that do not exist, as [`MeetingFields`] does.
    fn tie(&mut self) {
        let n_patterns = self.patterns.len();
        for tie in self.fields.ties() {
            let follower = self.slid[tie.follower];
            let size = self.size(follower);
            for pattern in (0..n_patterns).filter(|pattern| !tie.holds(*pattern)) {
                let (one, other) = (pattern ^ 1 << tie.leader, pattern ^ 1 << tie.follower);
                let pairs = self.patterns[one].iter().zip(&self.patterns[other]);
                let mut rows: Vec<Row> = pairs.map(|(one, other)| one.mean(other)).collect();
                let push = [2.0, -2.0][pattern >> tie.follower & 1] * size;
                rows[follower].value += push;
                rows[follower].time += push;
                self.patterns[pattern] = rows;
            }
        }
    }

    /// Does the hidden dynamics with this matrix come to its root, clearly? Equations that vanish at the point are slower than the
    /// others.
    fn is_stable(&self, jacobian: &Matrix) -> bool {
        let units: Vec<f64> = self.slid.iter().map(|&i| 1.0 / self.size(i)).collect();
        let scaled = jacobian.with_rows_scaled(&units);
        let fast = (0..self.slid.len()).filter(|&i| !self.is_silent[self.slid[i]]);
        let fast: Vec<usize> = fast.collect();
        // Fast rows that are neutral by themselves are damped by the slow ones.
        let is_repelled = !fast.is_empty() && scaling_margin(&scaled.principal(&fast)) < -TANGENT;
        !is_repelled && scaling_margin(&scaled) > TANGENT
    }

    /// A bound of the components normal to surface i of the meeting, divided by time or not.
    fn size(&self, i: usize) -> f64 {
        let speeds = (0..self.patterns.len()).map(|pattern| norm(self.fields.field(pattern)));
        let fastest = speeds.fold(1.0, f64::max);
        let size = |row: &Row| row.value.abs() + row.time.abs() + norm(&row.gradient) * fastest;
        let sizes = self.patterns.iter().map(|rows| size(&rows[i]));
        sizes.fold(0.0, f64::max)
    }

    fn velocity(&self, weights: &[f64]) -> Vec<f64> {
        let mut velocity = vec![0.0; self.n_states];
        self.fields.combine(weights, &mut velocity);
        velocity
    }

    /// The component normal to surface i of the meeting in one pattern, divided by time if it vanishes in all.
    fn component(&self, pattern: usize, i: usize, velocity: &[f64]) -> f64 {
        let row = &self.patterns[pattern][i];
        match self.is_silent[i] {
            true => row.time + dot(&row.gradient, velocity),
            false => row.value,
        }
    }

    /// How fast every h of the meeting, or its rate, grows with these multipliers.
    fn rates(&self, lambda: &[f64]) -> Vec<f64> {
        let weights = product_weights(lambda);
        let velocity = self.velocity(&weights);
        let rate = |i: usize| -> f64 {
            let terms = weights.iter().enumerate();
            terms
                .map(|(pattern, w)| w * self.component(pattern, i, &velocity))
                .sum()
        };
        (0..self.is_silent.len()).map(rate).collect()
    }

    /// The equations of the surfaces slid on.
    fn equations(&self, lambda: &[f64]) -> Vec<f64> {
        let rates = self.rates(lambda);
        self.slid.iter().map(|&i| rates[i]).collect()
    }

    /// The normal components of the surfaces slid on a moment later, divided by time where they vanish now, along the
    /// motion with these multipliers.
    fn divided(&self, lambda: &[f64]) -> Result<NormalFields, crate::error::Undecided> {
        let velocity = self.velocity(&product_weights(lambda));
        let patterns = 0..self.patterns.len();
        let values = patterns.flat_map(|pattern| {
            let velocity = &velocity;
            self.slid
                .iter()
                .map(move |&i| self.component(pattern, i, velocity))
        });
        NormalFields::new(self.slid.len(), values.collect())
    }

    /// A root in the cube, by Newton's method.
    fn root_from(&self, mut lambda: Vec<f64>) -> Option<Vec<f64>> {
        let m = lambda.len();
        for _ in 0..NEWTON_STEPS {
            let value = self.equations(&lambda);
            let mut jacobian = Matrix::zeros(m);
            for column in 0..m {
                // The equations are quadratic: central differences are exact.
                let [mut up, mut down] = [lambda.clone(), lambda.clone()];
                (up[column], down[column]) = (lambda[column] + 0.5, lambda[column] - 0.5);
                let (up, down) = (self.equations(&up), self.equations(&down));
                for row in 0..m {
                    jacobian[(row, column)] = up[row] - down[row];
                }
            }
            let step = jacobian.solve(&value)?;
            let length = step.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
            lambda.iter_mut().zip(&step).for_each(|(l, d)| *l -= d);
            if lambda
                .iter()
                .any(|l| l.is_nan() || l.abs() > FAR_FROM_THE_CUBE)
            {
                return None;
            }
            if length <= TANGENT {
                let is_inside = lambda.iter().all(|l| l.abs() <= 1.0 + AT_SIDE);
                return is_inside.then_some(lambda);
            }
        }
        None
    }
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

/// Where Newton's method starts.
fn starts(m: usize) -> impl Iterator<Item = Vec<f64>> {
    let n = BLOW_UP_STARTS.len();
    (0..n.pow(m as u32)).map(move |index| {
        (0..m)
            .map(|i| BLOW_UP_STARTS[index / n.pow(i as u32) % n])
            .collect()
    })
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}
