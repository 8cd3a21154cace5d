//! Operations of one and two operands: their names, values and nothing else.
//!
//! [`UnaryOp::apply`] and [`BinaryOp::apply`] are the *only* definition of each value: constant folding,
//! the interpreter and native code all call it, so that they agree to the bit.

/// Function of one operand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum UnaryOp {
    /// `-a`.
    Neg,
    /// Square root; NaN for negative operands.
    Sqrt,
    /// Real cube root, also of negative operands.
    Cbrt,
    /// `e^a`.
    Exp,
    /// `e^a - 1`, accurate near 0.
    Expm1,
    /// `2^a`.
    Exp2,
    /// Natural logarithm.
    Log,
    /// `log(1 + a)`, accurate near 0.
    Log1p,
    /// Logarithm to base 2.
    Log2,
    /// Logarithm to base 10.
    Log10,
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Inverse sine.
    Asin,
    /// Inverse cosine.
    Acos,
    /// Inverse tangent.
    Atan,
    /// Hyperbolic sine.
    Sinh,
    /// Hyperbolic cosine.
    Cosh,
    /// Hyperbolic tangent.
    Tanh,
    /// Inverse hyperbolic sine.
    Asinh,
    /// Inverse hyperbolic cosine; NaN below 1.
    Acosh,
    /// Inverse hyperbolic tangent.
    Atanh,
    /// The operand, or 0 where it is negative: beyond the regions of its signs, of an expression that is not negative in them.
    NotNegative,
    /// The error function.
    Erf,
}

/// Function of two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum BinaryOp {
    /// `a + b`.
    Add,
    /// `a - b`.
    Sub,
    /// `a * b`.
    Mul,
    /// `a / b`.
    Div,
    /// `a ** b` in floating point: NaN for a negative base with a non-integer exponent.
    Pow,
    /// Angle of the point (b, a): `atan2(a, b)`.
    Atan2,
    /// `sqrt(a^2 + b^2)` without overflow.
    Hypot,
}

impl UnaryOp {
    /// Every operation, in the order of their numbers in a serialised graph.
    pub const ALL: [UnaryOp; 24] = {
        use UnaryOp::*;
        [
            Neg,
            Sqrt,
            Cbrt,
            Exp,
            Expm1,
            Exp2,
            Log,
            Log1p,
            Log2,
            Log10,
            Sin,
            Cos,
            Tan,
            Asin,
            Acos,
            Atan,
            Sinh,
            Cosh,
            Tanh,
            Asinh,
            Acosh,
            Atanh,
            NotNegative,
            Erf,
        ]
    };

    /// The value of the operation at `a`.
    pub fn apply(self, a: f64) -> f64 {
        match self {
            UnaryOp::Neg => -a,
            UnaryOp::Sqrt => a.sqrt(),
            UnaryOp::Cbrt => a.cbrt(),
            UnaryOp::Exp => a.exp(),
            UnaryOp::Expm1 => a.exp_m1(),
            UnaryOp::Exp2 => a.exp2(),
            UnaryOp::Log => a.ln(),
            UnaryOp::Log1p => a.ln_1p(),
            UnaryOp::Log2 => a.log2(),
            UnaryOp::Log10 => a.log10(),
            UnaryOp::Sin => a.sin(),
            UnaryOp::Cos => a.cos(),
            UnaryOp::Tan => a.tan(),
            UnaryOp::Asin => a.asin(),
            UnaryOp::Acos => a.acos(),
            UnaryOp::Atan => a.atan(),
            UnaryOp::Sinh => a.sinh(),
            UnaryOp::Cosh => a.cosh(),
            UnaryOp::Tanh => a.tanh(),
            UnaryOp::Asinh => a.asinh(),
            UnaryOp::Acosh => acosh(a),
            UnaryOp::Atanh => a.atanh(),
            UnaryOp::NotNegative if a < 0.0 => 0.0,
            UnaryOp::NotNegative => a,
            UnaryOp::Erf => libm::erf(a),
        }
    }

    /// The name in NumPy: `"negative"`, `"sqrt"`, `"arcsin"`, ...
    pub fn name(self) -> &'static str {
        match self {
            UnaryOp::Neg => "negative",
            UnaryOp::Sqrt => "sqrt",
            UnaryOp::Cbrt => "cbrt",
            UnaryOp::Exp => "exp",
            UnaryOp::Expm1 => "expm1",
            UnaryOp::Exp2 => "exp2",
            UnaryOp::Log => "log",
            UnaryOp::Log1p => "log1p",
            UnaryOp::Log2 => "log2",
            UnaryOp::Log10 => "log10",
            UnaryOp::Sin => "sin",
            UnaryOp::Cos => "cos",
            UnaryOp::Tan => "tan",
            UnaryOp::Asin => "arcsin",
            UnaryOp::Acos => "arccos",
            UnaryOp::Atan => "arctan",
            UnaryOp::Sinh => "sinh",
            UnaryOp::Cosh => "cosh",
            UnaryOp::Tanh => "tanh",
            UnaryOp::Asinh => "arcsinh",
            UnaryOp::Acosh => "arccosh",
            UnaryOp::Atanh => "arctanh",
            UnaryOp::NotNegative => "not negative",
            UnaryOp::Erf => "erf",
        }
    }

    /// The operation of a NumPy name, or of the short form (`"asin"`, `"neg"`); `None` if unknown.
    pub fn from_name(name: &str) -> Option<Self> {
        let numpy = match name {
            "neg" => "negative",
            "asin" => "arcsin",
            "acos" => "arccos",
            "atan" => "arctan",
            "asinh" => "arcsinh",
            "acosh" => "arccosh",
            "atanh" => "arctanh",
            other => other,
        };
        Self::ALL.into_iter().find(|op| op.name() == numpy)
    }
}

impl BinaryOp {
    /// Every operation, in the order of their numbers in a serialised graph.
    pub const ALL: [BinaryOp; 7] = {
        use BinaryOp::*;
        [Add, Sub, Mul, Div, Pow, Atan2, Hypot]
    };

    /// The value of the operation at `a`, `b`.
    pub fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            BinaryOp::Add => a + b,
            BinaryOp::Sub => a - b,
            BinaryOp::Mul => a * b,
            BinaryOp::Div => a / b,
            BinaryOp::Pow => a.powf(b),
            BinaryOp::Atan2 => a.atan2(b),
            BinaryOp::Hypot => a.hypot(b),
        }
    }

    /// The name in NumPy: `"add"`, `"subtract"`, `"multiply"`, `"divide"`, `"power"`, `"arctan2"`, `"hypot"`.
    pub fn name(self) -> &'static str {
        match self {
            BinaryOp::Add => "add",
            BinaryOp::Sub => "subtract",
            BinaryOp::Mul => "multiply",
            BinaryOp::Div => "divide",
            BinaryOp::Pow => "power",
            BinaryOp::Atan2 => "arctan2",
            BinaryOp::Hypot => "hypot",
        }
    }

    /// The operation of a NumPy name, or of the short form (`"sub"`, `"pow"`, ...); `None` if unknown.
    pub fn from_name(name: &str) -> Option<Self> {
        let numpy = match name {
            "sub" => "subtract",
            "mul" => "multiply",
            "div" | "true_divide" => "divide",
            "pow" | "float_power" => "power",
            "atan2" => "arctan2",
            other => other,
        };
        Self::ALL.into_iter().find(|op| op.name() == numpy)
    }

    /// Whether the two operands may be exchanged without changing the value by a single bit.
    pub fn is_commutative(self) -> bool {
        matches!(self, BinaryOp::Add | BinaryOp::Mul | BinaryOp::Hypot)
    }
}

/// Inverse hyperbolic cosine, accurate also just above 1.
///
/// The standard library's `ln(a + sqrt(a - 1) sqrt(a + 1))` loses half of the digits there. With
/// `d = a - 1`, which is exact, `acosh(a) = log1p(d + sqrt(2 d + d^2))`.
fn acosh(a: f64) -> f64 {
    const LARGE: f64 = 1e9; // beyond it d^2 hides 2 d, and would overflow for the largest operands
    if a > LARGE {
        a.ln() + std::f64::consts::LN_2
    } else if a >= 1.0 {
        let d = a - 1.0;
        (d + (2.0 * d + d * d).sqrt()).ln_1p()
    } else {
        f64::NAN
    }
}

#[cfg(test)]
mod tests;
