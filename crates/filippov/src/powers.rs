//! Powers that are the same on every platform.

/// x to the power of `exponent`, to the same bits on every platform. The function of the standard library is that of the
/// platform, and its last bit would decide the length of a step.
pub(crate) fn power(x: f64, exponent: f64) -> f64 {
    libm::pow(x, exponent)
}
