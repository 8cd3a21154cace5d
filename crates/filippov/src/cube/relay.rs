//! The mode at surfaces in whose signs the field is affine: a relay problem.
//!
//! With nu_i + (N s)_i the rate of h_i at the signs s, find s in [-1, 1]^m and v with
//!
//! ```text
//! (R)   v = nu + N s,    v_i > 0 => s_i = 1,    v_i < 0 => s_i = -1,    v_i = 0 => s_i in [-1, 1].
//! ```
//!
//! Where v_i is not 0 the surface is left to that side, where it is 0 the motion slides with lambda_i = s_i. A
//! solution always exists; it is the only one for all nu if and only if -N is a P-matrix (friction).
//!
//! The algorithm, with one sparse linear system per step:
//!
//! 1. The semismooth Newton method on u -> nu + N clip(u) - (u - clip(u)): every surface in a wrong state changes
//!    it at once. When the number of wrong states stops decreasing, only the one of least index changes,
//!    until it is lower again. For P-matrices this is finite, and from the mode before it takes a few steps.
//! 2. N singular on the sliding surfaces, as with redundant contacts: the same for N - diag(d) with a small d,
//!    and its result improved by proximal steps. Of the solutions, which then differ in s but not
//!    in v if -N is monotone, this finds the one with small s.
//! 3. Up to `MOST_ENUMERATED` surfaces all 3^m modes are tried; beyond, the problem is left undecided.
//!
//! References: Cottle, Pang, Stone (1992); Júdice, Pires, *A block principal pivoting algorithm* (1994);
//! Guglielmi, Hairer (2022); `docs/theory/switching.md`.

use super::shared_load::{has_one_motion, let_stick};
use crate::cube::is_p_matrix;
use crate::patience::Patience;
use crate::sparse::{Singular, SparseRows, SparseSolver};
use crate::tolerances::{EPS, PIVOTS_PER_LOOK, RELAY_DAMPING};

/// Largest number of surfaces for which all modes are tried.
pub const MOST_ENUMERATED: usize = 8;

/// Steps without fewer wrong states before single changes.
const MOST_IDLE: usize = 4;

/// Proximal steps; each gains a factor of about 1 / d.
const MOST_PROXIMAL: usize = 30;

/// Rates of a solution that are to be 0 may be this many times what rounding alone would leave: the solution of the
/// linear system, and the last proximal step, add theirs.
pub(super) const SOLVED: f64 = 8.0;

/// The data of (R), one entry or row per surface.
#[derive(Clone, Debug)]
pub struct RelayProblem {
    /// The rates of the switching functions at s = 0.
    pub nu: Vec<f64>,
    /// How they depend on the signs.
    pub n: SparseRows,
    /// Rates below this fraction of the sum of their terms count as zero: `PiecewiseSystem::lie_tolerance(1)`.
    pub noise: f64,
}

/// Is the solution of a relay problem the only one?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Uniqueness {
    /// It is.
    Certain,
    /// There are others with the same rates, and so the same motion: redundant contacts share their load.
    OfMotion,
    /// There are others.
    Several,
    /// Not known.
    Unknown,
}

/// A solution of (R).
#[derive(Clone, Debug, PartialEq)]
pub struct RelaySolution {
    /// -1 or +1 where the surface is left, 0 where the motion slides.
    pub modes: Vec<i8>,
    /// The signs and multipliers s.
    pub signs: Vec<f64>,
    /// The rates v = nu + N s; exactly 0 where the motion slides.
    pub rates: Vec<f64>,
    /// Is this the only solution?
    pub uniqueness: Uniqueness,
    /// Entries with v_i = 0 and |s_i| = 1 within rounding: `modes` has one of the two possibilities, and
    /// derivatives along the motion decide.
    pub degenerate: Vec<usize>,
    /// May all fields around be tangent to a surface? They cross it at a small part of their speed.
    pub may_be_tangent: bool,
    /// How many contacts at most share one load because they are redundant.
    pub n_sharing: usize,
    /// Linear systems solved.
    pub n_pivots: usize,
    /// Multiplications and divisions in them.
    pub n_operations: usize,
}

/// A relay problem that was not solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RelayError {
    /// A coefficient is NaN or infinite.
    #[error("the rates at the surfaces are not finite: the field does not exist there")]
    NotFinite,
    /// No solution was found.
    #[error("no mode was found for {n_surfaces} surfaces that meet, and their jumps are not those of friction")]
    Undecided {
        /// How many surfaces meet.
        n_surfaces: usize,
    },
}

/// Solves (R), starting from the modes `before` (entries -1, 0, +1), which the result does not depend on if
/// it is unique.
///
/// # Errors
/// [`RelayError`].
///
/// # Example
/// ```
/// use filippov::sparse::SparseRows;
/// use filippov::switching::{solve_relay, RelayProblem, Uniqueness};
/// // Two masses of 1 pushed with 0.5 and 3 against friction of 1, joined by a damper.
/// let n = SparseRows::from_dense(&[vec![-1.0, 0.2], vec![0.2, -1.0]]);
/// let problem = RelayProblem { nu: vec![0.5, 3.0], n, noise: 1e-11 };
/// let found = solve_relay(&problem, &[0, 0])?;
/// assert_eq!(found.modes, [0, 1]);
/// assert!((found.signs[0] - 0.7).abs() < 1e-15 && (found.rates[1] - 2.14).abs() < 1e-15);
/// assert_eq!(found.uniqueness, Uniqueness::Certain);
/// # Ok::<(), filippov::switching::RelayError>(())
/// ```
pub fn solve_relay(problem: &RelayProblem, before: &[i8]) -> Result<RelaySolution, RelayError> {
    solve_relay_within(problem, before, Patience::endless())
}

/// As [`solve_relay`], as long as the caller waits.
///
/// # Errors
/// As [`solve_relay`]; [`RelayError::Undecided`] also when the caller has waited long enough.
pub fn solve_relay_within(
    problem: &RelayProblem,
    before: &[i8],
    patience: Patience,
) -> Result<RelaySolution, RelayError> {
    if !problem.n.is_finite() || !problem.nu.iter().all(|v| v.is_finite()) {
        return Err(RelayError::NotFinite);
    }
    let leaders = problem.leaders();
    let start: Vec<i8> = leaders.iter().map(|&i| before[i]).collect();
    let solved = problem.restricted(&leaders).solve(&start, patience)?;
    let mut solution = problem.completed(&leaders, &solved, before);
    let is_follower = |i: &usize| leaders.binary_search(i).is_err();
    if solution.degenerate.iter().any(is_follower) {
        solution.uniqueness = Uniqueness::Unknown;
    }
    if solution.uniqueness == Uniqueness::OfMotion {
        let_stick(problem, &mut solution);
    }
    Ok(solution)
}

/// All solutions of (R) for up to `MOST_ENUMERATED` surfaces, and whether there may be more of them in between:
/// a mode with singular N may hold a continuum.
pub fn all_relay_modes(problem: &RelayProblem) -> (Vec<Vec<i8>>, bool) {
    let (found, has_singular) = problem.enumerate(Patience::endless());
    let modes = found.into_iter().map(|state| state.modes);
    (modes.collect(), has_singular)
}

/// Modes with their signs and rates: the equations of (R) without the inequalities.
#[derive(Clone, Debug)]
struct State {
    modes: Vec<i8>,
    signs: Vec<f64>,
    rates: Vec<f64>,
}

struct Solved {
    modes: Vec<i8>,
    signs: Vec<f64>,
    uniqueness: Uniqueness,
    n_pivots: usize,
    n_operations: usize,
}

/// The linear systems of one problem, counted.
struct Pivots<'a> {
    solver: SparseSolver,
    n_pivots: usize,
    patience: Patience<'a>,
}

impl<'a> Pivots<'a> {
    fn within(patience: Patience<'a>) -> Self {
        Pivots {
            solver: SparseSolver::default(),
            n_pivots: 0,
            patience,
        }
    }

    /// Has the caller waited long enough? Asked after every system, and looked at after some.
    fn are_over(&self) -> bool {
        self.n_pivots.is_multiple_of(PIVOTS_PER_LOOK) && self.patience.is_over()
    }
}

impl RelayProblem {
    /// The surfaces whose sign has any effect. The others, kinks, follow: their sign is that of their rate.
    fn leaders(&self) -> Vec<usize> {
        let m = self.nu.len();
        let mut has_effect = vec![false; m];
        let ones = vec![1.0; m];
        for i in 0..m {
            let noise = self.rounding(&ones, i);
            for (j, value) in self.n.row(i) {
                has_effect[j] |= value.abs() > noise;
            }
        }
        (0..m).filter(|&j| has_effect[j]).collect()
    }

    /// The problem of some surfaces, in increasing order, without the others.
    fn restricted(&self, kept: &[usize]) -> Self {
        RelayProblem {
            nu: kept.iter().map(|&i| self.nu[i]).collect(),
            n: self.n.principal(kept),
            noise: self.noise,
        }
    }

    /// The whole solution from that of the leaders.
    fn completed(&self, leaders: &[usize], solved: &Solved, before: &[i8]) -> RelaySolution {
        let m = self.nu.len();
        let mut modes = before.to_vec();
        let mut leading = vec![0.0; m];
        for (place, &i) in leaders.iter().enumerate() {
            modes[i] = solved.modes[place];
            leading[i] = solved.signs[place].clamp(-1.0, 1.0);
        }
        let mut signs = leading.clone();
        let mut rates = vec![0.0; m];
        let mut degenerate = Vec::new();
        for i in 0..m {
            let rate = self.nu[i] + self.n.dot(i, &leading);
            let rounding = self.rounding(&leading, i);
            let is_zero = rate.abs() <= rounding;
            if leaders.binary_search(&i).is_err() && !is_zero {
                modes[i] = if rate > 0.0 { 1 } else { -1 };
                signs[i] = f64::from(modes[i]);
            } else if leaders.binary_search(&i).is_err()
                || modes[i] != 0 && is_zero
                || modes[i] == 0 && signs[i].abs() >= 1.0 - self.slack(rounding, i)
            {
                degenerate.push(i);
            }
            rates[i] = if modes[i] == 0 { 0.0 } else { rate };
        }
        RelaySolution {
            modes,
            signs,
            rates,
            uniqueness: solved.uniqueness,
            degenerate,
            may_be_tangent: false,
            n_sharing: 0,
            n_pivots: solved.n_pivots,
            n_operations: solved.n_operations,
        }
    }

    fn solve(&self, start: &[i8], patience: Patience) -> Result<Solved, RelayError> {
        let mut pivots = Pivots::within(patience);
        let is_p = is_p_matrix(&negative(&self.n)) == Some(true);
        let mut state = self.pivot(start, &mut pivots);
        // A surface that is left at rate 0 may share what it carries with others.
        if !state
            .as_ref()
            .is_some_and(|state| is_p || self.is_strict(state))
        {
            let shared = self.proximal(start, &mut pivots);
            state = shared.filter(|shared| self.is_solution(shared)).or(state);
        }
        let mut state = state.filter(|state| self.is_solution(state));
        let mut uniqueness = match is_p {
            true => Uniqueness::Certain,
            false if has_one_motion(&self.n) => Uniqueness::OfMotion,
            false => Uniqueness::Unknown,
        };
        if uniqueness == Uniqueness::Unknown && self.nu.len() <= MOST_ENUMERATED {
            let (all, has_singular) = self.enumerate(patience);
            uniqueness = match (all.len(), has_singular) {
                (2.., _) => Uniqueness::Several,
                (1, false) => Uniqueness::Certain,
                _ => Uniqueness::Unknown,
            };
            state = state.or_else(|| all.into_iter().next());
        }
        let state = state.ok_or(RelayError::Undecided {
            n_surfaces: self.nu.len(),
        })?;
        Ok(Solved {
            modes: state.modes,
            signs: state.signs,
            uniqueness,
            n_pivots: pivots.n_pivots,
            n_operations: pivots.solver.n_operations(),
        })
    }

    /// Are the rates of all surfaces that are left different from 0?
    fn is_strict(&self, state: &State) -> bool {
        let modes = state.modes.iter().enumerate();
        let mut left = modes.filter(|entry| *entry.1 != 0).map(|entry| entry.0);
        left.all(|i| state.rates[i].abs() > self.rounding(&state.signs, i))
    }

    /// Principal pivoting: many states at a time while that helps, else one.
    fn pivot(&self, start: &[i8], pivots: &mut Pivots) -> Option<State> {
        let mut modes = start.to_vec();
        let mut fewest = usize::MAX;
        let mut idle = 0;
        for _ in 0..100 + 10 * modes.len() {
            let state = self.state(&modes, pivots).ok()?;
            let wrong: Vec<usize> = (0..modes.len())
                .filter(|&i| self.is_wrong(&state, i))
                .collect();
            if wrong.is_empty() {
                return Some(state);
            }
            if pivots.are_over() {
                return None;
            }
            if wrong.len() < fewest {
                (fewest, idle) = (wrong.len(), 0);
            } else {
                idle += 1;
            }
            let many = idle < MOST_IDLE;
            let changed = if many { &wrong[..] } else { &wrong[..1] };
            for &i in changed {
                modes[i] = self.better(&state, i, many);
            }
        }
        None
    }

    /// The mode of an entry in a wrong state. A jump from one side to the other is allowed only where many states
    /// change: one at a time, such jumps might repeat.
    fn better(&self, state: &State, i: usize, may_jump: bool) -> i8 {
        let side = |value: f64| if value > 0.0 { 1 } else { -1 };
        if state.modes[i] == 0 {
            return side(state.signs[i]);
        }
        let reach = 2.0 * self.n.diagonal(i).abs();
        if may_jump && state.rates[i].abs() > reach {
            side(state.rates[i])
        } else {
            0
        }
    }

    /// Signs and rates for given modes: N_FF s_F = -(nu_F + N_FJ s_J) for the sliding surfaces F.
    fn state(&self, modes: &[i8], pivots: &mut Pivots) -> Result<State, Singular> {
        let m = modes.len();
        let mut signs: Vec<f64> = modes.iter().map(|&mode| f64::from(mode)).collect();
        let sliding: Vec<usize> = (0..m).filter(|&i| modes[i] == 0).collect();
        let mut unknown: Vec<f64> = sliding
            .iter()
            .map(|&i| -self.nu[i] - self.n.dot(i, &signs))
            .collect();
        pivots.n_pivots += 1;
        pivots.solver.factor(&self.n.principal(&sliding))?;
        pivots.solver.solve(&mut unknown);
        for (&i, &sign) in sliding.iter().zip(&unknown) {
            signs[i] = sign;
        }
        let rate = |i: usize| {
            if modes[i] == 0 {
                0.0
            } else {
                self.nu[i] + self.n.dot(i, &signs)
            }
        };
        Ok(State {
            rates: (0..m).map(rate).collect(),
            modes: modes.to_vec(),
            signs,
        })
    }

    /// A rate below this is rounding: of the rates at the signs, and of signs of size 1.
    pub(super) fn rounding(&self, signs: &[f64], i: usize) -> f64 {
        let of_signs: f64 = self.n.row(i).map(|(_, value)| value.abs()).sum();
        self.noise * (self.nu[i].abs() + self.n.magnitude(i, signs)) + EPS * of_signs
    }

    /// How much of a sign is rounding, if the rates are known up to `rounding`.
    fn slack(&self, rounding: f64, i: usize) -> f64 {
        let size = largest(&self.n, i);
        self.noise + if size > 0.0 { rounding / size } else { 0.0 }
    }

    fn is_wrong(&self, state: &State, i: usize) -> bool {
        let rounding = self.rounding(&state.signs, i);
        if state.modes[i] == 0 {
            let fits = state.signs[i].abs() <= 1.0 + self.slack(rounding, i);
            !fits
        } else {
            f64::from(state.modes[i]) * state.rates[i] < -rounding
        }
    }

    /// Do signs and modes satisfy (R), with sliding rates computed and not assumed to be 0?
    fn is_solution(&self, state: &State) -> bool {
        let signs: Vec<f64> = state
            .signs
            .iter()
            .map(|sign| sign.clamp(-1.0, 1.0))
            .collect();
        (0..signs.len()).all(|i| {
            let rate = self.nu[i] + self.n.dot(i, &signs);
            let rounding = SOLVED * self.rounding(&signs, i);
            match state.modes[i] {
                0 => rate.abs() <= rounding,
                mode => f64::from(mode) * rate >= -rounding,
            }
        })
    }

    /// Solves with N - diag(d), then repeatedly with nu + d s for the s before, until d (s - s before) is rounding.
    fn proximal(&self, start: &[i8], pivots: &mut Pivots) -> Option<State> {
        let m = self.nu.len();
        let damping: Vec<f64> = (0..m)
            .map(|i| RELAY_DAMPING * largest(&self.n, i))
            .collect();
        let mut damped = RelayProblem {
            nu: self.nu.clone(),
            n: with_diagonal(&self.n, &damping),
            noise: self.noise,
        };
        let mut center = vec![0.0; m];
        let mut modes = start.to_vec();
        for _ in 0..MOST_PROXIMAL {
            for i in 0..m {
                damped.nu[i] = self.nu[i] + damping[i] * center[i];
            }
            let state = damped.pivot(&modes, pivots)?;
            let is_done = (0..m).all(|i| {
                let residual = damping[i] * (state.signs[i] - center[i]).abs();
                residual <= self.rounding(&state.signs, i)
            });
            if is_done {
                return Some(state);
            }
            center.clone_from(&state.signs);
            modes = state.modes;
        }
        None
    }

    /// All solutions by trying every mode; also whether there may be others: a mode was singular, or was not tried.
    fn enumerate(&self, patience: Patience) -> (Vec<State>, bool) {
        let m = self.nu.len();
        let mut pivots = Pivots::within(patience);
        let (mut found, mut has_singular) = (Vec::new(), false);
        if m > MOST_ENUMERATED {
            return (found, true);
        }
        for pattern in 0..3_usize.pow(m as u32) {
            let digit = |i: usize| (pattern / 3_usize.pow(i as u32) % 3) as i8 - 1;
            let modes: Vec<i8> = (0..m).map(digit).collect();
            match self.state(&modes, &mut pivots) {
                Err(_) => has_singular = true,
                Ok(state) if !(0..m).any(|i| self.is_wrong(&state, i)) => found.push(state),
                Ok(_) => {}
            }
            if pivots.are_over() {
                return (found, true);
            }
        }
        (found, has_singular)
    }
}

/// The largest entry of a row.
pub(super) fn largest(matrix: &SparseRows, i: usize) -> f64 {
    matrix.row(i).fold(0.0, |size, (_, v)| size.max(v.abs()))
}

pub(super) fn negative(matrix: &SparseRows) -> SparseRows {
    let mut result = matrix.clone();
    result
        .values_mut()
        .iter_mut()
        .for_each(|value| *value = -*value);
    result
}

/// The matrix less a diagonal.
pub(super) fn with_diagonal(matrix: &SparseRows, less: &[f64]) -> SparseRows {
    let mut result = SparseRows::new(matrix.n_columns());
    for (i, less) in less.iter().enumerate() {
        let mut entries: Vec<(usize, f64)> = matrix.row(i).collect();
        match entries.iter_mut().find(|entry| entry.0 == i) {
            Some(entry) => entry.1 -= less,
            None => entries.push((i, -less)),
        }
        entries.sort_unstable_by_key(|entry| entry.0);
        result.push_row(entries);
    }
    result
}

#[cfg(test)]
mod tests;
