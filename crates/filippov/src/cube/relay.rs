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
//! The method, with one sparse linear system per step:
//!
//! 1. Principal pivoting: every surface in a wrong state changes it at once. When the number of wrong states stops
//!    decreasing, only the one of least index changes, until the number is lower again. For P-matrices this is finite, and
//!    from the mode before it takes a few steps.
//! 2. If -N is not a P-matrix, as with redundant contacts, the pivots solve the problem of N - diag(d) with a small d, and
//!    proximal steps take d away from the result: nu becomes nu + d s with the s before. Of the solutions, which then
//!    differ in s but not in v if -N is monotone, this finds the one with small s.
//!
//! References: Cottle, Pang, Stone (1992); Júdice, Pires, *A block principal pivoting algorithm* (1994);
//! Guglielmi, Hairer (2022); `docs/theory/switching.md`.

use super::shared_load::{idle, largest, KnownUniqueness, SharedLoads, Uniqueness};
use crate::patience::Patience;
use crate::sparse::{Singular, SparseRows, SparseSolver};
use crate::tolerances::{DEFINITE_PIVOT, EPS, LARGEST_BY_MINORS};

/// Steps without fewer wrong states before single changes.
const MOST_IDLE: usize = 4;

/// Proximal steps; each gains a factor of about 1 / d.
const MOST_PROXIMAL: usize = 30;

/// Rates of a solution that are to be 0 may be this many times what rounding alone would leave: the solution of the
/// linear system, and the last proximal step, add theirs.
const SOLVED: f64 = 8.0;

/// The data of (R), one entry or row per surface.
#[derive(Clone, Copy, Debug)]
pub struct RelayProblem<'n> {
    /// The rates of the switching functions at s = 0.
    pub nu: &'n [f64],
    /// How they depend on the signs.
    pub n: &'n SparseRows,
    /// Rates below this fraction of the sum of their terms count as zero: `PiecewiseSystem::lie_tolerance(1)`.
    pub noise: f64,
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
    /// The contacts that share their loads because some are redundant, a list for each load.
    pub loops: Vec<Vec<usize>>,
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
/// let problem = RelayProblem { nu: &[0.5, 3.0], n: &n, noise: 1e-11 };
/// let found = solve_relay(&problem, &[0, 0])?;
/// assert_eq!(found.modes, [0, 1]);
/// assert!((found.signs[0] - 0.7).abs() < 1e-15 && (found.rates[1] - 2.14).abs() < 1e-15);
/// assert_eq!(found.uniqueness, Uniqueness::Certain);
/// # Ok::<(), filippov::switching::RelayError>(())
/// ```
pub fn solve_relay(problem: &RelayProblem<'_>, before: &[i8]) -> Result<RelaySolution, RelayError> {
    let known = &mut KnownUniqueness::default();
    solve_relay_within(problem, before, Patience::endless(), known)
}

/// As [`solve_relay`], as long as the caller waits, with what is known of other problems.
///
/// # Errors
/// As [`solve_relay`]; [`RelayError::Undecided`] also when the caller has waited long enough.
pub fn solve_relay_within(
    problem: &RelayProblem<'_>,
    before: &[i8],
    patience: Patience,
    known: &mut KnownUniqueness,
) -> Result<RelaySolution, RelayError> {
    if !problem.n.is_finite() || !problem.nu.iter().all(|v| v.is_finite()) {
        return Err(RelayError::NotFinite);
    }
    let is_idle = problem.idle();
    let acting = is_idle.contains(&true).then(|| problem.without(&is_idle));
    let n = acting.as_ref().unwrap_or(problem.n);
    let mut pivots = Pivots::new(RelayProblem { n, ..*problem }, is_idle, patience, known);
    let state = pivots.only_state().or_else(|| pivots.proximal(before));
    let found = state.and_then(|state| pivots.solution(state));
    let mut solution = found.ok_or(RelayError::Undecided {
        n_surfaces: before.len(),
    })?;
    if solution.uniqueness == Uniqueness::OfMotion {
        solution.let_stick(problem);
    }
    Ok(solution)
}

/// Modes with their signs and rates: the equations of (R) without the inequalities.
struct State {
    modes: Vec<i8>,
    signs: Vec<f64>,
    rates: Vec<f64>,
}

/// The pivots of one problem.
struct Pivots<'a> {
    /// The problem without the effects of idle surfaces, which are rounding.
    problem: RelayProblem<'a>,
    /// The signs of these surfaces have no effect, for instance those of kinks. Each sign follows the rate of its surface.
    is_idle: Vec<bool>,
    uniqueness: Uniqueness,
    /// nu, and N where it is damped, with d.
    nu: Vec<f64>,
    damped: Option<SparseRows>,
    /// Does no sign act on the rate of another surface?
    is_diagonal: bool,
    n_divisions: usize,
    solver: SparseSolver,
    n_pivots: usize,
    patience: Patience<'a>,
}

impl<'a> Pivots<'a> {
    fn new(
        problem: RelayProblem<'a>,
        is_idle: Vec<bool>,
        patience: Patience<'a>,
        known: &mut KnownUniqueness,
    ) -> Self {
        let acting: Vec<usize> = (0..is_idle.len()).filter(|&i| !is_idle[i]).collect();
        let uniqueness = known.of(&problem.n.principal(&acting));
        Pivots {
            nu: problem.nu.to_vec(),
            damped: None,
            is_diagonal: problem.n.is_diagonal(),
            n_divisions: 0,
            problem,
            is_idle,
            uniqueness,
            solver: SparseSolver::default(),
            n_pivots: 0,
            patience,
        }
    }

    /// The solution from these modes. Where it is not certain to be the only one with N - diag(d), then repeatedly with
    /// nu + d s for the s before, until d (s - s before) is rounding.
    fn proximal(&mut self, before: &[i8]) -> Option<State> {
        let places = before.iter().zip(&self.is_idle);
        let mut modes: Vec<i8> = places
            .map(|(&mode, &is_idle)| if is_idle && mode == 0 { 1 } else { mode })
            .collect();
        if self.uniqueness == Uniqueness::Certain {
            return self.pivot(modes);
        }
        let damp = |i| match largest(self.problem.n, i) {
            0.0 => 1.0,
            size => DEFINITE_PIVOT.sqrt() * size,
        };
        let damping: Vec<f64> = (0..modes.len()).map(damp).collect();
        self.damped = Some(self.problem.n.less_diagonal(&damping));
        let mut center = vec![0.0; modes.len()];
        for _ in 0..MOST_PROXIMAL {
            let terms = self.problem.nu.iter().zip(damping.iter().zip(&center));
            self.nu = terms.map(|(nu, (d, s))| nu + d * s).collect();
            let state = self.pivot(modes)?;
            let terms = damping.iter().zip(state.signs.iter().zip(&center));
            let is_done = terms.enumerate().all(|(i, (d, (sign, before)))| {
                d * (sign - before).abs() <= self.problem.rounding(&state.signs, i)
            });
            if is_done {
                return Some(state);
            }
            (center, modes) = (state.signs, state.modes);
        }
        None
    }

    /// Principal pivoting: many states at a time while that helps, else one.
    fn pivot(&mut self, mut modes: Vec<i8>) -> Option<State> {
        let (mut fewest, mut idle) = (usize::MAX, 0);
        for step in 0..100 + 10 * modes.len() {
            if step > 0 && self.patience.is_over() {
                return None;
            }
            let state = self.state(&modes).ok()?;
            let wrong: Vec<usize> = (0..modes.len())
                .filter(|&i| self.is_wrong(&state, i))
                .collect();
            if wrong.is_empty() {
                return Some(state);
            }
            (fewest, idle) = match wrong.len() < fewest {
                true => (wrong.len(), 0),
                false => (fewest, idle + 1),
            };
            let many = idle < MOST_IDLE;
            let changed = if many { &wrong[..] } else { &wrong[..1] };
            for &i in changed {
                modes[i] = self.better(&state, i, many);
            }
        }
        None
    }

    fn n(&self) -> &SparseRows {
        self.damped.as_ref().unwrap_or(self.problem.n)
    }

    /// The mode of an entry in a wrong state. A jump from one side to the other is allowed only where many states
    /// change, or if the sign has no effect: one at a time, such jumps might repeat.
    fn better(&self, state: &State, i: usize, may_jump: bool) -> i8 {
        let side = |value: f64| if value > 0.0 { 1 } else { -1 };
        let reach = 2.0 * self.n().diagonal(i).abs();
        match state.modes[i] {
            0 => side(state.signs[i]),
            _ if self.is_idle[i] || may_jump && state.rates[i].abs() > reach => {
                side(state.rates[i])
            }
            _ => 0,
        }
    }

    /// Where nothing else makes the solution of a few surfaces unique: the only one among their 3^m modes, if N is not
    /// singular in any, which might hold others.
    fn only_state(&mut self) -> Option<State> {
        let m = self.nu.len();
        if self.uniqueness != Uniqueness::Unknown || m > LARGEST_BY_MINORS {
            return None;
        }
        let mut only = None;
        for pattern in 0..3_usize.pow(m as u32) {
            let digit = |i: usize| (pattern / 3_usize.pow(i as u32) % 3) as i8 - 1;
            let modes: Vec<i8> = (0..m).map(digit).collect();
            if (0..m).any(|i| self.is_idle[i] && modes[i] == 0) {
                continue;
            }
            let state = self.state(&modes).ok()?;
            let fits = !(0..m).any(|i| self.is_wrong(&state, i));
            if self.patience.is_over() || fits && only.replace(state).is_some() {
                return None;
            }
        }
        self.uniqueness = Uniqueness::Certain;
        only
    }

    /// Signs and rates for given modes: N_FF s_F = -(nu_F + N_FJ s_J) for the sliding surfaces F.
    fn state(&mut self, modes: &[i8]) -> Result<State, Singular> {
        let m = modes.len();
        let mut signs: Vec<f64> = modes.iter().map(|&mode| f64::from(mode)).collect();
        let sliding = (0..m).filter(|&i| modes[i] == 0);
        let n = self.damped.as_ref().unwrap_or(self.problem.n);
        self.n_pivots += 1;
        if self.is_diagonal {
            for i in sliding {
                let entry = n.diagonal(i);
                if entry == 0.0 {
                    return Err(Singular { unknowns: vec![i] });
                }
                signs[i] = -self.nu[i] / entry;
                self.n_divisions += 1;
            }
        } else {
            let sliding: Vec<usize> = sliding.collect();
            let loads = sliding.iter().map(|&i| -self.nu[i] - n.dot(i, &signs));
            let mut unknown: Vec<f64> = loads.collect();
            self.solver.factor(&n.principal(&sliding))?;
            self.solver.solve(&mut unknown);
            for (&i, &sign) in sliding.iter().zip(&unknown) {
                signs[i] = sign;
            }
        }
        let rate = |i: usize| match modes[i] {
            0 => 0.0,
            _ => self.nu[i] + self.n().dot(i, &signs),
        };
        Ok(State {
            rates: (0..m).map(rate).collect(),
            modes: modes.to_vec(),
            signs,
        })
    }

    fn is_wrong(&self, state: &State, i: usize) -> bool {
        let rounding = self.problem.rounding(&state.signs, i);
        match state.modes[i] {
            0 => {
                let fits = state.signs[i].abs() <= 1.0 + self.problem.slack(rounding, i);
                !fits
            }
            mode => f64::from(mode) * state.rates[i] < -rounding,
        }
    }

    /// The solution with the modes and signs of a state; `None` if the rates without damping, which are computed also
    /// where the motion slides, do not satisfy (R).
    fn solution(&self, state: State) -> Option<RelaySolution> {
        let State {
            modes, mut signs, ..
        } = state;
        signs
            .iter_mut()
            .for_each(|sign| *sign = sign.clamp(-1.0, 1.0));
        let (mut rates, mut degenerate) = (vec![0.0; modes.len()], Vec::new());
        for (i, &mode) in modes.iter().enumerate() {
            let rate = self.problem.nu[i] + self.problem.n.dot(i, &signs);
            let rounding = self.problem.rounding(&signs, i);
            let (wrong, is_at_end) = match f64::from(mode) {
                0.0 => (
                    rate.abs(),
                    signs[i].abs() >= 1.0 - self.problem.slack(rounding, i),
                ),
                side => (-side * rate, rate.abs() <= rounding),
            };
            if wrong > SOLVED * rounding {
                return None;
            }
            if is_at_end {
                degenerate.push(i);
            }
            rates[i] = if mode == 0 { 0.0 } else { rate };
        }
        let is_open = degenerate.iter().any(|&i| self.is_idle[i]);
        let known = (!is_open).then_some(self.uniqueness);
        Some(RelaySolution {
            modes,
            signs,
            rates,
            uniqueness: known.unwrap_or(Uniqueness::Unknown),
            degenerate,
            loops: Vec::new(),
            n_pivots: self.n_pivots,
            n_operations: self.n_divisions + self.solver.n_operations(),
        })
    }
}

impl RelayProblem<'_> {
    /// A rate below this is rounding: of the rates at the signs, and of signs of size 1.
    fn rounding(&self, signs: &[f64], i: usize) -> f64 {
        let of_signs: f64 = self.n.row(i).map(|(_, value)| value.abs()).sum();
        self.noise * (self.nu[i].abs() + self.n.magnitude(i, signs)) + EPS * of_signs
    }

    /// The surfaces whose sign has no effect but rounding.
    fn idle(&self) -> Vec<bool> {
        idle(self.n, |i| self.rounding_at_ends(i))
    }

    /// N without the effects of these surfaces.
    fn without(&self, is_idle: &[bool]) -> SparseRows {
        let acts = is_idle.iter().map(|is_idle| f64::from(u8::from(!is_idle)));
        let acts: Vec<f64> = acts.collect();
        self.n.with_columns_scaled(&acts)
    }

    /// A rate below this is rounding where all signs have size 1.
    fn rounding_at_ends(&self, i: usize) -> f64 {
        let of_signs: f64 = self.n.row(i).map(|(_, value)| value.abs()).sum();
        self.noise * (self.nu[i].abs() + of_signs) + EPS * of_signs
    }

    /// How much of a sign is rounding, if the rates are known up to `rounding`.
    fn slack(&self, rounding: f64, i: usize) -> f64 {
        let size = largest(self.n, i);
        self.noise + if size > 0.0 { rounding / size } else { 1.0 }
    }
}

impl RelaySolution {
    /// Makes a solution whose motion alone is unique one of modes: what does not slip sticks, though its sign may be -1 or
    /// +1. Where the strength of all contacts of a loop is just used up, the entries stay degenerate.
    fn let_stick(&mut self, problem: &RelayProblem<'_>) {
        let rate = |i: usize| problem.nu[i] + problem.n.dot(i, &self.signs);
        let sticks = |&i: &usize| {
            let rounding = SOLVED * problem.rounding(&self.signs, i);
            self.modes[i] == 0 || rate(i).abs() <= rounding
        };
        let sticking: Vec<usize> = (0..problem.nu.len()).filter(sticks).collect();
        let here: Vec<f64> = sticking.iter().map(|&i| self.signs[i]).collect();
        let rates: Vec<f64> = sticking.iter().map(|&i| rate(i)).collect();
        let Some(mut loads) = SharedLoads::new(&problem.n.principal(&sticking)) else {
            return;
        };
        let all = |places: &[usize]| places.iter().map(|&place| sticking[place]).collect();
        self.loops = loads.loops().map(all).collect();
        let reserves = loads.at(&rates, &here).map(|shared| shared.reserves);
        for (&i, reserve) in sticking.iter().zip(reserves.unwrap_or_default()) {
            if reserve.is_some_and(|reserve| reserve > DEFINITE_PIVOT.sqrt()) {
                (self.modes[i], self.rates[i]) = (0, 0.0);
                self.degenerate.retain(|&degenerate| degenerate != i);
            }
        }
    }
}

#[cfg(test)]
mod tests;
