//! What is compiled of a traced system: field, surfaces, rates, gradients, Lie derivatives.

use std::iter::once;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use filippov_expr::{
    has_native_code, Backend, BinaryOp, EnclosureProgram, ExprError, Gradient, Graph, Names,
    NodeId, Program, Regions,
};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use super::affine_model::AffineModel;
use super::both_sides::stretched;
use super::jacobian::MotionJacobian;
use super::jets::MotionJets;
use super::reduction::{reduced, relative_degree};
use super::region_fields::RegionProgram;
use super::tiered::{compile, Tiered, TieredProgram};
use super::Word;
use crate::page::IS_PAGE;

/// Graphs with more nodes are not kept to be compiled anew.
const LARGEST_COPIED: usize = 500;

/// Surfaces slid on at once whose sign patterns are all looked at.
const MOST_ENUMERATED: usize = 4;

/// A traced system with everything that was compiled of it so far.
pub(super) struct Model {
    pub graph: Graph,
    pub field: Vec<NodeId>,
    pub n_states: usize,
    pub names: Names,
    backend: Backend,
    pub field_program: TieredProgram,
    /// The field in one region, where signs and parameters alone make much of it.
    region_program: OnceLock<Option<RegionProgram>>,
    pub surfaces_program: TieredProgram,
    rates_program: OnceLock<TieredProgram>,
    single_rates: Vec<OnceLock<TieredProgram>>,
    affine_signs: OnceLock<AffineModel>,
    pub affine: Vec<bool>,
    /// The only switching function, if it is a state: nothing needs to be computed then.
    pub only_state: Option<usize>,
    /// Do switching functions contain signs of others?
    pub is_nested: bool,
    pub is_analytic: bool,
    /// May they change where no Taylor coefficient tells?
    pub hides_changes: bool,
    gradients: Vec<OnceLock<CompiledGradient>>,
    both_sides: Vec<OnceLock<TieredProgram>>,
    first_lie: Vec<OnceLock<TieredProgram>>,
    enclosed_surface: Vec<OnceLock<Option<EnclosureProgram>>>,
    enclosed_surfaces: OnceLock<Option<EnclosureProgram>>,
    enclosed_components: Vec<OnceLock<Option<EnclosureProgram>>>,
    rate_gradients: Vec<OnceLock<TieredProgram>>,
    lie: Mutex<LieCache>,
    /// Second derivatives along the field of one side, asked for at the end of every slide.
    second_lie: Vec<[OnceLock<Arc<LieProgram>>; 2]>,
    /// Ratio of static to kinetic friction, where it is not 1.
    sticking: FxHashMap<usize, TieredProgram>,
    /// The nodes of these ratios.
    ratios: FxHashMap<usize, NodeId>,
    /// Surfaces that trigger actions: monitored in every mode, but for those of followers.
    watched: Vec<usize>,
    followers: Vec<Follower>,
    /// Surfaces whose sign something depends on: the field, or another surface that matters.
    switching: OnceLock<Vec<bool>>,
    jets: Mutex<JetsCache>,
    jacobians: Mutex<JacobianCache>,
    /// Active surfaces of the modes met so far; a zero entry is the surface slid on.
    activity: Mutex<FxHashMap<Entries, Vec<bool>>>,
    relative_degrees: Vec<OnceLock<usize>>,
    /// What is left of the system on surfaces of higher relative degree, by surfaces slid on.
    reductions: Mutex<ReductionCache>,
    /// Whether something jumps at a surface, by surface and mode; found only where a function is zero along a motion.
    jumps: Mutex<FxHashMap<(usize, Entries), bool>>,
}

/// A discrete state that is a function of the point, and that need not be followed where nothing reads it. There the quantity
/// that it follows may end, or jump.
#[derive(Clone)]
pub(super) struct Follower {
    /// The parameter that it is.
    pub parameter: u32,
    /// The surface at which it changes; none of one that is made of others.
    pub guard: Option<usize>,
    /// What it follows.
    pub argument: NodeId,
}

/// The entries of a mode: a sign per surface, 0 for one slid on.
type Entries = SmallVec<[i8; 16]>;

/// The entries of a mode, given by its signs and the surfaces slid on (increasing).
fn entries(signs: &[f64], sliding: &[usize]) -> Entries {
    let entry = |(j, &sign): (usize, &f64)| match sliding.binary_search(&j) {
        Ok(_) => 0,
        Err(_) => sign as i8,
    };
    signs.iter().enumerate().map(entry).collect()
}

/// The gradient of one switching function: outputs are the derivative in t, then the listed states.
pub(super) struct CompiledGradient {
    pub states: Vec<usize>,
    pub values: GradientValues,
}

/// Constant for an affine surface, else a program.
pub(super) enum GradientValues {
    Constant(Vec<f64>),
    Computed(Box<TieredProgram>),
}

/// Lie derivatives built so far, by (surface, surface with the word, word).
#[derive(Default)]
struct LieCache {
    graph: Option<Graph>,
    programs: FxHashMap<(usize, usize, u32), Arc<LieProgram>>,
}

/// Taylor coefficients of the motions met so far, by surfaces slid on, curved functions if not all of them, and order.
type JetsCache = FxHashMap<JetsKey, Option<Arc<MotionJets>>>;
type JetsKey = (SmallVec<[usize; 2]>, Option<SmallVec<[usize; 4]>>, usize);

/// From so many on those of chosen functions are forgotten: a run meets few choices at a time.
const MOST_JETS: usize = 64;

/// Models of reduced systems, by surfaces slid on.
type ReductionCache = FxHashMap<SmallVec<[usize; 2]>, Option<Arc<Model>>>;

/// Derivatives of the fields of the motions met so far, by surfaces slid on.
type JacobianCache = FxHashMap<SmallVec<[usize; 2]>, Option<Arc<MotionJacobian>>>;

/// Sets of surfaces whose derivatives are kept: a run over more of them finds some anew now and then.
const MOST_JACOBIANS: usize = 64;

/// Fields of larger graphs take so long to interpret, and to compile, that their native code is begun with at once.
const LARGEST_INTERPRETED: usize = 10_000;

/// Output 0 is the derivative, the others its terms.
struct LieProgram {
    node: NodeId,
    program: TieredProgram,
}

impl Model {
    /// Compiles field and surfaces; the rest follows when it is needed.
    ///
    /// # Errors
    /// If an expression cannot be compiled.
    pub fn new(
        graph: Graph,
        field: Vec<NodeId>,
        names: Names,
        backend: Backend,
    ) -> Result<Self, ExprError> {
        let surfaces: Vec<NodeId> = (0..graph.n_surfaces())
            .map(|j| graph.surface(j as u32))
            .collect();
        let mut field_program = TieredProgram::checked(graph.clone(), field.clone(), backend)?;
        if graph.len() > LARGEST_INTERPRETED {
            field_program = field_program.soon();
        }
        let surfaces_program = TieredProgram::new(graph.clone(), surfaces.clone(), backend);
        Ok(Model {
            n_states: field.len(),
            is_analytic: graph.is_analytic(&field) && graph.is_analytic(&surfaces),
            hides_changes: graph.hides_changes(&field) || graph.hides_changes(&surfaces),
            only_state: match surfaces[..] {
                [h] => graph.as_state(h),
                _ => None,
            },
            affine: surfaces.iter().map(|&h| graph.is_affine(h)).collect(),
            is_nested: graph.sign_dependencies(&surfaces, &[]).contains(&true),
            gradients: surfaces.iter().map(|_| OnceLock::new()).collect(),
            both_sides: surfaces.iter().map(|_| OnceLock::new()).collect(),
            first_lie: surfaces.iter().map(|_| OnceLock::new()).collect(),
            enclosed_surface: surfaces.iter().map(|_| OnceLock::new()).collect(),
            enclosed_surfaces: OnceLock::new(),
            enclosed_components: surfaces.iter().map(|_| OnceLock::new()).collect(),
            rate_gradients: surfaces.iter().map(|_| OnceLock::new()).collect(),
            sticking: FxHashMap::default(),
            ratios: FxHashMap::default(),
            watched: Vec::new(),
            followers: Vec::new(),
            switching: OnceLock::new(),
            lie: Mutex::new(LieCache::default()),
            second_lie: surfaces.iter().map(|_| Default::default()).collect(),
            jets: Mutex::default(),
            jacobians: Mutex::default(),
            activity: Mutex::default(),
            jumps: Mutex::default(),
            relative_degrees: surfaces.iter().map(|_| OnceLock::new()).collect(),
            reductions: Mutex::default(),
            region_program: OnceLock::new(),
            rates_program: OnceLock::new(),
            single_rates: surfaces.iter().map(|_| OnceLock::new()).collect(),
            affine_signs: OnceLock::new(),
            field_program,
            surfaces_program,
            graph,
            field,
            names,
            backend,
        })
    }

    /// Is the field native code, or will it be after some calls?
    pub fn is_native(&self) -> bool {
        self.backend != Backend::Interpreter && has_native_code()
    }

    /// Does one of these surfaces have a higher relative degree than 1?
    pub fn is_reducible(&self, surfaces: &[usize]) -> bool {
        surfaces
            .iter()
            .any(|&j| match self.relative_degrees[j].get() {
                Some(&degree) => degree > 1,
                None => self.find_relative_degree(j) > 1,
            })
    }

    #[cold]
    #[inline(never)]
    fn find_relative_degree(&self, j: usize) -> usize {
        let find = || relative_degree(&self.graph, &self.field, j);
        *self.relative_degrees[j].get_or_init(find)
    }

    /// What is left of the system where a motion slides on these surfaces, if one of them has a higher relative degree.
    pub fn reduced(&self, surfaces: &[usize]) -> Option<Arc<Model>> {
        let mut known = self
            .reductions
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let made = known.entry(SmallVec::from_slice(surfaces));
        made.or_insert_with(|| {
            let (graph, field) = reduced(&self.graph, &self.field, surfaces)?;
            let model = Model::new(graph, field, self.names.clone(), self.backend);
            let mut model = model.ok()?;
            let ratios: Vec<_> = self.ratios.iter().map(|(&j, &node)| (j, node)).collect();
            model.stick(&ratios);
            model.watch(&self.watched, self.followers.clone());
            Some(Arc::new(model))
        })
        .clone()
    }

    /// Gives surfaces a ratio of static to kinetic friction.
    pub fn stick(&mut self, ratios: &[(usize, NodeId)]) {
        for &(j, node) in ratios {
            let program = TieredProgram::new(self.graph.clone(), vec![node], self.backend);
            self.sticking.insert(j, program);
            self.ratios.insert(j, node);
        }
    }

    pub fn has_sticking(&self) -> bool {
        !self.sticking.is_empty()
    }

    pub fn sticks_at(&self, j: usize) -> bool {
        !self.sticking.is_empty() && self.sticking.contains_key(&j)
    }

    pub fn stick_ratio(&self, j: usize) -> Option<&Program> {
        self.sticking.get(&j).map(TieredProgram::program)
    }

    /// Monitors these surfaces in every mode, but those of followers only where something reads their discrete states.
    pub fn watch(&mut self, surfaces: &[usize], followers: Vec<Follower>) {
        self.watched = surfaces.to_vec();
        self.followers = followers;
    }

    /// Does anything but the trigger of an action depend on the sign of surface `j`?
    pub fn switches_at(&self, j: usize) -> bool {
        // No sign is given: both branches of every choice count.
        self.switching.get_or_init(|| {
            let mut depends = self.depend_on(&[], Vec::new(), &[]);
            for &watched in &self.watched {
                let others = self
                    .graph
                    .sign_dependencies(&[self.graph.surface(watched as u32)], &[]);
                depends.iter_mut().zip(others).for_each(|(d, o)| *d |= o);
            }
            depends
        })[j]
    }

    /// L_f h_j, its derivative in t, the size of its terms, then its derivatives in the states.
    pub fn rate_gradient(&self, j: usize) -> &Program {
        let made = self.rate_gradients[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let h = graph.surface(j as u32);
            let Gradient { time, states } = graph.gradient(h);
            let (mut rate, mut magnitude) = (time, time);
            for (i, partial) in states {
                let term = graph.mul(partial, self.field[i as usize]);
                rate = graph.add(rate, term);
                magnitude = graph.binary(BinaryOp::Hypot, magnitude, term);
            }
            let Gradient { time, states } = graph.gradient(rate);
            let zero = graph.constant(0.0);
            let mut outputs = vec![zero; 3 + self.n_states];
            (outputs[0], outputs[1], outputs[2]) = (rate, time, magnitude);
            states
                .iter()
                .for_each(|(i, partial)| outputs[3 + *i as usize] = *partial);
            TieredProgram::new(graph, outputs, self.backend)
        });
        made.program()
    }

    /// The field in one region, where signs and parameters alone make much of it.
    #[inline]
    pub fn region_program(&self) -> Option<&RegionProgram> {
        if IS_PAGE {
            return None;
        }
        let made = self
            .region_program
            .get_or_init(|| RegionProgram::new(&self.graph, &self.field, self.backend));
        made.as_ref()
    }

    /// h_j, then their rates along the input vector.
    pub fn rates(&self) -> &Program {
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

    /// The state that h_j is, if it is one.
    pub fn as_state(&self, j: usize) -> Option<usize> {
        self.graph.as_state(self.graph.surface(j as u32))
    }

    /// h_j, then its rate along the input vector.
    pub fn single_rate(&self, j: usize) -> &Program {
        let rate = self.single_rates[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let velocity: Vec<NodeId> = (0..self.n_states).map(|i| graph.input(i as u32)).collect();
            let h = graph.surface(j as u32);
            let outputs = vec![h, graph.directional(h, &velocity)];
            TieredProgram::new(graph, outputs, self.backend)
        });
        rate.program()
    }

    /// Field, jumps and gradients for sliding where the field is affine in signs.
    pub fn affine_signs(&self) -> &AffineModel {
        let make = || AffineModel::new(&self.graph, &self.field, self.backend);
        self.affine_signs.get_or_init(make)
    }

    /// The normal components and the fields of both sides on surface `j`, as one program that shares what they have
    /// in common.
    pub fn both_sides(&self, j: usize) -> &Program {
        let both = self.both_sides[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let h = graph.surface(j as u32);
            let mut outputs = Vec::with_capacity(2 + 2 * self.n_states);
            let mut fields = Vec::with_capacity(2 * self.n_states);
            for side in [-1.0, 1.0] {
                let mut signs = vec![None; graph.n_surfaces()];
                signs[j] = Some(side);
                let field = graph.at_signs(&self.field, &signs);
                let field = graph.on_surface(&field, j as u32);
                outputs.push(graph.directional(h, &field));
                fields.extend(field);
            }
            outputs.extend(fields);
            TieredProgram::new(graph, outputs, self.backend)
        });
        both.program()
    }

    /// Bounds of h_j along a motion.
    pub fn enclosed_surface(&self, j: usize) -> Option<&EnclosureProgram> {
        let program = self.enclosed_surface[j].get_or_init(|| {
            EnclosureProgram::compile(&self.graph, &[self.graph.surface(j as u32)]).ok()
        });
        program.as_ref()
    }

    /// Bounds of all switching functions along a motion.
    pub fn enclosed_surfaces(&self) -> Option<&EnclosureProgram> {
        let program = self.enclosed_surfaces.get_or_init(|| {
            let surfaces = (0..self.affine.len()).map(|j| self.graph.surface(j as u32));
            EnclosureProgram::compile(&self.graph, &surfaces.collect::<Vec<_>>()).ok()
        });
        program.as_ref()
    }

    /// Bounds of the normal components of f- and f+ at surface `j` along a motion.
    pub fn enclosed_normal_components(&self, j: usize) -> Option<&EnclosureProgram> {
        let program = self.enclosed_components[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let mut components = [-1.0, 1.0].map(|side| {
                let h = graph.surface(j as u32);
                self.derivative_terms(&mut graph, h, j, side).0
            });
            if let Some(&ratio) = self.ratios.get(&j) {
                components = stretched(&mut graph, components, ratio);
            }
            EnclosureProgram::compile(&graph, &components).ok()
        });
        program.as_ref()
    }

    /// The first Lie derivative of h_j along f- with its terms, then that along f+.
    pub fn first_lie_derivatives(&self, j: usize) -> &Program {
        let both = self.first_lie[j].get_or_init(|| {
            let mut graph = self.graph.clone();
            let mut outputs = Vec::new();
            for side in [-1.0, 1.0] {
                let h = graph.surface(j as u32);
                let (sum, terms) = self.derivative_terms(&mut graph, h, j, side);
                outputs.push(sum);
                outputs.extend(terms);
            }
            TieredProgram::new(graph, outputs, self.backend)
        });
        both.program()
    }

    /// The derivative of a node along the field with sign `side` on surface `j`, and its terms: that in t, then one
    /// per state that moves the node.
    fn derivative_terms(
        &self,
        graph: &mut Graph,
        node: NodeId,
        j: usize,
        side: f64,
    ) -> (NodeId, Vec<NodeId>) {
        let mut signs = vec![None; graph.n_surfaces()];
        signs[j] = Some(side);
        let Gradient { time, states } = graph.gradient(node);
        let moving = states.iter().map(|(i, _)| self.field[*i as usize]);
        let field = graph.at_signs(&moving.collect::<Vec<_>>(), &signs);
        let field = graph.on_surface(&field, j as u32);
        let mut terms = vec![time];
        let velocities = states.iter().zip(field);
        terms.extend(velocities.map(|(&(_, partial), v)| graph.mul(partial, v)));
        let sum = terms[1..]
            .iter()
            .fold(time, |sum, &term| graph.add(sum, term));
        (sum, terms)
    }

    pub fn gradient(&self, j: usize) -> &CompiledGradient {
        self.gradients[j].get_or_init(|| {
            let h = self.graph.surface(j as u32);
            if let Some((time, states)) = self.graph.constant_gradient(h) {
                let slopes = states.iter().map(|(_, slope)| *slope);
                return CompiledGradient {
                    states: states.iter().map(|(i, _)| *i as usize).collect(),
                    values: GradientValues::Constant(once(time).chain(slopes).collect()),
                };
            }
            let mut graph = self.graph.clone();
            let Gradient { time, states } = graph.gradient(h);
            let outputs: Vec<NodeId> = once(time)
                .chain(states.iter().map(|(_, node)| *node))
                .collect();
            let constants: Option<Vec<f64>> = outputs
                .iter()
                .map(|&node| graph.as_constant(node))
                .collect();
            let compiled = || TieredProgram::new(graph, outputs, self.backend);
            CompiledGradient {
                states: states.iter().map(|(i, _)| *i as usize).collect(),
                values: constants.map_or_else(
                    || GradientValues::Computed(Box::new(compiled())),
                    GradientValues::Constant,
                ),
            }
        })
    }

    /// Taylor coefficients of the motions on these surfaces.
    pub fn motion_jets(
        &self,
        sliding: &[usize],
        functions: Option<&[usize]>,
        order: usize,
    ) -> Option<Arc<MotionJets>> {
        let mut known = self.jets.lock().unwrap_or_else(PoisonError::into_inner);
        if functions.is_some() && known.len() >= MOST_JETS {
            known.retain(|(_, functions, _), _| functions.is_none());
        }
        let key = (
            SmallVec::from_slice(sliding),
            functions.map(SmallVec::from_slice),
            order,
        );
        let made = known.entry(key);
        made.or_insert_with(|| {
            let motion = (&self.field[..], sliding, functions);
            MotionJets::new(&self.graph, motion, order, self.backend).map(Arc::new)
        })
        .clone()
    }

    /// Derivatives of the field of the motions on these surfaces.
    pub fn motion_jacobian(&self, sliding: &[usize]) -> Option<Arc<MotionJacobian>> {
        let mut known = self
            .jacobians
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let key = SmallVec::from_slice(sliding);
        if known.len() >= MOST_JACOBIANS && !known.contains_key(&key) {
            known.clear();
        }
        let made = known.entry(key);
        made.or_insert_with(|| {
            MotionJacobian::new(&self.graph, &self.field, sliding, self.backend).map(Arc::new)
        })
        .clone()
    }

    /// Marks the surfaces whose sign matters in a mode.
    pub fn active(&self, signs: &[f64], sliding: &[usize], active: &mut [bool]) {
        let key = entries(signs, sliding);
        let mut known = self.activity.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known
            .entry(key)
            .or_insert_with(|| self.find_active(signs, sliding));
        active.copy_from_slice(found);
    }

    /// Surfaces whose sign the field, or an active switching function, depends on in this mode. While
    /// sliding on many surfaces at once, those whose sign matters anywhere.
    fn find_active(&self, signs: &[f64], sliding: &[usize]) -> Vec<bool> {
        let mut active = vec![false; signs.len()];
        if sliding.len() > MOST_ENUMERATED {
            active.fill(true);
            return active;
        }
        for pattern in 0..1_usize << sliding.len() {
            let mut signs = signs.to_vec();
            for (bit, &j) in sliding.iter().enumerate() {
                signs[j] = if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 };
            }
            let found = self.active_at(&signs);
            active.iter_mut().zip(found).for_each(|(a, f)| *a |= f);
        }
        sliding.iter().for_each(|&j| active[j] = true);
        active
    }

    /// The surfaces that matter for one sign pattern.
    fn active_at(&self, signs: &[f64]) -> Vec<bool> {
        let is_free = |j: &usize| self.followers.iter().all(|one| one.guard != Some(*j));
        let watched = self.watched.iter().copied().filter(is_free);
        self.depend_on(signs, watched.collect(), &self.followers)
    }

    /// The surfaces on which the field depends, or one of `also`, or one found so; and those of the followers that these read.
    fn depend_on(&self, signs: &[f64], also: Vec<usize>, followers: &[Follower]) -> Vec<bool> {
        let mut active = vec![false; self.affine.len()];
        let mut outputs = self.field.clone();
        for j in also {
            active[j] = true;
            outputs.push(self.graph.surface(j as u32));
        }
        let mut idle: Vec<&Follower> = followers.iter().collect();
        loop {
            let found = self.graph.sign_dependencies(&outputs, signs);
            let fresh: Vec<usize> = (0..found.len())
                .filter(|&j| found[j] && !active[j])
                .collect();
            for &j in &fresh {
                active[j] = true;
                outputs.push(self.graph.surface(j as u32));
            }
            if !fresh.is_empty() {
                continue;
            }
            let read = match idle.is_empty() {
                true => Vec::new(),
                false => self.graph.parameters_read_at(&outputs, signs),
            };
            let is_read = |one: &&Follower| read.contains(&one.parameter);
            let (needed, others): (Vec<_>, Vec<_>) = idle.into_iter().partition(is_read);
            if needed.is_empty() {
                return active;
            }
            for follower in needed {
                outputs.push(follower.argument);
                if let Some(guard) = follower.guard {
                    active[guard] = true;
                    outputs.push(self.graph.surface(guard as u32));
                }
            }
            idle = others;
        }
    }

    /// May the field, or the function of an active or watched surface, jump at surface `j` in this mode? A watched surface
    /// triggers actions by its own sign.
    pub fn jumps_across(&self, j: usize, signs: &[f64], sliding: &[usize]) -> bool {
        if self.watched.contains(&j) {
            return true;
        }
        let mut mode = entries(signs, sliding);
        mode[j] = 0;
        let mut known = self.jumps.lock().unwrap_or_else(PoisonError::into_inner);
        *known.entry((j, mode)).or_insert_with_key(|(_, mode)| {
            let mut roots = self.field.clone();
            let watched = self.watched.iter();
            roots.extend(watched.map(|&k| self.graph.surface(k as u32)));
            let signs = mode.iter().map(|&s| (s != 0).then(|| f64::from(s)));
            let signs: Vec<Option<f64>> = signs.collect();
            // The values of the parameters and of discrete states are left open: the answer holds for all of them.
            Regions::new(self.graph.clone(), Vec::new(), Vec::new())
                .jump_across(&roots, &signs, j as u32)
        })
    }

    /// Calls a function with the program of a Lie derivative, which is made when it is first needed.
    pub fn with_lie_derivative<R>(
        &self,
        (i, j): (usize, usize),
        word: Word,
        f: impl FnOnce(&Program) -> R,
    ) -> R {
        match *word {
            [first, second] if i == j && first == second => {
                let known = &self.second_lie[j][usize::from(first > 0)];
                let made = known.get_or_init(|| self.lie_derivative(i, j, word));
                f(made.program.program())
            }
            _ => f(self.lie_derivative(i, j, word).program.program()),
        }
    }

    fn lie_derivative(&self, i: usize, j: usize, word: Word) -> Arc<LieProgram> {
        let mut cache = self.lie.lock().unwrap_or_else(PoisonError::into_inner);
        self.lie(&mut cache, i, j, word)
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
            Some((&side, _)) => self.derivative_terms(graph, inner, j, f64::from(side)),
        };
        let mut outputs = vec![node];
        outputs.extend(terms);
        // The first derivatives are asked for at every switch; a large graph is not copied for each of them.
        let program = if graph.len() <= LARGEST_COPIED && word.len() <= 2 {
            TieredProgram::new(graph.clone(), outputs, self.backend)
        } else {
            Tiered::interpreted(compile(graph, &outputs, Backend::Interpreter))
        };
        let lie = Arc::new(LieProgram { node, program });
        cache.programs.insert(key, Arc::clone(&lie));
        lie
    }
}
