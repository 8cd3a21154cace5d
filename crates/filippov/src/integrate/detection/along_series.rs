//! The search of a Taylor step: the series of a function tells of its zeros.

use crate::error::FieldError;
use crate::event::certificate::Proof;
use crate::event::filter::may_vanish_between;
use crate::event::isolate::{is_steep, Bracket};
use crate::event::locate::refine;
use crate::event::series::{FirstZero, Near, Series, NO_TERMS};
use crate::event::Monitored;
use crate::field::{Guard, ModeField};
use crate::integrate::detection::curve::Curve;
use crate::integrate::detection::search::Polynomial;
use crate::integrate::integrator::Integrator;
use crate::tolerances::{EPS, SERIES_MARGIN, SMALL_REST};

/// How a series stands for a monitored function.
#[derive(Clone, Copy, Debug)]
struct Likeness {
    /// How far the function may lie beside it.
    margin: f64,
    /// They are the same: the function is a polynomial along the step.
    is_exact: bool,
}

/// Where a zero is, about where, and how large the terms are that were left out to find it.
struct Between {
    lo: f64,
    hi: f64,
    guess: f64,
    rest: f64,
}

impl Integrator<'_> {
    /// The first zero of one monitored function in a Taylor step up to `reach`, and how far it was searched: to the
    /// same point, or to one behind a zero.
    pub(in crate::integrate) fn search_along_series(
        &mut self,
        index: usize,
        reach: f64,
        dt: f64,
    ) -> Result<(Option<(f64, bool)>, f64), FieldError> {
        let m = self.motion.monitored[index];
        if m.deflation.is_some() {
            self.motion.monitored[index].noise = self.noise_beside(&m)?;
        }
        let (value, _) = self.detector.right[index];
        let mut buffer = NO_TERMS;
        let rows = &mut buffer[..self.n_rows()];
        let mut has_series = false;
        let likeness = match m.guard {
            Guard::Surface(j) if self.is_polynomial(&m) => {
                self.affine_series(j, &m, dt, rows)?;
                Some(Likeness {
                    margin: 0.0,
                    is_exact: true,
                })
            }
            _ => {
                has_series = self.exit_series(&m, rows);
                match has_series {
                    true => self.likeness_of_exit(&m, &Series::new(rows), value)?,
                    false => None,
                }
            }
        };
        let mut polynomial = Polynomial::None;
        let mut near = None;
        if let Some(likeness) = likeness {
            let along = self.as_polynomial(&m, rows);
            if let Polynomial::Quotient(series) | Polynomial::Powers(series) = &along {
                let margin = likeness.margin;
                if value > 0.0 && series.stays_above(margin) {
                    return Ok((None, reach));
                }
                // Leaving small terms out is cheaper, and hardly ever too rough.
                for spare in [SMALL_REST, 0.0] {
                    let (found, rest) = series.first_zero(reach, margin, spare);
                    match found {
                        FirstZero::Nowhere if value > 0.0 || reach < 1.0 => {
                            return Ok((None, reach));
                        }
                        FirstZero::Between { lo, hi, guess } if value < 0.0 || hi < 1.0 => {
                            let between = Between {
                                lo,
                                hi,
                                guess,
                                rest,
                            };
                            if let Some(theta) = self.only_zero(index, series, likeness, between)? {
                                let searched = (theta + self.together(dt)).min(reach);
                                return Ok((Some((theta, false)), searched));
                            }
                        }
                        _ => {}
                    }
                    if rest == 0.0 {
                        break;
                    }
                }
                near = series.near_zero();
            }
            if likeness.is_exact {
                polynomial = along;
            }
        } else if has_series {
            near = Series::new(rows).near_zero();
        }
        if let Polynomial::None = polynomial {
            return self.search_bounded(index, (value, has_series), near, reach);
        }
        self.search_near((index, true), &polynomial, near, reach, dt)
    }

    /// How the series of an exit function in this step stands for it; `None` if it may change where no coefficient tells.
    fn likeness_of_exit(
        &mut self,
        m: &Monitored,
        series: &Series,
        value_at_end: f64,
    ) -> Result<Option<Likeness>, FieldError> {
        let Some(jets) = &self.motion.jets else {
            return Ok(None);
        };
        let sticks = |j: &usize| self.system.sticks_at(*j);
        let is_one_of_two = matches!(self.motion.field, ModeField::Sliding(_));
        // Where the motion sticks its limits are others than those of the series.
        if !is_one_of_two
            || m.deflation.is_some()
            || !self.motion.is_straight
            || self.motion.sliding().iter().any(sticks)
        {
            return Ok(None);
        }
        if jets.has_affine_exits() {
            let is_exact = series.leads_between(m.value, value_at_end);
            return Ok(is_exact.then_some(Likeness {
                margin: 0.0,
                is_exact,
            }));
        }
        if !jets.tells_of_exits() {
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
            margin: SERIES_MARGIN * widest,
            is_exact: false,
        }))
    }

    /// A monitored function within the step, in the sense of the mode.
    fn value_along(&mut self, m: &Monitored, theta: f64) -> Result<f64, FieldError> {
        let mut curve = Curve {
            system: self.system,
            field: &mut self.motion.field,
            signs: &self.motion.signs,
            interpolant: self.stepper.interpolant(),
            is_straight: self.motion.is_straight,
            h: &mut self.detector.h,
            x: &mut self.detector.x,
            exits: &mut self.detector.exits,
            n_evaluations: &mut self.stats.n_surface_evaluations,
        };
        curve.value(m, theta)
    }

    /// The only zero of a series between two points, and of the function that it stands for, to rounding; `None` if
    /// what it may be off by matters for whether it is one.
    fn only_zero(
        &mut self,
        index: usize,
        series: &Series,
        likeness: Likeness,
        Between {
            lo,
            hi,
            guess,
            rest,
        }: Between,
    ) -> Result<Option<f64>, FieldError> {
        let m = self.motion.monitored[index];
        let noise = self.noise_of(&m)?;
        self.motion.monitored[index].noise = noise;
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
        let width = 0.5 * EPS * (self.t.abs() / dt).max(1.0);
        let (mut theta, mut slope) = series.only_zero((lo, hi), guess, width);
        if rest > 0.0 && !series.is_single(slope, rest) {
            return Ok(None);
        }
        if !likeness.is_exact {
            // One step of Newton's method with the slope of the series. What it errs by: by how far that may be off.
            let value = self.value_along(&m, theta)?;
            let is_alike = SERIES_MARGIN * value.abs() <= doubt;
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
        self.detector.blurred |= !is_steep(slope, scale, noise);
        Ok(Some(theta))
    }

    /// The first zero of a function up to `reach` as far as bounds tell, and how far was searched.
    fn search_bounded(
        &mut self,
        index: usize,
        (value_at_end, has_series): (f64, bool),
        near: Option<Near>,
        reach: f64,
    ) -> Result<(Option<(f64, bool)>, f64), FieldError> {
        let m = self.motion.monitored[index];
        // Beyond zero at the end: there is a zero, whether there are bounds or not.
        let proof = if value_at_end <= 0.0 && has_series {
            Proof::Open
        } else {
            self.prove_clear(index, value_at_end, reach)
        };
        if proof == Proof::Silent && !self.exit_may_vanish(&m) {
            self.detector.dismissed |= self.motion.ends_root(&m);
            return Ok((None, reach));
        }
        if proof == Proof::Clear {
            return Ok((None, reach));
        }
        let bounded = (index, proof == Proof::Open);
        let dt = self.stepper.interpolant().dt;
        self.search_near(bounded, &Polynomial::None, near, reach, dt)
    }

    /// May an exit function about which there are no bounds vanish, to judge by its values at the stages?
    fn exit_may_vanish(&self, m: &Monitored) -> bool {
        let seen = m.exit().and_then(|place| self.detector.seen.get(place));
        let is_known = m.deflation.is_none() && !self.stepper.is_taylor();
        seen.is_none_or(|seen| !is_known || may_vanish_between(seen.range))
    }

    /// The first zero of an affine h on a piece of a Taylor step.
    pub(in crate::integrate) fn search_series(
        &mut self,
        index: usize,
        piece: (f64, f64),
        dt: f64,
    ) -> Result<Option<(f64, bool)>, FieldError> {
        let m = self.motion.monitored[index];
        let Guard::Surface(j) = m.guard else {
            return Ok(None);
        };
        let mut buffer = NO_TERMS;
        let rows = &mut buffer[..self.n_rows()];
        self.affine_series(j, &m, dt, rows)?;
        let polynomial = self.as_polynomial(&m, rows);
        self.search_piece((index, true), &polynomial, None, piece, dt)
    }
}
