//! Values that the functions of a system read like parameters and that a run changes in instants.

use std::sync::atomic::{AtomicU64, Ordering};

use smallvec::SmallVec;

/// The discrete states of one run of a system. Only that run writes them, between evaluations.
#[derive(Debug, Default)]
pub(super) struct DiscreteStates {
    bits: Vec<AtomicU64>,
}

impl DiscreteStates {
    pub fn is_empty(&self) -> bool {
        self.bits.is_empty()
    }

    pub fn len(&self) -> usize {
        self.bits.len()
    }

    /// Sets all values; their number was fixed when the system was made.
    pub fn set(&self, values: &[f64]) {
        for (slot, value) in self.bits.iter().zip(values) {
            slot.store(value.to_bits(), Ordering::Relaxed);
        }
    }

    fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let load = |slot: &AtomicU64| f64::from_bits(slot.load(Ordering::Relaxed));
        self.bits.iter().map(load)
    }

    /// The parameters with the discrete states behind them.
    #[cold]
    pub fn behind(&self, parameters: &[f64]) -> SmallVec<[f64; 16]> {
        let mut all = SmallVec::from_slice(parameters);
        all.extend(self.values());
        all
    }
}

impl FromIterator<f64> for DiscreteStates {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let store = |value: f64| AtomicU64::new(value.to_bits());
        DiscreteStates {
            bits: values.into_iter().map(store).collect(),
        }
    }
}

impl Clone for DiscreteStates {
    fn clone(&self) -> Self {
        self.values().collect()
    }
}
