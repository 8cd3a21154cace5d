//! The end of a run that came to it without incident, in few bytes: ensembles keep very many.

use smallvec::SmallVec;

use super::{Segment, Segments, Solution, Switches};
use crate::mode::Mode;
use crate::options::SlidingRule;
use crate::stats::Stats;
use crate::status::Stop;

/// What is left of a [`Solution`] of which only the end is kept ([`crate::Keep::Last`]): all of it, without room for what it lacks.
#[derive(Clone, Debug)]
pub struct EndOnly {
    /// When the last segment started, when it ended, the initial and the last state, the multipliers.
    numbers: Box<[f64]>,
    n_states: u32,
    sliding: SlidingRule,
    is_projected: bool,
    mode: Mode,
    /// The counters, seven bits a byte, the lowest first; the last byte of each is below 128.
    counts: Box<[u8]>,
}

impl EndOnly {
    /// The end of a solution; `None` if there is more to it: it stopped before its end, it has warnings, switches, discrete states,
    /// zeros of a user's function or the like.
    pub fn of(solution: &Solution) -> Option<Self> {
        let (mut stats, n) = (solution.stats, solution.n_states);
        let segment = solution.segments.last()?;
        let is_end = matches!(solution.stop, Stop::End)
            && segment.t_end == solution.t_last
            && segment.mode == solution.mode
            && segment.steps == (0, 0)
            && solution.segments.len() == 1
            && solution.t == [solution.t_last]
            && solution.y == solution.y_last;
        let has_more = !solution.switches.is_empty()
            || !solution.user_zeros.is_empty()
            || !solution.discrete.is_empty()
            || !segment.discrete.is_empty()
            || !solution.sides.is_empty()
            || !solution.warnings.is_empty()
            || solution.returns.is_some()
            || !solution.decisions.is_empty()
            || solution.y_end.is_some()
            || stats.stiff_since.is_some()
            || stats.here_since.is_some();
        if !is_end || has_more {
            return None;
        }
        let times = [segment.t_start, solution.t_last];
        let states = solution.y0.iter().chain(&solution.y_last);
        let numbers = times.iter().chain(states).chain(&segment.multipliers);
        let mut counts = Vec::with_capacity(64);
        for count in stats.counts_mut() {
            let mut count = *count;
            while count >= 128 {
                counts.push(count as u8 | 128);
                count >>= 7;
            }
            counts.push(count as u8);
        }
        Some(EndOnly {
            numbers: numbers.copied().collect(),
            n_states: u32::try_from(n).ok()?,
            sliding: solution.sliding,
            is_projected: solution.is_projected,
            mode: segment.mode,
            counts: counts.into(),
        })
    }

    /// The last time.
    pub fn t_last(&self) -> f64 {
        self.numbers[1]
    }

    /// The state there.
    pub fn last_state(&self) -> &[f64] {
        let n = self.n_states as usize;
        &self.numbers[2 + n..2 + 2 * n]
    }

    /// The solution.
    pub fn solution(&self) -> Solution {
        let n = self.n_states as usize;
        let (times, numbers) = self.numbers.split_at(2);
        let (y0, numbers) = numbers.split_at(n);
        let (y_last, multipliers) = numbers.split_at(n);
        let mut counts = self
            .counts
            .split_inclusive(|byte| *byte < 128)
            .map(|bytes| {
                let bytes = bytes.iter().rev();
                bytes.fold(0, |count, byte| count << 7 | u64::from(byte & 127))
            });
        let mut stats = Stats::default();
        for (count, known) in stats.counts_mut().into_iter().zip(&mut counts) {
            *count = known;
        }
        let mut segments = Segments::default();
        segments.push(Segment {
            t_start: times[0],
            t_end: times[1],
            mode: self.mode.clone(),
            steps: (0, 0),
            multipliers: SmallVec::from_slice(multipliers),
            discrete: Vec::new(),
        });
        Solution {
            n_states: n,
            t: vec![times[1]],
            y: y_last.to_vec(),
            switches: Switches::default(),
            last_switched: Vec::new(),
            segments,
            user_zeros: Vec::new(),
            stop: Stop::End,
            t_last: times[1],
            sliding: self.sliding,
            is_projected: self.is_projected,
            units: Vec::new(),
            mode: self.mode.clone(),
            discrete: Vec::new(),
            discrete_at_t: Vec::new(),
            sides: Vec::new(),
            stats,
            warnings: Vec::new(),
            returns: None,
            decisions: Vec::new(),
            steps: Vec::new(),
            coefficients: Vec::new(),
            y0: y0.to_vec(),
            y_last: y_last.to_vec(),
            y_end: None,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::EndOnly;
    use crate::{ClosureSystem, Keep, Options, Problem};

    #[test]
    fn the_end_of_a_run_is_kept_as_it_was() {
        let field = |t: f64, x: &[f64], s: &[f64], dx: &mut [f64]| {
            (dx[0], dx[1]) = (x[1], t.sin() - x[0] - 1.3 * s[0]);
        };
        let system = ClosureSystem::new(2, 1, field, |_, x, h| h[0] = x[1]);
        let options = Options {
            keep: Keep::Last,
            ..Options::default()
        };
        let run = |t_end: f64| {
            let problem = Problem::new(&system, (0.0, t_end), &[1.0, 2.0]);
            problem.options(&options).solve().unwrap()
        };
        for t_end in [0.5, 7.0, 300.0] {
            let whole = run(t_end);
            let mut again = EndOnly::of(&whole).unwrap().solution();
            again.segments.pack();
            assert_eq!(format!("{whole:?}"), format!("{again:?}"));
        }
    }
}
