//! Instants of all kinds, on the way forward and back.

use smallvec::SmallVec;

use super::change::{matrices, Row};
use super::forms::Second;
use super::instant::{Instant, Lost, Passage};
use super::one_sided::{agree, OneSided};
use super::second::{SecondOrder, Timed};
use super::weights::Weights;
use crate::error::FieldError;
use crate::tolerances::AT_SIDE;
use crate::vectors::{dot, dot_magnitude};

/// The derivatives of an instant: of its time, and of the state behind it by the state before.
#[derive(Clone, Debug)]
pub struct InstantDerivative {
    /// The time.
    pub t: f64,
    /// The derivative of the time by each column; NaN where it is not known.
    pub dt: Vec<f64>,
    /// Its mixed second derivatives by every pair of columns (a, b) with b <= a, in order; empty if they were not followed or are
    /// not known.
    pub second_dt: Vec<f64>,
    /// The saltation matrix, n rows of n entries.
    pub saltation: Vec<f64>,
    /// What parameters add to their own columns, n rows of one entry for each of them.
    pub by_parameters: Vec<f64>,
    /// 1 / c with the cosine c = |dg . F| / (|dg| |F|) of the angle between motion and normal, F = (1, f) the motion before, in
    /// which time is measured by the span of the run and each state by rtol |x| + atol, both over rtol.
    pub condition: f64,
    /// Why the derivatives end here, if they do.
    pub lost: Option<Lost>,
    /// The derivatives by sides, where they differ.
    pub sides: Vec<OneSided>,
    /// At an impact without speed: by how much the state behind differs from the undisturbed motion, for each unit of the root of the
    /// depth that this would reach.
    pub square_root: Vec<f64>,
    /// Do actions put a changed state beside the surfaces slid on, to which it comes a little later?
    pub(super) arrives: bool,
}

impl InstantDerivative {
    /// An instant at this time, to be filled.
    fn new(t: f64) -> Self {
        InstantDerivative {
            t,
            dt: Vec::new(),
            second_dt: Vec::new(),
            saltation: Vec::new(),
            by_parameters: Vec::new(),
            condition: f64::NAN,
            lost: None,
            sides: Vec::new(),
            square_root: Vec::new(),
            arrives: false,
        }
    }

    /// An instant at this time of which nothing is known.
    pub(super) fn unknown(t: f64, n_columns: usize, (n, m): (usize, usize)) -> Self {
        InstantDerivative {
            dt: vec![f64::NAN; n_columns],
            saltation: vec![f64::NAN; n * n],
            by_parameters: vec![f64::NAN; n * m],
            ..InstantDerivative::new(t)
        }
    }
}

impl<'a> Instant<'_, 'a> {
    /// The derivatives of the instant, and the columns after it; one for each switch if different functions fix their times.
    pub(super) fn pass(
        &mut self,
        weights: &Weights,
        columns: &mut [Vec<f64>],
        second: &mut Option<Second>,
    ) -> Result<(Vec<InstantDerivative>, Option<Timed>), FieldError> {
        let (n, m) = (self.extended.n, self.extended.n_parameters());
        let mut condition = f64::NAN;
        let passages = match self.through(weights, &mut condition)? {
            Ok(passages) => passages,
            Err(lost) => {
                let t = self.record.t[0];
                let mut found = InstantDerivative::unknown(t, columns.len(), (n, m));
                (found.condition, found.lost) = (condition, Some(lost));
                self.add_sides(&mut found)?;
                return Ok((vec![found], None));
            }
        };
        let mixed = second.take();
        let mut timed = None;
        if let ([passage], Some(pairs)) = (&passages[..], mixed) {
            let mut order = self.second_order(&passage.time, passage.goes_on);
            if let Some((behind, own)) = order.pass(columns, &pairs)? {
                *second = Some(behind);
                timed = Some(own);
            }
        }
        let further = match passages.len() {
            1 => self.further_times()?,
            _ => SmallVec::new(),
        };
        let mut all = Vec::with_capacity(passages.len());
        for passage in &passages {
            let mut found = InstantDerivative::new(self.record.t[0]);
            found.condition = condition;
            if let Some(timed) = &timed {
                found.second_dt.clone_from(&timed.times);
            }
            let dt = columns
                .iter()
                .map(|column| common(&passage.time, &further, column));
            found.dt.extend(dt);
            let beside = passage.apply(n, columns);
            found.arrives = !beside.is_empty();
            if let (Some(second), Some(arrival)) = (&mut *second, passage.arrival()) {
                let z = self.extended.state(self.record.x[1]);
                let at = (self.record.t[1], &z[..]);
                second.arrive((self.after, arrival), at, columns, &beside)?;
            }
            (found.saltation, found.by_parameters) = matrices(&passage.changes, (n, m));
            let is_finite = columns.iter().flatten().all(|v| v.is_finite());
            found.lost = (!is_finite).then_some(Lost::NotFinite);
            for _ in 1..passage.n_recorded {
                all.push(found.clone());
            }
            all.push(found);
        }
        Ok((all, timed))
    }

    /// Up to second order, with the derivative of its time.
    pub(super) fn second_order<'o>(
        &'o mut self,
        time: &'o [f64],
        goes_on: bool,
    ) -> SecondOrder<'o, 'a> {
        SecondOrder {
            extended: self.extended,
            record: self.record,
            before: self.before,
            after: self.after,
            time,
            goes_on,
        }
    }

    /// Adds what is known of an instant without a derivative.
    fn add_sides(&mut self, found: &mut InstantDerivative) -> Result<(), FieldError> {
        let sizes = (self.extended.n, self.extended.n_parameters());
        let cones = match found.lost {
            Some(Lost::OneSided) => self.cones()?.unwrap_or_default(),
            Some(Lost::Grazing) => {
                found.square_root = self.square_root()?;
                self.touching()?
            }
            _ => Vec::new(),
        };
        found.sides = cones.iter().map(|cone| cone.matrices(sizes)).collect();
        Ok(())
    }

    /// What the instant does, whatever its kind, one after the other if different functions fix the times.
    pub(super) fn through(
        &mut self,
        weights: &Weights,
        condition: &mut f64,
    ) -> Result<Result<Vec<Passage>, Lost>, FieldError> {
        let sizes = (self.extended.n, self.extended.n_parameters());
        if let Some(found) = self.in_parts(weights, condition)? {
            return Ok(found);
        }
        let lost = match self.passage(weights, condition)? {
            Err(lost) => lost,
            Ok(found) => return Ok(Ok(vec![found])),
        };
        if lost == Lost::OneSided {
            if let Some(mut cones) = self.cones()?.filter(|cones| agree(cones, sizes)) {
                if let Ok(time) = self.time(weights, condition)? {
                    return Ok(Ok(vec![Passage {
                        time,
                        changes: cones.swap_remove(0).changes,
                        goes_on: false,
                        n_recorded: 0,
                        arrives: false,
                    }]));
                }
            }
        }
        // Where the field is the same on both sides of a surface, a touch changes nothing.
        if lost == Lost::Grazing && self.touching()?.len() == 1 {
            return Ok(Ok(vec![Passage {
                time: Row::from_elem(f64::NAN, sizes.0 + sizes.1),
                changes: SmallVec::new(),
                goes_on: true,
                n_recorded: 0,
                arrives: false,
            }]));
        }
        Ok(Err(lost))
    }
}

/// The derivative of a time by a column; NaN where the times of further guards that vanish there have others.
fn common(time: &Row, further: &[Row], column: &[f64]) -> f64 {
    let own = dot(time, column);
    let is_same = |other: &Row| {
        let terms = dot_magnitude(time, column).max(dot_magnitude(other, column));
        (dot(other, column) - own).abs() <= AT_SIDE * terms
    };
    match further.iter().all(is_same) {
        true => own,
        false => f64::NAN,
    }
}
