//! Switching functions that contain signs of others: they may jump where those change.
//!
//! On the far side of a surface h_j = 0 the signs of such functions are others than on the near side, and with them the
//! field. If that field leads away from the surface, it is crossed. If it leads back, the motion would slide between two
//! fields that differ in several signs at once; the run ends there, and names the surfaces. A surface that only bends there,
//! as that of abs or maximum does, is slid on beyond if its field and its normal there allow it.

use super::integrator::Integrator;
use super::transition::{Decided, Left, Lefts};
use super::Stop;
use crate::error::FieldError;
use crate::mode::Mode;
use crate::switching::Undecided;
use crate::tolerances::SURFACE_NOISE;

impl Integrator<'_> {
    /// What follows where the surfaces `fresh` are reached and others jump; `None` if no other does.
    pub(super) fn decide_where_others_jump(
        &mut self,
        mode: &Mode,
        fresh: &[usize],
    ) -> Result<Option<Decided>, FieldError> {
        if !self.system.has_nested_signs() {
            return Ok(None);
        }
        let mut beyond = mode.clone();
        fresh
            .iter()
            .for_each(|&j| beyond.set(j, -mode.entries()[j]));
        let (jumped, landed) = self.let_others_jump(mode, &mut beyond, fresh)?;
        if jumped.is_empty() {
            return match fresh {
                [j] if self.bends_what_is_slid_on(mode, &beyond)? => {
                    Ok(self.leave_to(&beyond, *j, &landed)?.map(Ok))
                }
                _ => Ok(None),
            };
        }
        if let [j] = fresh {
            if let Some(decided) = self.leave_to(&beyond, *j, &landed)? {
                return Ok(Some(Ok(decided)));
            }
        }
        Ok(Some(Err(between(fresh, &jumped))))
    }

    /// The mode of a start on the surfaces `meeting`, as decided with the signs of `mode`; others may jump with it.
    pub(super) fn follow_jumps(
        &mut self,
        mode: &Mode,
        meeting: &[usize],
        decided: Decided,
    ) -> Result<Decided, FieldError> {
        let Ok((after, _)) = &decided else {
            return Ok(decided);
        };
        if meeting.is_empty() || !self.system.has_nested_signs() {
            return Ok(decided);
        }
        let mut beyond = after.clone();
        let (jumped, landed) = self.let_others_jump(mode, &mut beyond, meeting)?;
        if jumped.is_empty() {
            return Ok(decided);
        }
        if let [j] = meeting {
            let mut opposite = mode.with(*j, -after.entries()[*j]);
            let (_, on_opposite) = self.let_others_jump(mode, &mut opposite, meeting)?;
            for (mode, landed) in [(beyond, landed), (opposite, on_opposite)] {
                if mode.entries()[*j] != 0 {
                    if let Some(decided) = self.leave_to(&mode, *j, &landed)? {
                        return Ok(Ok(decided));
                    }
                }
            }
        }
        Ok(Err(between(meeting, &jumped)))
    }

    /// The motion that leaves h_j = 0 to its side in `mode`, if its field leads there. What it slides on besides, and
    /// what jumped to zero, is decided anew.
    fn leave_to(
        &mut self,
        mode: &Mode,
        j: usize,
        landed: &[usize],
    ) -> Result<Option<(Mode, Lefts)>, FieldError> {
        let mut sliding: Vec<usize> = mode.sliding_set().chain(landed.iter().copied()).collect();
        sliding.sort_unstable();
        sliding.dedup();
        let mut after = mode.clone();
        if !sliding.is_empty() {
            match self.place_on(mode.clone(), &sliding, Some(mode))? {
                Ok((placed, _)) => after = placed,
                Err(_) => return Ok(None),
            }
        }
        let leaving: Vec<usize> = sliding.into_iter().chain([j]).collect();
        let left = self.departures(&after, &leaving, &[])?;
        let leads_away = |l: &Left| match l {
            Left::Surface(j, leading) => leading.sign() == after.entries()[*j],
            Left::Exit(..) => true,
        };
        Ok(left.iter().all(leads_away).then_some((after, left)))
    }

    /// Has a surface that is slid on another normal in the second mode?
    fn bends_what_is_slid_on(&self, mode: &Mode, beyond: &Mode) -> Result<bool, FieldError> {
        let (mut near, mut far) = (vec![0.0; self.x.len()], vec![0.0; self.x.len()]);
        for &j in self.motion.sliding() {
            let (t, x) = (self.t, &self.x[..]);
            self.system.gradient(j, t, x, &mode.signs(), &mut near)?;
            self.system.gradient(j, t, x, &beyond.signs(), &mut far)?;
            if near != far {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Gives all surfaces that jump between two modes the side that they are on afterwards; returns which, and those
    /// of them that jump to zero, which keep their side.
    fn let_others_jump(
        &mut self,
        before: &Mode,
        after: &mut Mode,
        fresh: &[usize],
    ) -> Result<(Vec<usize>, Vec<usize>), FieldError> {
        let old = self.surface_values(&before.signs())?;
        let (mut jumped, mut landed) = (Vec::new(), Vec::new());
        // A jump may make others jump.
        for _ in 0..old.len() {
            let signs = after.signs();
            let new = self.surface_values(&signs)?;
            let mut is_final = true;
            landed.clear();
            for j in (0..new.len()).filter(|j| !fresh.contains(j)) {
                let size = self.system.surface_size(j, self.t, &self.x, &signs)?;
                let noise = SURFACE_NOISE * (size + old[j].abs() + new[j].abs());
                if (new[j] - old[j]).abs() <= noise {
                    continue;
                }
                let side = if new[j] < 0.0 { -1 } else { 1 };
                if new[j].abs() <= noise {
                    landed.push(j);
                } else if after.entries()[j] != side {
                    after.set(j, side);
                    jumped.push(j);
                    is_final = false;
                }
            }
            if is_final {
                break;
            }
        }
        jumped.extend(&landed);
        Ok((jumped, landed))
    }
}

/// Surfaces between whose sides the motion would slide while others jump.
fn between(meeting: &[usize], jumped: &[usize]) -> Stop {
    let mut surfaces: Vec<usize> = meeting.iter().chain(jumped).copied().collect();
    surfaces.sort_unstable();
    surfaces.dedup();
    Stop::Intersection {
        surfaces,
        candidates: Vec::new(),
        reason: Undecided::NoOutcome,
    }
}
