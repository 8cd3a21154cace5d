//! Enclosures: what a program and its rate may be while its arguments move within intervals.
//!
//! The certificate that a function has no zero along a motion, or exactly one, is a bound on its value
//! or on its rate (Moore, Kearfott, Cloud: *Introduction to Interval Analysis*, 2009, chapters 5 and 6).
//! Value and rate are carried together through the expression, as in forward differentiation.

use crate::error::ExprError;
use crate::graph::Graph;
use crate::interval::Interval;
use crate::node::NodeId;
use crate::op::{BinaryOp, UnaryOp};
use crate::schedule::{Lengths, Schedule};
use crate::tape::{Arguments, Number, Tape};

/// Bounds of a moving value and of its rate of change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Enclosure {
    /// What the value may be.
    pub value: Interval,
    /// What its derivative in time may be.
    pub rate: Interval,
}

/// The arguments of an enclosing program: a piece of a motion.
pub trait Motion {
    /// The times of the piece.
    fn time(&self) -> Interval;
    /// State `index` during the piece.
    fn state(&self, index: usize) -> Enclosure;
}

/// A program that is evaluated on pieces of motions instead of points.
///
/// # Example
/// ```
/// use filippov_expr::{Enclosure, EnclosureProgram, Graph, Interval, Motion};
/// let mut g = Graph::new();
/// let (x, one) = (g.state(0), g.constant(1.0));
/// let square = g.mul(x, x);
/// let h = g.sub(square, one);
///
/// struct Rising; // x = t on [2, 3]
/// impl Motion for Rising {
///     fn time(&self) -> Interval { Interval::hull(2.0, 3.0) }
///     fn state(&self, _: usize) -> Enclosure {
///         Enclosure { value: self.time(), rate: Interval::point(1.0) }
///     }
/// }
/// let program = EnclosureProgram::compile(&g, &[h])?;
/// let mut out = [Enclosure::UNKNOWN];
/// program.eval(&Rising, &[], &[], &mut out);
/// assert!(out[0].value.lo > 2.999 && out[0].rate.lo > 3.999); // x^2 - 1 in [3, 8], 2 x in [4, 6]
/// # Ok::<(), filippov_expr::ExprError>(())
/// ```
#[derive(Debug, Clone)]
pub struct EnclosureProgram {
    tape: Tape,
    settled: Option<SettledValues>,
    n_signs: usize,
    n_parameters: usize,
    n_outputs: usize,
}

/// The page does without: its module is to be small.
const IS_SETTLED: bool = !cfg!(target_family = "wasm");

/// What follows from signs and parameters alone: numbers that the program reads as parameters.
#[derive(Debug, Clone)]
struct SettledValues {
    tape: Tape,
    count: usize,
    /// The parameters in front of them.
    n_parameters: usize,
}

impl EnclosureProgram {
    /// Prepares the values of some nodes.
    ///
    /// # Errors
    /// [`ExprError::UnknownNode`], [`ExprError::IndexTooLarge`].
    pub fn compile(graph: &Graph, outputs: &[NodeId]) -> Result<Self, ExprError> {
        let Lengths {
            signs, parameters, ..
        } = Schedule::new(graph, outputs)?.lengths;
        let settled = match IS_SETTLED {
            true => graph.settled(outputs)?,
            false => None,
        };
        let (tape, settled) = match settled {
            None => (tape(graph, outputs)?, None),
            Some(found) => {
                let values = SettledValues {
                    tape: tape(graph, &found.values)?,
                    count: found.values.len(),
                    n_parameters: found.n_parameters,
                };
                (tape(&found.graph, &found.outputs)?, Some(values))
            }
        };
        Ok(EnclosureProgram {
            tape,
            settled,
            n_signs: signs,
            n_parameters: parameters,
            n_outputs: outputs.len(),
        })
    }

    /// Encloses the outputs along a piece of motion with signs `s` and parameters `p`. Nothing is
    /// claimed if `s` or `p` is too short.
    pub fn eval(&self, motion: &dyn Motion, s: &[f64], p: &[f64], out: &mut [Enclosure]) {
        let long_enough =
            s.len() >= self.n_signs && p.len() >= self.n_parameters && out.len() >= self.n_outputs;
        if !long_enough {
            out.fill(Enclosure::UNKNOWN);
            return;
        }
        match &self.settled {
            Some(values) if IS_SETTLED => self.tape.enclose(motion, s, &values.behind(s, p), out),
            _ => self.tape.enclose(motion, s, p, out),
        }
    }
}

impl SettledValues {
    /// The parameters with the values behind them.
    fn behind(&self, s: &[f64], p: &[f64]) -> Vec<f64> {
        let mut all = p[..self.n_parameters].to_vec();
        all.resize(self.n_parameters + self.count, 0.0);
        let arguments = Arguments {
            t: f64::NAN,
            x: &[],
            s,
            p,
            v: &[],
        };
        self.tape.run(arguments, &mut all[self.n_parameters..]);
        all
    }
}

fn tape(graph: &Graph, outputs: &[NodeId]) -> Result<Tape, ExprError> {
    Ok(Tape::new(graph, &Schedule::new(graph, outputs)?))
}

impl Enclosure {
    /// Nothing is known.
    pub const UNKNOWN: Enclosure = Enclosure {
        value: Interval::ALL,
        rate: Interval::ALL,
    };

    /// A value that does not move.
    pub const fn constant(value: f64) -> Self {
        Enclosure {
            value: Interval::point(value),
            rate: Interval::ZERO,
        }
    }

    /// What is in either of two enclosures.
    #[must_use]
    pub fn hull(self, other: Self) -> Self {
        Enclosure {
            value: self.value.joined(other.value),
            rate: self.rate.joined(other.rate),
        }
    }

    /// The time itself.
    pub const fn time(times: Interval) -> Self {
        Enclosure {
            value: times,
            rate: Interval::point(1.0),
        }
    }

    /// The derivative of a function of one operand, whose value is known to be in `value`.
    fn slope(self, op: UnaryOp, value: Interval) -> Interval {
        let one = Interval::point(1.0);
        let a = self.value;
        let root = |square: Interval| one / square.unary(UnaryOp::Sqrt);
        match op {
            UnaryOp::Neg => Interval::point(-1.0),
            UnaryOp::NotNegative => Interval { lo: 0.0, hi: 1.0 },
            UnaryOp::Sqrt => Interval::point(0.5) / value,
            UnaryOp::Cbrt => Interval::point(1.0 / 3.0) / value.square(),
            UnaryOp::Exp => value,
            UnaryOp::Expm1 => a.unary(UnaryOp::Exp),
            UnaryOp::Exp2 => value.scaled(std::f64::consts::LN_2),
            UnaryOp::Log => one / a,
            UnaryOp::Log1p => one / (one + a),
            UnaryOp::Log2 => Interval::point(std::f64::consts::LOG2_E) / a,
            UnaryOp::Log10 => Interval::point(std::f64::consts::LOG10_E) / a,
            UnaryOp::Sin => a.unary(UnaryOp::Cos),
            UnaryOp::Cos => -a.unary(UnaryOp::Sin),
            UnaryOp::Tan => one + value.square(),
            UnaryOp::Asin => root(one - a.square()),
            UnaryOp::Acos => -root(one - a.square()),
            UnaryOp::Atan => one / (one + a.square()),
            UnaryOp::Sinh => a.unary(UnaryOp::Cosh),
            UnaryOp::Cosh => a.unary(UnaryOp::Sinh),
            UnaryOp::Tanh => one / a.unary(UnaryOp::Cosh).square(),
            UnaryOp::Asinh => root(one + a.square()),
            UnaryOp::Acosh => root(a.square() - one),
            UnaryOp::Atanh => one / (one - a.square()),
            UnaryOp::Erf => (-a.square())
                .unary(UnaryOp::Exp)
                .scaled(std::f64::consts::FRAC_2_SQRT_PI),
        }
    }
}

impl Number for Enclosure {
    fn constant(value: f64) -> Self {
        Self::constant(value)
    }

    fn unary(self, op: UnaryOp) -> Self {
        if self.rate.is_zero() {
            return Enclosure {
                value: self.value.unary(op),
                rate: Interval::ZERO,
            };
        }
        let (value, slope) = match op {
            UnaryOp::Sin => self.value.sine_and_cosine(),
            UnaryOp::Cos => {
                let (sine, cosine) = self.value.sine_and_cosine();
                (cosine, -sine)
            }
            _ => {
                let value = self.value.unary(op);
                (value, self.slope(op, value))
            }
        };
        let rate = slope * self.rate;
        Enclosure { value, rate }
    }

    fn square(self) -> Self {
        Enclosure {
            value: self.value.square(),
            rate: (self.value * self.rate).scaled(2.0),
        }
    }

    fn binary(self, op: BinaryOp, b: Self) -> Self {
        let value = self.value.binary(op, b.value);
        let (da, db) = (self.rate, b.rate);
        let rate = match op {
            // What stands still adds nothing: most operands do.
            BinaryOp::Add | BinaryOp::Sub if db.is_zero() => da,
            BinaryOp::Add if da.is_zero() => db,
            BinaryOp::Sub if da.is_zero() => -db,
            BinaryOp::Add => da + db,
            BinaryOp::Sub => da - db,
            BinaryOp::Mul if db.is_zero() && self.value.is_bounded() => da * b.value,
            BinaryOp::Mul if da.is_zero() && b.value.is_bounded() => self.value * db,
            BinaryOp::Mul => da * b.value + self.value * db,
            _ if da.is_zero() && db.is_zero() => Interval::ZERO,
            BinaryOp::Div => (da - value * db) / b.value,
            BinaryOp::Pow => power_rate(self, b, value),
            BinaryOp::Atan2 => {
                let radius = self.value.square() + b.value.square();
                (da * b.value - self.value * db) / radius
            }
            BinaryOp::Hypot => (self.value * da + b.value * db) / value,
        };
        Enclosure { value, rate }
    }
}

/// The rate of a^b, which is `value`: b a^(b-1) a' + a^b log(a) b'.
fn power_rate(a: Enclosure, b: Enclosure, value: Interval) -> Interval {
    let one = Interval::point(1.0);
    let lower = a.value.binary(BinaryOp::Pow, b.value.sub_exactly(one));
    let by_base = b.value * lower * a.rate;
    if b.rate.is_zero() {
        return by_base;
    }
    by_base + value * a.value.unary(UnaryOp::Log) * b.rate
}
