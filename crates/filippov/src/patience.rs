//! How long a caller waits for a decision.

/// Asked again and again during long computations: when the caller has waited long enough, they end without an outcome, or
/// with a part of it. Whoever gave the patience drops what comes of them.
///
/// A question costs about as much as a look at a clock: loops with short rounds ask after some rounds only.
#[derive(Clone, Copy)]
pub struct Patience<'a>(Option<&'a dyn Fn() -> bool>);

impl<'a> Patience<'a> {
    /// Computations end when `is_over` returns `true`, and from then on it has to.
    pub fn until(is_over: &'a dyn Fn() -> bool) -> Self {
        Patience(Some(is_over))
    }

    /// Every computation runs to its own end.
    pub const fn endless() -> Self {
        Patience(None)
    }

    /// Has the caller waited long enough?
    pub fn is_over(self) -> bool {
        self.0.is_some_and(|is_over| is_over())
    }
}
