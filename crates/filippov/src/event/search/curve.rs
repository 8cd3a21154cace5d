//! A monitored function along the continuous extension of a step.

use crate::error::FieldError;
use crate::motion::Monitored;
use crate::motion::{Exits, ModeField};
use crate::stepper::Interpolant;
use crate::system::{PiecewiseSystem, Setting};

/// A monitored function along the continuous extension.
pub(crate) struct Curve<'a, 'b> {
    pub system: &'a dyn PiecewiseSystem,
    pub field: &'a mut ModeField<'b>,
    pub setting: Setting<'a>,
    pub interpolant: &'a Interpolant,
    /// The surfaces slid on are affine: the extension stays on them but for rounding.
    pub is_straight: bool,
    pub h: &'a mut [f64],
    pub x: &'a mut [f64],
    /// Exit functions already known along this step, by theta.
    pub exits: &'a mut Vec<(f64, Exits)>,
    pub n_evaluations: &'a mut u64,
}

impl Curve<'_, '_> {
    /// The value in the sense of the mode: positive inside.
    pub fn value(&mut self, m: &Monitored, theta: f64) -> Result<f64, FieldError> {
        let t = self.interpolant.t0 + theta * self.interpolant.dt;
        self.interpolant.at(theta, self.x);
        let Some(place) = m.exit() else {
            return self.surface(m, t);
        };
        let known = self.exits.iter().position(|(at, _)| *at == theta);
        let at = match known {
            Some(at) => at,
            None => {
                let exits = if self.is_straight {
                    self.field.exits_at(t, self.x)?
                } else {
                    self.field.exits(t, self.x)?
                };
                self.exits.push((theta, exits));
                self.exits.len() - 1
            }
        };
        Ok(self.exits[at].1.get(place).copied().unwrap_or(f64::NAN))
    }

    /// A switching function at the point in `x`, projected onto curved surfaces.
    fn surface(&mut self, m: &Monitored, t: f64) -> Result<f64, FieldError> {
        let Some(j) = m.surface() else {
            return Ok(f64::NAN);
        };
        if !self.is_straight {
            self.field.project(t, self.x)?;
        }
        *self.n_evaluations += 1;
        self.system.surfaces(&self.setting.at(t, self.x), self.h)?;
        Ok(m.orientation * self.h[j])
    }
}

/// Does the function turn back within rounding of zero just beyond `theta`? Then it touches, and two
/// crossings a rounding error deep would be invented. Returns the turning point.
pub(crate) fn grazes(
    g: &mut dyn FnMut(f64) -> Result<f64, FieldError>,
    theta: f64,
    from: f64,
    to: f64,
    noise: f64,
) -> Result<Option<f64>, FieldError> {
    let d = 1e-3;
    if theta - d < from || theta + d > to {
        return Ok(None);
    }
    let (below, above, here) = (g(theta - d)?, g(theta + d)?, g(theta)?);
    let slope = (above - below) / (2.0 * d);
    let curvature = (above - 2.0 * here + below) / (d * d);
    let depth = slope * slope / (2.0 * curvature);
    let vertex = theta - slope / curvature;
    // Away from its three points the parabola says nothing.
    let turns = curvature > 0.0 && depth <= noise && (vertex - theta).abs() <= d;
    Ok(turns.then_some(vertex))
}
