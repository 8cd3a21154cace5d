//! Counters of a run.

use crate::options::Method;

/// What a run cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stats {
    /// Evaluations of the right-hand side; one of the sliding field counts two, the coefficients of a Taylor step
    /// count as many as take the same number of operations.
    pub n_field_evaluations: u64,
    /// Evaluations of the switching functions in the search for events.
    pub n_surface_evaluations: u64,
    /// Accepted steps.
    pub n_steps: u64,
    /// Accepted steps by each method, in the order of [`Method::ALL`].
    pub n_steps_by: [u64; Method::ALL.len()],
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
    /// Events and actions: `max_events` bounds their number.
    pub n_events: u64,
    /// Switches that were recorded.
    pub n_switches: u64,
    /// Those in the place where the run ended, one after the other, if they are very many; else 0.
    pub n_switches_here: u64,
    /// The time of the first of those.
    pub here_since: Option<f64>,
}

impl Stats {
    /// Counts a rejected step.
    pub(crate) fn reject(&mut self, is_sliding: bool) {
        self.n_rejected += 1;
        self.n_rejected_sliding += u64::from(is_sliding);
    }

    /// All counters, in a fixed order. The two times are none.
    pub(crate) fn counts_mut(&mut self) -> Vec<&mut u64> {
        let Stats {
            n_field_evaluations,
            n_surface_evaluations,
            n_steps,
            n_steps_by,
            stiff_since: _,
            n_jacobians,
            n_factorisations,
            n_rejected,
            n_steps_sliding,
            n_rejected_sliding,
            n_extensions,
            n_events,
            n_switches,
            n_switches_here,
            here_since: _,
        } = self;
        let mut all = vec![
            n_field_evaluations,
            n_surface_evaluations,
            n_steps,
            n_jacobians,
            n_factorisations,
            n_rejected,
            n_steps_sliding,
            n_rejected_sliding,
            n_extensions,
            n_events,
            n_switches,
            n_switches_here,
        ];
        all.extend(n_steps_by);
        all
    }

    /// Accepted steps that this method took.
    pub fn n_steps_of(&self, method: Method) -> u64 {
        self.n_steps_by[method as usize]
    }
}
