//! The derivative at the limit of infinitely many switches: that of the formula by which the limit is found.
//!
//! If the times between rounds shrink by the ratio r, the limit of a sequence is x + (x - x') r / (1 - r), x' one round before x. Times,
//! and states at these times, are such sequences; r is the ratio of the last two rounds.

use std::collections::VecDeque;

use smallvec::SmallVec;

use super::forms::pairs;
use super::second::Timed;
use crate::mode::Mode;
use crate::motion::Guard;
use crate::record::InstantRecord;
use crate::vectors::dot;

/// Instants that are remembered: two rounds of up to so many and the last one.
pub(super) const MOST_REMEMBERED: usize = 17;

/// An instant, seen from the motion before it.
struct Past {
    t: f64,
    x: Vec<f64>,
    field: Vec<f64>,
    guards: SmallVec<[Guard; 2]>,
    mode: Mode,
    /// The derivative of the time by each column.
    dt: Vec<f64>,
    /// The derivative of the state before by each column, one behind the other.
    columns: Vec<f64>,
    /// The second derivatives of its time and of the state at that time, if they are followed.
    second: Option<Timed>,
}

impl Past {
    fn is_like(&self, other: &Past) -> bool {
        self.guards == other.guards && self.mode == other.mode
    }

    /// The derivative by a column of the state at the time of the instant.
    fn dx(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        let n = self.x.len();
        let states = self.columns[column * n..][..n].iter().zip(&self.field);
        states.map(move |(entry, f)| entry + f * self.dt[column])
    }
}

/// Do two instants end the same motion in the same way?
pub(super) fn is_like(one: &InstantRecord, other: &InstantRecord) -> bool {
    one.guards == other.guards && one.mode[0] == other.mode[0]
}

/// How fast the times between rounds shrink.
struct Rounds {
    ratio: f64,
    late: f64,
    early: f64,
}

impl Rounds {
    /// From the times of three instants, the latest first; `None` if they do not shrink.
    fn of([now, before, first]: [f64; 3]) -> Option<Self> {
        let (late, early) = (now - before, before - first);
        let ratio = late / early;
        (ratio > 0.0 && ratio < 1.0).then_some(Rounds { ratio, late, early })
    }

    /// r / (1 - r).
    fn share(&self) -> f64 {
        self.ratio / (1.0 - self.ratio)
    }

    /// The derivatives of r / (1 - r) by two columns each, and the mixed one, from those of both rounds.
    fn bend(&self, late: [f64; 3], early: [f64; 3]) -> [f64; 3] {
        let by = |k: usize| (late[k] - self.ratio * early[k]) / self.early;
        let (a, b) = (by(0), by(1));
        let mixed = by(2) - (a * early[1] + b * early[0]) / self.early;
        let rest = 1.0 - self.ratio;
        let slope = rest.powi(-2);
        [slope * a, slope * b, slope * (mixed + 2.0 * a * b / rest)]
    }

    /// The derivative of r / (1 - r) by the length of the later round.
    fn slope(&self) -> f64 {
        1.0 / self.early / (1.0 - self.ratio).powi(2)
    }
}

/// What a function of the limit takes from an instant before: by its time, and by the state at that time.
pub(super) struct Shares {
    pub instant: usize,
    pub by_time: f64,
    pub by_state: Vec<f64>,
}

impl Shares {
    /// From the last instants of three rounds, the latest first, with their numbers: `w` is the gradient of the function by the state
    /// behind the limit, which is also the later end of the first record. The transpose of [`History::limit`].
    pub fn of(numbers: [usize; 3], records: [InstantRecord; 3], w: &[f64]) -> Option<[Shares; 3]> {
        let rounds = Rounds::of(records.map(|record| record.t[0]))?;
        let (share, slope) = (rounds.share(), rounds.slope());
        let by_limit = -dot(w, records[0].field[1]);
        let moved = records[0].x[0].iter().zip(records[1].x[0]);
        let moved: f64 = w
            .iter()
            .zip(moved)
            .map(|(w, (x, before))| w * (x - before))
            .sum();
        let by_share = (moved + by_limit * rounds.late) * slope;
        let scaled = |factor: f64| w.iter().map(|w| factor * w).collect();
        let of = |k: usize, by_time: f64, factor: f64| Shares {
            instant: numbers[k],
            by_time,
            by_state: scaled(factor),
        };
        Some([
            of(0, by_limit * (1.0 + share) + by_share, 1.0 + share),
            of(
                1,
                -by_limit * share - by_share * (1.0 + rounds.ratio),
                -share,
            ),
            of(2, by_share * rounds.ratio, 0.0),
        ])
    }
}

/// The instants so far, the latest last.
#[derive(Default)]
pub(super) struct History(VecDeque<Past>);

/// The limit of instants: its time by each column, and its state.
pub(super) struct Limit {
    pub dt: Vec<f64>,
    pub dx: Vec<Vec<f64>>,
    /// The mixed derivatives of both, for every pair of columns, if they are followed.
    pub second: Option<(Vec<f64>, Vec<Vec<f64>>)>,
}

impl History {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Lets the instants follow a change of the columns, each of which is a combination of the old ones.
    pub fn change(&mut self, change: &[Vec<f64>]) {
        for past in &mut self.0 {
            let n = past.x.len();
            let mut columns = vec![0.0; n * change.len()];
            for (sum, factors) in columns.chunks_exact_mut(n.max(1)).zip(change) {
                for (factor, column) in factors.iter().zip(past.columns.chunks_exact(n.max(1))) {
                    let entries = sum.iter_mut().zip(column);
                    entries.for_each(|(entry, d)| *entry += factor * d);
                }
            }
            past.dt = change
                .iter()
                .map(|factors| dot(factors, &past.dt))
                .collect();
            past.columns = columns;
            past.second = None;
        }
    }

    /// Takes an instant down, with the columns before it and the derivatives of its time.
    pub fn push(
        &mut self,
        record: &InstantRecord,
        columns: &[Vec<f64>],
        dt: &[f64],
        second: Option<Timed>,
    ) {
        let n = record.x[0].len();
        let states = columns.iter().flat_map(|column| &column[..n]).copied();
        // The room of the oldest is used again.
        let oldest = match self.0.len() {
            MOST_REMEMBERED => self.0.pop_front(),
            _ => None,
        };
        let Some(mut past) = oldest else {
            self.0.push_back(Past {
                t: record.t[0],
                x: record.x[0].to_vec(),
                field: record.field[0].to_vec(),
                guards: record.guards.into(),
                mode: record.mode[0].clone(),
                dt: dt.to_vec(),
                columns: states.collect(),
                second,
            });
            return;
        };
        past.t = record.t[0];
        past.second = second;
        past.guards = record.guards.into();
        past.mode.clone_from(record.mode[0]);
        let rows = [
            (&mut past.x, record.x[0]),
            (&mut past.field, record.field[0]),
            (&mut past.dt, dt),
        ];
        for (row, values) in rows {
            row.clear();
            row.extend_from_slice(values);
        }
        past.columns.clear();
        past.columns.extend(states);
        self.0.push_back(past);
    }

    /// The limit of the rounds, if the latest instants make any.
    pub fn limit(&self) -> Option<Limit> {
        let last = self.0.len().checked_sub(1)?;
        let round = (1..=last / 2).find(|round| {
            let earlier = [last - round, last - 2 * round];
            earlier.iter().all(|&k| self.0[k].is_like(&self.0[last]))
        })?;
        let [now, before, first] = [0, round, 2 * round].map(|back| &self.0[last - back]);
        let rounds = Rounds::of([now.t, before.t, first.t])?;
        let (share, slope) = (rounds.share(), rounds.slope());
        let (mut dt, mut dx) = (Vec::new(), Vec::new());
        for c in 0..now.dt.len() {
            let (d_late, d_early) = (now.dt[c] - before.dt[c], before.dt[c] - first.dt[c]);
            let d_share = (d_late - rounds.ratio * d_early) * slope;
            dt.push(now.dt[c] + d_late * share + rounds.late * d_share);
            let states = now.dx(c).zip(before.dx(c));
            let moved = now.x.iter().zip(&before.x);
            let limit = states.zip(moved).map(|((now, before), (x, x_before))| {
                now + (now - before) * share + (x - x_before) * d_share
            });
            dx.push(limit.collect());
        }
        let second = second_of([now, before, first], &rounds);
        Some(Limit { dt, dx, second })
    }
}

/// The mixed derivatives of the limit of three instants, the latest first: of its time, and of its state.
fn second_of(
    [now, before, first]: [&Past; 3],
    rounds: &Rounds,
) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let all = [now, before, first].map(|past| past.second.as_ref());
    let [Some(own), Some(earlier), Some(earliest)] = all else {
        return None;
    };
    let share = rounds.share();
    let (mut times, mut states) = (Vec::new(), Vec::new());
    for (k, (a, b)) in pairs(now.dt.len()).enumerate() {
        let length = |late: &Past, early: &Past, mixed: f64| {
            [late.dt[a] - early.dt[a], late.dt[b] - early.dt[b], mixed]
        };
        let late = length(now, before, own.times[k] - earlier.times[k]);
        let early = length(before, first, earlier.times[k] - earliest.times[k]);
        let bent = rounds.bend(late, early);
        // The mixed derivative of what is added to the last value: a difference times the share.
        let added = |size: f64, by: [f64; 3]| {
            by[2] * share + by[0] * bent[1] + by[1] * bent[0] + size * bent[2]
        };
        times.push(own.times[k] + added(rounds.late, late));
        let by = |past: &Past, c: usize| past.dx(c).collect::<Vec<f64>>();
        let [now_a, now_b, before_a, before_b] =
            [by(now, a), by(now, b), by(before, a), by(before, b)];
        let state = (0..now.x.len()).map(|i| {
            let moved = [
                now_a[i] - before_a[i],
                now_b[i] - before_b[i],
                own.states[k][i] - earlier.states[k][i],
            ];
            own.states[k][i] + added(now.x[i] - before.x[i], moved)
        });
        states.push(state.collect());
    }
    Some((times, states))
}
