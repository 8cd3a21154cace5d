//! The law of sliding on a few surfaces: the multilinear combination of all fields around them.

use super::MeetingFields;
use crate::cube::Bilinear;
use crate::cube::{
    least_multipliers, newton, scaling_margin, stability_margins, stable_roots_within, Matrix,
    NormalFields,
};
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::patience::Patience;
use crate::system::{PiecewiseSystem, Place};
use crate::tolerances::TRACKED_CHANGE;

/// The canopy of the 2^m fields around an intersection, and the root that the motion follows.
#[derive(Clone)]
pub struct Canopy {
    fields: MeetingFields,
    weights: Vec<f64>,
    /// The surfaces, counted within the set, whose equations said anything since the motion began.
    telling: Vec<usize>,
    /// The scaling of the surfaces, for the stability of the root of three and more.
    kappa: Vec<f64>,
}

impl Canopy {
    /// Room for the fields around the surfaces of `set`, scaled by `kappa`.
    pub fn new(system: &dyn PiecewiseSystem, set: &[usize], kappa: &[f64]) -> Self {
        Canopy {
            fields: MeetingFields::new(system, set),
            weights: Vec::new(),
            telling: Vec::new(),
            kappa: kappa.to_vec(),
        }
    }

    /// Evaluates all fields at a point of the intersection. Returns the number of evaluations.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn evaluate(
        &mut self,
        system: &dyn PiecewiseSystem,
        place: &Place<'_>,
        units: Units<'_>,
    ) -> Result<u64, FieldError> {
        self.fields.evaluate(system, place, units)
    }

    /// Are all fields finite that were evaluated last?
    pub fn is_finite(&self) -> bool {
        self.fields.normal_fields().is_ok()
    }

    /// The surfaces whose equations say anything. One that did once does so for the rest of the motion: where its normal
    /// components vanish at an instant, it is not tangent to all fields, but about to lose what holds the motion there.
    fn telling(&mut self) -> Vec<usize> {
        for row in self.fields.telling() {
            if !self.telling.contains(&row) {
                self.telling.push(row);
            }
        }
        self.telling.sort_unstable();
        self.telling.clone()
    }

    /// Finds the multipliers that continue the first of those in `tracked` that can be continued, and writes the field. Returns the
    /// multipliers with the exit functions of the root ([`RootWatch`]); `None` if there is no root.
    pub(super) fn solve(
        &mut self,
        tracked: &[&[f64]],
        watch: &mut RootWatch,
        dx: &mut [f64],
        patience: Patience,
    ) -> Option<(Vec<f64>, [f64; 2])> {
        let fields = self.fields.normal_fields().ok()?;
        let telling = self.telling();
        let (lambda, ends) = if telling.len() < fields.m() {
            // Sliding of higher order: some equations hold for all multipliers. The exit functions of the root are 1 here,
            // so that only those of the multipliers can vanish.
            (least_multipliers(&fields, &telling)?, [1.0, 1.0])
        } else if fields.m() == 2 {
            solve_two(&fields)?
        } else {
            let lambda = solve_many(&fields, tracked, patience)?;
            let jacobian = (fields.jacobian(&lambda), fields.groups().len() > 1);
            let ends = watch.ends((&jacobian.0, jacobian.1), &self.kappa);
            // Beyond a fold Newton's method may find the other root, which is never followed.
            (ends[0] > 0.0).then_some((lambda, ends))?
        };
        self.fields.fill_product_weights(&lambda, &mut self.weights);
        self.fields.combine(&self.weights, dx);
        Some((lambda, ends))
    }
}

/// Two surfaces: the root with det G > 0 in closed form, extended slightly beyond a fold.
fn solve_two(fields: &NormalFields) -> Option<(Vec<f64>, [f64; 2])> {
    let canopy = Bilinear::of_fields(fields);
    let root = canopy.extended_root()?;
    let jacobian = canopy.jacobian(root);
    let sizes = [fields.row_size(0), fields.row_size(1)];
    let stability = -(jacobian[0][0] / sizes[0]).min(jacobian[1][1] / sizes[1]);
    let fold = canopy.discriminant() / (sizes[0] * sizes[1]).powi(2);
    Some((root.to_vec(), [fold, stability]))
}

/// More surfaces: Newton's method from the last multipliers; at the start from the only stable root.
fn solve_many(fields: &NormalFields, tracked: &[&[f64]], patience: Patience) -> Option<Vec<f64>> {
    let mut known = tracked
        .iter()
        .filter(|last| last.len() == fields.m())
        .peekable();
    if known.peek().is_none() {
        let root = stable_roots_within(fields, patience).into_iter().next()?;
        return newton(fields, &root);
    }
    known.find_map(|last| newton(fields, last).filter(|root| is_continued(fields, last, root)))
}

/// Is it the root that the last multipliers belong to? Between them G changes by less than itself, so that there is no
/// other one: |1 - G(last)^-1 G(root)| is below [`TRACKED_CHANGE`].
fn is_continued(fields: &NormalFields, last: &[f64], root: &[f64]) -> bool {
    let Some(inverse) = fields.jacobian(last).inverse() else {
        return false;
    };
    let (product, m) = (inverse.times(&fields.jacobian(root)), last.len());
    let deviation = |i: usize, j: usize| {
        let unit = if i == j { 1.0 } else { 0.0 };
        (unit - product[(i, j)]).abs()
    };
    (0..m).all(|i| (0..m).map(|j| deviation(i, j)).sum::<f64>() < TRACKED_CHANGE)
}

/// What tells when the root of three and more surfaces ends, from its matrices G along a motion.
#[derive(Clone, Debug, Default)]
pub(super) struct RootWatch {
    /// Where the motion begins at a root that is not stable for its scaling, the regularised motion oscillates around it; none as long
    /// as it is not known.
    pub oscillates: Option<bool>,
    /// The unit of G at the start of the motion: products of many entries are beside multipliers of size 1.
    unit: Option<f64>,
}

impl RootWatch {
    /// The watch of a motion that begins.
    pub fn new(oscillates: bool) -> Self {
        RootWatch {
            oscillates: oscillates.then_some(true),
            unit: None,
        }
    }

    /// The factor that makes G of size 1 at the start, from its size now.
    pub fn unit(&mut self, size: f64) -> f64 {
        *self.unit.get_or_insert(1.0 / size.max(f64::MIN_POSITIVE))
    }

    /// The exit functions of a root with this matrix G: that two roots meet, and that it is no longer stable with the surfaces scaled
    /// by `kappa` ([`stability_margins`]). If the motion oscillates around it the second function ends it where the root is not
    /// stable for any scaling.
    pub fn ends(&mut self, (jacobian, in_parts): (&Matrix, bool), kappa: &[f64]) -> [f64; 2] {
        let unit = self.unit(jacobian.with_rows_scaled(kappa).size());
        let factors: Vec<f64> = kappa.iter().map(|factor| factor * unit).collect();
        let [fold, stability] = stability_margins(&jacobian.with_rows_scaled(&factors), in_parts);
        if *self.oscillates.get_or_insert(stability <= 0.0) {
            let size =
                |i: usize| (0..kappa.len()).fold(0.0_f64, |s, j| s.max(jacobian[(i, j)].abs()));
            let units: Vec<f64> = (0..kappa.len()).map(|i| 1.0 / size(i)).collect();
            [
                fold,
                scaling_margin(&jacobian.with_rows_scaled(&units)).max(stability),
            ]
        } else {
            [fold, stability]
        }
    }
}
