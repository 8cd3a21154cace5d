//! Systems and events whose functions are Python callables.

use std::sync::Arc;

use filippov::action::ActionMap;
use filippov::{
    AffinePart, FieldError, Held, Piece, PiecewiseSystem, Place, Setting, Side, SignStructure,
    SmoothParts, TracedSystem, UserFunction,
};
use filippov_expr::{
    Backend, Enclosure, EnclosureProgram, ExprError, Graph, Interval, Motion, NodeId, Program,
};
use numpy::{PyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use smallvec::SmallVec;

use crate::builder::{n_rows_without_number, Builder};
use crate::conversion::{read_scalar, read_vector};

/// Python switching functions h_j(t, x).
pub struct Surfaces {
    pub functions: Vec<Py<PyAny>>,
    pub names: Vec<String>,
    /// The first so many switch the field; those behind them trigger actions.
    pub n_switching: usize,
}

impl Surfaces {
    fn value(&self, py: Python<'_>, j: usize, t: f64, x: &[f64]) -> PyResult<f64> {
        read_scalar(
            &self.functions[j]
                .bind(py)
                .call1((t, PyArray1::from_slice(py, x)))?,
        )
    }

    fn write(&self, t: f64, x: &[f64], h: &mut [f64]) -> Result<(), FieldError> {
        Python::attach(|py| {
            h.iter_mut()
                .enumerate()
                .try_for_each(|(j, h)| self.value(py, j, t, x).map(|v| *h = v))
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }
}

/// A black box: f(t, x) looks at the signs of the switching functions itself, so that it exists in
/// each region only; beyond a surface it is NaN.
pub struct Opaque {
    pub fun: Py<PyAny>,
    pub surfaces: Surfaces,
    pub n_states: usize,
}

impl SignStructure for Opaque {
    fn switches_at(&self, j: usize) -> bool {
        j < self.surfaces.n_switching
    }
}

impl PiecewiseSystem for Opaque {
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn n_surfaces(&self) -> usize {
        self.surfaces.functions.len()
    }

    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError> {
        let &Place { t, x, signs, .. } = place;
        Python::attach(|py| {
            for (j, sign) in signs.iter().enumerate().take(self.surfaces.n_switching) {
                if self.surfaces.value(py, j, t, x)? * sign <= 0.0 {
                    dx.fill(f64::NAN);
                    return Ok(());
                }
            }
            let value = self.fun.bind(py).call1((t, PyArray1::from_slice(py, x)))?;
            read_vector(&value, dx, "fun")
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }

    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError> {
        self.surfaces.write(place.t, place.x, h)
    }

    fn surface_name(&self, j: usize) -> String {
        self.surfaces.names[j].clone()
    }
}

/// A callable f(t, x, s) that takes the sign vector as data.
pub struct Signed {
    pub fun: Py<PyAny>,
    pub surfaces: Surfaces,
    pub n_states: usize,
}

impl SignStructure for Signed {
    fn switches_at(&self, j: usize) -> bool {
        j < self.surfaces.n_switching
    }
}

impl PiecewiseSystem for Signed {
    fn n_states(&self) -> usize {
        self.n_states
    }

    fn n_surfaces(&self) -> usize {
        self.surfaces.functions.len()
    }

    fn field(&self, place: &Place<'_>, dx: &mut [f64]) -> Result<(), FieldError> {
        let &Place { t, x, signs, .. } = place;
        Python::attach(|py| {
            let arguments = (
                t,
                PyArray1::from_slice(py, x),
                PyArray1::from_slice(py, signs),
            );
            read_vector(&self.fun.bind(py).call1(arguments)?, dx, "fun")
        })
        .map_err(|e: PyErr| FieldError::new(e))
    }

    fn surfaces(&self, place: &Place<'_>, h: &mut [f64]) -> Result<(), FieldError> {
        self.surfaces.write(place.t, place.x, h)
    }

    fn surface_name(&self, j: usize) -> String {
        self.surfaces.names[j].clone()
    }
}

/// The map of an action, (t, x) -> x+, as a Python callable. Named discrete states stand behind the states.
pub struct CalledMap {
    pub map: Py<PyAny>,
    pub n_named: usize,
}

impl ActionMap for CalledMap {
    fn apply(&self, t: f64, x: &mut [f64], _: &[f64], q: &mut [f64]) -> Result<(), FieldError> {
        let mut all = [&*x, &q[..self.n_named]].concat();
        Python::attach(|py| {
            let value = self
                .map
                .bind(py)
                .call1((t, PyArray1::from_slice(py, &all)))?;
            read_vector(&value, &mut all, "the map of a reset")
        })
        .map_err(|e: PyErr| FieldError::new(e))?;
        let (states, named) = all.split_at(x.len());
        x.copy_from_slice(states);
        q[..self.n_named].copy_from_slice(named);
        Ok(())
    }
}

/// A user's event g(t, x) as a Python callable.
pub struct CalledEvent(pub Py<PyAny>);

impl UserFunction for CalledEvent {
    fn value(&self, t: f64, x: &[f64], _: &[f64]) -> Result<f64, FieldError> {
        Python::attach(|py| read_scalar(&self.0.bind(py).call1((t, PyArray1::from_slice(py, x)))?))
            .map_err(|e: PyErr| FieldError::new(e))
    }
}

/// The expression of a user's event in smooth parts: the switching functions inside of it, each after those that it reads,
/// and the expression itself.
pub struct EventExpression {
    parts: Vec<EventPart>,
    /// The surface whose function it is a multiple of, and the sign of the factor.
    multiple_of: Option<(u32, f64)>,
    /// The surfaces of the graph that the inner parts are.
    surfaces: Vec<usize>,
    /// How many signs the programs read at most.
    n_signs: usize,
    /// What its own floors are taken of, each after those that it reads.
    levels: Vec<OwnLevel>,
    /// Parameters and discrete states of the system before those of the levels.
    n_given: usize,
}

/// A floor that an event has and the field has not. It is read as two parameters, the even and the odd whole number beside the
/// expression, and the sign of sin(pi g) says which of them is the floor.
struct OwnLevel {
    program: Program,
    enclosing: EnclosureProgram,
}

impl OwnLevel {
    /// The even whole number below g where floor(g) is even, and the odd one where it is odd; also a little beyond.
    fn beside(g: f64) -> [f64; 2] {
        let even = 2.0 * (0.5 * (g - 0.5)).round();
        let odd = 2.0 * (0.5 * (g - 1.5)).round() + 1.0;
        [even, odd]
    }
}

struct EventPart {
    program: Program,
    enclosing: EnclosureProgram,
    affine: Option<AffinePart>,
}

impl EventExpression {
    pub fn compile(
        graph: &Graph,
        node: NodeId,
        levels: &[NodeId],
        n_given: usize,
    ) -> Result<Self, ExprError> {
        let mut surfaces = Vec::new();
        add_inner(graph, node, &mut surfaces);
        let inner = surfaces.iter().map(|&k| graph.surface(k as u32));
        let nodes: Vec<NodeId> = inner.chain([node]).collect();
        let parts = nodes.iter().map(|&node| EventPart::compile(graph, node));
        Ok(EventExpression {
            parts: parts.collect::<Result<_, _>>()?,
            multiple_of: graph.surface_of(node),
            surfaces,
            n_signs: graph.n_surfaces(),
            levels: levels
                .iter()
                .map(|&node| {
                    Ok(OwnLevel {
                        program: Program::compile(graph, &[node], Backend::Auto)?,
                        enclosing: EnclosureProgram::compile(graph, &[node])?,
                    })
                })
                .collect::<Result<_, ExprError>>()?,
            n_given,
        })
    }

    /// Calls a function with the parameters, and behind them those of the levels at a place.
    fn with_levels<R>(
        &self,
        (t, x, signs): (f64, &[f64], &[f64]),
        p: &[f64],
        f: impl FnOnce(&[f64]) -> R,
    ) -> R {
        let level_at = |level: &OwnLevel, all: &[f64]| {
            let mut g = [0.0];
            level.program.eval(t, x, signs, all, &[], &mut g);
            OwnLevel::beside(g[0])
        };
        self.with_parameters(p, level_at, f)
    }

    /// The same along a piece of motion. A whole number that changes in it is not a number: nothing is known of what reads it.
    fn with_levels_along<R>(
        &self,
        (motion, signs): (&dyn Motion, &[f64]),
        p: &[f64],
        f: impl FnOnce(&[f64]) -> R,
    ) -> R {
        let level_along = |level: &OwnLevel, all: &[f64]| {
            let mut g = [Enclosure::UNKNOWN];
            level.enclosing.eval(motion, signs, all, &mut g);
            let (low, high) = (
                OwnLevel::beside(g[0].value.lo),
                OwnLevel::beside(g[0].value.hi),
            );
            [0, 1].map(|k| if low[k] == high[k] { low[k] } else { f64::NAN })
        };
        self.with_parameters(p, level_along, f)
    }

    /// Calls `f` with the given parameters and, behind them, the two whole numbers of each level. A level reads those before it.
    fn with_parameters<R>(
        &self,
        p: &[f64],
        beside: impl Fn(&OwnLevel, &[f64]) -> [f64; 2],
        f: impl FnOnce(&[f64]) -> R,
    ) -> R {
        if self.levels.is_empty() {
            return f(p);
        }
        let mut all: SmallVec<[f64; 16]> = SmallVec::from_slice(p);
        all.resize(self.n_given + 2 * self.levels.len(), 0.0);
        for (k, level) in self.levels.iter().enumerate() {
            let numbers = beside(level, &all);
            let first = self.n_given + 2 * k;
            all[first..first + 2].copy_from_slice(&numbers);
        }
        f(&all)
    }

    /// The signs that the programs read, from those of the inner parts.
    fn signs(&self, inner: &[f64]) -> SmallVec<[f64; 8]> {
        let mut signs = SmallVec::from_elem(1.0, self.n_signs);
        for (&surface, &sign) in self.surfaces.iter().zip(inner) {
            signs[surface] = sign;
        }
        signs
    }
}

/// Adds the surfaces whose signs an expression reads, after those that they read.
fn add_inner(graph: &Graph, node: NodeId, surfaces: &mut Vec<usize>) {
    let depends = graph.sign_dependencies(&[node], &[]);
    for (surface, depends) in depends.into_iter().enumerate() {
        if depends && !surfaces.contains(&surface) {
            add_inner(graph, graph.surface(surface as u32), surfaces);
            surfaces.push(surface);
        }
    }
}

impl EventPart {
    fn compile(graph: &Graph, node: NodeId) -> Result<Self, ExprError> {
        let terms = graph
            .rate_terms(node)
            .filter(|terms| terms.others.is_empty());
        Ok(EventPart {
            program: Program::compile(graph, &[node], Backend::Auto)?,
            enclosing: EnclosureProgram::compile(graph, &[node])?,
            affine: terms.map(|terms| AffinePart {
                of_time: terms.of_time,
                slopes: terms.linear,
            }),
        })
    }
}

/// A user's event as an expression, for any parameters.
#[pyclass(frozen, module = "filippov._core")]
pub struct TracedEvent {
    pub expression: Arc<EventExpression>,
    /// It holds for one set of values only.
    is_pinned: bool,
    /// What it asked about that other values of the parameters may make a number.
    moving: Vec<NodeId>,
    graph: Graph,
}

#[pymethods]
impl TracedEvent {
    #[new]
    fn new(
        builder: &Builder,
        node: u32,
        levels: Vec<u32>,
        n_given: usize,
        is_pinned: bool,
        moving: Vec<u32>,
    ) -> PyResult<Self> {
        let graph = builder.graph();
        let root = Builder::node(&graph, node)?;
        let nodes = |ids: Vec<u32>| {
            ids.into_iter()
                .map(|id| Builder::node(&graph, id))
                .collect()
        };
        let levels: PyResult<Vec<NodeId>> = nodes(levels);
        let (levels, moving) = (levels?, nodes(moving)?);
        let expression = EventExpression::compile(&graph, root, &levels, n_given)
            .map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok(TracedEvent {
            expression: Arc::new(expression),
            is_pinned,
            graph: match moving.is_empty() {
                true => Graph::new(),
                false => graph.clone(),
            },
            moving,
        })
    }

    /// For how many of the first rows of parameters it holds; for the first it does.
    fn n_valid(&self, table: PyReadonlyArray2<'_, f64>) -> PyResult<usize> {
        if !self.is_pinned {
            return n_rows_without_number(&self.graph, (&self.moving, &[]), &table);
        }
        let rows = table.as_array();
        let differs = |row: &_| *row != rows.row(0);
        let first = rows.rows().into_iter().position(|row| differs(&row));
        Ok(first.unwrap_or(rows.nrows()))
    }

    /// The value with these parameters and discrete states; none within rounding of a zero inside of it.
    fn value(&self, t: f64, x: Vec<f64>, p: Vec<f64>) -> Option<f64> {
        let tiny = 1e-13 * x.iter().fold(1.0_f64, |most, x| most.max(x.abs()));
        let (mut inner, mut out) = (Vec::new(), [0.0]);
        for part in &self.expression.parts {
            let signs = self.expression.signs(&inner);
            let place = (t, &x[..], &signs[..]);
            self.expression.with_levels(place, &p, |p| {
                part.program.eval(t, &x, &signs, p, &[], &mut out);
            });
            if inner.len() < self.expression.surfaces.len() {
                if out[0].abs() <= tiny {
                    return None;
                }
                inner.push(if out[0] < 0.0 { -1.0 } else { 1.0 });
            }
        }
        Some(out[0])
    }
}

/// An expression along a motion: a quantity that a user asks for.
pub struct Signal<'a> {
    pub expression: &'a EventExpression,
    /// The velocity of the states, if it is known, and the limit that is meant where the quantity jumps.
    pub velocity: Option<&'a [f64]>,
    pub side: Side,
    /// The surfaces whose contact accelerations it reads behind the states.
    pub contacts: &'a [usize],
}

/// A point of a motion, and its velocity; that of what stands behind the states is not known.
struct Passing<'p> {
    t: f64,
    x: &'p [f64],
    velocity: &'p [f64],
}

impl Motion for Passing<'_> {
    fn time(&self) -> Interval {
        Interval::point(self.t)
    }

    fn state(&self, index: usize) -> Enclosure {
        Enclosure {
            value: Interval::point(self.x[index]),
            rate: match self.velocity.get(index) {
                Some(rate) => Interval::point(*rate),
                None => Enclosure::UNKNOWN.rate,
            },
        }
    }
}

impl Signal<'_> {
    /// The sign of an inner part with this value. One that is zero up to rounding has that of the limit, if it changes there.
    fn sign_of(
        &self,
        part: &EventPart,
        value: f64,
        (t, x, signs): (f64, &[f64], &[f64]),
        p: &[f64],
    ) -> f64 {
        let of_value = if value == 0.0 { 0.0 } else { value.signum() };
        let Some(velocity) = self.velocity else {
            return of_value;
        };
        let passing = Passing { t, x, velocity };
        let mut bound = [Enclosure::UNKNOWN];
        self.expression
            .with_levels_along((&passing, signs), p, |p| {
                part.enclosing.eval(&passing, signs, p, &mut bound);
            });
        let [Enclosure { value, rate }] = bound;
        let is_zero = value.lo <= 0.0 && value.hi >= 0.0;
        let rises = match () {
            () if rate.lo > 0.0 => 1.0,
            () if rate.hi < 0.0 => -1.0,
            () => return of_value,
        };
        match self.side {
            _ if !is_zero => of_value,
            Side::Right => rises,
            Side::Left => -rises,
        }
    }

    /// The value at a point of a motion. The surfaces slid on, with their multipliers, count with the weights of both of their
    /// sides; a surface in contact is zero.
    pub fn value(&self, (t, y): (f64, &[f64]), p: &[f64], piece: &Piece, held: &Held) -> f64 {
        let of_contact = |j: usize| held.contacts.iter().find(|(k, _)| *k == j);
        let accelerations = self
            .contacts
            .iter()
            .map(|&j| of_contact(j).map_or(0.0, |c| c.1));
        let x: Vec<f64> = y.iter().copied().chain(accelerations).collect();
        let p = [p, &piece.discrete].concat();
        let inside = &self.expression.surfaces;
        let slides = |(j, _): &&(usize, f64)| inside.contains(j);
        let sliding: SmallVec<[(usize, f64); 4]> =
            held.signs.iter().filter(slides).copied().collect();
        let mut total = 0.0;
        for corner in 0..1_u64 << sliding.len() {
            let above = |k: usize| corner >> k & 1 == 1;
            let sign = |k: usize| if above(k) { 1.0 } else { -1.0 };
            let weight: f64 = (0..sliding.len())
                .map(|k| 0.5 * (1.0 + sign(k) * sliding[k].1))
                .product();
            let (mut inner, mut out) = (Vec::new(), [0.0]);
            for part in &self.expression.parts {
                let signs = self.expression.signs(&inner);
                self.expression.with_levels((t, &x, &signs), &p, |p| {
                    part.program.eval(t, &x, &signs, p, &[], &mut out);
                });
                let Some(&j) = inside.get(inner.len()) else {
                    continue;
                };
                let own = || match of_contact(j) {
                    Some(_) => 0.0,
                    None => self.sign_of(part, out[0], (t, &x, &signs), &p),
                };
                let slid = sliding.iter().position(|s| s.0 == j).map(sign);
                let entry = piece.mode.entries().get(j).filter(|entry| **entry != 0);
                let held = slid.or(entry.map(|&entry| f64::from(entry)));
                inner.push(held.unwrap_or_else(own));
            }
            total += weight * out[0];
        }
        total
    }
}

/// A user's event as a compiled expression.
pub struct CompiledEvent {
    pub expression: Arc<EventExpression>,
    /// Knows the parameters.
    pub system: Arc<TracedSystem>,
}

impl UserFunction for CompiledEvent {
    fn value(&self, t: f64, x: &[f64], q: &[f64]) -> Result<f64, FieldError> {
        let n = self.n_inner();
        let mut signs: SmallVec<[f64; 8]> = SmallVec::new();
        signs.resize(n, 0.0);
        for part in 0..n {
            let value = SmoothParts::value(self, part, &Setting::new(&signs, q).at(t, x));
            signs[part] = if value == 0.0 { 0.0 } else { value.signum() };
        }
        Ok(SmoothParts::value(
            self,
            n,
            &Setting::new(&signs, q).at(t, x),
        ))
    }

    fn parts(&self) -> Option<&dyn SmoothParts> {
        Some(self)
    }

    fn surface(&self) -> Option<(usize, f64)> {
        let (index, sense) = self.expression.multiple_of?;
        let index = index as usize;
        (index < self.system.n_surfaces()).then_some((index, sense))
    }

    fn reads(&self, surface: usize) -> bool {
        self.expression.surfaces.contains(&surface)
    }

    fn value_held(&self, at: (f64, &[f64]), piece: &Piece, held: &Held) -> Result<f64, FieldError> {
        let signal = Signal {
            expression: &self.expression,
            velocity: None,
            side: Side::Right,
            contacts: &[],
        };
        Ok(signal.value(at, self.system.parameters(), piece, held))
    }
}

impl SmoothParts for CompiledEvent {
    fn n_inner(&self) -> usize {
        self.expression.surfaces.len()
    }

    fn value(&self, part: usize, place: &Place<'_>) -> f64 {
        let mut out = [0.0];
        let program = &self.expression.parts[part].program;
        let signs = self.expression.signs(place.signs);
        self.system.with_values(place.q, |p| {
            let at = (place.t, place.x, &signs[..]);
            self.expression.with_levels(at, p, |p| {
                program.eval(place.t, place.x, &signs, p, &[], &mut out);
            });
        });
        out[0]
    }

    fn enclose(&self, part: usize, motion: &dyn Motion, setting: Setting<'_>) -> Enclosure {
        let mut out = [Enclosure::UNKNOWN];
        let program = &self.expression.parts[part].enclosing;
        let signs = self.expression.signs(setting.signs);
        let along = (motion, &signs[..]);
        self.system.with_values(setting.q, |p| {
            self.expression
                .with_levels_along(along, p, |p| program.eval(motion, &signs, p, &mut out));
        });
        out[0]
    }

    fn affine(&self, part: usize) -> Option<&AffinePart> {
        self.expression.parts[part].affine.as_ref()
    }
}
