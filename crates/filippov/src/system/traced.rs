//! A system given by a traced expression graph.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use filippov_expr::{Backend, ExprError, Gradient, Graph, Names, NodeId, Program};
use rustc_hash::FxHashMap;

use super::tiered::{compile, TieredProgram};
use super::{BothSides, LieValue, PiecewiseSystem, Word};
use crate::error::FieldError;
use crate::field::{move_inside, side_offsets};
use crate::tolerances::{MAX_LIE_ORDER, SIDE_REACH, TANGENT};

/// Up to that many states both sides of a surface are compiled into one program; the programs of
/// larger systems would take longer to compile than they save.
const FUSED_STATES: usize = 12;

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

struct Model {
    graph: Graph,
    field: Vec<NodeId>,
    n_states: usize,
    names: Names,
    backend: Backend,
    field_program: Program,
    surfaces_program: TieredProgram,
    rates_program: OnceLock<TieredProgram>,
    affine: Vec<bool>,
    gradients: Vec<OnceLock<CompiledGradient>>,
    both_sides: Vec<OnceLock<TieredProgram>>,
    lie: Mutex<LieCache>,
    /// Active surfaces of the modes met so far; a zero entry is the surface slid on.
    activity: Mutex<FxHashMap<Vec<i8>, Vec<bool>>>,
}

/// The gradient of one switching function: outputs are the derivative in t, then the listed states.
struct CompiledGradient {
    states: Vec<usize>,
    values: GradientValues,
}

/// Constant for an affine surface, else a program.
enum GradientValues {
    Constant(Vec<f64>),
    Computed(Box<TieredProgram>),
}

/// Lie derivatives built so far, by (surface, surface with the word, word).
#[derive(Default)]
struct LieCache {
    graph: Option<Graph>,
    programs: FxHashMap<(usize, usize, u32), Arc<LieProgram>>,
}

/// Output 0 is the derivative, the others its terms.
struct LieProgram {
    node: NodeId,
    program: Program,
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
        let surfaces: Vec<NodeId> = (0..graph.n_surfaces())
            .map(|j| graph.surface(j as u32))
            .collect();
        let field_program = Program::compile(&graph, &field, backend)?;
        let surfaces_program = TieredProgram::new(graph.clone(), surfaces.clone(), backend);
        let model = Model {
            n_states: field.len(),
            affine: surfaces.iter().map(|&h| graph.is_affine(h)).collect(),
            gradients: surfaces.iter().map(|_| OnceLock::new()).collect(),
            both_sides: surfaces.iter().map(|_| OnceLock::new()).collect(),
            lie: Mutex::new(LieCache::default()),
            activity: Mutex::default(),
            rates_program: OnceLock::new(),
            field_program,
            surfaces_program,
            graph,
            field,
            names,
            backend,
        };
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

impl Model {
    /// h_j, then their rates along the input vector.
    fn rates(&self) -> &Program {
        let rates = self.rates_program.get_or_init(|| {
            let mut graph = self.graph.clone();
            let velocity: Vec<NodeId> = (0..self.n_states).map(|i| graph.input(i as u32)).collect();
            let surfaces: Vec<NodeId> = (0..graph.n_surfaces())
                .map(|j| graph.surface(j as u32))
                .collect();
            let mut outputs = surfaces.clone();
            outputs.extend(surfaces.iter().map(|&h| graph.directional(h, &velocity)));
            TieredProgram::new(graph, outputs, self.backend)
        });
        rates.program()
    }

    /// The normal components and the fields of both sides, as one program that shares what they have
    /// in common.
    fn both_sides(&self, j: usize) -> &Program {
        let both = self.both_sides[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let h = graph.surface(j as u32);
            let mut outputs = Vec::with_capacity(2 + 2 * self.n_states);
            let mut fields = Vec::with_capacity(2 * self.n_states);
            for side in [-1.0, 1.0] {
                let mut signs = vec![None; graph.n_surfaces()];
                signs[j] = Some(side);
                let field = graph.at_signs(&self.field, &signs);
                outputs.push(graph.directional(h, &field));
                fields.extend(field);
            }
            outputs.extend(fields);
            TieredProgram::new(graph, outputs, self.backend)
        });
        both.program()
    }

    fn gradient(&self, j: usize) -> &CompiledGradient {
        self.gradients[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let Gradient { time, states } = graph.gradient(graph.surface(j as u32));
            let mut outputs = vec![time];
            outputs.extend(states.iter().map(|(_, node)| *node));
            let constants: Option<Vec<f64>> = outputs
                .iter()
                .map(|&node| graph.as_constant(node))
                .collect();
            CompiledGradient {
                states: states.iter().map(|(i, _)| *i as usize).collect(),
                values: match constants {
                    Some(values) => GradientValues::Constant(values),
                    None => GradientValues::Computed(Box::new(TieredProgram::new(
                        graph,
                        outputs,
                        self.backend,
                    ))),
                },
            }
        })
    }

    /// Surfaces whose sign the field, or an active switching function, depends on in this mode.
    fn find_active(&self, signs: &[f64], sliding: Option<usize>) -> Vec<bool> {
        let mut active = vec![false; signs.len()];
        let sides: &[Option<f64>] = match sliding {
            None => &[None],
            Some(_) => &[Some(-1.0), Some(1.0)],
        };
        for side in sides {
            let mut signs = signs.to_vec();
            if let (Some(j), Some(side)) = (sliding, side) {
                signs[j] = *side;
            }
            let mut outputs = self.field.clone();
            loop {
                let found = self.graph.sign_dependencies(&outputs, &signs);
                let fresh: Vec<usize> = (0..found.len())
                    .filter(|&j| found[j] && !active[j])
                    .collect();
                for &j in &fresh {
                    active[j] = true;
                    outputs.push(self.graph.surface(j as u32));
                }
                if fresh.is_empty() {
                    break;
                }
            }
        }
        if let Some(j) = sliding {
            active[j] = true;
        }
        active
    }

    /// The Lie derivative of h_i for a word on the signs of surface j, built from that of the word
    /// without its last letter.
    fn lie(&self, cache: &mut LieCache, i: usize, j: usize, word: Word) -> Arc<LieProgram> {
        // The letters as bits behind a leading one.
        let bits = word
            .iter()
            .fold(1_u32, |bits, &w| bits << 1 | u32::from(w > 0));
        let key = (i, j, bits);
        if let Some(known) = cache.programs.get(&key) {
            return Arc::clone(known);
        }
        let inner = match word.split_last() {
            None => self.graph.surface(i as u32),
            Some((_, rest)) => self.lie(cache, i, j, rest).node,
        };
        let graph = cache.graph.get_or_insert_with(|| self.graph.clone());
        let (node, terms) = match word.split_last() {
            None => (inner, vec![inner]),
            Some((&side, _)) => {
                let mut signs = vec![None; graph.n_surfaces()];
                signs[j] = Some(f64::from(side));
                let field = graph.at_signs(&self.field, &signs);
                let Gradient { time, states } = graph.gradient(inner);
                let mut terms = vec![time];
                for (state, partial) in states {
                    terms.push(graph.mul(partial, field[state as usize]));
                }
                let sum = terms
                    .iter()
                    .skip(1)
                    .fold(time, |sum, &term| graph.add(sum, term));
                (sum, terms)
            }
        };
        let mut outputs = vec![node];
        outputs.extend(terms);
        let program = compile(graph, &outputs, Backend::Interpreter);
        let lie = Arc::new(LieProgram { node, program });
        cache.programs.insert(key, Arc::clone(&lie));
        lie
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
        let compiled = self.model.gradient(j);
        let mut computed = Vec::new();
        let values = match &compiled.values {
            GradientValues::Constant(values) => values,
            GradientValues::Computed(tiered) => {
                let program = tiered.program();
                computed.resize(program.n_outputs(), 0.0);
                program.eval(t, x, signs, &self.parameters, &[], &mut computed);
                &computed
            }
        };
        gradient.fill(0.0);
        for (&state, &value) in compiled.states.iter().zip(&values[1..]) {
            gradient[state] = value;
        }
        Ok(values[0])
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
        if n > FUSED_STATES {
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

    fn active(&self, signs: &[f64], sliding: Option<usize>, active: &mut [bool]) {
        let key: Vec<i8> = signs
            .iter()
            .enumerate()
            .map(|(j, &s)| if Some(j) == sliding { 0 } else { s as i8 })
            .collect();
        let mut known = self
            .model
            .activity
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let found = known
            .entry(key)
            .or_insert_with(|| self.model.find_active(signs, sliding));
        active.copy_from_slice(found);
    }

    fn is_affine(&self, j: usize) -> bool {
        self.model.affine[j]
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
        let lie = {
            let mut cache = self
                .model
                .lie
                .lock()
                .unwrap_or_else(PoisonError::into_inner);
            self.model.lie(&mut cache, i, j, word)
        };
        let mut small = [0.0; 16];
        let mut large = Vec::new();
        let count = lie.program.n_outputs();
        let out = if count <= small.len() {
            &mut small[..count]
        } else {
            large.resize(count, 0.0);
            &mut large[..]
        };
        lie.program.eval(t, x, signs, &self.parameters, &[], out);
        if !out[0].is_finite() {
            // The derivative of a one-sided field: taken just inside of its region.
            let mut side = signs.to_vec();
            side[j] = word.last().map_or(side[j], |&w| f64::from(w));
            for offset in side_offsets(x) {
                let inside = move_inside(self, t, x, &side, offset, SIDE_REACH * offset)?;
                lie.program
                    .eval(t, &inside, signs, &self.parameters, &[], out);
                if out[0].is_finite() {
                    break;
                }
            }
        }
        Ok(LieValue {
            value: out[0],
            magnitude: out[1..].iter().map(|v| v.abs()).sum(),
        })
    }

    fn lie_tolerance(&self, _order: usize) -> f64 {
        TANGENT
    }

    fn max_lie_order(&self) -> usize {
        MAX_LIE_ORDER
    }

    fn surface_name(&self, j: usize) -> String {
        self.model
            .graph
            .text(self.model.graph.surface(j as u32), &self.model.names)
    }
}
