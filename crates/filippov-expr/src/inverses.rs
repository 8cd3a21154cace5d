//! Switching functions without roots: `sqrt(u) - c` has the sign of `u - c abs(c)`, which is smooth where u vanishes.
//!
//! A root begins with a vertical tangent, and a logarithm with a pole, where its argument vanishes: beside that place neither
//! derivatives nor bounds of it say anything. The inverse function moves to the other side of the comparison:
//!
//! | term | beside c | compared instead |
//! |---|---|---|
//! | `cbrt(u)` | anything | u and c^3 |
//! | `sqrt(u)` | a number, what no motion changes, or of known sign; anything, if u is a cube root, or \|v\| with the sign of v in front | u and c \|c\| |
//! | `u**p` | the same | u and the power 1/p of \|c\|, with the sign of c |
//! | `log(u)` | the same | u and exp(c) |
//!
//! The last three are looked at only where u is not negative by itself: elsewhere they end where u does, and so has the comparison to.

use crate::few::sort_few;
use crate::graph::Graph;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::switching::Switching;

/// A function of one operand whose inverse is known.
#[derive(Clone, Copy, PartialEq)]
enum Inverse {
    Cube,
    /// This power.
    Power(f64),
    /// That of this base.
    Exponential(f64),
}

/// A term of a sum: `coefficient * signs * function(argument)`.
struct Term {
    place: usize,
    /// The signs in front, as a product; none if there are none.
    sign: Option<NodeId>,
    argument: NodeId,
    inverse: Inverse,
}

/// An expression with the same sign as a sum, times `+-1`, in which one root less stands; `None` if no root can be taken away.
pub(crate) fn without_root(graph: &mut Graph, form: &LinearForm) -> Option<(NodeId, f64)> {
    let joined = with_own_roots_joined(graph, form).map(|joined| (joined, 1.0));
    joined
        .or_else(|| base_of_odd_powers(graph, form))
        .or_else(|| solved_for_a_root(graph, form, true))
}

/// The v of a sum of odd powers `sign(v) |v|^p` of the same v, and of v itself, whose coefficients have one sign.
fn base_of_odd_powers(graph: &Graph, form: &LinearForm) -> Option<(NodeId, f64)> {
    let mut rest = LinearForm {
        terms: Vec::new(),
        constant: form.constant,
    };
    let mut found: Option<(NodeId, f64)> = None;
    for &(atom, coefficient) in &form.terms {
        match base_of_odd_power(graph, atom) {
            Some(v) => {
                let (known, sense) = *found.get_or_insert((v, coefficient.signum()));
                if known != v || sense * coefficient < 0.0 {
                    return None;
                }
            }
            None => rest.terms.push((atom, coefficient)),
        }
    }
    let (v, sense) = found?;
    let whole = LinearForm::of(graph, v);
    let is_multiple = match (rest.key(), whole.key()) {
        (Some((rest, leading)), Some((whole, own))) => {
            rest.matches(&whole) && sense * leading * own > 0.0
        }
        _ => rest.is_zero(),
    };
    is_multiple.then_some((v, sense))
}

/// The v of `sign(v) |m v|^p`.
fn base_of_odd_power(graph: &Graph, atom: NodeId) -> Option<NodeId> {
    let Node::Binary(BinaryOp::Mul, sign, power) = *graph.node(atom) else {
        return None;
    };
    let base = match *graph.node(power) {
        Node::Unary(UnaryOp::Sqrt, base) => base,
        Node::Binary(BinaryOp::Pow, base, p) if graph.as_constant(p)? > 0.0 => base,
        Node::Binary(BinaryOp::Mul, v, same) => {
            let is_own =
                matches!(*graph.node(sign), Node::Sign(j) if v == same && graph.surface(j) == v);
            return is_own.then_some(v);
        }
        _ => return None,
    };
    let inside = match *graph.node(base) {
        Node::Unary(UnaryOp::NotNegative, inside) => inside,
        _ => base,
    };
    let (size, factor) = with_factor(graph, inside);
    match *graph.node(size) {
        Node::Binary(BinaryOp::Mul, own, v) if own == sign && factor > 0.0 => Some(v),
        _ => None,
    }
}

/// The sum with every `v |v|^p` as the sign of v times `|v|^(p + 1)`: the first form has no slope at v = 0 that can be computed.
/// `None` if there is no such term.
fn with_own_roots_joined(graph: &mut Graph, form: &LinearForm) -> Option<NodeId> {
    let mut terms = form.terms.clone();
    for term in &mut terms {
        let Node::Binary(BinaryOp::Mul, a, b) = *graph.node(term.0) else {
            continue;
        };
        let joined = joined_with_own_root(graph, a, b);
        term.0 = joined
            .or_else(|| joined_with_own_root(graph, b, a))
            .unwrap_or(term.0);
    }
    let has_changed = terms != form.terms;
    let constant = form.constant;
    has_changed.then(|| LinearForm { terms, constant }.expression(graph))
}

/// `k v |m v|^p` as `k/m sign(v) |m v|^(p + 1)`, if the second factor is that root.
fn joined_with_own_root(graph: &mut Graph, kv: NodeId, root: NodeId) -> Option<NodeId> {
    let (base, exponent) = match *graph.node(root) {
        Node::Unary(UnaryOp::Sqrt, base) => (base, 0.5),
        Node::Binary(BinaryOp::Pow, base, p) => (base, graph.as_constant(p)?),
        _ => return None,
    };
    let inside = match *graph.node(base) {
        Node::Unary(UnaryOp::NotNegative, inside) => inside,
        _ => base,
    };
    let (v, k) = with_factor(graph, kv);
    let (size, m) = with_factor(graph, inside);
    let Node::Binary(BinaryOp::Mul, _, own) = *graph.node(size) else {
        return None;
    };
    let is_size = graph.is_absolute_value(graph.node(size));
    if exponent < 0.0 || m <= 0.0 || !is_size || own != v && own != graph.neg(v) {
        return None;
    }
    let (exponent, factor) = (graph.constant(exponent + 1.0), graph.constant(k / m));
    let (sign, power) = (graph.sign(v), graph.pow(base, exponent));
    let odd = graph.mul(sign, power);
    Some(graph.mul(factor, odd))
}

/// An expression as an expression and a number in front.
fn with_factor(graph: &Graph, id: NodeId) -> (NodeId, f64) {
    LinearForm::of(graph, id).single_atom().unwrap_or((id, 1.0))
}

/// The same, with the sign of the sum where that is defined: beyond the domain of the root it may have another one.
pub(crate) fn within_domain(graph: &mut Graph, form: &LinearForm) -> Option<(NodeId, f64)> {
    solved_for_a_root(graph, form, false)
}

/// If `is_everywhere`, also beyond the domain of the root.
fn solved_for_a_root(
    graph: &mut Graph,
    form: &LinearForm,
    is_everywhere: bool,
) -> Option<(NodeId, f64)> {
    let mut terms: Vec<Term> = (0..form.terms.len())
        .filter_map(|place| root_at(graph, form, place, is_everywhere))
        .collect();
    // A cube asks for nothing, and leaves other roots smoother than they were.
    let is_cube = |term: &Term| term.inverse == Inverse::Cube;
    sort_few(&mut terms, |a, b| is_cube(a) && !is_cube(b));
    for term in terms {
        if let Some(found) = solved(graph, form, &term) {
            return Some(found);
        }
    }
    None
}

/// The root that a term of a sum is, if it is one whose argument may vanish.
fn root_at(
    graph: &mut Graph,
    form: &LinearForm,
    place: usize,
    is_everywhere: bool,
) -> Option<Term> {
    let (sign, function) = signs_in_front(graph, form.terms[place].0);
    let (argument, inverse) = match *graph.node(function) {
        Node::Unary(UnaryOp::Cbrt, a) => (a, Inverse::Cube),
        Node::Unary(UnaryOp::Sqrt, a) => (a, Inverse::Power(2.0)),
        Node::Unary(UnaryOp::Log, a) => (a, Inverse::Exponential(std::f64::consts::E)),
        Node::Unary(UnaryOp::Log2, a) => (a, Inverse::Exponential(2.0)),
        Node::Unary(UnaryOp::Log10, a) => (a, Inverse::Exponential(10.0)),
        Node::Binary(BinaryOp::Pow, a, p) => match graph.as_constant(p) {
            Some(p) if p > 0.0 && p.fract() != 0.0 => (a, Inverse::Power(1.0 / p)),
            _ => return None,
        },
        _ => return None,
    };
    if !graph.facts(argument).varies {
        return None;
    }
    let argument = match (inverse, *graph.node(argument)) {
        (Inverse::Cube, _) => argument,
        // Beyond the regions of the signs in it the root counts as 0.
        (_, Node::Unary(UnaryOp::NotNegative, inner)) => inner,
        _ if !is_everywhere
            || graph.facts(argument).nonnegative
            || graph.range(argument).0 >= 0.0 =>
        {
            argument
        }
        _ => return None,
    };
    // A logarithm of what has no kink has no pole that a motion passes.
    let is_log = matches!(inverse, Inverse::Exponential(_));
    let passes_no_pole = is_everywhere && !graph.facts(argument).has_sign;
    if is_log && (sign.is_some() || passes_no_pole) {
        return None;
    }
    Some(Term {
        place,
        sign,
        argument,
        inverse,
    })
}

/// The signs in front of a product, as a product, and the rest of it.
fn signs_in_front(graph: &mut Graph, product: NodeId) -> (Option<NodeId>, NodeId) {
    let (mut sign, mut rest) = (None, product);
    while let Node::Binary(BinaryOp::Mul, left, right) = *graph.node(rest) {
        if !matches!(*graph.node(left), Node::Sign(_)) {
            break;
        }
        sign = Some(match sign {
            Some(sign) => graph.mul(sign, left),
            None => left,
        });
        rest = right;
    }
    (sign, rest)
}

/// `k s (f(u) + s R/k)`, with the other terms R and signs s, has the sign of `k (s u + g(R/k))`, where g is the inverse of f
/// continued as an odd function; for a logarithm of `k (u - exp(-R/k))`.
fn solved(graph: &mut Graph, form: &LinearForm, term: &Term) -> Option<(NodeId, f64)> {
    let coefficient = form.terms[term.place].1;
    let mut rest = LinearForm {
        terms: form.terms.clone(),
        constant: form.constant / coefficient,
    };
    rest.terms.remove(term.place);
    rest.terms.iter_mut().for_each(|term| term.1 /= coefficient);
    let sum = rest.expression(graph);
    let inverse = match term.inverse {
        Inverse::Cube => match power_of_root(graph, &rest, 3.0) {
            Some(power) => power,
            None => {
                let square = graph.mul(sum, sum);
                graph.mul(square, sum)
            }
        },
        Inverse::Power(p) => match power_of_root(graph, &rest, p) {
            Some(power) => power,
            // A power above 1 is smooth enough, and its inverse a root.
            None if p < 1.0 && graph.facts(sum).varies => return None,
            None => {
                let below = graph.all_below(&[term.argument]);
                let is_cube =
                    |id: &NodeId| matches!(graph.node(*id), Node::Unary(UnaryOp::Cbrt, _));
                // The root of |v| with the sign of v is as steep where it vanishes. Its inverse function leaves v, which has no kink.
                let is_steep = below.iter().any(is_cube) || is_odd_root(graph, term);
                odd_power(graph, &rest, sum, p, is_steep)?
            }
        },
        Inverse::Exponential(base) => {
            let exponent = graph.constant(-base.ln());
            let exponent = graph.mul(exponent, sum);
            let power = graph.unary(UnaryOp::Exp, exponent);
            let is_lost = |value: f64| !value.is_normal();
            if graph.as_constant(power).is_some_and(is_lost) {
                return None;
            }
            graph.neg(power)
        }
    };
    let argument = match term.sign {
        Some(sign) => graph.mul(sign, term.argument),
        None => term.argument,
    };
    Some((graph.add(argument, inverse), coefficient.signum()))
}

/// Is this the root of |v| with the sign of v?
fn is_odd_root(graph: &Graph, term: &Term) -> bool {
    match (term.sign, *graph.node(term.argument)) {
        (Some(sign), Node::Binary(BinaryOp::Mul, own, v)) => own == sign && !graph.has_signs(v),
        _ => false,
    }
}

/// The odd power p of `k s v^q`, which is one root with signs s: `|k|^p s v^(pq)` with the sign of k.
fn power_of_root(graph: &mut Graph, form: &LinearForm, p: f64) -> Option<NodeId> {
    let (atom, k) = form.single_atom()?;
    let (sign, function) = signs_in_front(graph, atom);
    let (base, exponent) = match *graph.node(function) {
        Node::Unary(UnaryOp::Cbrt, base) if p == 3.0 => (base, 1.0),
        Node::Unary(UnaryOp::Sqrt, base) if graph.facts(base).nonnegative => (base, 0.5 * p),
        Node::Binary(BinaryOp::Pow, base, q) if graph.facts(base).nonnegative => {
            (base, p * graph.as_constant(q)?)
        }
        _ => return None,
    };
    // No root is made of a power above 1.
    if p < 1.0 && exponent < 1.0 {
        return None;
    }
    let factor = graph.constant(k.abs().powf(p).copysign(k));
    let power = match exponent == 1.0 {
        true => base,
        false => {
            let exponent = graph.constant(exponent);
            graph.pow(base, exponent)
        }
    };
    let power = graph.mul(factor, power);
    Some(match sign {
        Some(sign) => graph.mul(sign, power),
        None => power,
    })
}

/// |c|^p with the sign of c; `None` if that may have a kink along a motion, unless its sign may be a surface of its own.
fn odd_power(
    graph: &mut Graph,
    form: &LinearForm,
    c: NodeId,
    p: f64,
    may_switch: bool,
) -> Option<NodeId> {
    if let Some(value) = graph.as_constant(c) {
        return Some(graph.constant(value.abs().powf(p).copysign(value)));
    }
    let power = |graph: &mut Graph, base: NodeId, p: f64| {
        let p = graph.constant(p);
        graph.pow(base, p)
    };
    let known = match graph.known_sign(form) {
        Some(Switching::Constant(sign)) => sign,
        _ => match graph.range(c) {
            (low, _) if low >= 0.0 => 1.0,
            (_, high) if high <= 0.0 => -1.0,
            _ => 0.0,
        },
    };
    if known > 0.0 {
        return Some(power(graph, c, p));
    }
    if known < 0.0 {
        let opposite = graph.neg(c);
        let power = power(graph, opposite, p);
        return Some(graph.neg(power));
    }
    // What no motion changes needs no surface for its sign, nor does what jumps only.
    let is_fixed = !graph.facts(c).varies || graph.is_stepwise(c);
    if p <= 1.0 || !is_fixed && !may_switch {
        return None;
    }
    let magnitude = match is_fixed {
        true => {
            let zero = graph.constant(0.0);
            graph.binary(BinaryOp::Hypot, c, zero)
        }
        false if p.fract() == 0.0 => graph.abs(c),
        // Close to its surface c may have another sign than the mode says. Then `abs(c)` is negative, and has no broken power.
        false => {
            let magnitude = graph.abs(c);
            graph.unary(UnaryOp::NotNegative, magnitude)
        }
    };
    let power = power(graph, magnitude, p - 1.0);
    let odd = graph.mul(c, power);
    Some(joined_with_own_root(graph, c, power).unwrap_or(odd))
}

#[cfg(test)]
mod tests;
