//! Surfaces of higher relative degree where surfaces vanish: a motion crosses such a surface while the rate at which both fields
//! cross it is not zero. Where the rate vanishes too, the decision is one of the reduced system.

use smallvec::SmallVec;

use super::point::{Decided, Left, Notes, Point};
use super::rule::{How, Meeting};
use crate::error::FieldError;
use crate::mode::Mode;
use crate::motion::{Leading, Level};
use crate::switching::Arrival as SurfaceArrival;
use crate::system::{BothSides, PiecewiseSystem, Place};
use crate::tolerances::{DOUBTFUL, ERRORS_OF_STEPS, ROUNDING};

/// Does a reduced system jump at a point of a surface, or is its rate reduced once more?
fn jumps(system: &dyn PiecewiseSystem, j: usize, place: &Place<'_>) -> Result<bool, FieldError> {
    let mut sides = BothSides::new(place.x.len(), place.signs.len());
    system.both_sides(j, place, &mut sides)?;
    let (minus, plus) = (sides.normal_minus, sides.normal_plus);
    let is_clear = (minus - plus).abs() > DOUBTFUL * (minus.abs() + plus.abs());
    Ok(is_clear || system.reduced(&[j]).is_some())
}

/// What is left of a meeting.
pub(super) struct Reduced<'a> {
    /// The system in which the surfaces that are left meet: the rates of those of higher degree are in their place.
    pub system: &'a dyn PiecewiseSystem,
    /// The point, moved onto these surfaces.
    pub x: Vec<f64>,
    /// The mode before, on the other side of the surfaces that the motion crosses.
    pub mode: Mode,
    /// The surfaces that are left, in increasing order.
    pub surfaces: Vec<usize>,
    /// Those among them that were reached now.
    pub fresh: Vec<usize>,
    pub how: How,
    /// The surfaces crossed, with the first derivative of h that does not vanish.
    crossed: SmallVec<[Left; 1]>,
    /// How many derivatives of h vanish at each surface that is left.
    orders: Vec<usize>,
}

impl<'a> Reduced<'a> {
    /// What is left of a meeting with surfaces of higher degree; `None` if it has none, if a rate is not finite, if one that vanishes
    /// does not jump at this point, or if a surface is crossed and signs are nested.
    pub fn of(
        at: &Point<'_, '_, 'a>,
        notes: &mut Notes,
        meeting: &Meeting,
    ) -> Result<Option<Self>, FieldError> {
        let signs = meeting.mode.signs();
        let mut left = Reduced {
            system: at.system,
            x: at.x.to_vec(),
            mode: meeting.mode.clone(),
            surfaces: meeting.surfaces.to_vec(),
            fresh: meeting.fresh.to_vec(),
            how: meeting.how,
            crossed: SmallVec::new(),
            orders: vec![0; signs.len()],
        };
        let mut projector = at.projector();
        let mut h = vec![0.0; signs.len()];
        let mut order = 0;
        let mut levels: SmallVec<[(&dyn PiecewiseSystem, Vec<usize>); 3]> = SmallVec::new();
        while let Some(next) = left.system.reduced(&left.surfaces) {
            order += 1;
            let (setting, system) = (at.setting(&signs), left.system);
            levels.push((system, left.surfaces.clone()));
            let all: SmallVec<[Level<'_>; 3]> = levels
                .iter()
                .map(|(system, set)| (*system, &set[..]))
                .collect();
            projector.project_onto_levels(&all, at.t, &mut left.x, setting)?;
            let place = at.place_at(at.t, &left.x, &signs);
            next.surfaces(&place, &mut h)?;
            notes.n_surface_evaluations += 1;
            let mut crossed: SmallVec<[Left; 1]> = SmallVec::new();
            for &j in &left.surfaces {
                if system.reduced(&[j]).is_none() {
                    continue;
                }
                let (value, noise) = (h[j], ROUNDING * next.surface_size(j, &place)?);
                if !value.is_finite() {
                    return Ok(None);
                }
                // Sliding keeps the rate to errors of steps. What acts on the motion may have changed it.
                let mut is_kept = at.arrival.sliding.contains(&j);
                if is_kept && value.abs() > noise {
                    let error = next.tolerance(j, &place, at.scale)?;
                    is_kept = value.abs() <= ERRORS_OF_STEPS * error;
                }
                if value.abs() <= noise && !jumps(next, j, &place)? {
                    return Ok(None);
                }
                if value.abs() > noise && !is_kept {
                    crossed.push(Left::beside(j, Leading { order, value }));
                } else {
                    left.orders[j] = order;
                }
            }
            if crossed.is_empty() {
                left.system = next;
                continue;
            }
            if at.system.has_nested_signs() {
                // Other functions may jump with the sign that changes.
                return Ok(None);
            }
            order -= 1;
            left.cross(crossed);
        }
        Ok((order > 0 || !left.crossed.is_empty()).then_some(left))
    }

    /// Takes away surfaces that the motion crosses.
    fn cross(&mut self, crossed: SmallVec<[Left; 1]>) {
        for left in &crossed {
            let Some(j) = left.surface() else { continue };
            self.mode.set(j, left.leading.sign());
            self.surfaces.retain(|k| *k != j);
            self.fresh.retain(|k| *k != j);
        }
        self.how = How::Start(match self.surfaces[..] {
            [j] => SurfaceArrival::from_side(self.mode.entries()[j]),
            _ => SurfaceArrival::Start,
        });
        self.crossed.extend(crossed);
    }

    /// The meeting that is left.
    pub fn meeting(&self) -> Meeting<'_> {
        Meeting::new(&self.mode, &self.surfaces, &self.fresh, self.how)
    }

    /// What was decided there as a decision of the system itself.
    pub fn lifted(self, decided: Decided) -> Decided {
        decided.map(|mut next| {
            for left in &mut next.left {
                if let Some(j) = left.surface().filter(|_| left.leading.order > 0) {
                    left.leading.order += self.orders[j];
                }
            }
            next.left.extend(self.crossed);
            if self.orders.iter().any(|&order| order > 0) {
                next.start_mut().moved.get_or_insert(self.x);
            }
            next
        })
    }
}
