//! Regions of an expression: what it is under each combination of the signs inside of it.
//!
//! An expression that contains signs is one smooth expression in each region that these make. In some regions it may be
//! *identically zero*, as `maximum(x - 1, 0)` is where x < 1: a comparison of it with 0 is no surface there. This room finds such
//! regions, and the jumps and the edges of domains at the borders between regions. It reads graphs only;
//! time stepping does not enter it.

mod choices;
mod discrete;
mod edge;
mod inequalities;
mod jump;
mod pieces;

pub use discrete::Discrete;
pub use edge::Edge;
pub use pieces::{PartSign, Pieces};

use crate::few::sort_few;
use crate::graph::Graph;
use crate::inverses;
use crate::linear::LinearForm;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::switching::Switching;
use inequalities::{have_solution, Inequality};

/// What an expression is in a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Identically zero, or (if it contains discrete states) zero for some values of them.
    Zero,
    /// Positive, isolated zeros aside.
    Positive,
    /// Negative, isolated zeros aside.
    Negative,
    /// Of either sign, or not known.
    Varies,
}

/// A region and the expression there.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The signs that were fixed, by surface; the others do not matter.
    pub signs: Vec<Option<f64>>,
    /// What the expression is there.
    pub kind: Kind,
    /// The number that it is there, if it is one.
    pub value: Option<f64>,
    /// The distance of the values that it takes there, if it is a sum of discrete states.
    pub step: Option<f64>,
}

/// The regions of an expression.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Split {
    /// Those that are not empty, as far as that is seen.
    pub regions: Vec<Region>,
    /// Whether these are all; false if the search was given up.
    pub is_complete: bool,
}

/// Whether a region has points.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Possible {
    Never,
    /// Not for the values of the parameters.
    NotForParameters,
    Yes,
}

/// What counts as a number in the inequalities of a region.
#[derive(Clone, Copy, PartialEq)]
enum Numbers {
    /// Constants alone: parameters are free.
    Constants,
    /// Constants, and the parameters with their values.
    All,
}

/// Parameters that differ by this share are as near as one likes.
const BESIDE: f64 = 1e-9;

/// Multiples of it have fractions that differ.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// In questions about the field that many combinations of other signs are looked at.
const MOST_COMBINATIONS: usize = 256;

/// The regions of the expressions of a graph, which receives new nodes.
pub struct Regions {
    graph: Graph,
    parameters: Vec<f64>,
    discrete: Vec<Discrete>,
    used_parameters: bool,
    is_at_border: bool,
}

impl Regions {
    /// Regions in a graph with these values of the parameters; those after them are discrete states.
    pub fn new(graph: Graph, parameters: Vec<f64>, discrete: Vec<Discrete>) -> Self {
        Regions {
            graph,
            parameters,
            discrete,
            used_parameters: false,
            is_at_border: false,
        }
    }

    /// The graph.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The graph, with the nodes that it received.
    pub fn into_graph(self) -> Graph {
        self.graph
    }

    /// Whether an answer was true for these values of the parameters only.
    pub fn used_parameters(&self) -> bool {
        self.used_parameters
    }

    /// Whether an answer is another one for parameters as near to these as one likes.
    pub fn is_at_border(&self) -> bool {
        self.is_at_border
    }

    /// The sign that an expression has been given: of a product with signs in front that of the rest, and where it switches.
    pub fn question(&mut self, node: NodeId) -> (NodeId, Switching) {
        let rest = self.graph.without_signs(node);
        (rest, self.graph.switch(rest))
    }

    /// The switching function of a surface with these signs inside of it.
    ///
    /// # Panics
    /// If there are not so many surfaces.
    pub fn function(&mut self, surface: u32, signs: &[Option<f64>]) -> NodeId {
        let function = self.graph.surface(surface);
        self.graph.at_signs(&[function], signs)[0]
    }

    /// The inequalities `side * value > 0` of a region, without those that follow from the others.
    pub fn conditions(&mut self, signs: &[Option<f64>]) -> Vec<(NodeId, f64)> {
        let mut kept = Vec::new();
        for (k, sign) in (0..).zip(signs) {
            if let Some(sign) = *sign {
                kept.push((self.function(k, signs), sign));
            }
        }
        for at in (0..kept.len()).rev() {
            let mut flipped = kept.clone();
            flipped[at].1 = -flipped[at].1;
            if !self.is_solvable(&flipped, &[], Numbers::All) {
                kept.remove(at);
            }
        }
        kept
    }

    /// The combinations of signs of all surfaces that points have, as far as linear inequalities between the terms of the
    /// switching functions show that; `None` if there are more than `most`.
    pub fn combinations(&mut self, most: usize) -> Option<Vec<Vec<f64>>> {
        let n = self.graph.n_surfaces();
        let mut found: Vec<Vec<f64>> = vec![Vec::new()];
        for _ in 0..n {
            let mut longer = Vec::new();
            for known in found {
                for sign in [-1.0, 1.0] {
                    let signs: Vec<f64> = known.iter().copied().chain([sign]).collect();
                    let mut partial: Vec<Option<f64>> = signs.iter().copied().map(Some).collect();
                    partial.resize(n, None);
                    if self.possible(&partial, None) == Possible::Yes {
                        longer.push(signs);
                    }
                }
            }
            if longer.len() > most {
                return None;
            }
            found = longer;
        }
        Some(found)
    }

    /// The regions of an expression; the search is given up after looking at `most` combinations of signs.
    ///
    /// Combinations that no point has are left out, as far as linear inequalities between the terms of the switching
    /// functions show that. Unless `in_full`, those under which terms without signs are left that nothing cancels are not
    /// looked at one by one, nor are those of a sum of numbers that is zero for no choice of them: the expression is nowhere
    /// identically zero there, and counts as one that varies.
    pub fn split(&mut self, node: NodeId, most: usize, in_full: bool) -> Split {
        let mut found = Split {
            regions: Vec::new(),
            is_complete: true,
        };
        let mut pending = vec![(node, vec![None; self.graph.n_surfaces()], true)];
        let mut n_visited = 0;
        while let Some((value, signs, is_here)) = pending.pop() {
            n_visited += 1;
            if n_visited > most {
                found.is_complete = false;
                break;
            }
            let form = LinearForm::of(&self.graph, value);
            if !self.graph.facts(value).has_sign || form.is_zero() {
                let (region, is_known) = self.region(value, &form, signs, Numbers::Constants);
                if is_here {
                    found.is_complete &= is_known;
                    found.regions.push(region);
                } else if region.kind == Kind::Zero || !is_known {
                    self.is_possible(&region.signs, None);
                }
                continue;
            }
            if n_visited == 1 && !in_full && choices::are_never_zero(&self.graph, &form) {
                found.regions.push(Region {
                    signs,
                    kind: Kind::Varies,
                    value: None,
                    step: None,
                });
                continue;
            }
            let next = (0..signs.len()).zip(self.graph.sign_dependencies(&[value], &[]));
            let next = next.filter(|&(_, depends)| depends).map(|(k, _)| k).next();
            let (Some(k), true) = (next, in_full || self.may_cancel(&form)) else {
                if is_here {
                    found.regions.push(Region {
                        signs,
                        kind: Kind::Varies,
                        value: None,
                        step: None,
                    });
                }
                continue;
            };
            let mut sides = Vec::new();
            for sign in [1.0, -1.0] {
                let mut signs = signs.clone();
                signs[k] = Some(sign);
                let possible = self.possible(&signs, None);
                if possible != Possible::Never {
                    let value = self.graph.at_signs(&[value], &signs)[0];
                    let form = LinearForm::of(&self.graph, value);
                    let distance = (form.terms.len(), form.constant.abs());
                    sides.push((distance, value, signs, is_here && possible == Possible::Yes));
                }
            }
            // The side with fewer terms, then with the smaller constant, is nearer to a zero: it is looked at first.
            sort_few(&mut sides, |a, b| a.0 > b.0);
            let sides = sides.into_iter();
            pending.extend(sides.map(|(_, value, signs, is_here)| (value, signs, is_here)));
        }
        found
    }

    /// Whether the sign of a surface makes a difference to some of the values where some signs are fixed: directly, or
    /// through surfaces on which the values depend there.
    pub fn matters(&mut self, roots: &[NodeId], signs: &[Option<f64>], surface: u32) -> bool {
        let mut budget = MOST_COMBINATIONS;
        self.values_read(roots, signs, Some(surface))
            .into_iter()
            .any(|value| self.differs(value, signs, surface, &mut budget))
    }

    /// Whether some of the values depend, where some signs are fixed, on which of -1, 0 and 1 a state variable is that stands for
    /// a sign: directly, or through surfaces on which the values depend there.
    pub fn reads(&mut self, roots: &[NodeId], signs: &[Option<f64>], state: u32) -> bool {
        let values = self.values_read(roots, signs, None);
        values.into_iter().any(|value| {
            let at = [-1.0, 0.0, 1.0].map(|number| self.graph.at_state(value, state, number));
            at[1..].iter().any(|&other| {
                let difference = self.graph.sub(at[0], other);
                !LinearForm::of(&self.graph, difference).is_zero()
            })
        })
    }

    /// The values where some signs are fixed, and the functions of the surfaces on which they depend there, but for one.
    fn values_read(
        &mut self,
        roots: &[NodeId],
        signs: &[Option<f64>],
        without: Option<u32>,
    ) -> Vec<NodeId> {
        let mut values = self.graph.at_signs(roots, signs);
        let mut seen = vec![false; self.graph.n_surfaces()];
        let mut first = 0;
        while first < values.len() {
            let depends = self.graph.sign_dependencies(&values[first..], &[]);
            first = values.len();
            for k in 0..seen.len() {
                if depends[k] && !seen[k] && without != Some(k as u32) {
                    seen[k] = true;
                    values.push(self.function(k as u32, signs));
                }
            }
        }
        values
    }

    /// Whether a value differs on the two sides of a surface, under some combination of the other signs.
    fn differs(
        &mut self,
        value: NodeId,
        signs: &[Option<f64>],
        surface: u32,
        budget: &mut usize,
    ) -> bool {
        let mut pending = vec![(value, signs.to_vec())];
        while let Some((value, signs)) = pending.pop() {
            let difference = self.difference(value, surface);
            if LinearForm::of(&self.graph, difference).is_zero() {
                continue;
            }
            let depends = self.graph.sign_dependencies(&[difference], &[]);
            let next = depends.iter().position(|&depends| depends);
            let (Some(k), true) = (next, *budget > 0) else {
                return true;
            };
            *budget -= 1;
            for sign in [1.0, -1.0] {
                let mut signs = signs.clone();
                signs[k] = Some(sign);
                if self.is_possible(&signs, None) {
                    pending.push((self.graph.at_signs(&[value], &signs)[0], signs));
                }
            }
        }
        false
    }

    /// The value on the positive side of a surface minus that on the other side.
    fn difference(&mut self, value: NodeId, surface: u32) -> NodeId {
        let mut signs = vec![None; surface as usize + 1];
        signs[surface as usize] = Some(1.0);
        let above = self.graph.at_signs(&[value], &signs)[0];
        signs[surface as usize] = Some(-1.0);
        let below = self.graph.at_signs(&[value], &signs)[0];
        self.graph.sub(above, below)
    }

    /// Whether there may be a point with these signs for the values of the parameters; an answer that depends on them is
    /// remembered.
    fn is_possible(&mut self, signs: &[Option<f64>], also: Option<(NodeId, f64)>) -> bool {
        let possible = self.possible(signs, also);
        if possible == Possible::NotForParameters {
            self.used_parameters = true;
            self.is_at_border = self.is_at_border || self.is_possible_beside(signs, also);
        }
        possible == Possible::Yes
    }

    /// Whether there may be a point with these signs for parameters a little beside their values, in one of four directions.
    fn is_possible_beside(&mut self, signs: &[Option<f64>], also: Option<(NodeId, f64)>) -> bool {
        let given = self.parameters.clone();
        let ways = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let is_possible = ways.into_iter().any(|(way, odd)| {
            let moved = given.iter().enumerate().map(|(k, value)| {
                // No two parameters by the same share.
                let share = way * (1.0 + (k as f64 * GOLDEN).fract());
                let share = if k % 2 == 1 { odd * share } else { share };
                value + BESIDE * share * (1.0 + value.abs())
            });
            self.parameters = moved.collect();
            self.is_possible_with(signs, also, Numbers::All)
        });
        self.parameters = given;
        is_possible
    }

    /// Whether there may be a point with these signs, at which moreover side * value > 0 (side 0: value = 0).
    fn possible(&mut self, signs: &[Option<f64>], also: Option<(NodeId, f64)>) -> Possible {
        if !self.is_possible_with(signs, also, Numbers::Constants) {
            Possible::Never
        } else if self.parameters.is_empty() || self.is_possible_with(signs, also, Numbers::All) {
            Possible::Yes
        } else {
            Possible::NotForParameters
        }
    }

    fn is_possible_with(
        &mut self,
        signs: &[Option<f64>],
        also: Option<(NodeId, f64)>,
        numbers: Numbers,
    ) -> bool {
        let mut sides = Vec::new();
        for (k, sign) in (0..).zip(signs) {
            if let Some(sign) = *sign {
                sides.push((self.function(k, signs), sign));
            }
        }
        if let Some((value, side)) = also {
            sides.push((self.graph.at_signs(&[value], signs)[0], side));
        }
        let known = self.graph.not_negative.clone();
        let known = self.graph.at_signs(&known, signs);
        self.is_solvable(&sides, &known, numbers)
    }

    /// Whether there may be a point at which all `side * value > 0` (side 0: value = 0), where the known values are not negative.
    fn is_solvable(&mut self, sides: &[(NodeId, f64)], known: &[NodeId], numbers: Numbers) -> bool {
        let mut rows = Vec::new();
        for &(mut function, side) in sides {
            if numbers == Numbers::All {
                function = self.with_parameters(function);
            }
            let form = LinearForm::of(&self.graph, function);
            if side == 0.0 {
                rows.extend([1.0, -1.0].map(|side| Inequality::new(&form, side, false)));
            } else if !form.is_zero() {
                rows.push(Inequality::new(&form, side, true));
            }
        }
        let mut atoms: Vec<NodeId> = rows.iter().flat_map(Inequality::atoms).collect();
        atoms.sort_unstable();
        atoms.dedup();
        for &known in known {
            let known = match numbers {
                Numbers::All => self.with_parameters(known),
                Numbers::Constants => known,
            };
            let form = LinearForm::of(&self.graph, known);
            // Of other atoms nothing else is known.
            let is_of_these = |term: &(NodeId, f64)| atoms.binary_search(&term.0).is_ok();
            if form.terms.iter().all(is_of_these) {
                rows.push(Inequality::new(&form, 1.0, false));
            }
        }
        for atom in atoms {
            if self.graph.facts(atom).nonnegative && !self.graph.facts(atom).has_sign {
                rows.push(Inequality::bound(atom, 1.0, 0.0));
            }
            if let Node::Unary(UnaryOp::Sin | UnaryOp::Cos | UnaryOp::Tanh | UnaryOp::Erf, _) =
                *self.graph.node(atom)
            {
                rows.extend([1.0, -1.0].map(|side| Inequality::bound(atom, side, 1.0)));
            }
        }
        have_solution(rows)
    }

    /// The expression with the values of the parameters in their place.
    fn with_parameters(&mut self, node: NodeId) -> NodeId {
        let values = self.parameters.clone();
        self.graph.at_parameters(node, |k| values.get(k).copied())
    }

    /// What an expression without signs is in a region, and whether that is known; its sign where it moves as far as the numbers
    /// tell.
    fn region(
        &mut self,
        value: NodeId,
        form: &LinearForm,
        signs: Vec<Option<f64>>,
        numbers: Numbers,
    ) -> (Region, bool) {
        let mut region = Region {
            signs,
            kind: Kind::Varies,
            value: None,
            step: None,
        };
        if form.terms.is_empty() {
            region.value = Some(form.constant);
            region.kind = kind_of(form.constant);
            return (region, true);
        }
        if !self.graph.depends_on_motion(value) {
            let value = self.with_parameters(value);
            let found = discrete::values(
                &mut self.graph,
                value,
                self.parameters.len(),
                &self.discrete,
            );
            let Some(found) = found else {
                return (region, false);
            };
            let is_for_these = found.is_number && !self.parameters.is_empty();
            self.used_parameters |= is_for_these;
            self.is_at_border |= is_for_these && found.kind == Kind::Zero;
            (region.kind, region.value, region.step) = (found.kind, found.value, found.step);
            return (region, true);
        }
        let signs = region.signs.clone();
        // It may have the sign of a surface, as a cube root has that of its argument.
        if let Some((index, orientation)) = self.graph.known_switch(value) {
            if let Some(sign) = signs.get(index as usize).copied().flatten() {
                region.kind = kind_of(orientation * sign);
                return (region, true);
            }
        }
        let rootless = inverses::within_domain(&mut self.graph, form);
        let (value, sense) = rootless.unwrap_or((value, 1.0));
        let mut is_never = |sense: f64| match numbers {
            Numbers::Constants => self.possible(&signs, Some((value, sense))) == Possible::Never,
            Numbers::All => !self.is_possible(&signs, Some((value, sense))),
        };
        if is_never(-sense) {
            region.kind = Kind::Positive;
        } else if is_never(sense) {
            region.kind = Kind::Negative;
        }
        (region, true)
    }

    /// Whether terms without signs may cancel terms of what the signs decide; otherwise the sum is never identically zero.
    fn may_cancel(&self, form: &LinearForm) -> bool {
        let mut made = Vec::new();
        for &(atom, _) in &form.terms {
            if self.graph.facts(atom).has_sign && !self.terms_made(atom, &mut made) {
                return true;
            }
        }
        form.terms.iter().all(|&(atom, _)| {
            let facts = self.graph.facts(atom);
            facts.has_sign || !facts.varies || made.contains(&atom)
        })
    }

    /// Collects the terms without signs that an atom may become as signs are fixed; false if it may become anything.
    fn terms_made(&self, atom: NodeId, made: &mut Vec<NodeId>) -> bool {
        let mut pending = vec![atom];
        while let Some(atom) = pending.pop() {
            let parts = match *self.graph.node(atom) {
                Node::Sign(_) => continue,
                Node::Select { plus, minus, .. } => vec![plus, minus],
                Node::Binary(BinaryOp::Mul, left, right)
                    if matches!(*self.graph.node(left), Node::Sign(_)) =>
                {
                    vec![right]
                }
                _ => return false,
            };
            for part in parts {
                for (term, _) in LinearForm::of(&self.graph, part).terms {
                    if self.graph.facts(term).has_sign {
                        pending.push(term);
                    } else {
                        made.push(term);
                    }
                }
            }
        }
        true
    }
}

fn kind_of(value: f64) -> Kind {
    if value > 0.0 {
        Kind::Positive
    } else if value < 0.0 {
        Kind::Negative
    } else if value == 0.0 {
        Kind::Zero
    } else {
        Kind::Varies
    }
}

#[cfg(test)]
mod tests;
