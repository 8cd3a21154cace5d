//! All fields that meet at an intersection, with their normal components.

use super::eval_on_side;
use crate::error::FieldError;
use crate::switching::{Matrix, NormalFields, Undecided};
use crate::system::{dot, PiecewiseSystem};
use crate::tolerances::TANGENT_TO_ALL;

/// The 2^m fields around an intersection of m surfaces, one after the other, and the gradients of the
/// switching functions. Pattern p has sign +1 at surface i of the set where bit i of p is set.
#[derive(Clone, Debug)]
pub struct MeetingFields {
    set: Vec<usize>,
    n: usize,
    fields: Vec<f64>,
    /// Normal components, `[pattern * m + i]`.
    components: Vec<f64>,
    gradients: Vec<f64>,
    time_derivatives: Vec<f64>,
    signs: Vec<f64>,
}

impl MeetingFields {
    /// Room for the fields around the surfaces of `set`.
    pub fn new(system: &dyn PiecewiseSystem, set: &[usize]) -> Self {
        let (n, m) = (system.n_states(), set.len());
        MeetingFields {
            set: set.to_vec(),
            n,
            fields: vec![0.0; n << m],
            components: vec![0.0; m << m],
            gradients: vec![0.0; n * m],
            time_derivatives: vec![0.0; m],
            signs: Vec::new(),
        }
    }

    /// The surfaces.
    pub fn set(&self) -> &[usize] {
        &self.set
    }

    /// Evaluates everything at a point; `signs` holds the sides of the other surfaces. Returns the number
    /// of evaluations of the right-hand side.
    ///
    /// # Errors
    /// If a function of the user raises.
    pub fn evaluate(
        &mut self,
        system: &dyn PiecewiseSystem,
        t: f64,
        x: &[f64],
        signs: &[f64],
    ) -> Result<u64, FieldError> {
        let (n, m) = (self.n, self.set.len());
        self.signs.clear();
        self.signs.extend_from_slice(signs);
        for (i, &j) in self.set.iter().enumerate() {
            let gradient = &mut self.gradients[i * n..(i + 1) * n];
            self.time_derivatives[i] = system.gradient(j, t, x, signs, gradient)?;
        }
        let mut evaluations = 0;
        for pattern in 0..1_usize << m {
            for (i, &j) in self.set.iter().enumerate() {
                self.signs[j] = if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
            }
            let field = &mut self.fields[pattern * n..(pattern + 1) * n];
            evaluations += eval_on_side(system, t, x, &self.signs, field)?;
            for i in 0..m {
                let gradient = &self.gradients[i * n..(i + 1) * n];
                self.components[pattern * m + i] = self.time_derivatives[i] + dot(gradient, field);
            }
        }
        for i in (0..m).filter(|&i| system.sticks_at(self.set[i])) {
            let ratio = system.stick_ratio(self.set[i], t, x, signs);
            stretch(&mut self.fields, 1 << i, n, ratio);
            stretch(&mut self.components, 1 << i, m, ratio);
        }
        Ok(evaluations)
    }

    /// The normal components as data for a decision.
    ///
    /// # Errors
    /// If one is not finite, or the surfaces are too many.
    pub fn normal_fields(&self) -> Result<NormalFields, Undecided> {
        NormalFields::new(self.set.len(), self.components.clone())
    }

    /// The normal components in units of the gradients: those along unit normals.
    ///
    /// # Errors
    /// As [`normal_fields`](Self::normal_fields).
    pub fn unit_normal_fields(&self) -> Result<NormalFields, Undecided> {
        let lengths = self.gradients.chunks_exact(self.n);
        let factors: Vec<f64> = lengths.map(|g| 1.0 / dot(g, g).sqrt()).collect();
        Ok(self.normal_fields()?.scaled(&factors))
    }

    /// The surfaces, counted within the set, whose equation says anything about the multipliers. To the others
    /// all fields are tangent, up to rounding.
    pub fn telling(&self) -> Vec<usize> {
        let m = self.set.len();
        let fastest = self
            .fields
            .chunks_exact(self.n)
            .map(|f| dot(f, f))
            .fold(0.0, f64::max);
        let is_telling = |&i: &usize| {
            let gradient = &self.gradients[i * self.n..(i + 1) * self.n];
            let size = (dot(gradient, gradient) * fastest).sqrt();
            let components = self.components.iter().skip(i).step_by(m);
            components.fold(0.0_f64, |largest, c| largest.max(c.abs())) > TANGENT_TO_ALL * size
        };
        (0..m).filter(is_telling).collect()
    }

    /// The field of one pattern.
    pub fn field(&self, pattern: usize) -> &[f64] {
        &self.fields[pattern * self.n..(pattern + 1) * self.n]
    }

    /// Writes the combination of the fields with these weights, one per pattern.
    pub fn combine(&self, weights: &[f64], dx: &mut [f64]) {
        dx.fill(0.0);
        for (weight, field) in weights.iter().zip(self.fields.chunks_exact(self.n)) {
            if *weight != 0.0 {
                dx.iter_mut()
                    .zip(field)
                    .for_each(|(dx, f)| *dx += weight * f);
            }
        }
    }

    /// Projects the combination `dx` with these weights onto the intersection: dx - N^T (N N^T)^-1 r with the
    /// gradients as the rows of N and r the normal components of the combination.
    pub fn make_tangent(&self, weights: &[f64], dx: &mut [f64]) {
        let m = self.set.len();
        let row = |i: usize| &self.gradients[i * self.n..(i + 1) * self.n];
        let mut gram = Matrix::zeros(m);
        for i in 0..m {
            for j in 0..m {
                gram[(i, j)] = dot(row(i), row(j));
            }
        }
        let component = |i: usize| {
            let components = self.components.iter().skip(i).step_by(m);
            weights.iter().zip(components).map(|(w, c)| w * c).sum()
        };
        let residuals: Vec<f64> = (0..m).map(component).collect();
        match gram.solve(&residuals) {
            Some(shifts) => {
                for (i, shift) in shifts.iter().enumerate() {
                    dx.iter_mut().zip(row(i)).for_each(|(v, g)| *v -= shift * g);
                }
            }
            None => dx.fill(f64::NAN),
        }
    }
}

/// Moves rows of `width` numbers, one per pattern, from the signs -1 and +1 of one surface to -ratio and +ratio; `bit` is
/// that of the surface in the pattern.
fn stretch(rows: &mut [f64], bit: usize, width: usize, ratio: f64) {
    let (near, far) = (0.5 * (1.0 + ratio), 0.5 * (1.0 - ratio));
    let patterns = rows.len() / width;
    for pattern in (0..patterns).filter(|pattern| pattern & bit == 0) {
        for k in 0..width {
            let (minus, plus) = (pattern * width + k, (pattern | bit) * width + k);
            let (a, b) = (rows[minus], rows[plus]);
            (rows[minus], rows[plus]) = (near * a + far * b, far * a + near * b);
        }
    }
}
