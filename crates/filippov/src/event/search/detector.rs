//! What the event stage keeps of a step: values of the monitored functions, and what was found out about them.

use std::cell::RefCell;

use super::bounds::{Piece, RootPiece};
use crate::error::FieldError;
use crate::event::Multiple;
use crate::motion::{Exits, Guard, Monitored, Run};
use crate::tolerances::ROUNDING;

/// A function is clear of a zero that was divided out beyond this multiple of its rounding.
pub(super) const CLEAR_OF_NOISE: f64 = 1e3;

/// One of so many surfaces is evaluated by itself, more are evaluated with all others, for which the program is shorter.
const FEW_OF_ALL: usize = 4;

/// Scratch space of the event stage, and values of what is monitored.
#[derive(Clone)]
pub(crate) struct Detector {
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
    /// Rounding of the exit functions in this step, once it was needed: of those of multipliers, and of those of their root.
    pub(super) exit_noise: [Option<f64>; 2],
}

impl Detector {
    pub fn new(n: usize, d: usize) -> Self {
        Detector {
            exits: Vec::new(),
            h: vec![0.0; d],
            probed: Default::default(),
            is_probed: false,
            rate: vec![0.0; d],
            x: vec![0.0; n],
            margin: Vec::new(),
            enclosed_exits: RefCell::default(),
            enclosed_roots: RefCell::default(),
            right: Vec::new(),
            exit_noise: [None; 2],
        }
    }

    /// Forgets what is known of the last step.
    pub fn forget_step(&mut self) {
        self.exits.clear();
        self.enclosed_exits.get_mut().clear();
        self.enclosed_roots.get_mut().clear();
        self.margin.clear();
        self.exit_noise = [None; 2];
        self.is_probed = false;
    }

    /// Values and rates of the monitored functions at (t, x) with velocity `v`, into `right`.
    pub fn measure(
        &mut self,
        run: &Run,
        (t, x, v): (f64, &[f64], &[f64]),
    ) -> Result<(), FieldError> {
        let (system, motion) = (run.system, &run.motion);
        if motion.asleep.has_any() {
            self.measure_awake(run, (t, x, v))?;
        } else if motion.monitored.iter().any(|m| m.guard.is_surface()) {
            let place = motion.setting().at(t, x);
            system.surface_rates(&place, v, &mut self.h, &mut self.rate)?;
        }
        self.right.clear();
        for m in &motion.monitored {
            self.right.push(match m.surface() {
                Some(j) => (m.orientation * self.h[j], m.orientation * self.rate[j]),
                None => (run.seen[m.place].end, f64::NAN),
            });
        }
        Ok(())
    }

    /// The switching functions that are monitored where others are asleep: each by itself, if they are few.
    #[cold]
    #[inline(never)]
    fn measure_awake(
        &mut self,
        run: &Run,
        (t, x, v): (f64, &[f64], &[f64]),
    ) -> Result<(), FieldError> {
        let (system, motion) = (run.system, &run.motion);
        let place = motion.setting().at(t, x);
        let awake = motion.monitored.iter().filter_map(Monitored::surface);
        if FEW_OF_ALL * awake.clone().count() > self.h.len() {
            return system.surface_rates(&place, v, &mut self.h, &mut self.rate);
        }
        for j in awake {
            (self.h[j], self.rate[j]) = system.surface_rate(j, &place, v)?;
        }
        Ok(())
    }

    /// Makes the values at the end of the step those at the start of the next one. Returns whether a
    /// surface that the motion departed from is now clear.
    pub fn accept(&mut self, run: &mut Run, dt: f64) -> bool {
        run.seen.iter_mut().for_each(|seen| seen.start = seen.end);
        let mut cleared = false;
        for (m, &(value, rate)) in run.motion.monitored.iter_mut().zip(&self.right) {
            // Of a root that began at the start of the step nothing is known.
            let curvature = (rate - m.rate) / dt;
            m.curvature = if curvature.is_finite() {
                curvature
            } else {
                0.0
            };
            (m.value, m.rate) = (value, rate);
            // A zero that rounding still blurs stays divided out.
            if m.deflation.is_some() && value > CLEAR_OF_NOISE * m.noise {
                m.deflation = None;
                cleared = true;
            }
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
        run: &Run,
        m: &Monitored,
        end: &[f64],
    ) -> Result<f64, FieldError> {
        let Some(j) = m.surface() else {
            let is_of_root = |m: &Monitored| matches!(m.guard, Guard::Root(_));
            let of_root = is_of_root(m);
            let noise = *self.exit_noise[usize::from(of_root)].get_or_insert_with(|| {
                let exits = run.motion.monitored.iter();
                let alike = exits.filter(|m| m.surface().is_none() && is_of_root(m) == of_root);
                let sizes = alike.map(|m| run.seen[m.place].size());
                4.0 * ROUNDING * sizes.fold(0.0_f64, f64::max)
            });
            return Ok(noise);
        };
        let setting = run.motion.setting();
        let size = |x| run.system.surface_size(j, &setting.at(run.t, x));
        let size = size(end)?.max(size(&run.x)?);
        Ok(ROUNDING * size)
    }
}
