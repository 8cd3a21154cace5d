//! Some guards have a power series along a step; it bounds them and locates their zeros.

use super::curve::Curve;
use super::sought::AtZero;
use super::StepSearch;
use crate::error::FieldError;
use crate::event::filter::may_vanish_between;
use crate::event::isolate::{is_steep, Bracket};
use crate::event::series::Series;
use crate::locate::refine;
use crate::motion::ModeField;
use crate::motion::Monitored;
use crate::stepper::{powers_of_nested, Basis, ExitSeries};
use crate::system::Setting;
use crate::tolerances::{EPS, PROBED};

/// A guard along a step, as far as it is a polynomial.
pub(super) enum Polynomial<'a> {
    /// It is none.
    None,
    /// A series.
    Powers(Series<'a>),
    /// A series; the zero at the start of this step is divided out.
    Quotient(Series<'a>),
    /// A series; a zero before this step is yet to be divided out.
    Deflated(Series<'a>),
}

/// How a series stands for a guard.
#[derive(Clone, Copy, Debug)]
pub(super) struct Likeness {
    /// How far the guard may lie beside it.
    pub margin: f64,
    /// They are the same: the guard is a polynomial along the step.
    pub is_exact: bool,
}

impl Likeness {
    const EXACT: Likeness = Likeness {
        margin: 0.0,
        is_exact: true,
    };
}

impl StepSearch<'_, '_> {
    /// Is a guard a polynomial along the step?
    pub(super) fn is_polynomial(&self, m: &Monitored) -> bool {
        m.affine && self.run.motion.is_straight && m.guard.is_surface()
    }

    /// Coefficients of the step.
    pub(super) fn n_rows(&self) -> usize {
        self.stepper.interpolant().coefficients().len() / self.run.x.len()
    }

    /// The series of a guard in this step, into `rows`, and how it stands for the guard; `None` if it does not.
    pub(super) fn series_along(
        &mut self,
        m: &Monitored,
        rows: &mut [f64],
        value_at_end: f64,
    ) -> Result<Option<Likeness>, FieldError> {
        if self.is_polynomial(m) {
            self.affine_series(m, rows)?;
            return Ok(Some(Likeness::EXACT));
        }
        let sticks = |j: &usize| self.run.system.sticks_at(*j);
        // Where the motion sticks its limits are others than those of the series.
        if !matches!(self.run.motion.field, ModeField::Sliding(_))
            || m.deflation.is_some()
            || !self.run.motion.is_straight
            || self.run.motion.sliding().iter().any(sticks)
        {
            return Ok(None);
        }
        match self.exit_series(m, rows) {
            Some(known) => self.likeness_of_exit(m, known, &Series::new(rows), value_at_end),
            None => Ok(None),
        }
    }

    /// A polynomial along the step, with what is to be divided out.
    pub(super) fn as_polynomial<'a>(&self, m: &Monitored, rows: &'a [f64]) -> Polynomial<'a> {
        let series = Series::new(rows);
        match m.deflation {
            None => Polynomial::Powers(series),
            Some(zero) if zero.t == self.run.t => {
                Polynomial::Quotient(series.divided(zero.order as usize))
            }
            Some(_) => Polynomial::Deflated(series),
        }
    }

    /// An affine switching function along the step, positive inside of the mode, into `rows`.
    pub(super) fn affine_series(&self, m: &Monitored, rows: &mut [f64]) -> Result<(), FieldError> {
        let extension = self.stepper.interpolant();
        let place = self.run.motion.setting().at(self.run.t, &self.run.x);
        let ht =
            self.run
                .system
                .gradient_products(m.place, &place, extension.coefficients(), rows)?;
        if m.orientation < 0.0 {
            rows.iter_mut().for_each(|row| *row = -*row);
        }
        rows[0] = m.value;
        rows[1] += m.orientation * ht * extension.dt;
        if extension.basis() == Basis::Nested {
            powers_of_nested(rows);
        }
        Ok(())
    }

    /// An exit function along the step, as far as its series describes it, into `rows`; `None` if there is none.
    pub(super) fn exit_series(&self, m: &Monitored, rows: &mut [f64]) -> Option<ExitSeries> {
        let known = self.stepper.exit_series(m.exit()?, rows)?;
        rows[0] += self.slacks.of(m.guard);
        Some(known)
    }

    /// How the series of an exit function in this step stands for it; `None` if it may change where no coefficient tells.
    fn likeness_of_exit(
        &mut self,
        m: &Monitored,
        known: ExitSeries,
        series: &Series,
        value_at_end: f64,
    ) -> Result<Option<Likeness>, FieldError> {
        if known.is_affine {
            let is_exact = series.leads_between(m.value, value_at_end);
            return Ok(is_exact.then_some(Likeness::EXACT));
        }
        if !known.is_complete {
            return Ok(None);
        }
        let [start, end] = series.ends();
        let mut gaps = [start - m.value, end - value_at_end, 0.0];
        // Within the step the function is known at a zero of the other one. At its own it will be.
        let known = self.detector.exits.first().map(|known| known.0);
        if let Some(theta) = known.or((value_at_end > 0.0).then_some(0.5)) {
            gaps[2] = series.value(theta) - self.value_along(m, theta)?;
        }
        let widest = gaps.into_iter().fold(0.0, |w: f64, gap| w.max(gap.abs()));
        let is_known = !gaps.iter().any(|gap| gap.is_nan());
        Ok(is_known.then_some(Likeness {
            margin: PROBED * widest,
            is_exact: false,
        }))
    }

    /// A guard within the step, in the sense of the mode.
    fn value_along(&mut self, m: &Monitored, theta: f64) -> Result<f64, FieldError> {
        let mut curve = Curve {
            system: self.run.system,
            field: &mut self.run.motion.field,
            setting: Setting::new(&self.run.motion.signs, &self.run.motion.discrete),
            interpolant: self.stepper.interpolant(),
            is_straight: self.run.motion.is_straight,
            h: &mut self.detector.h,
            x: &mut self.detector.x,
            exits: &mut self.detector.exits,
            n_evaluations: &mut self.run.stats.n_surface_evaluations,
        };
        curve.value(m, theta)
    }

    /// The only zero of a series between two points, `rest` being the size of the terms that were left out to find it; and
    /// of the guard that it stands for, to rounding. `None` if what it may be off by matters for whether it is one.
    pub(super) fn only_zero(
        &mut self,
        index: usize,
        series: &Series,
        likeness: Likeness,
        (lo, hi, guess, rest): (f64, f64, f64, f64),
    ) -> Result<Option<(f64, AtZero)>, FieldError> {
        let m = self.run.motion.monitored[index];
        let noise = self.noise_of(&m)?;
        self.run.motion.monitored[index].noise = noise;
        let doubt = noise.max(likeness.margin);
        let g_lo = series.value(lo);
        let g_hi = match hi {
            1.0 => self.detector.right[index].0,
            _ => series.value(hi),
        };
        let chord = (g_hi - g_lo) / (hi - lo);
        let scale = g_lo.max(-g_hi);
        if g_lo <= doubt || g_hi >= -doubt || !is_steep(chord, scale, doubt) {
            return Ok(None);
        }
        let (dt, n_rows) = (self.stepper.interpolant().dt, self.n_rows() as f64);
        let width = 0.5 * EPS * (self.run.t.abs() / dt).max(1.0);
        let (mut theta, mut slope) = series.only_zero(1.0, (lo, hi), guess, width);
        if rest > 0.0 && !series.is_single(slope, rest) {
            return Ok(None);
        }
        if !likeness.is_exact {
            // One step of Newton's method with the slope of the series. What it errs by: by how far that may be off.
            let value = self.value_along(&m, theta)?;
            let is_alike = PROBED * value.abs() <= doubt;
            if !is_alike {
                return Ok(None);
            }
            let step = -value / slope;
            let doubt = (likeness.margin * n_rows / slope).abs() + step.abs() / (hi - lo);
            theta += step;
            if step.abs() * doubt > width {
                let bracket = Bracket {
                    lo,
                    hi,
                    g_lo,
                    g_hi,
                    guess: theta,
                    slope,
                };
                let located = refine(&mut |theta| self.value_along(&m, theta), bracket, width)?;
                (theta, slope) = (located.theta, located.slope);
            }
        }
        let kind = AtZero::crossing(is_steep(slope, scale, noise));
        Ok(Some((theta, kind)))
    }

    /// May an exit function about which there are no bounds vanish, to judge by its values at the stages?
    pub(super) fn exit_may_vanish(&self, m: &Monitored) -> bool {
        let seen = m.exit().and_then(|place| self.run.seen.get(place));
        let is_known = m.deflation.is_none() && !self.stepper.is_series();
        seen.is_none_or(|seen| !is_known || may_vanish_between(seen.range))
    }
}
