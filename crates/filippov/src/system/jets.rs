//! Taylor coefficients of the motions of a traced system: in a region, and sliding.

use filippov_expr::{Backend, ExprError, Gradient, Graph, JetProgram, Multipliers, NodeId};

use super::jet_multipliers::MultiplierEquations;
use super::tiered::Tiered;
use super::Place;

/// Taylor coefficients of the motions on a set of surfaces, and of what is monitored on them.
///
/// One row per order; each has the states, then the listed surfaces, then the exit functions.
pub struct MotionJets {
    program: Tiered<JetProgram>,
    order: usize,
    n_states: usize,
    surfaces: Vec<usize>,
    n_exits: usize,
    has_affine_exits: bool,
    tells_of_exits: bool,
    /// Of sliding on several surfaces.
    equations: Option<MultiplierEquations>,
}

impl MotionJets {
    /// The coefficients up to `order` of a motion on the surfaces `sliding`, and of these curved switching functions (increasing), or of all;
    /// `None` if sliding on these surfaces has none.
    pub(super) fn new(
        graph: &Graph,
        (field, sliding, functions): (&[NodeId], &[usize], Option<&[usize]>),
        order: usize,
        backend: Backend,
    ) -> Option<MotionJets> {
        let mut graph = graph.clone();
        let n_states = field.len();
        let mut equations = None;
        let mut multipliers = Multipliers::default();
        let (field, exits) = match sliding {
            [] => (field.to_vec(), Vec::new()),
            &[j] => sliding_field(&mut graph, field, j),
            _ => {
                let made = MultiplierEquations::new(&mut graph, field, sliding, backend)?;
                (equations, multipliers) = (Some(made.0), made.2);
                (made.1, ends(&mut graph, sliding))
            }
        };
        let curved = |j: &usize| !graph.is_affine(graph.surface(*j as u32));
        let surfaces: Vec<usize> = match functions {
            Some(chosen) => chosen.iter().copied().filter(curved).collect(),
            None => (0..graph.n_surfaces()).filter(curved).collect(),
        };
        let mut functions: Vec<NodeId> =
            surfaces.iter().map(|&j| graph.surface(j as u32)).collect();
        functions.extend(&exits);
        // Multipliers of several surfaces stand in the place of signs, and are no constants.
        let has_affine_exits =
            sliding.len() == 1 && exits.iter().all(|&f| graph.is_affine_between_switches(f));
        let tells_of_exits = !graph.hides_changes(&field) && graph.is_told_by_series(&exits);
        let make = move |backend| compile(&graph, &field, &functions, &multipliers, order, backend);
        Some(MotionJets {
            program: Tiered::from(make, backend),
            order,
            n_states,
            surfaces,
            n_exits: exits.len(),
            has_affine_exits,
            tells_of_exits,
            equations,
        })
    }

    /// The highest order.
    pub fn order(&self) -> usize {
        self.order
    }

    /// How many evaluations of the field take as many operations.
    #[inline(always)]
    pub fn cost(&self) -> u64 {
        self.program.program().cost() as u64
    }

    /// How many operations the coefficients take.
    pub fn operations(&self) -> usize {
        self.program.program().operations()
    }

    /// Is the program unrolled? Else it works by loops, for large systems.
    pub fn is_unrolled(&self) -> bool {
        self.program.program().is_unrolled()
    }

    /// Entries of a row.
    pub fn width(&self) -> usize {
        self.n_states + self.surfaces.len() + self.n_exits
    }

    /// The place of a switching function in a row; none if it is affine, and follows from the states.
    pub fn surface(&self, j: usize) -> Option<usize> {
        let place = self.surfaces.binary_search(&j).ok()?;
        Some(self.n_states + place)
    }

    /// The place of an exit function in a row: on one surface the normal component of f-, then that of f+ with its
    /// sign changed; on several 1 + lambda and 1 - lambda for each.
    pub fn exit(&self, index: usize) -> Option<usize> {
        (index < self.n_exits).then_some(self.n_states + self.surfaces.len() + index)
    }

    /// Are the exit functions affine in (t, x) while no other surface switches? Then along a step they are polynomials
    /// as the states are.
    pub fn has_affine_exits(&self) -> bool {
        self.has_affine_exits
    }

    /// Do the coefficients of the exit functions tell of all that these do in a step?
    pub fn tells_of_exits(&self) -> bool {
        self.tells_of_exits
    }

    pub(super) fn eval(&self, place: &Place<'_>, p: &[f64], out: &mut [f64]) {
        let equations = self.equations.as_ref();
        MultiplierEquations::eval(equations, self.program.program(), place, p, out);
    }
}

/// 1 + lambda and 1 - lambda for each surface.
fn ends(graph: &mut Graph, surfaces: &[usize]) -> Vec<NodeId> {
    let one = graph.constant(1.0);
    let mut ends = Vec::with_capacity(2 * surfaces.len());
    for &j in surfaces {
        let lambda = graph.sign_of(j as u32);
        ends.extend([graph.add(one, lambda), graph.sub(one, lambda)]);
    }
    ends
}

fn compile(
    graph: &Graph,
    field: &[NodeId],
    functions: &[NodeId],
    multipliers: &Multipliers,
    order: usize,
    backend: Backend,
) -> JetProgram {
    let compile = |backend| -> Result<JetProgram, ExprError> {
        JetProgram::with_multipliers(graph, field, functions, multipliers, order, backend)
    };
    compile(backend)
        .or_else(|_| compile(Backend::Interpreter))
        .expect("the interpreter refuses only nodes of another graph")
}

/// Filippov's field on surface `j` and its exit functions. With the field f0 + s f1 in the sign s of the surface,
/// and the rates a0 + s a1 of its switching function, the multiplier is -a0/a1: in this form it is simple where
/// the jump f1 is.
pub(crate) fn sliding_field(
    graph: &mut Graph,
    field: &[NodeId],
    j: usize,
) -> (Vec<NodeId>, Vec<NodeId>) {
    let Gradient { time, states } = graph.gradient(graph.surface(j as u32));
    let (middle, jump) = middle_and_jump(graph, field, j);
    let zero = graph.constant(0.0);
    // On a surface x_i = constant the state x_i stands still; written out, that would be so up to rounding.
    let stands_still = match states[..] {
        [(i, _)] if time == zero => Some(i as usize),
        _ => None,
    };
    let mut rates = [time, zero];
    for (i, partial) in states {
        for (rate, values) in rates.iter_mut().zip([&middle, &jump]) {
            let term = graph.mul(partial, values[i as usize]);
            *rate = graph.add(*rate, term);
        }
    }
    let [still, change] = rates;
    let opposite = graph.neg(still);
    let multiplier = graph.div(opposite, change);
    let sides = middle.iter().zip(&jump).enumerate();
    let sliding = sides.map(|(i, (&middle, &jump))| {
        if stands_still == Some(i) {
            return zero;
        }
        let share = graph.mul(multiplier, jump);
        graph.add(middle, share)
    });
    let sliding = sliding.collect();
    // The component of f- is a0 - a1; that of f+ is a0 + a1.
    let minus = graph.sub(still, change);
    let plus = graph.add(still, change);
    let inward = graph.neg(plus);
    (sliding, vec![minus, inward])
}

/// f0 and f1 of the field f0 + s f1 in the sign s of surface `j`.
fn middle_and_jump(graph: &mut Graph, field: &[NodeId], j: usize) -> (Vec<NodeId>, Vec<NodeId>) {
    let mut at = |values: &[NodeId], sign: f64| {
        let mut signs = vec![None; graph.n_surfaces()];
        signs[j] = Some(sign);
        graph.at_signs(values, &signs)
    };
    let (below, above) = (at(field, -1.0), at(field, 1.0));
    let dependence = graph.sign_dependence(field, &[j as u32]);
    if dependence.surfaces.is_empty() {
        let half = graph.constant(0.5);
        let mut halves = |subtract: bool| -> Vec<NodeId> {
            let sides = above.iter().zip(&below);
            let both = sides.map(|(&above, &below)| {
                let both = if subtract {
                    graph.sub(above, below)
                } else {
                    graph.add(above, below)
                };
                graph.mul(half, both)
            });
            both.collect()
        };
        return (halves(false), halves(true));
    }
    let zero = graph.constant(0.0);
    let jump = dependence.derivatives.iter().map(|derivatives| {
        let own = derivatives.iter().find(|(k, _)| *k == j as u32);
        own.map_or(zero, |&(_, node)| node)
    });
    let jump = jump.collect();
    let mut signs = vec![None; graph.n_surfaces()];
    signs[j] = Some(0.0);
    (graph.at_signs(&dependence.values, &signs), jump)
}
