//! Counters of a run.

/// What a run cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Evaluations of the right-hand side; one of the sliding field counts two, the coefficients of a Taylor step
    /// count as many as take the same number of operations.
    pub n_field_evaluations: u64,
    /// Evaluations of the switching functions in the search for events.
    pub n_surface_evaluations: u64,
    /// Accepted steps.
    pub n_steps: u64,
    /// Accepted steps by Taylor series.
    pub n_steps_taylor: u64,
    /// Accepted steps by the Runge-Kutta method of order 8.
    pub n_steps_dop853: u64,
    /// Accepted steps by the midpoint rule.
    pub n_steps_midpoint: u64,
    /// Accepted steps by the method for stiff motions.
    pub n_steps_rodas5p: u64,
    /// The time from which on an explicit method found the run stiff.
    pub stiff_since: Option<f64>,
    /// Evaluations of the derivatives of the field.
    pub n_jacobians: u64,
    /// Factorisations of its matrix.
    pub n_factorisations: u64,
    /// Rejected steps.
    pub n_rejected: u64,
    /// Accepted steps while sliding.
    pub n_steps_sliding: u64,
    /// Rejected steps while sliding.
    pub n_rejected_sliding: u64,
    /// Continuous extensions of order 5 that were computed.
    pub n_extensions: u64,
    /// Switches.
    pub n_switches: u64,
}
