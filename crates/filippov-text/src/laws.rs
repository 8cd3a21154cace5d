//! Laws with memory in a trace, each with a discrete state of its own: what `python/filippov/trace/laws.py` does.

use std::collections::BTreeSet;
use std::sync::Arc;

use filippov::{Law, Rules, Step};
use filippov_expr::{BinaryOp, Discrete, NodeId, Pieces, Switching, UnaryOp};

use crate::parts::{by_parts, has_constant_part};
use crate::tracer::{Kind, Tracer};
use crate::unreadable::Refused;

/// Whole numbers are told apart by less.
const BETWEEN: f64 = 1e-6;
/// An end of a range counts as a whole number up to rounding.
const WHOLE: f64 = 1e-9;

/// What a discrete state follows.
#[derive(Clone, Debug, PartialEq)]
enum Form {
    Clock(NodeId),
    Level(NodeId),
    Held(NodeId),
    Sign(NodeId),
    Place(NodeId, Vec<f64>),
    Piece(NodeId, Vec<f64>),
    Entry(NodeId, f64, Vec<f64>),
    Hysteresis([NodeId; 3], f64),
}

impl Form {
    fn argument(&self) -> NodeId {
        match *self {
            Form::Clock(node)
            | Form::Level(node)
            | Form::Held(node)
            | Form::Sign(node)
            | Form::Place(node, _)
            | Form::Piece(node, _)
            | Form::Entry(node, ..)
            | Form::Hysteresis([node, ..], _) => node,
        }
    }

    fn values(&self) -> Discrete {
        match self {
            Form::Hysteresis(..) => Discrete::Side,
            Form::Entry(_, first, list) => {
                let numbers = std::iter::once(first).chain(list);
                match numbers.into_iter().all(|number| number.fract() == 0.0) {
                    true => Discrete::Whole,
                    false => Discrete::Real,
                }
            }
            _ => Discrete::Whole,
        }
    }
}

/// The laws of one trace: equal ones share their discrete state.
#[derive(Debug, Default)]
pub struct Laws {
    /// The index of the first discrete state among the parameters.
    first: usize,
    forms: Vec<Form>,
    values: Vec<Discrete>,
    /// Surfaces with static friction above kinetic, and the ratios of the two.
    sticking: Vec<(u32, NodeId)>,
}

impl Laws {
    pub fn new(first: usize) -> Self {
        Laws {
            first,
            ..Laws::default()
        }
    }

    pub fn is_empty(&self) -> bool {
        self.forms.is_empty()
    }

    /// What each discrete state is.
    pub fn discrete(&self) -> Vec<Discrete> {
        self.values.clone()
    }

    /// Does what a law returns depend on the past, and not on the point alone?
    pub fn remember(&self) -> bool {
        let is_relay = |form: &Form| matches!(form, Form::Hysteresis(..));
        !self.sticking.is_empty() || self.forms.iter().any(is_relay)
    }

    /// The largest whole number that is not above an expression.
    pub fn floor(tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        if let Some(known) = tracer.known_value(node) {
            let whole = known.floor();
            for bound in [whole, whole + 1.0] {
                let bound = tracer.graph.constant(bound);
                let difference = tracer.binary(BinaryOp::Sub, node, bound);
                tracer.known_sign(difference);
            }
            return Ok(tracer.graph.constant(whole));
        }
        if !tracer.graph.depends_on_motion(node) || tracer.is_constant_of_motion(node) {
            return Ok(Laws::state(tracer, Form::Held(node), "floor"));
        }
        if Laws::is_clock(tracer, node) {
            return Ok(Laws::state(tracer, Form::Clock(node), "floor"));
        }
        let pieces = tracer.pieces(node, true)?;
        if let Some(pieces) = Laws::own_parts(tracer, node, pieces) {
            // A level follows what moves continuously: each part has its own.
            return by_parts(tracer, &pieces, &mut |tracer, part, _| {
                Laws::floor(tracer, part)
            });
        }
        let (plain, node) = (node, tracer.as_surface(node));
        let level = Laws::state(tracer, Form::Level(node), "nearest");
        let half = tracer.graph.constant(0.5);
        tracer.ask(node, Kind::Quantiser);
        // At a whole number the floor is that number itself.
        let above = Laws::above(tracer, node, level)?;
        let below = tracer.graph.constant(-0.5);
        let step = tracer.choose_by(above, half, below)?;
        let lower = tracer.binary(BinaryOp::Sub, level, half);
        let floor = tracer.binary(BinaryOp::Add, lower, step);
        let arguments: &[NodeId] = match plain == node {
            true => &[node],
            false => &[plain, node],
        };
        for &argument in arguments {
            let rest = tracer.binary(BinaryOp::Sub, argument, floor);
            tracer.graph.declare_not_negative(rest);
            let one = tracer.graph.constant(1.0);
            let other = tracer.binary(BinaryOp::Sub, one, rest);
            tracer.graph.declare_not_negative(other);
        }
        Ok(floor)
    }

    /// Pieces each of which has a law of its own, as a law follows what moves continuously.
    pub fn own_parts(tracer: &Tracer, node: NodeId, pieces: Option<Pieces>) -> Option<Pieces> {
        pieces.filter(|pieces| has_constant_part(tracer, pieces) || tracer.jumps(node))
    }

    /// What is positive where an expression is above the whole number of its level.
    ///
    /// An expression turns back at the ends of its range. If such an end is a whole number, the difference is moved off zero there.
    fn above(tracer: &mut Tracer, node: NodeId, level: NodeId) -> Result<NodeId, Refused> {
        let distance = tracer.binary(BinaryOp::Sub, node, level);
        let (low, high) = tracer.graph.range(node);
        let (low, high) = (whole_number(low), whole_number(high));
        if low.is_none() && high.is_none() {
            return Ok(distance);
        }
        let mut knots: Vec<f64> = low.iter().map(|low| low + 0.5).collect();
        let mut offsets = match low {
            None => vec![0.0],
            Some(_) => vec![1.0, 0.0],
        };
        if let Some(high) = high.filter(|high| low.is_none_or(|low| *high > low)) {
            knots.push(high - 0.5);
            offsets.push(-1.0);
        }
        let place = Laws::state(tracer, Form::Place(level, knots), "place");
        let entry = Laws::entry(tracer, place, offsets, 0.0, "end");
        Ok(tracer.binary(BinaryOp::Add, distance, entry))
    }

    /// The smallest whole number that is not below an expression.
    pub fn ceil(tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        if let Some(pieces) = Laws::still_parts(tracer, node)? {
            return by_parts(tracer, &pieces, &mut |tracer, part, _| {
                Laws::ceil(tracer, part)
            });
        }
        if tracer.graph.depends_on_motion(node) && !tracer.is_constant_of_motion(node) {
            // What moves is a whole number in instants only.
            let floor = Laws::floor(tracer, node)?;
            let one = tracer.graph.constant(1.0);
            return Ok(tracer.binary(BinaryOp::Add, floor, one));
        }
        let opposite = tracer.unary(UnaryOp::Neg, node);
        let floor = Laws::floor(tracer, opposite)?;
        Ok(tracer.unary(UnaryOp::Neg, floor))
    }

    fn still_parts(tracer: &mut Tracer, node: NodeId) -> Result<Option<Pieces>, Refused> {
        let pieces = tracer.pieces(node, true)?;
        Ok(pieces.filter(|pieces| {
            matches!(pieces, Pieces::Sides(..)) && has_constant_part(tracer, pieces)
        }))
    }

    /// The whole number that is next to an expression on the side of zero.
    pub fn trunc(tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        if !Laws::is_clock(tracer, node) || tracer.graph.as_constant(node).is_some() {
            let floor = Laws::floor(tracer, node)?;
            let ceil = Laws::ceil(tracer, node)?;
            return tracer.choose_by(node, floor, ceil);
        }
        // Of the time it is the floor from 0 on and one more before: without a surface at 0.
        let below = Laws::floor(tracer, node)?;
        let half = tracer.graph.constant(0.5);
        let middle = tracer.binary(BinaryOp::Add, below, half);
        let side = Laws::sign(tracer, middle)?;
        let share = tracer.binary(BinaryOp::Mul, half, side);
        let rise = tracer.binary(BinaryOp::Sub, half, share);
        Ok(tracer.binary(BinaryOp::Add, below, rise))
    }

    /// The nearest whole number; halfway the even one.
    pub fn rint(tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        if let Some(value) = tracer.graph.as_constant(node) {
            return Ok(tracer.graph.constant(value.round_ties_even()));
        }
        if let Some(pieces) = Laws::still_parts(tracer, node)? {
            return by_parts(tracer, &pieces, &mut |tracer, part, _| {
                Laws::rint(tracer, part)
            });
        }
        let half = tracer.graph.constant(0.5);
        let shifted = tracer.binary(BinaryOp::Add, node, half);
        let above = Laws::floor(tracer, shifted)?;
        if !Laws::is_held(tracer, node) {
            return Ok(above);
        }
        // What stands still may stand halfway: there the whole number above is one more than the one below.
        let shifted = tracer.binary(BinaryOp::Sub, half, node);
        let below = Laws::floor(tracer, shifted)?;
        let is_halfway = tracer.binary(BinaryOp::Add, above, below);
        let half_of = tracer.binary(BinaryOp::Mul, half, above);
        let even = Laws::floor(tracer, half_of)?;
        let rest = tracer.binary(BinaryOp::Sub, half_of, even);
        let two = tracer.graph.constant(2.0);
        let odd = tracer.binary(BinaryOp::Mul, two, rest);
        let lowered = tracer.binary(BinaryOp::Mul, is_halfway, odd);
        Ok(tracer.binary(BinaryOp::Sub, above, lowered))
    }

    /// The sign of a constant of motion: -1, 0 or 1 as Python has it.
    pub fn sign(tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        Ok(Laws::state(tracer, Form::Sign(node), "sign"))
    }

    /// The state, +1 or -1, of a relay with two thresholds.
    pub fn hysteresis(
        tracer: &mut Tracer,
        node: NodeId,
        [low, high]: [NodeId; 2],
        initial: f64,
    ) -> NodeId {
        tracer.ask(node, Kind::Hysteresis);
        Laws::state(
            tracer,
            Form::Hysteresis([node, low, high], initial),
            "hysteresis",
        )
    }

    /// The sign of an expression at whose zero static friction is above kinetic.
    pub fn stick(tracer: &mut Tracer, node: NodeId, ratio: NodeId) -> Result<NodeId, Refused> {
        tracer.ask(node, Kind::Sign);
        if let Switching::Surface { index, .. } = tracer.graph.switch(node) {
            let sticking = &mut tracer.laws.sticking;
            match sticking.iter().find(|(surface, _)| *surface == index) {
                Some((_, other)) if *other != ratio => {
                    return tracer.refuse("two ratios of static to kinetic friction in one place");
                }
                Some(_) => {}
                None => sticking.push((index, ratio)),
            }
        }
        Ok(tracer.graph.sign(node))
    }

    /// The number of knots that are not above an expression.
    pub fn place(tracer: &mut Tracer, node: NodeId, knots: Vec<f64>) -> NodeId {
        if !tracer.graph.depends_on_motion(node) || tracer.is_constant_of_motion(node) {
            return Laws::state(tracer, Form::Place(node, knots), "place");
        }
        let node = match Laws::is_clock(tracer, node) {
            true => node,
            false => tracer.as_surface(node),
        };
        Laws::state(tracer, Form::Piece(node, knots), "piece")
    }

    /// The entry of a list at a place that stands still between jumps; the list begins at the place `first`.
    pub fn entry(
        tracer: &mut Tracer,
        place: NodeId,
        entries: Vec<f64>,
        first: f64,
        name: &str,
    ) -> NodeId {
        if entries.windows(2).all(|pair| pair[0] == pair[1]) {
            return tracer.graph.constant(entries[0]);
        }
        let own = Laws::read(tracer, place);
        let inner = match (&own[..], *tracer.graph.node(place)) {
            // The entry at an entry is that of a list of its own.
            (&[index], filippov_expr::Node::Parameter(_)) => match &tracer.laws.forms[index] {
                Form::Entry(place, inner_first, through)
                    if tracer.laws.values[index] == Discrete::Whole =>
                {
                    Some((*place, *inner_first, through.clone()))
                }
                _ => None,
            },
            _ => None,
        };
        let (place, first, entries) = match inner {
            Some((place, inner_first, through)) => {
                // As Python counts, from the end where it is negative.
                let at = |at: &f64| {
                    let index = (at - first) as i64;
                    let count = entries.len() as i64;
                    let index = if index < 0 { index + count } else { index };
                    entries.get(index as usize).copied().unwrap_or(f64::NAN)
                };
                (place, inner_first, through.iter().map(at).collect())
            }
            None => (place, first, entries),
        };
        let name = match name {
            "" => format!("entry({})", tracer.text(place)),
            name => name.to_owned(),
        };
        Laws::state(tracer, Form::Entry(place, first, entries), &name)
    }

    /// Does an expression contain discrete states, and is it constant between their changes?
    pub fn is_held(tracer: &Tracer, node: NodeId) -> bool {
        Laws::reads_any(tracer, node) && !tracer.graph.depends_on_motion(node)
    }

    /// Does an expression contain discrete states?
    pub fn reads_any(tracer: &Tracer, node: NodeId) -> bool {
        !tracer.laws.is_empty() && !Laws::read(tracer, node).is_empty()
    }

    /// Is an expression affine in time, with coefficients that no run changes?
    pub fn is_clock(tracer: &Tracer, node: NodeId) -> bool {
        let graph = &tracer.graph;
        !graph.depends_on_state(node)
            && graph.is_affine(node)
            && Laws::read(tracer, node).is_empty()
    }

    /// An expression of whole numbers with the sign of one that stands still between jumps.
    pub fn whole(tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        let values = &tracer.laws.values;
        let mut read = Laws::read(tracer, node).into_iter();
        match read.any(|index| values[index] == Discrete::Real) {
            true => Laws::sign(tracer, node),
            false => Ok(node),
        }
    }

    /// An expression of whole numbers moved off them, so that it is never zero.
    pub fn beside(tracer: &mut Tracer, node: NodeId, side: f64) -> NodeId {
        let shift = tracer.graph.constant(side * BETWEEN);
        tracer.binary(BinaryOp::Add, node, shift)
    }

    /// Does an expression of tables stand still in some of their pieces?
    pub fn stands_still_in_pieces(tracer: &mut Tracer, node: NodeId) -> bool {
        if tracer.laws.is_empty() || !tracer.graph.depends_on_motion(node) {
            return false;
        }
        let mut tables: Vec<(NodeId, Vec<Row>)> = Vec::new();
        for index in Laws::read(tracer, node) {
            if let Form::Entry(place, first, list) = &tracer.laws.forms[index] {
                let state = (tracer.laws.first + index) as u32;
                let is_zero = list.iter().map(|entry| *entry == 0.0).collect();
                let row = Row {
                    state,
                    first: *first,
                    is_zero,
                };
                match tables.iter_mut().find(|(known, _)| known == place) {
                    Some((_, rows)) => rows.push(row),
                    None => tables.push((*place, vec![row])),
                }
            }
        }
        tables.iter().any(|(_, rows)| still(tracer, node, rows))
    }

    /// Declares the surfaces at which discrete states change, behind all others; the new numbers of those before, and the rules.
    pub fn complete(tracer: &mut Tracer, kept: &[u32]) -> Result<(Vec<u32>, Rules), Refused> {
        let order = tracer.graph.put_standing_surfaces_last(kept);
        let sticking = std::mem::take(&mut tracer.laws.sticking);
        // Python makes this number here.
        tracer.graph.constant(0.5);
        let before = tracer.graph.n_surfaces();
        let mut laws = Vec::new();
        // A table adds laws for the ends of its pieces.
        let mut index = 0;
        while let Some(form) = tracer.laws.forms.get(index).cloned() {
            let state = tracer.graph.parameter((tracer.laws.first + index) as u32);
            laws.push(Laws::law(tracer, form, state)?);
            index += 1;
        }
        let mut sticking: Vec<(usize, NodeId)> = sticking
            .into_iter()
            .map(|(surface, ratio)| (order[surface as usize] as usize, ratio))
            .collect();
        sticking.dedup();
        let rules = Rules {
            laws,
            n_hidden: tracer.graph.n_surfaces() - before,
            sticking,
            ..Rules::default()
        };
        Ok((order, rules))
    }

    fn law(tracer: &mut Tracer, form: Form, state: NodeId) -> Result<Law, Refused> {
        let held = |argument, step| Law::Held { argument, step };
        Ok(match form {
            Form::Clock(argument) => Law::Clock { argument },
            Form::Held(argument) => held(argument, Step::Floor),
            Form::Sign(argument) => held(argument, Step::Sign),
            Form::Place(argument, knots) => held(argument, Step::Place(knots.into())),
            Form::Entry(argument, first, list) => {
                let list: Arc<[f64]> = list.into();
                held(argument, Step::Entry { first, list })
            }
            Form::Level(argument) => {
                let distance = tracer.binary(BinaryOp::Sub, argument, state);
                let above = Laws::above(tracer, argument, state)?;
                let Switching::Surface { index, orientation } = tracer.graph.switch(above) else {
                    return tracer.refuse("a floor of what never changes is not read here");
                };
                let sign = tracer.graph.sign(above);
                let size = tracer.binary(BinaryOp::Mul, sign, distance);
                // At the golden ratio no quantity turns back by design, as many do at 1/2.
                let reach = tracer.graph.constant(0.5 * (5.0_f64.sqrt() - 1.0));
                let inside = tracer.binary(BinaryOp::Sub, reach, size);
                let guard = tracer.graph.declare_surface(inside) as usize;
                Law::Level {
                    argument,
                    surface: index as usize,
                    orientation,
                    guard,
                }
            }
            Form::Piece(argument, knots) => {
                let guard = match Laws::is_clock(tracer, argument) {
                    true => None,
                    false => {
                        let between = Laws::between(tracer, argument, &knots, state);
                        Some(tracer.graph.declare_surface(between) as usize)
                    }
                };
                Law::Piece {
                    argument,
                    knots: knots.into(),
                    guard,
                }
            }
            Form::Hysteresis([argument, low, high], initial) => {
                let half = tracer.graph.constant(0.5);
                let sum = tracer.binary(BinaryOp::Add, low, high);
                let middle = tracer.binary(BinaryOp::Mul, half, sum);
                let difference = tracer.binary(BinaryOp::Sub, high, low);
                let width = tracer.binary(BinaryOp::Mul, half, difference);
                let distance = tracer.binary(BinaryOp::Sub, argument, middle);
                let inside = tracer.binary(BinaryOp::Mul, state, distance);
                let guard = tracer.binary(BinaryOp::Add, inside, width);
                let guard = tracer.graph.declare_surface(guard) as usize;
                Law::Hysteresis {
                    argument,
                    thresholds: [low, high],
                    initial,
                    guard,
                }
            }
        })
    }

    /// What is positive between the knots around an expression, and zero at them.
    fn between(tracer: &mut Tracer, node: NodeId, knots: &[f64], piece: NodeId) -> NodeId {
        let rates: Vec<f64> = knots
            .windows(2)
            .map(|pair| 1.0 / (pair[1] - pair[0]))
            .collect();
        // The slopes at a knot are the same from both pieces: what is rounding on one side is so on the other.
        let slope = match knots {
            [first, .., last] => rates.len() as f64 / (last - first),
            _ => 1.0,
        };
        let above = [&[slope], &rates[..]].concat();
        let below = vec![slope; knots.len()];
        let mut distance = |rates: Vec<f64>, ends: Vec<f64>| {
            let rate = Laws::entry(tracer, piece, rates, 0.0, "");
            let end = Laws::entry(tracer, piece, ends, 0.0, "");
            let scaled = tracer.binary(BinaryOp::Mul, rate, node);
            tracer.binary(BinaryOp::Sub, scaled, end)
        };
        // Beyond the ends of the table one of the two distances is 1.
        let products = |rates: &[f64]| -> Vec<f64> {
            rates
                .iter()
                .zip(knots)
                .map(|(rate, knot)| rate * knot)
                .collect()
        };
        let from_below = distance(
            [&[0.0], &below[..]].concat(),
            [&[-1.0], &products(&below)[..]].concat(),
        );
        let from_above = distance(
            [&above[..], &[0.0]].concat(),
            [&products(&above)[..], &[1.0]].concat(),
        );
        let product = tracer.binary(BinaryOp::Mul, from_below, from_above);
        tracer.unary(UnaryOp::Neg, product)
    }

    /// The indices of the discrete states in an expression.
    fn read(tracer: &Tracer, node: NodeId) -> Vec<usize> {
        let read = tracer.graph.parameters_read(node).into_iter();
        read.filter_map(|index| (index as usize).checked_sub(tracer.laws.first))
            .collect()
    }

    fn state(tracer: &mut Tracer, form: Form, name: &str) -> NodeId {
        let known = tracer.laws.forms.iter().position(|known| *known == form);
        let index = known.unwrap_or_else(|| {
            let name = match name.ends_with(')') {
                true => name.to_owned(),
                false => format!("{name}({})", tracer.text(form.argument())),
            };
            tracer.names.parameters.push(name);
            tracer.laws.values.push(form.values());
            tracer.laws.forms.push(form);
            tracer.laws.forms.len() - 1
        });
        tracer.graph.parameter((tracer.laws.first + index) as u32)
    }

    /// Are what was taken for constants of motion constant along these motions?
    pub fn are_of_constants(
        tracer: &Tracer,
        constants: &crate::constants_of_motion::Constants,
    ) -> bool {
        let held = tracer.laws.forms.iter().filter(|form| {
            matches!(
                form,
                Form::Held(_) | Form::Sign(_) | Form::Place(..) | Form::Entry(..)
            )
        });
        held.map(Form::argument).all(|node| {
            !tracer.graph.depends_on_motion(node) || constants.have(&tracer.graph, node)
        })
    }

    /// The expressions that laws follow.
    pub fn arguments(&self) -> Vec<NodeId> {
        let of = |form: &Form| match form {
            Form::Hysteresis(nodes, _) => nodes.to_vec(),
            other => vec![other.argument()],
        };
        self.forms.iter().flat_map(of).collect()
    }
}

/// Where the entries of a list are zero.
struct Row {
    state: u32,
    first: f64,
    is_zero: Vec<bool>,
}

/// Does an expression stand still where entries of these lists, which are read at one place, are zero?
fn still(tracer: &mut Tracer, node: NodeId, rows: &[Row]) -> bool {
    let shape = |row: &Row| (row.first.to_bits(), row.is_zero.len());
    if rows.iter().any(|row| shape(row) != shape(&rows[0])) {
        return false;
    }
    let graph = &mut tracer.graph;
    let zero = graph.constant(0.0);
    let pattern = |k: usize| rows.iter().map(|row| row.is_zero[k]).collect::<Vec<bool>>();
    let patterns: BTreeSet<Vec<bool>> = (0..rows[0].is_zero.len()).map(pattern).collect();
    let mut stands_still = false;
    for pattern in patterns {
        let zeros = rows.iter().zip(pattern).filter(|(_, is_zero)| *is_zero);
        let images: Vec<(NodeId, NodeId)> = zeros
            .map(|(row, _)| (graph.parameter(row.state), zero))
            .collect();
        let still = graph.substituted(node, &images);
        stands_still |= !images.is_empty() && !graph.depends_on_motion(still);
    }
    stands_still
}

/// The end of a range if it is a whole number.
fn whole_number(end: f64) -> Option<f64> {
    let whole = end.round_ties_even();
    (end.is_finite() && (end - whole).abs() < WHOLE).then_some(whole)
}
