//! The derivative of the state at any time of a run.

use super::extended::Extended;
use super::piece::{Piece, Surroundings};
use super::tangents::{Column, Derivatives};
use crate::error::FieldError;
use crate::motion::Law;
use crate::options::Options;
use crate::record::{Side, Solution};
use crate::system::PiecewiseSystem;

impl Derivatives {
    /// The derivative of the state at a time, a column of n states after the other, found from that at the last step before;
    /// `None` outside of the run, or if its continuous extension was not kept.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn at(
        &self,
        (extended, kinds): (&Extended<'_>, &[Column]),
        (system, options): (&dyn PiecewiseSystem, &Options),
        solution: &Solution,
        (t, side): (f64, Side),
    ) -> Result<Option<Vec<f64>>, FieldError> {
        let (n, size) = (extended.n, extended.n * kinds.len());
        let is_known = |&known: &f64| match side {
            Side::Left => known < t,
            Side::Right => known <= t,
        };
        let next = self.t.partition_point(is_known);
        if side == Side::Left && self.t.get(next) == Some(&t) {
            return Ok(Some(self.values[next * size..][..size].to_vec()));
        }
        let Some(index) = next.checked_sub(1) else {
            return Ok(None);
        };
        let known = &self.values[index * size..][..size];
        if self.t[index] == t {
            return Ok(Some(known.to_vec()));
        }
        let Some(segment) = solution.segment_at(t, side).filter(|_| solution.is_dense()) else {
            return Ok(None);
        };
        let columns = kinds.iter().zip(known.chunks_exact(n));
        let mut columns: Vec<Vec<f64>> = columns
            .map(|(kind, states)| extended.column(*kind, states))
            .collect();
        let impacts = extended.impacts();
        let mut around = Surroundings {
            extended,
            impacts: &impacts,
            law: Law::from(options),
            sides: impacts.sides_at_start(system.n_surfaces()).collect(),
        };
        let earlier = solution
            .segments
            .iter()
            .take_while(|s| s.t_start <= segment.t_start);
        earlier.for_each(|earlier| around.take_sides(&earlier.mode));
        let mut piece = Piece::new(&around, &segment.mode, &segment.discrete);
        let path = |t: f64, x: &mut [f64]| match solution.evaluate(system, t, side, x)? {
            Some(_) => Ok(()),
            None => {
                x.fill(f64::NAN);
                Ok(())
            }
        };
        piece.advance(path, (self.t[index], t), &mut columns)?;
        let mut x = vec![0.0; n];
        solution.evaluate(system, t, side, &mut x)?;
        piece.project(t, &extended.state(&x), &mut columns)?;
        Ok(Some(
            columns
                .into_iter()
                .flat_map(|column| column.into_iter().take(n))
                .collect(),
        ))
    }
}
