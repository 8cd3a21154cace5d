//! Switching functions: which sign an expression has, and which surface it switches on.
//!
//! `sign`, `abs`, `maximum`, `minimum` and comparisons all ask [`Graph::switch`]. It recognises one surface
//! in many spellings, because two surfaces in the same place would make every crossing a degenerate
//! intersection:
//!
//! - an expression is written as `sum c_k a_k + c` and compared up to a factor: `v`, `-v`, `2*v`, `v/3`,
//!   `v + 0`, `a - b` and `b - a`, `c*a - c*b` are one surface;
//! - functions with the sign of their argument are dropped: `tanh(v)`, `arctan(v)`, `v**3`, `1/v`, and factors that
//!   are not negative: `exp(y)*v`, `y**2*v`;
//! - what cannot be negative has no surface: `exp(v)`, `v**2`, `1 + abs(v)` give the constant sign +1. This
//!   includes `abs(v)` itself: it is positive on both sides of v = 0, so its sign switches nowhere, and no
//!   second surface is created in the place of v;
//! - what is made of a sign switches where that one does: `sign(v)`, `1 + sign(v)`, `sign(v)*exp(y)`;
//! - a quotient or a tangent changes its sign at its poles too: `tan(v) - 1` switches as `cos(v)*(sin(v) - cos(v))`;
//! - a root moves to the other side as its inverse: `sqrt(abs(v)) - 2` switches as `abs(v) - 4`, `cbrt(v) - y` as `v - y**3`.
//!
//! Division by a parameter is not stripped, since its sign is not known.

use rustc_hash::FxHashMap;

use crate::graph::Graph;
use crate::inverses::without_root;
use crate::linear::{LinearForm, LinearKey};
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::poles::without_poles;

/// What the sign of an expression is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Switching {
    /// The same everywhere: -1, 0 or 1. (At isolated zeros, as of `abs(v)`, it is the sign around them.)
    Constant(f64),
    /// `orientation * s_index`.
    Surface {
        /// The number of the surface.
        index: u32,
        /// +1.0 or -1.0.
        orientation: f64,
    },
}

impl Switching {
    /// The sign of a multiple by +-1.
    fn times(self, side: f64) -> Self {
        match self {
            Switching::Constant(sign) => Switching::Constant(side * sign + 0.0),
            Switching::Surface { index, orientation } => Switching::Surface {
                index,
                orientation: side * orientation,
            },
        }
    }
}

/// A surface and the orientation by which its sign is multiplied.
type Side = (u32, f64);

/// The surfaces of a graph and the expressions known to switch on them.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurfaceTable {
    /// The switching functions h_j.
    pub functions: Vec<NodeId>,
    /// Expressions whose sign is `orientation * s_j`: a cache, and the memory of what is an absolute value.
    pub switches: FxHashMap<NodeId, Side>,
    /// Linear forms with surface and orientation, by their atoms.
    forms: FxHashMap<Vec<NodeId>, Vec<(LinearKey, Side)>>,
}

impl SurfaceTable {
    pub fn switch_of(&self, id: NodeId) -> Option<Side> {
        self.switches.get(&id).copied()
    }

    /// Surface and orientation of a linear form that is known up to a factor.
    fn switch_of_form(&self, key: &LinearKey) -> Option<Side> {
        let candidates = self.forms.get(&key.atoms)?;
        candidates
            .iter()
            .find(|known| known.0.matches(key))
            .map(|known| known.1)
    }

    /// Gives every surface its new number; `order` has the old ones in the new order.
    pub fn renumber(&mut self, order: &[u32], number: &[u32]) {
        let functions = order.iter().map(|&old| self.functions[old as usize]);
        self.functions = functions.collect();
        let forms = self.forms.values_mut().flatten().map(|(_, side)| side);
        for side in self.switches.values_mut().chain(forms) {
            side.0 = number[side.0 as usize];
        }
    }

    fn insert_form(&mut self, key: LinearKey, side: Side) {
        self.forms
            .entry(key.atoms.clone())
            .or_default()
            .push((key, side));
    }
}

/// An expression reduced to what decides its sign.
enum Reduced {
    Known(Switching),
    Form(NodeId, LinearForm, f64),
}

impl Graph {
    /// The switching function h_`index`.
    ///
    /// # Panics
    /// If there are not so many surfaces.
    pub fn surface(&self, index: u32) -> NodeId {
        self.surfaces.functions[index as usize]
    }

    /// How many surfaces there are.
    pub fn n_surfaces(&self) -> usize {
        self.surfaces.functions.len()
    }

    /// Declares a switching function that the user gives: it keeps its order and its sign.
    ///
    /// Later [`Graph::switch`] recognises other spellings of it. Declaring the same node again gives the
    /// same index; another spelling of a known surface is a surface of its own, as asked.
    pub fn declare_surface(&mut self, function: NodeId) -> u32 {
        if let Some(index) = self
            .surfaces
            .functions
            .iter()
            .position(|&known| known == function)
        {
            return index as u32;
        }
        let index = self.surfaces.functions.len() as u32;
        self.surfaces_mut().functions.push(function);
        self.register_surface(index);
        index
    }

    /// The sign of an expression: constant, or that of a surface, which is created if it is a new one.
    ///
    /// The sign and the spelling of a new surface are those seen first, except that the leading state
    /// variable is made positive: `0.2 - v` becomes `v - 0.2`. See the [module](crate::switching) for what
    /// is recognised as the same.
    pub fn switch(&mut self, id: NodeId) -> Switching {
        if let Some((index, orientation)) = self.surfaces.switch_of(id) {
            return Switching::Surface { index, orientation };
        }
        if self.as_constant(id).is_some_and(f64::is_nan) {
            return Switching::Constant(0.0);
        }
        let (index, orientation) = match self.reduce(id) {
            Reduced::Known(Switching::Surface { index, orientation }) => (index, orientation),
            Reduced::Known(constant) => return constant,
            Reduced::Form(spelling, form, side) => {
                let Some((key, lead)) = form.key() else {
                    return Switching::Constant(0.0);
                };
                if let Some(cleared) = without_poles(self, spelling) {
                    let switching = self.switch(cleared).times(side);
                    if let Switching::Surface { index, orientation } = switching {
                        self.surfaces_mut()
                            .switches
                            .insert(id, (index, orientation));
                    }
                    return switching;
                }
                if let Some((rootless, sense)) = without_root(self, &form) {
                    let switching = self.switch(rootless).times(side * sense);
                    if let Switching::Surface { index, orientation } = switching {
                        self.surfaces_mut()
                            .switches
                            .insert(id, (index, orientation));
                    }
                    return switching;
                }
                let (index, orientation) = match self.surfaces.switch_of_form(&key) {
                    Some(known) => known,
                    None => {
                        let (function, flip) = self.spell(spelling, &form);
                        let (index, orientation) = self.surface_of_spelling(function);
                        let known = (index, lead * flip * orientation);
                        self.surfaces_mut().insert_form(key, known);
                        known
                    }
                };
                (index, side * lead * orientation)
            }
        };
        self.surfaces_mut()
            .switches
            .insert(id, (index, orientation));
        Switching::Surface { index, orientation }
    }

    /// Lets an expression switch where another one does that has the same sign wherever both are defined: one with its roots
    /// continued.
    pub fn switch_as(&mut self, id: NodeId, other: NodeId) {
        if let Switching::Surface { index, orientation } = self.switch(other) {
            let side = (index, orientation);
            self.surfaces_mut().switches.entry(id).or_insert(side);
        }
    }

    /// The surface of a function as it is spelled: a known one, or a new one. (A spelling can be known while
    /// its linear form is not: the terms of long sums are matched up to rounding, and can cancel.)
    fn surface_of_spelling(&mut self, function: NodeId) -> Side {
        if let Some(known) = self.surfaces.switch_of(function) {
            return known;
        }
        let index = self.surfaces.functions.len() as u32;
        self.surfaces_mut().functions.push(function);
        self.surfaces_mut().switches.insert(function, (index, 1.0));
        (index, 1.0)
    }

    /// The sign of `a` as an expression: a constant, or `+-s_j` (times other signs, for a product with them).
    pub fn sign(&mut self, a: NodeId) -> NodeId {
        if let Some(value) = self.as_constant(a) {
            let sign = if value == 0.0 || value.is_nan() {
                value
            } else {
                value.signum()
            };
            return self.constant(sign);
        }
        // sign(s_k * b) = s_k * sign(b): a new surface on s_k * b would jump where surface k is crossed.
        let (signs, rest) = self.split_signs(a);
        if !signs.is_empty() && !matches!(self.reduce(a), Reduced::Known(_)) {
            let mut result = self.sign(rest);
            for sign in signs {
                result = self.mul(sign, result);
            }
            return result;
        }
        match self.switch(a) {
            Switching::Constant(sign) => self.constant(sign),
            Switching::Surface { index, orientation } => {
                let sign = self.sign_of(index);
                if orientation < 0.0 {
                    self.neg(sign)
                } else {
                    sign
                }
            }
        }
    }

    /// `|a|`, as `s_j * a` with the sign of a.
    pub fn abs(&mut self, a: NodeId) -> NodeId {
        if let Some(value) = self.as_constant(a) {
            return self.constant(value.abs());
        }
        let (signs, rest) = self.split_signs(a);
        if !signs.is_empty() && !matches!(self.reduce(a), Reduced::Known(_)) {
            return self.abs(rest);
        }
        match self.switch(a) {
            Switching::Constant(sign) if sign > 0.0 => a,
            Switching::Constant(sign) if sign < 0.0 => self.neg(a),
            Switching::Constant(_) => self.constant(0.0),
            Switching::Surface { index, orientation } => {
                let positive = if orientation < 0.0 { self.neg(a) } else { a };
                self.surfaces_mut().switches.insert(positive, (index, 1.0));
                let sign = self.sign_of(index);
                self.mul(sign, positive)
            }
        }
    }

    /// The larger of two values: a select on `a - b`.
    pub fn maximum(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.extremum(a, b, a, b)
    }

    /// The smaller of two values: a select on `a - b`.
    pub fn minimum(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.extremum(a, b, b, a)
    }

    fn extremum(&mut self, a: NodeId, b: NodeId, if_above: NodeId, if_below: NodeId) -> NodeId {
        let difference = self.sub(a, b);
        if let Some(value) = self.as_constant(difference) {
            if value.is_nan() {
                return difference;
            }
        }
        match self.switch(difference) {
            Switching::Constant(sign) if sign < 0.0 => if_below,
            Switching::Constant(_) => if_above,
            Switching::Surface { index, orientation } => {
                self.select(index, orientation, if_above, if_below)
            }
        }
    }

    /// The surface whose function an expression is a multiple of, and the sign of the factor, if there is one.
    pub fn surface_of(&self, id: NodeId) -> Option<(u32, f64)> {
        let form = LinearForm::of(self, id);
        let (key, lead) = form.key()?;
        let (index, side) = self.surfaces.switch_of_form(&key)?;
        let function = LinearForm::of(self, self.surface(index));
        // A known form may be what is left of a surface without its powers.
        let is_multiple = function.key().is_some_and(|(own, _)| own.matches(&key));
        is_multiple.then_some((index, side * lead))
    }

    /// Makes a surface known to [`Graph::switch`]; of several in one place the first is kept.
    pub(crate) fn register_surface(&mut self, index: u32) {
        let function = self.surface(index);
        if let Reduced::Form(_, form, side) = self.reduce(function) {
            if let Some((key, lead)) = form.key() {
                if self.surfaces.switch_of_form(&key).is_none() {
                    self.surfaces_mut().insert_form(key, (index, side * lead));
                }
                self.surfaces_mut()
                    .switches
                    .entry(function)
                    .or_insert((index, 1.0));
            }
        }
    }

    /// Strips what does not change the sign, until the sign is known or a linear form is left. The number is
    /// the sign by which that form differs from the expression.
    fn reduce(&self, id: NodeId) -> Reduced {
        let mut current = id;
        let mut side = 1.0;
        loop {
            let form = LinearForm::of(self, current);
            if let Some(known) = self.known_sign(&form) {
                return Reduced::Known(known.times(side));
            }
            let Some((atom, coefficient)) = form.single_atom() else {
                return Reduced::Form(current, form, side);
            };
            match self.sign_carrier(atom) {
                Some((inner, flip)) => {
                    side *= coefficient.signum() * flip;
                    current = inner;
                }
                None => return Reduced::Form(current, form, side),
            }
        }
    }

    /// The sign of a linear form, where it follows from its terms.
    pub(crate) fn known_sign(&self, form: &LinearForm) -> Option<Switching> {
        let Some(&(first, c)) = form.terms.first() else {
            let sign = if form.constant == 0.0 {
                0.0
            } else {
                form.constant.signum()
            };
            return Some(Switching::Constant(sign));
        };
        if let ([_], Node::Sign(index)) = (form.terms.as_slice(), *self.node(first)) {
            // c s + constant with s = +-1
            return Some(if form.constant.abs() > c.abs() {
                Switching::Constant(form.constant.signum())
            } else {
                Switching::Surface {
                    index,
                    orientation: c.signum(),
                }
            });
        }
        if form.constant == 0.0 && form.terms.len() == 1 {
            if let Some((index, orientation)) = self.sign_data(first) {
                return Some(Switching::Surface {
                    index,
                    orientation: orientation * c.signum(),
                });
            }
        }
        let common = self.definite_sign(first)? * c.signum();
        let agree = form.terms[1..]
            .iter()
            .all(|&(atom, c)| self.definite_sign(atom) == Some(common * c.signum()));
        (agree && form.constant * common >= 0.0).then_some(Switching::Constant(common))
    }

    /// The sign of an atom that is the same wherever it is defined (isolated zeros aside).
    fn definite_sign(&self, atom: NodeId) -> Option<f64> {
        if self.facts(atom).nonnegative {
            return Some(1.0);
        }
        match *self.node(atom) {
            Node::Constant(value) if value < 0.0 => Some(-1.0),
            Node::Binary(BinaryOp::Mul, left, right) => match *self.node(left) {
                Node::Sign(j) => match self.known_switch(right) {
                    Some((index, orientation)) if index == j => Some(orientation),
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        }
    }

    /// The surface on which an expression switches, if it is known already, also when what does not change
    /// the sign is stripped. No new nodes, no recursion.
    pub(crate) fn known_switch(&self, id: NodeId) -> Option<Side> {
        let mut current = id;
        let mut side = 1.0;
        loop {
            if let Some((index, orientation)) = self.surfaces.switch_of(current) {
                return Some((index, side * orientation));
            }
            let form = LinearForm::of(self, current);
            if let Some((key, lead)) = form.key() {
                if let Some((index, orientation)) = self.surfaces.switch_of_form(&key) {
                    return Some((index, side * lead * orientation));
                }
            }
            let (atom, coefficient) = form.single_atom()?;
            let (inner, flip) = self.sign_carrier(atom)?;
            side *= coefficient.signum() * flip;
            current = inner;
        }
    }

    /// The surface whose sign alone decides that of an atom: `s_j * (something positive)`, or a select
    /// between a positive and a negative value.
    fn sign_data(&self, atom: NodeId) -> Option<Side> {
        match *self.node(atom) {
            Node::Binary(BinaryOp::Mul, left, right) => match *self.node(left) {
                Node::Sign(j) if self.facts(right).nonnegative => Some((j, 1.0)),
                _ => None,
            },
            Node::Select {
                surface,
                plus,
                minus,
            } => {
                let (above, below) = (self.definite_sign(plus)?, self.definite_sign(minus)?);
                (above != below).then_some((surface, above))
            }
            _ => None,
        }
    }

    /// The operand that has the same sign as an atom, or the opposite one (-1).
    fn sign_carrier(&self, atom: NodeId) -> Option<(NodeId, f64)> {
        match *self.node(atom) {
            Node::Unary(op, a) => {
                use UnaryOp::*;
                matches!(
                    op,
                    Cbrt | Expm1 | Log1p | Sinh | Tanh | Asin | Atan | Asinh | Atanh | Erf
                )
                .then_some((a, 1.0))
            }
            Node::Binary(BinaryOp::Mul, a, b) => {
                let is_square = |id, of| *self.node(id) == Node::Binary(BinaryOp::Mul, of, of);
                if self.facts(a).nonnegative || is_square(a, b) {
                    Some((b, 1.0))
                } else if self.facts(b).nonnegative || is_square(b, a) {
                    Some((a, 1.0))
                } else {
                    None
                }
            }
            Node::Binary(BinaryOp::Div, a, b) => {
                if self.facts(b).nonnegative {
                    return Some((a, 1.0));
                }
                self.as_constant(a).map(|c| (b, c.signum()))
            }
            _ => None,
        }
    }

    /// What is left to take the sign of, where [`Graph::sign`] takes signs in front of a product for themselves.
    pub(crate) fn without_signs(&self, id: NodeId) -> NodeId {
        let (signs, rest) = self.split_signs(id);
        if signs.is_empty() || matches!(self.reduce(id), Reduced::Known(_)) {
            id
        } else {
            rest
        }
    }

    /// The signs in front of a product, and the rest of it.
    fn split_signs(&self, id: NodeId) -> (Vec<NodeId>, NodeId) {
        let mut signs = Vec::new();
        let mut rest = id;
        while let Node::Binary(BinaryOp::Mul, left, right) = *self.node(rest) {
            if !matches!(*self.node(left), Node::Sign(_)) {
                break;
            }
            signs.push(left);
            rest = right;
        }
        (signs, rest)
    }
}

#[cfg(test)]
mod tests;
