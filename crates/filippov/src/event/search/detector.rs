//! What the event stage keeps of a step: values of the monitored functions, and what was found out about them.

use std::cell::RefCell;

use super::bounds::{Piece, RootPiece};
use crate::error::FieldError;
use crate::event::Multiple;
use crate::motion::CurrentMotion;
use crate::motion::Monitored;
use crate::motion::{Exits, Seen};
use crate::system::PiecewiseSystem;
use crate::tolerances::{SMALL_JUMP, SURFACE_NOISE};

/// A function is clear of a zero that was divided out beyond this multiple of its rounding.
pub(super) const CLEAR_OF_NOISE: f64 = 1e3;

/// Scratch space of the event stage, and values of what is monitored.
pub(crate) struct Detector {
    /// The exit functions of the motion in the step.
    pub seen: Vec<Seen>,
    /// Exit functions computed in the search of this step, by theta.
    pub exits: Vec<(f64, Exits)>,
    pub h: Vec<f64>,
    /// Switching functions at the probes of the step.
    pub(super) probed: [Vec<f64>; 2],
    /// They were evaluated in this step.
    pub(super) is_probed: bool,
    pub(super) rate: Vec<f64>,
    pub x: Vec<f64>,
    /// How far the projection onto a curved surface moves the extension in this step; else empty.
    pub margin: Vec<f64>,
    /// Bounds of the normal components over pieces of the extension of this step.
    pub enclosed_exits: RefCell<Vec<Piece>>,
    /// Bounds of the multipliers there, while sliding on an intersection.
    pub enclosed_roots: RefCell<Vec<RootPiece>>,
    /// Value and rate at the end of the step, per monitored function.
    pub right: Vec<(f64, f64)>,
    /// Rounding of the exit functions in this step, once it was needed.
    pub(super) exit_noise: Option<f64>,
}

impl Detector {
    pub fn new(n: usize, d: usize) -> Self {
        Detector {
            seen: Vec::new(),
            exits: Vec::new(),
            h: vec![0.0; d],
            probed: [vec![0.0; d], vec![0.0; d]],
            is_probed: false,
            rate: vec![0.0; d],
            x: vec![0.0; n],
            margin: Vec::new(),
            enclosed_exits: RefCell::default(),
            enclosed_roots: RefCell::default(),
            right: Vec::new(),
            exit_noise: None,
        }
    }

    /// Forgets what is known of the last step.
    pub fn forget_step(&mut self) {
        self.exits.clear();
        self.enclosed_exits.get_mut().clear();
        self.enclosed_roots.get_mut().clear();
        self.margin.clear();
        self.exit_noise = None;
        self.is_probed = false;
    }

    /// Is the difference of the normal components at an end of the step so small, compared with `speed`, that the multiplier
    /// may be lost? Far from it nothing else has to be looked at.
    pub fn may_lose_multiplier(&self, speed: f64, rtol: f64) -> bool {
        let [minus, plus, ..] = self.seen.as_slice() else {
            return false;
        };
        let least = (minus.start + plus.start).min(minus.end + plus.end);
        least <= (SMALL_JUMP * rtol).min(1.0) * speed
    }

    /// Does the share of f+ change fast in the step just made, towards a two-fold? Asked while the motion slides on one surface.
    pub fn approaches_two_fold(&self) -> bool {
        let [minus, plus, ..] = self.seen.as_slice() else {
            return false;
        };
        minus.end + plus.end < 0.99 * (minus.start + plus.start)
    }

    /// Values and rates of the monitored functions at (t, x) with velocity `v`, into `right`.
    pub fn measure(
        &mut self,
        system: &dyn PiecewiseSystem,
        motion: &CurrentMotion,
        (t, x, v): (f64, &[f64], &[f64]),
    ) -> Result<(), FieldError> {
        let with_surfaces = motion.monitored.iter().any(|m| m.guard.is_surface());
        if with_surfaces {
            system.surface_rates(t, x, &motion.signs, v, &mut self.h, &mut self.rate)?;
        }
        self.right.clear();
        for m in &motion.monitored {
            self.right.push(match m.surface() {
                Some(j) => (m.orientation * self.h[j], m.orientation * self.rate[j]),
                None => (self.seen[m.place].end, f64::NAN),
            });
        }
        Ok(())
    }

    /// Makes the values at the end of the step those at the start of the next one. Returns whether a
    /// surface that the motion departed from is now clear.
    pub fn accept(&mut self, monitored: &mut [Monitored], dt: f64) -> bool {
        let mut cleared = false;
        for (m, &(value, rate)) in monitored.iter_mut().zip(&self.right) {
            m.curvature = (rate - m.rate) / dt;
            (m.value, m.rate) = (value, rate);
            // A zero that rounding still blurs stays divided out.
            if m.deflation.is_some() && value > CLEAR_OF_NOISE * m.noise {
                m.deflation = None;
                cleared = true;
            }
        }
        for seen in &mut self.seen {
            seen.start = seen.end;
        }
        cleared
    }

    /// Makes the values just measured those at the start of a motion that leaves a multiple zero, if it does.
    pub fn accept_start(&mut self, monitored: &mut [Monitored], left: &Multiple) {
        for (m, &(value, rate)) in monitored.iter_mut().zip(&self.right) {
            (m.value, m.rate) = (value, rate);
            if let Some(zero) = &mut m.deflation {
                zero.blur = left.blur;
                zero.residual = if value.abs() <= left.depth {
                    value
                } else {
                    0.0
                };
            }
        }
    }

    /// Rounding of a monitored function over the step.
    pub(super) fn noise(
        &mut self,
        system: &dyn PiecewiseSystem,
        motion: &CurrentMotion,
        m: &Monitored,
        (t, start, end): (f64, &[f64], &[f64]),
    ) -> Result<f64, FieldError> {
        let Some(j) = m.surface() else {
            let seen = &self.seen;
            let noise = *self.exit_noise.get_or_insert_with(|| {
                4.0 * SURFACE_NOISE * seen.iter().fold(0.0_f64, |m, seen| m.max(seen.size()))
            });
            return Ok(noise);
        };
        let size = system
            .surface_size(j, t, end, &motion.signs)?
            .max(system.surface_size(j, t, start, &motion.signs)?);
        Ok(SURFACE_NOISE * size)
    }
}
