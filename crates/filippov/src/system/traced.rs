//! A system given by a traced expression graph.

use std::borrow::Cow;
use std::sync::Arc;

use filippov_expr::{Backend, Enclosure, ExprError, Graph, Interval, Motion, Names, NodeId};

use super::compiled::{CompiledGradient, GradientValues, Model};
use super::{AffineParts, AffineSigns, BothSides, LieValue, MotionJets, PiecewiseSystem, Word};
use crate::error::FieldError;
use crate::tolerances::{MAX_LIE_ORDER, TANGENT};

/// Up to that many states both sides of a surface are compiled into one program; the programs of
/// larger systems would take longer to compile than they save.
const FUSED_STATES: usize = 12;

/// Lie derivatives of up to that many terms, and their sum, are computed on the stack.
const MOST_TERMS: usize = 16;

/// A system whose field and switching functions are expressions: compiled, with exact derivatives.
///
/// Field, surfaces and rates are compiled once for all modes, the signs being data. Gradients and
/// Lie derivatives are built and compiled when they are first needed. Cloning is cheap and shares
/// everything.
#[derive(Clone)]
pub struct TracedSystem {
    model: Arc<Model>,
    parameters: Vec<f64>,
}

impl TracedSystem {
    /// A system with the given field; the switching functions are those of the graph.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn new(
        graph: Graph,
        field: Vec<NodeId>,
        parameters: Vec<f64>,
        names: Names,
        backend: Backend,
    ) -> Result<Self, ExprError> {
        let model = Model::new(graph, field, names, backend)?;
        Ok(TracedSystem {
            model: Arc::new(model),
            parameters,
        })
    }

    /// The same system with other parameter values.
    #[must_use]
    pub fn with_parameters(&self, parameters: Vec<f64>) -> Self {
        TracedSystem {
            model: Arc::clone(&self.model),
            parameters,
        }
    }

    /// The parameter values.
    pub fn parameters(&self) -> &[f64] {
        &self.parameters
    }

    /// The expression graph.
    pub fn graph(&self) -> &Graph {
        &self.model.graph
    }

    /// The nodes of the field.
    pub fn field_nodes(&self) -> &[NodeId] {
        &self.model.field
    }

    /// The names of states and parameters.
    pub fn names(&self) -> &Names {
        &self.model.names
    }

    /// Is the field native code, or interpreted?
    pub fn is_native(&self) -> bool {
        self.model.field_program.is_native()
    }
}

impl TracedSystem {
    /// The derivative of h_j in t, then those by the states that it depends on.
    fn gradient_values(
        &self,
        j: usize,
        t: f64,
        x: &[f64],
        signs: &[f64],
    ) -> (&CompiledGradient, Cow<'_, [f64]>) {
        let compiled = self.model.gradient(j);
        let values = match &compiled.values {
            GradientValues::Constant(values) => Cow::Borrowed(&values[..]),
            GradientValues::Computed(tiered) => {
                let program = tiered.program();
                let mut computed = vec![0.0; program.n_outputs()];
                program.eval(t, x, signs, &self.parameters, &[], &mut computed);
                Cow::Owned(computed)
            }
        };
        (compiled, values)
    }
}

impl PiecewiseSystem for TracedSystem {
    fn n_states(&self) -> usize {
        self.model.n_states
    }

    fn n_surfaces(&self) -> usize {
        self.model.affine.len()
    }

    #[inline]
    fn field(&self, t: f64, x: &[f64], signs: &[f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.model
            .field_program
            .eval(t, x, signs, &self.parameters, &[], dx);
        Ok(())
    }

    fn surfaces(&self, t: f64, x: &[f64], signs: &[f64], h: &mut [f64]) -> Result<(), FieldError> {
        self.model
            .surfaces_program
            .program()
            .eval(t, x, signs, &self.parameters, &[], h);
        Ok(())
    }

    fn surface_rates(
        &self,
        t: f64,
        x: &[f64],
        signs: &[f64],
        v: &[f64],
        h: &mut [f64],
        rate: &mut [f64],
    ) -> Result<(), FieldError> {
        let d = h.len();
        let program = self.model.rates();
        if d == 1 {
            let mut out = [0.0; 2];
            program.eval(t, x, signs, &self.parameters, v, &mut out);
            (h[0], rate[0]) = (out[0], out[1]);
        } else {
            let mut out = vec![0.0; 2 * d];
            program.eval(t, x, signs, &self.parameters, v, &mut out);
            h.copy_from_slice(&out[..d]);
            rate.copy_from_slice(&out[d..]);
        }
        Ok(())
    }

    fn gradient(
        &self,
        j: usize,
        t: f64,
        x: &[f64],
        signs: &[f64],
        gradient: &mut [f64],
    ) -> Result<f64, FieldError> {
        let (compiled, values) = self.gradient_values(j, t, x, signs);
        gradient.fill(0.0);
        for (&state, &value) in compiled.states.iter().zip(&values[1..]) {
            gradient[state] = value;
        }
        Ok(values[0])
    }

    fn gradient_products(
        &self,
        j: usize,
        (t, x): (f64, &[f64]),
        signs: &[f64],
        vectors: &[f64],
        products: &mut [f64],
    ) -> Result<f64, FieldError> {
        let (compiled, values) = self.gradient_values(j, t, x, signs);
        if let &[i] = &compiled.states[..] {
            let (slope, n) = (values[1], x.len());
            let vectors = &vectors[..n * products.len()];
            for (k, product) in products.iter_mut().enumerate() {
                *product = slope * vectors[k * n + i];
            }
            return Ok(values[0]);
        }
        for (product, vector) in products.iter_mut().zip(vectors.chunks_exact(x.len())) {
            let entries = compiled.states.iter().zip(&values[1..]);
            *product = entries.map(|(&i, value)| value * vector[i]).sum();
        }
        Ok(values[0])
    }

    fn surface_size(&self, j: usize, t: f64, x: &[f64], signs: &[f64]) -> Result<f64, FieldError> {
        let (compiled, values) = self.gradient_values(j, t, x, signs);
        let entries = compiled.states.iter().zip(&values[1..]);
        let size: f64 = entries.map(|(&i, value)| (value * x[i]).abs()).sum();
        Ok(size + (values[0] * t).abs())
    }

    fn both_sides(
        &self,
        j: usize,
        t: f64,
        x: &[f64],
        signs: &[f64],
        out: &mut BothSides,
    ) -> Result<u64, FieldError> {
        let n = self.model.n_states;
        if n > FUSED_STATES || out.meets_edges {
            return out.both_sides_by_parts(self, j, t, x, signs);
        }
        let program = self.model.both_sides(j);
        program.eval(t, x, signs, &self.parameters, &[], &mut out.outputs);
        let (head, rest) = out.outputs.split_at(2);
        (out.normal_minus, out.normal_plus) = (head[0], head[1]);
        out.f_minus.copy_from_slice(&rest[..n]);
        out.f_plus.copy_from_slice(&rest[n..]);
        // A field that is not finite on its surface is taken just inside of its region.
        let finite = rest.iter().all(|v| v.is_finite()) && out.is_finite();
        if finite {
            Ok(2)
        } else {
            out.both_sides_by_parts(self, j, t, x, signs)
        }
    }

    fn active(&self, signs: &[f64], sliding: &[usize], active: &mut [bool]) {
        self.model.active(signs, sliding, active);
    }

    fn is_affine(&self, j: usize) -> bool {
        self.model.affine[j]
    }

    fn enclose_surface(&self, j: usize, motion: &dyn Motion, signs: &[f64]) -> Option<Enclosure> {
        let mut out = [Enclosure::UNKNOWN];
        let program = self.model.enclosed_surface(j)?;
        program.eval(motion, signs, &self.parameters, &mut out);
        Some(out[0])
    }

    fn enclose_normal_components(
        &self,
        j: usize,
        motion: &dyn Motion,
        signs: &[f64],
    ) -> Option<[Enclosure; 2]> {
        let mut out = [Enclosure::UNKNOWN; 2];
        let program = self.model.enclosed_normal_components(j)?;
        program.eval(motion, signs, &self.parameters, &mut out);
        Some(out)
    }

    fn lie_derivative(
        &self,
        i: usize,
        j: usize,
        word: Word,
        t: f64,
        x: &[f64],
        signs: &[f64],
    ) -> Result<LieValue, FieldError> {
        let lie = self.model.lie_derivative(i, j, word);
        let mut small = [0.0; MOST_TERMS];
        let mut large = Vec::new();
        let program = lie.program.program();
        let count = program.n_outputs();
        let out = if count <= small.len() {
            &mut small[..count]
        } else {
            large.resize(count, 0.0);
            &mut large[..]
        };
        program.eval(t, x, signs, &self.parameters, &[], out);
        Ok(LieValue {
            value: out[0],
            magnitude: out[1..].iter().map(|v| v.abs()).sum(),
        })
    }

    fn first_lie_derivatives(
        &self,
        j: usize,
        t: f64,
        x: &[f64],
        signs: &[f64],
    ) -> Option<[LieValue; 2]> {
        let program = self.model.first_lie_derivatives(j);
        let mut values = [0.0; 2 * MOST_TERMS];
        let out = values.get_mut(..program.n_outputs())?;
        program.eval(t, x, signs, &self.parameters, &[], out);
        let (minus, plus) = out.split_at(out.len() / 2);
        Some([minus, plus].map(|side| LieValue {
            value: side[0],
            magnitude: side[1..].iter().map(|v| v.abs()).sum(),
        }))
    }

    fn lie_tolerance(&self, _order: usize) -> f64 {
        TANGENT
    }

    fn max_lie_order(&self) -> usize {
        MAX_LIE_ORDER
    }

    fn affine_signs(&self) -> Option<&dyn AffineSigns> {
        Some(self)
    }

    fn is_analytic(&self) -> bool {
        self.model.is_analytic
    }

    fn motion_jets(&self, sliding: &[usize], order: usize) -> Option<Arc<MotionJets>> {
        self.model.motion_jets(sliding, order)
    }

    fn eval_jets(&self, jets: &MotionJets, t: f64, x: &[f64], signs: &[f64], out: &mut [f64]) {
        jets.eval(t, x, signs, &self.parameters, out);
    }

    fn surface_name(&self, j: usize) -> String {
        self.model
            .graph
            .text(self.model.graph.surface(j as u32), &self.model.names)
    }
}

impl AffineSigns for TracedSystem {
    fn affine_parts(&self, surfaces: &[usize]) -> Option<AffineParts> {
        self.model.affine_signs().parts(surfaces)
    }

    fn fill_affine_parts(
        &self,
        t: f64,
        x: &[f64],
        signs: &[f64],
        parts: &mut AffineParts,
    ) -> Result<u64, FieldError> {
        let compiled = self.model.affine_signs();
        compiled.fill(t, x, signs, &self.parameters, parts);
        Ok(1)
    }

    fn is_steady(&self, j: usize) -> bool {
        self.model.affine_signs().is_steady(j)
    }

    fn enclose_rate(&self, j: usize, motion: &dyn Motion, signs: &[f64]) -> Option<Interval> {
        let model = self.model.affine_signs();
        model.enclose_rate(j, motion, signs, &self.parameters)
    }
}
