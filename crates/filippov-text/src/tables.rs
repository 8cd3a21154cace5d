//! Tables of numbers in a trace: piecewise linear functions, places among knots, entries of lists, as in
//! `python/filippov/trace/tables.py`.

use filippov_expr::{BinaryOp, NodeId, UnaryOp};

use crate::laws::Laws;
use crate::parts::by_parts;
use crate::tracer::{Kind, Tracer};
use crate::unreadable::Refused;

/// A table of the state that jumps at more knots is looked up piece by piece.
pub const MOST_JUMPS: usize = 64;
/// Of the values beside a knot, relative: what rounding leaves is no jump.
const ROUNDING: f64 = 1e-10;

/// A piecewise linear function: it has the value `value + slope * (x - base)` in each piece.
#[derive(Clone, Debug)]
pub struct Table {
    knots: Vec<f64>,
    bases: Vec<f64>,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Table {
    /// The table that is linear between its places, and has these values beyond them. Where two places are equal, it jumps.
    pub fn linear(places: &[f64], values: &[f64], left: f64, right: f64) -> Self {
        let n = places.len();
        let kept: Vec<usize> = (0..n - 1)
            .filter(|&k| places[k + 1] - places[k] > 0.0)
            .collect();
        let slope = |&k: &usize| (values[k + 1] - values[k]) / (places[k + 1] - places[k]);
        let mut knots: Vec<f64> = kept.iter().map(|&k| places[k]).collect();
        knots.push(places[n - 1]);
        let around =
            |first: f64, middle: Vec<f64>, last: f64| [vec![first], middle, vec![last]].concat();
        Table {
            bases: around(
                knots[0],
                kept.iter().map(|&k| places[k]).collect(),
                places[n - 1],
            ),
            values: around(left, kept.iter().map(|&k| values[k]).collect(), right),
            slopes: around(0.0, kept.iter().map(slope).collect(), 0.0),
            knots,
        }
    }

    /// The knots at which the table jumps.
    fn jumps(&self) -> Vec<usize> {
        let value = |knot: usize, piece: usize| {
            let distance = self.knots[knot] - self.bases[piece];
            self.values[piece] + distance * (self.slopes[piece] + distance * 0.0)
        };
        let is_jump = |&k: &usize| {
            let (before, after) = (value(k, k), value(k, k + 1));
            let largest = before.abs().max(after.abs());
            (after - before).abs() > ROUNDING * largest
        };
        (0..self.knots.len()).filter(is_jump).collect()
    }

    /// The pieces from `first` to `last`, whose ends are continued.
    fn part(&self, first: usize, last: usize) -> Table {
        Table {
            knots: self.knots[first..last].to_vec(),
            bases: self.bases[first..=last].to_vec(),
            values: self.values[first..=last].to_vec(),
            slopes: self.slopes[first..=last].to_vec(),
        }
    }

    /// The node of the table at an expression.
    pub fn at(&self, tracer: &mut Tracer, node: NodeId) -> Result<NodeId, Refused> {
        if let Some(known) = tracer.known_value(node) {
            let piece = known_place(tracer, node, known, &self.knots);
            return Ok(self.part(piece, piece).value(tracer, node));
        }
        if stands_still_or_ticks(tracer, node) {
            return Ok(self.value(tracer, node));
        }
        let pieces = tracer.pieces(node, true)?;
        if let Some(pieces) = Laws::own_parts(tracer, node, pieces) {
            return by_parts(tracer, &pieces, &mut |tracer, part, _| {
                self.at(tracer, part)
            });
        }
        let jumps = self.jumps();
        if jumps.len() > MOST_JUMPS {
            return tracer.refuse(format!(
                "a table of the state that jumps at {} places is not read here",
                jumps.len()
            ));
        }
        let mut result = None;
        let firsts = std::iter::once(0).chain(jumps.iter().map(|jump| jump + 1));
        let ends = jumps.iter().copied().chain([self.knots.len()]);
        for (first, last) in firsts.zip(ends) {
            let value = self.part(first, last).value(tracer, node);
            result = Some(match result {
                None => value,
                Some(before) => {
                    let knot = tracer.graph.constant(self.knots[first - 1]);
                    let difference = tracer.binary(BinaryOp::Sub, node, knot);
                    tracer.choose_by(difference, value, before)?
                }
            });
        }
        Ok(result.unwrap_or(node))
    }

    /// The node of the polynomial of the piece in which the expression is.
    fn value(&self, tracer: &mut Tracer, node: NodeId) -> NodeId {
        let entry = |tracer: &mut Tracer, row: &[f64], name: &str| {
            if row.windows(2).all(|pair| pair[0] == pair[1]) {
                return tracer.graph.constant(row[0]);
            }
            let place = Laws::place(tracer, node, self.knots.clone());
            let name = format!("{name}({})", tracer.text(node));
            Laws::entry(tracer, place, row.to_vec(), 0.0, &name)
        };
        let mut result = tracer.graph.constant(0.0);
        let base = entry(tracer, &self.bases, "knot");
        let distance = tracer.binary(BinaryOp::Sub, node, base);
        for (row, name) in [(&self.slopes, "slope"), (&self.values, "value")] {
            let product = tracer.binary(BinaryOp::Mul, distance, result);
            let coefficient = entry(tracer, row, name);
            result = tracer.binary(BinaryOp::Add, coefficient, product);
        }
        result
    }
}

/// The number of knots that are not above an expression, or strictly below it.
pub fn count(
    tracer: &mut Tracer,
    node: NodeId,
    knots: &[f64],
    strictly: bool,
) -> Result<NodeId, Refused> {
    if strictly {
        let opposite = tracer.unary(UnaryOp::Neg, node);
        let reversed: Vec<f64> = knots.iter().rev().map(|knot| -knot).collect();
        let others = count(tracer, opposite, &reversed, false)?;
        let all = tracer.graph.constant(knots.len() as f64);
        return Ok(tracer.binary(BinaryOp::Sub, all, others));
    }
    if let Some(known) = tracer.known_value(node) {
        let place = known_place(tracer, node, known, knots);
        return Ok(tracer.graph.constant(place as f64));
    }
    if stands_still_or_ticks(tracer, node) {
        return Ok(Laws::place(tracer, node, knots.to_vec()));
    }
    let pieces = tracer.pieces(node, true)?;
    if let Some(pieces) = Laws::own_parts(tracer, node, pieces) {
        return by_parts(tracer, &pieces, &mut |tracer, part, _| {
            count(tracer, part, knots, false)
        });
    }
    // Nearest to the knot k the expression is behind k knots, or k + 1: a jump of an ordinary surface.
    let middles: Vec<f64> = knots
        .windows(2)
        .map(|pair| 0.5 * (pair[1] + pair[0]))
        .collect();
    let nearest = match middles.is_empty() {
        true => tracer.graph.constant(0.0),
        false => Laws::place(tracer, node, middles),
    };
    let name = format!("nearest({})", tracer.text(node));
    let knot = Laws::entry(tracer, nearest, knots.to_vec(), 0.0, &name);
    let next = (1..=knots.len()).map(|k| k as f64).collect();
    let above = Laws::entry(tracer, nearest, next, 0.0, "");
    tracer.ask(node, Kind::Quantiser);
    let difference = tracer.binary(BinaryOp::Sub, node, knot);
    tracer.choose_by(difference, above, nearest)
}

/// The entry of a list of numbers at an expression of whole numbers; a negative one counts from the end.
pub fn lookup(tracer: &mut Tracer, index: NodeId, entries: &[f64]) -> Result<NodeId, Refused> {
    let n = entries.len() as i64;
    let row = [entries, entries].concat();
    let at = |tracer: &mut Tracer, part: NodeId| {
        if let Some(place) = tracer.known_integer(part) {
            let found = usize::try_from(place + n).ok();
            let found = found.and_then(|place| row.get(place)).copied();
            return Ok(tracer.graph.constant(found.unwrap_or(f64::NAN)));
        }
        if !Laws::is_held(tracer, part) {
            return tracer.refuse("an index is a whole number: round it by int or np.floor");
        }
        Ok(Laws::entry(tracer, part, row.clone(), -(n as f64), ""))
    };
    match tracer.pieces(index, true)? {
        None => at(tracer, index),
        Some(pieces) => by_parts(tracer, &pieces, &mut |tracer, part, _| at(tracer, part)),
    }
}

fn stands_still_or_ticks(tracer: &mut Tracer, node: NodeId) -> bool {
    let still = !tracer.graph.depends_on_motion(node) || tracer.is_constant_of_motion(node);
    still || Laws::is_clock(tracer, node)
}

/// The place of an expression of parameters, which other values of them may change.
fn known_place(tracer: &mut Tracer, node: NodeId, known: f64, knots: &[f64]) -> usize {
    let place = knots.iter().filter(|knot| **knot <= known).count();
    let ends = place.saturating_sub(1)..(place + 1).min(knots.len());
    for end in &knots[ends] {
        let end = tracer.graph.constant(*end);
        let difference = tracer.binary(BinaryOp::Sub, node, end);
        tracer.known_sign(difference);
    }
    place
}
