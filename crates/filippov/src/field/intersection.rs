//! The sliding field on an intersection of surfaces.

use super::{MeetingFields, Projector, SmoothField};
use crate::error::FieldError;
use crate::switching::codim2::Bilinear;
use crate::switching::{least_multipliers, newton, stable_roots, Matrix, NormalFields};
use crate::system::PiecewiseSystem;

/// What ends sliding on an intersection of m surfaces: functions that are positive until then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntersectionExit {
    /// A multiplier reaches -1 or +1: 1 + lambda_i and 1 - lambda_i, i counted within the set.
    Side {
        /// Which multiplier.
        position: usize,
        /// The end, -1 or +1.
        end: i8,
    },
    /// Two roots meet: (-1)^m det G, for two surfaces the discriminant.
    Fold,
    /// No scaling of the surfaces makes the root stable any longer: -min(G11, G22), or the last Hurwitz
    /// determinant.
    Stability,
}

impl IntersectionExit {
    /// Exit function `index` of sliding on m surfaces.
    pub fn of(index: usize, m: usize) -> Self {
        match index {
            _ if index < 2 * m => IntersectionExit::Side {
                position: index / 2,
                end: if index.is_multiple_of(2) { -1 } else { 1 },
            },
            _ if index == 2 * m => IntersectionExit::Fold,
            _ => IntersectionExit::Stability,
        }
    }
}

/// Filippov's field on an intersection of m >= 2 surfaces: the multilinear combination ("canopy") of the
/// 2^m fields with the multipliers lambda in [-1, 1]^m that make it tangent to all surfaces,
///
///   f_s = sum over k of prod_i (1 + k_i lambda_i)/2 * f^k,   grad h_j . f_s + d_t h_j = 0,
///
/// evaluated at the projection of the point onto the intersection. For two surfaces lambda is the root with
/// det G > 0 in closed form; for more it is tracked by Newton's method.
///
/// Reference: Guglielmi, Hairer (2022), sections 2 and 4; `docs/theory/intersections.md`.
pub struct IntersectionField<'a> {
    system: &'a dyn PiecewiseSystem,
    signs: Vec<f64>,
    corners: MeetingFields,
    weights: Vec<f64>,
    lambda: Vec<f64>,
    exits: Vec<f64>,
    projector: Projector,
    n_evaluations: u64,
}

impl<'a> IntersectionField<'a> {
    /// Sliding on the surfaces of `set`, the others with the given signs; the multipliers are tracked from
    /// `lambda`, or found anew if that is empty.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        set: &[usize],
        signs: &[f64],
        lambda: &[f64],
    ) -> Self {
        IntersectionField {
            system,
            signs: signs.to_vec(),
            corners: MeetingFields::new(system, set),
            weights: vec![0.0; 1 << set.len()],
            lambda: lambda.to_vec(),
            exits: vec![f64::NAN; Self::n_exits_of(set.len())],
            projector: Projector::new(system.n_states(), system.n_surfaces()),
            n_evaluations: 0,
        }
    }

    /// The surfaces slid on.
    pub fn set(&self) -> &[usize] {
        self.corners.set()
    }

    /// Number of functions that end the motion.
    pub fn n_exits(&self) -> usize {
        self.exits.len()
    }

    fn n_exits_of(m: usize) -> usize {
        2 * m + 2
    }

    /// What exit function `index` is.
    pub fn exit(&self, index: usize) -> IntersectionExit {
        IntersectionExit::of(index, self.set().len())
    }

    /// The multipliers at the last evaluation, in the order of the set.
    pub fn multipliers(&self) -> &[f64] {
        &self.lambda
    }

    /// The exit functions at the last evaluation.
    pub fn exits(&self) -> &[f64] {
        &self.exits
    }

    /// The fields around the intersection at the last evaluation.
    pub fn corners(&self) -> &MeetingFields {
        &self.corners
    }

    /// Moves `x` onto the intersection.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        self.projector
            .project_onto(self.system, self.corners.set(), t, x, &self.signs)
    }

    /// Evaluates multipliers and exit functions at (t, x), after projection. Where there is no root they are
    /// NaN.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn solve(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        self.project(t, x)?;
        self.n_evaluations += self.corners.evaluate(self.system, t, x, &self.signs)?;
        let Ok(fields) = self.corners.normal_fields() else {
            self.lose_root();
            return Ok(());
        };
        let telling = self.corners.telling();
        let found = if telling.len() < fields.m() {
            self.solve_telling(&fields, &telling)
        } else if fields.m() == 2 {
            self.solve_two(&fields)
        } else {
            self.solve_many(&fields)
        };
        if found.is_none() {
            self.lose_root();
        }
        Ok(())
    }

    fn lose_root(&mut self) {
        self.exits.fill(f64::NAN);
        self.lambda.clear();
    }

    /// Two surfaces: the root with det G > 0 in closed form, extended slightly beyond a fold.
    fn solve_two(&mut self, fields: &NormalFields) -> Option<()> {
        let canopy = Bilinear::of_fields(fields);
        let lambda = canopy.extended_root()?;
        let jacobian = canopy.jacobian(lambda);
        self.lambda.clear();
        self.lambda.extend(lambda);
        let sizes = [fields.row_size(0), fields.row_size(1)];
        let stability = -(jacobian[0][0] / sizes[0]).min(jacobian[1][1] / sizes[1]);
        self.fill_exits(canopy.discriminant(), stability);
        Some(())
    }

    /// More surfaces: Newton's method from the last multipliers; at the start from the only stable root.
    fn solve_many(&mut self, fields: &NormalFields) -> Option<()> {
        if self.lambda.len() != fields.m() {
            self.lambda = stable_roots(fields).into_iter().next()?;
        }
        self.lambda = newton(fields, &self.lambda)?;
        let mut jacobian = fields.jacobian(&self.lambda);
        normalise(&mut jacobian, fields);
        let sign = if fields.m().is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        self.fill_exits(
            sign * jacobian.determinant(),
            jacobian.last_hurwitz_determinant(),
        );
        Some(())
    }

    /// Sliding of higher order: some equations hold for all multipliers, and only their ends end the motion.
    fn solve_telling(&mut self, fields: &NormalFields, telling: &[usize]) -> Option<()> {
        self.lambda = least_multipliers(fields, telling)?;
        self.fill_exits(1.0, 1.0);
        Some(())
    }

    fn fill_exits(&mut self, fold: f64, stability: f64) {
        for (pair, lambda) in self.exits.chunks_exact_mut(2).zip(&self.lambda) {
            (pair[0], pair[1]) = (1.0 + lambda, 1.0 - lambda);
        }
        let m = self.lambda.len();
        (self.exits[2 * m], self.exits[2 * m + 1]) = (fold, stability);
    }
}

/// Divides every row by the size of its normal components, so that the scaling of a surface does not matter.
fn normalise(jacobian: &mut Matrix, fields: &NormalFields) {
    for i in 0..fields.m() {
        let size = fields.row_size(i);
        for j in 0..fields.m() {
            jacobian[(i, j)] /= size;
        }
    }
}

impl SmoothField for IntersectionField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.solve(t, x)?;
        if self.lambda.is_empty() {
            dx.fill(f64::NAN);
            return Ok(());
        }
        for (pattern, weight) in self.weights.iter_mut().enumerate() {
            let factors = self.lambda.iter().enumerate();
            *weight = factors.fold(1.0, |product, (i, lambda)| {
                let sign = if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
                product * 0.5 * (1.0 + sign * lambda)
            });
        }
        self.corners.combine(&self.weights, dx);
        Ok(())
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}
