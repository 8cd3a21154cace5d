//! A system given by a traced expression graph.

mod affine;
mod gradient;
mod rounding;

use std::sync::Arc;

use filippov_expr::{
    Backend, Enclosure, ExprError, Graph, JetProgram, Motion, Names, NodeId, Program,
};
use smallvec::SmallVec;

use super::compiled::{Follower, Model};
use super::jet_multipliers::MultiplierEquations;
use super::reduction::Reductions;
use super::{
    AffineSigns, BothSides, Enclosures, LieDerivatives, LieValue, Linearisations, MotionJacobian,
    MotionJets, PiecewiseSystem, Place, RatePartials, RegionFields, Setting, SignStructure,
    TaylorSeries, Word,
};
use crate::error::FieldError;
use crate::error_scale::ErrorScale;
use crate::system::Linearisation;
use crate::tolerances::{MAX_LIE_ORDER, ROUNDING, TANGENT};

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
    /// How many discrete states the functions read, behind the parameters.
    n_discrete: usize,
    /// How many of its last states are parameters.
    n_as_states: usize,
    reductions: Reductions<TracedSystem>,
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
            n_discrete: 0,
            n_as_states: 0,
            reductions: Reductions::default(),
        })
    }

    /// The same system with these surfaces monitored in every mode, whether the field depends on them or not:
    /// they trigger actions. For a system that was just made.
    #[must_use]
    pub fn watching(self, surfaces: &[usize]) -> Self {
        self.watching_with_followers(surfaces, Vec::new())
    }

    /// The same, some of them only where something reads the discrete state that changes there.
    pub(super) fn watching_with_followers(
        mut self,
        surfaces: &[usize],
        followers: Vec<Follower>,
    ) -> Self {
        if let Some(model) = Arc::get_mut(&mut self.model) {
            model.watch(surfaces, followers);
        }
        self
    }

    /// The same system with static friction above kinetic on some surfaces, given by the ratios of the two. For a
    /// system that was just made.
    #[must_use]
    pub fn sticking(mut self, ratios: &[(usize, NodeId)]) -> Self {
        if let Some(model) = Arc::get_mut(&mut self.model) {
            model.stick(ratios);
        }
        self
    }

    /// The same system, whose functions read `count` discrete states behind the parameters.
    #[must_use]
    pub fn with_discrete(mut self, count: usize) -> Self {
        self.n_discrete = count;
        self
    }

    /// The same system, whose last `count` states are parameters.
    #[must_use]
    pub(crate) fn with_parameters_as_states(mut self, count: usize) -> Self {
        self.n_as_states = count;
        self
    }

    /// The same system with other parameter values.
    #[must_use]
    pub fn with_parameters(&self, parameters: Vec<f64>) -> Self {
        TracedSystem {
            model: Arc::clone(&self.model),
            parameters,
            n_discrete: self.n_discrete,
            n_as_states: self.n_as_states,
            reductions: Reductions::default(),
        }
    }

    /// The system of another model with these values of the same parameters.
    pub(super) fn with_model(&self, model: Arc<Model>) -> Self {
        TracedSystem {
            model,
            parameters: self.parameters.clone(),
            n_discrete: self.n_discrete,
            n_as_states: self.n_as_states,
            reductions: Reductions::default(),
        }
    }

    /// How many discrete states its functions read.
    pub fn n_discrete(&self) -> usize {
        self.n_discrete
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
        self.model.is_native()
    }
}

impl TracedSystem {
    /// Calls a function with the parameters, these discrete states behind them.
    #[inline(always)]
    pub fn with_values<R>(&self, q: &[f64], f: impl FnOnce(&[f64]) -> R) -> R {
        // Filled only where there are discrete states.
        let values;
        f(if q.is_empty() {
            &self.parameters
        } else {
            values = behind(&self.parameters, q);
            &values
        })
    }

    /// Evaluates the series of a motion at a place.
    pub(crate) fn eval_series(
        &self,
        series: &JetProgram,
        equations: Option<&MultiplierEquations>,
        place: &Place<'_>,
        out: &mut [f64],
    ) {
        self.with_values(place.q, |p| {
            MultiplierEquations::eval(equations, series, place, p, out);
        });
    }

    /// Evaluates a program at a place, with a vector handed in.
    #[inline(always)]
    pub(crate) fn eval(&self, program: &Program, place: &Place<'_>, v: &[f64], out: &mut [f64]) {
        self.with_values(place.q, |p| {
            program.eval(place.t, place.x, place.signs, p, v, out);
        });
    }

    /// The field where there are discrete states, or other code than one native function: apart, so that the way without them is short.
    #[cold]
    #[inline(never)]
    fn field_apart(&self, place: &Place<'_>, dx: &mut [f64]) {
        self.eval(self.model.field_program.program(), place, &[], dx);
    }
}

impl TracedSystem {
    /// What is left of the system where a motion slides on these surfaces, one of which has a higher relative degree.
    #[cold]
    #[inline(never)]
    fn reduction(&self, surfaces: &[usize]) -> Option<&dyn PiecewiseSystem> {
        let make = || {
            self.model
                .reduced(surfaces)
                .map(|model| self.with_model(model))
        };
        let reduced = self.reductions.get_or_make(surfaces, make);
        reduced.map(|system| system as _)
    }
}

impl TracedSystem {
    /// Values and rates of switching functions that have to be computed.
    #[inline(never)]
    fn computed_rates(&self, place: &Place<'_>, v: &[f64], h: &mut [f64], rate: &mut [f64]) {
        let (d, program) = (h.len(), self.model.rates());
        if d == 1 {
            let mut out = [0.0; 2];
            self.eval(program, place, v, &mut out);
            (h[0], rate[0]) = (out[0], out[1]);
        } else {
            let mut out = vec![0.0; 2 * d];
            self.eval(program, place, v, &mut out);
            h.copy_from_slice(&out[..d]);
            rate.copy_from_slice(&out[d..]);
        }
    }
}

impl TracedSystem {
    /// The size of the terms of a switching function that has to be computed.
    #[inline(never)]
    fn computed_size(&self, j: usize, place: &Place<'_>) -> f64 {
        let &Place { t, x, .. } = place;
        let size = self.with_gradient(j, place, |time, states, values| {
            let entries = states.iter().zip(values);
            let size: f64 = entries.map(|(&i, value)| (value * x[i]).abs()).sum();
            size + (time * t).abs()
        });
        if self.is_affine(j) {
            return size;
        }
        // Terms may cancel where the gradient vanishes.
        let size = size.max(self.rounding_of_surface(j, place) / ROUNDING);
        if size.is_finite() {
            return size;
        }
        // A root ends here, and has no slope: what counts is its value.
        let mut h = vec![0.0; self.n_surfaces()];
        match self.surfaces(place, &mut h) {
            Ok(()) => h[j].abs(),
            Err(_) => size,
        }
    }
}

/// The parameters with the discrete states behind them.
#[cold]
fn behind(parameters: &[f64], q: &[f64]) -> SmallVec<[f64; 16]> {
    let mut all = SmallVec::from_slice(parameters);
    all.extend_from_slice(q);
    all
}

impl PiecewiseSystem for TracedSystem {
    fn n_states(&self) -> usize {
        self.model.n_states
    }

    fn n_own_states(&self) -> usize {
        self.model.n_states - self.n_as_states
    }

    fn n_surfaces(&self) -> usize {
        self.model.affine.len()
    }

    #[inline]
    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError> {
        let &Place { t, x, signs, q } = place;
        let p = &self.parameters;
        match self.model.field_program.native() {
            Some(program) if q.is_empty() && program.eval_native(t, x, signs, p, &[], dx) => {}
            _ => self.field_apart(place, dx),
        }
        Ok(())
    }

    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError> {
        if let Some(i) = self.model.only_state {
            h[0] = place.x[i];
            return Ok(());
        }
        self.eval(self.model.surfaces_program.program(), place, &[], h);
        Ok(())
    }

    fn surface_rates(
        &self,
        place: &Place<'_>,
        v: &[f64],
        h: &mut [f64],
        rate: &mut [f64],
    ) -> Result<(), FieldError> {
        if let Some(i) = self.model.only_state {
            (h[0], rate[0]) = (place.x[i], v[i]);
        } else {
            self.computed_rates(place, v, h, rate);
        }
        Ok(())
    }

    fn surface_rate(
        &self,
        j: usize,
        place: &Place<'_>,
        v: &[f64],
    ) -> Result<(f64, f64), FieldError> {
        if let Some(i) = self.model.as_state(j) {
            return Ok((place.x[i], v[i]));
        }
        let mut out = [0.0; 2];
        self.eval(self.model.single_rate(j), place, v, &mut out);
        Ok((out[0], out[1]))
    }

    fn gradient(
        &self,
        j: usize,
        place: &Place<'_>,
        gradient: &mut [f64],
    ) -> Result<f64, FieldError> {
        Ok(self.with_gradient(j, place, |time, states, values| {
            gradient.fill(0.0);
            for (&state, &value) in states.iter().zip(values) {
                gradient[state] = value;
            }
            time
        }))
    }

    fn gradient_products(
        &self,
        j: usize,
        place: &Place<'_>,
        vectors: &[f64],
        products: &mut [f64],
    ) -> Result<f64, FieldError> {
        Ok(self.with_gradient(j, place, |time, states, values| {
            let vectors = vectors.chunks_exact(place.x.len());
            if let (&[i], &[slope]) = (states, values) {
                for (product, vector) in products.iter_mut().zip(vectors) {
                    *product = slope * vector[i];
                }
                return time;
            }
            for (product, vector) in products.iter_mut().zip(vectors) {
                let entries = states.iter().zip(values);
                *product = entries.map(|(&i, value)| value * vector[i]).sum();
            }
            time
        }))
    }

    fn tolerance(
        &self,
        j: usize,
        place: &Place<'_>,
        scale: &ErrorScale,
    ) -> Result<f64, FieldError> {
        let own = |&i: &usize| scale.tolerance(i, place.x[i], place.x[i]);
        if let Some(i) = self.model.only_state {
            return Ok(own(&i));
        }
        Ok(self.with_gradient(j, place, |_, states, values| {
            let entries = states.iter().zip(values);
            entries.map(|(i, value)| value.abs() * own(i)).sum()
        }))
    }

    fn surface_size(&self, j: usize, place: &Place<'_>) -> Result<f64, FieldError> {
        Ok(match self.model.only_state {
            Some(i) => place.x[i].abs(),
            None => self.computed_size(j, place),
        })
    }

    fn both_sides(
        &self,
        j: usize,
        place: &Place<'_>,
        out: &mut BothSides,
    ) -> Result<u64, FieldError> {
        let n = self.model.n_states;
        if self.model.sticks_at(j) {
            let evaluations = out.both_sides_by_parts(self, j, place)?;
            out.stretch(self.stick_ratio(j, place));
            return Ok(evaluations);
        }
        if n > FUSED_STATES || out.meets_edges {
            return out.both_sides_by_parts(self, j, place);
        }
        let program = self.model.both_sides(j);
        self.eval(program, place, &[], &mut out.outputs);
        let (head, rest) = out.outputs.split_at(2);
        (out.normal_minus, out.normal_plus) = (head[0], head[1]);
        out.f_minus.copy_from_slice(&rest[..n]);
        out.f_plus.copy_from_slice(&rest[n..]);
        // A field that is not finite on its surface is taken just inside of its region.
        let finite = rest.iter().all(|v| v.is_finite()) && out.is_finite();
        if finite {
            Ok(2)
        } else {
            out.both_sides_by_parts(self, j, place)
        }
    }

    fn affine_signs(&self) -> Option<&dyn AffineSigns> {
        Some(self)
    }

    fn lie_derivatives(&self) -> Option<&dyn LieDerivatives> {
        Some(self)
    }

    fn taylor_series(&self) -> Option<&dyn TaylorSeries> {
        Some(self)
    }

    fn region_fields(&self) -> Option<&dyn RegionFields> {
        self.model.region_program().map(|_| self as _)
    }

    fn enclosures(&self) -> Option<&dyn Enclosures> {
        Some(self)
    }

    fn linearisations(&self) -> Option<&dyn Linearisations> {
        Some(self)
    }

    fn depends_on_time(&self) -> bool {
        let graph = &self.model.graph;
        let surfaces = (0..graph.n_surfaces()).map(|j| graph.surface(j as u32));
        let all: Vec<NodeId> = surfaces.chain(self.model.field.iter().copied()).collect();
        graph.depends_on_time(&all)
    }

    fn reduced(&self, surfaces: &[usize]) -> Option<&dyn PiecewiseSystem> {
        match self.model.is_reducible(surfaces) {
            true => self.reduction(surfaces),
            false => None,
        }
    }

    fn surface_name(&self, j: usize) -> String {
        self.model
            .graph
            .text(self.model.graph.surface(j as u32), &self.model.names)
    }
}

impl SignStructure for TracedSystem {
    fn active(&self, signs: &[f64], sliding: &[usize], active: &mut [bool]) {
        self.model.active(signs, sliding, active);
    }

    fn has_nested_signs(&self) -> bool {
        self.model.is_nested
    }

    fn is_affine(&self, j: usize) -> bool {
        self.model.affine[j]
    }

    fn known_groups(&self, surfaces: &[usize]) -> Option<Vec<Vec<usize>>> {
        Some(self.model.affine_signs().groups(surfaces))
    }

    fn switches_at(&self, j: usize) -> bool {
        self.model.switches_at(j)
    }

    fn jumps_across(&self, j: usize, signs: &[f64], sliding: &[usize]) -> bool {
        self.model.jumps_across(j, signs, sliding)
    }

    fn sticks_at(&self, j: usize) -> bool {
        self.model.sticks_at(j)
    }

    fn stick_ratio(&self, j: usize, place: &Place<'_>) -> f64 {
        let Some(program) = self.model.stick_ratio(j) else {
            return 1.0;
        };
        let mut ratio = [1.0];
        self.eval(program, place, &[], &mut ratio);
        ratio[0].max(1.0)
    }
}

impl LieDerivatives for TracedSystem {
    fn lie_derivative(
        &self,
        i: usize,
        j: usize,
        word: Word,
        place: &Place<'_>,
    ) -> Result<LieValue, FieldError> {
        Ok(self.model.with_lie_derivative((i, j), word, |program| {
            let (mut small, mut large) = ([0.0; MOST_TERMS], Vec::new());
            let count = program.n_outputs();
            let out = if count <= small.len() {
                &mut small[..count]
            } else {
                large.resize(count, 0.0);
                &mut large[..]
            };
            self.eval(program, place, &[], out);
            LieValue {
                value: out[0],
                magnitude: out[1..].iter().map(|v| v.abs()).sum(),
            }
        }))
    }

    fn first_lie_derivatives(&self, j: usize, place: &Place<'_>) -> Option<[LieValue; 2]> {
        let program = self.model.first_lie_derivatives(j);
        let mut values = [0.0; 2 * MOST_TERMS];
        let out = values.get_mut(..program.n_outputs())?;
        self.eval(program, place, &[], out);
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

    fn rate_gradient(
        &self,
        j: usize,
        place: &Place<'_>,
        gradient: &mut [f64],
    ) -> Result<RatePartials, FieldError> {
        let program = self.model.rate_gradient(j);
        let mut out = SmallVec::<[f64; 16]>::from_elem(0.0, program.n_outputs());
        self.eval(program, place, &[], &mut out);
        gradient.copy_from_slice(&out[3..]);
        Ok(RatePartials {
            rate: out[0],
            magnitude: out[2],
            time: out[1],
        })
    }
}

impl TaylorSeries for TracedSystem {
    fn is_analytic(&self) -> bool {
        self.model.is_analytic
    }

    fn hides_changes(&self) -> bool {
        self.model.hides_changes
    }

    fn motion_jets(
        &self,
        sliding: &[usize],
        functions: Option<&[usize]>,
        order: usize,
    ) -> Option<Arc<MotionJets>> {
        self.model.motion_jets(sliding, functions, order)
    }

    fn eval_jets(&self, jets: &MotionJets, place: &Place<'_>, out: &mut [f64]) {
        self.with_values(place.q, |p| jets.eval(place, p, out));
    }
}

impl Enclosures for TracedSystem {
    fn enclose_surface(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<Enclosure> {
        let mut out = [Enclosure::UNKNOWN];
        let program = self.model.enclosed_surface(j)?;
        let signs = setting.signs;
        self.with_values(setting.q, |p| program.eval(motion, signs, p, &mut out));
        Some(out[0])
    }

    fn enclose_surfaces(
        &self,
        motion: &dyn Motion,
        setting: Setting<'_>,
        bounds: &mut [Enclosure],
    ) {
        if let Some(program) = self.model.enclosed_surfaces() {
            let signs = setting.signs;
            self.with_values(setting.q, |p| program.eval(motion, signs, p, bounds));
        }
    }

    fn enclose_normal_components(
        &self,
        j: usize,
        motion: &dyn Motion,
        setting: Setting<'_>,
    ) -> Option<[Enclosure; 2]> {
        let mut out = [Enclosure::UNKNOWN; 2];
        let program = self.model.enclosed_normal_components(j)?;
        let signs = setting.signs;
        self.with_values(setting.q, |p| program.eval(motion, signs, p, &mut out));
        Some(out)
    }
}

impl RegionFields for TracedSystem {
    fn settle(&self, setting: Setting<'_>, values: &mut Vec<f64>) {
        if let Some(region) = self.model.region_program() {
            self.with_values(setting.q, |p| region.settle(setting.signs, p, values));
        }
    }

    #[inline]
    fn eval(&self, place: &Place<'_>, values: &[f64], dx: &mut [f64]) {
        if let Some(region) = self.model.region_program() {
            region.eval(place, values, dx);
        }
    }
}

impl Linearisations for TracedSystem {
    fn motion_jacobian(&self, sliding: &[usize]) -> Option<Arc<MotionJacobian>> {
        self.model.motion_jacobian(sliding)
    }

    fn eval_jacobian(&self, jacobian: &MotionJacobian, place: &Place<'_>, out: &mut Linearisation) {
        self.with_values(place.q, |p| jacobian.eval(place, p, out));
    }
}
