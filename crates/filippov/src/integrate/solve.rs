//! Runs from start to end.

use super::{Integrator, Problem};
use crate::error::Error;
use crate::event::UserEvent;
use crate::integrate::progress::Reached;
use crate::record::section::{Place, Section};
use crate::record::{Observer, Solution};
use crate::status::Stop;

impl Problem<'_> {
    /// Integrates to the end.
    ///
    /// # Errors
    /// If an argument is out of range. A failure during the run is no error: the solution up to there
    /// comes back with its [`Stop`].
    pub fn solve(self) -> Result<Solution, Error> {
        self.solve_interruptible(&mut |_| false)
    }

    /// As [`solve`](Self::solve); `interrupt` is asked every few steps, and during long decisions, with the time reached, and the
    /// run stops where it says `true`.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_interruptible(
        self,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<Solution, Error> {
        self.solve_with(None, interrupt)
    }

    /// As [`solve_interruptible`](Self::solve_interruptible), with an observer of the steps and instants.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_observed(
        self,
        observer: &mut dyn Observer,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<Solution, Error> {
        self.solve_with(Some(observer), interrupt)
    }

    fn solve_with(
        self,
        observer: Option<&mut dyn Observer>,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<Solution, Error> {
        let mut integrator = Integrator::new(self)?;
        if let Some(observer) = observer {
            integrator = integrator.observed_by(observer);
        }
        let mut solution = integrator.interruptible(interrupt).solve();
        let wanted = self.options.t_eval.as_ref();
        let resampled = wanted
            .filter(|_| solution.is_dense())
            .map(|times| solution.resample(self.system, times));
        if let Some(Err(raised)) = resampled {
            solution.stop = Stop::FieldRaised(raised);
        }
        Ok(solution)
    }

    /// Integrates until a section was met as often as it asks for, its returns are periodic, or the end of the span;
    /// [`Solution::returns`](crate::Solution::returns) are the returns. The function of the section takes the place of the events.
    ///
    /// # Example
    ///
    /// The forced oscillator with dry friction, once per period of the forcing (Piiroinen and Kuznetsov 2008, Fig. 4).
    ///
    /// ```
    /// use filippov::action::Clock;
    /// use filippov::section::{Place, Section};
    /// use filippov::{ClosureSystem, Problem};
    ///
    /// let oscillator = ClosureSystem::new(
    ///     2,
    ///     1,
    ///     |t, x, s, dx| (dx[0], dx[1]) = (x[1], -x[0] + (t / 3.0).sin() - 0.4 * s[0]),
    ///     |_t, x, h| h[0] = x[1],
    /// );
    /// let clock = Clock { period: 6.0 * std::f64::consts::PI, phase: 0.0 };
    /// let (transient, most) = (20, 2);
    /// let place = Place::Ticks(clock);
    /// let section = Section { place, transient, most, cycle: None, keeps_pieces: false };
    /// let problem = Problem::new(&oscillator, (0.0, 1e3), &[1.0, 2.0]);
    /// let solution = problem.solve_to_section(&section, &mut |_| false)?;
    /// let returns = solution.returns.expect("there is a section");
    /// assert_eq!((returns.count, returns.kept.len()), (22, 2));
    /// assert!((returns.kept[1].y[1] - 0.3570302433858536).abs() < 1e-5);
    /// # Ok::<(), filippov::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_to_section(
        self,
        section: &Section,
        interrupt: &mut dyn FnMut(Reached) -> bool,
    ) -> Result<Solution, Error> {
        let function = match section.place {
            Place::Function {
                function,
                direction,
            } => Some(UserEvent {
                function,
                direction,
                terminal: 0,
            }),
            _ => None,
        };
        if let Place::Ticks(clock) = section.place {
            clock.check("period of the section", "offset of the section")?;
        }
        let mut integrator = Integrator::new(Problem {
            events: function.as_slice(),
            ..self
        })?;
        integrator.recorder.observe(section, self.t_span.0);
        Ok(integrator.interruptible(interrupt).solve())
    }
}
