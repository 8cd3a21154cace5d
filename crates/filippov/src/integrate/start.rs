//! Where a run starts: arguments checked, the mode of the initial state found.

use super::integrator::Integrator;
use super::transition::{Decided, Lefts};
use super::Stop;
use crate::error::{Error, FieldError};
use crate::mode::Mode;
use crate::options::Options;
use crate::switching::{decide, Arrival};
use crate::system::{surfaces_that_matter, PiecewiseSystem};
use crate::tolerances::SURFACE_NOISE;

/// Checks the arguments of a run.
pub(super) fn check(
    system: &dyn PiecewiseSystem,
    (t0, t1): (f64, f64),
    y0: &[f64],
    options: &Options,
) -> Result<(), Error> {
    let n = system.n_states();
    if y0.len() != n {
        return Err(Error::WrongLength {
            name: "y0",
            found: y0.len(),
            expected: n,
        });
    }
    if options.atol.len() != 1 && options.atol.len() != n {
        return Err(Error::WrongLength {
            name: "atol",
            found: options.atol.len(),
            expected: n,
        });
    }
    let require = |name, value: f64, holds: bool, requirement| {
        if holds {
            Ok(())
        } else {
            Err(Error::OutOfRange {
                name,
                value,
                requirement,
            })
        }
    };
    require("t_span[0]", t0, t0.is_finite(), "must be finite")?;
    require(
        "t_span[1]",
        t1,
        t1.is_finite() && t1 >= t0,
        "must be finite and not before t_span[0]",
    )?;
    for &y in y0 {
        require("y0", y, y.is_finite(), "must be finite")?;
    }
    for &a in &options.atol {
        require("atol", a, a >= 0.0 && a.is_finite(), "must not be negative")?;
    }
    require(
        "rtol",
        options.rtol,
        options.rtol > 0.0 && options.rtol.is_finite(),
        "must be positive",
    )?;
    require(
        "max_step",
        options.max_step,
        options.max_step > 0.0,
        "must be positive",
    )?;
    if let Some(first) = options.first_step {
        require(
            "first_step",
            first,
            first > 0.0 && first.is_finite(),
            "must be positive",
        )?;
    }
    Ok(())
}

impl Integrator<'_> {
    /// Finds the mode of the initial state and starts the motion.
    pub(super) fn start(&mut self) -> Result<Option<Stop>, FieldError> {
        self.recorder.start(self.t, &self.x);
        let d = self.system.n_surfaces();
        let mut mode = Mode::new(vec![1; d]);
        // Switching functions may contain signs of others: repeat until nothing changes.
        let mut on_surface = vec![false; d];
        for _ in 0..=d {
            let before = mode.clone();
            let signs = mode.signs();
            let h = self.surface_values(&signs)?;
            if h.iter().any(|h| h.is_nan()) {
                return Ok(Some(Stop::NotFinite));
            }
            for j in 0..d {
                let size = self.system.surface_size(j, self.t, &self.x, &signs)?;
                let noise = SURFACE_NOISE * size;
                on_surface[j] = h[j].abs() <= noise;
                let entry = if h[j] < 0.0 { -1 } else { 1 };
                mode.set(j, entry);
            }
            if mode == before {
                break;
            }
        }
        // An inactive surface has the sign of the side that it moves to.
        let zeros = (0..d).filter(|&j| on_surface[j]).collect();
        let meeting = surfaces_that_matter(self.system, &mode, zeros);
        let (mode, left) = match meeting.as_slice() {
            [] => (mode, Lefts::new()),
            [j] => match self.start_on_surface(&mode, *j)? {
                Ok(placed) => placed,
                Err(stop) => return Ok(Some(stop)),
            },
            _ => match self.decide_at_start(&mode, &meeting)? {
                Ok(placed) => placed,
                Err(stop) => return Ok(Some(stop)),
            },
        };
        self.begin(mode, &left)
    }

    /// The mode of a start on one surface, or the reason to stop.
    fn start_on_surface(&mut self, mode: &Mode, j: usize) -> Result<Decided, FieldError> {
        let signs = mode.signs();
        let decision = decide(self.system, j, Arrival::Start, self.t, &self.x, &signs)?;
        Ok(self.follow_at_surface(mode, j, decision))
    }
}
