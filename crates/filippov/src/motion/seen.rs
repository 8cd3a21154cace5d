//! What a step shows of the exit functions of its motion.

use super::ModeField;

/// What a step shows of an exit function: its values at both ends, and the range of those at the ends and the stages.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// At the start of the step.
    pub start: f64,
    /// At its end, once the step was attempted.
    pub end: f64,
    /// The least and the largest value; NaN if one of them is.
    pub range: [f64; 2],
}

impl Seen {
    /// This value at the start of a motion.
    pub fn at_start(value: f64) -> Self {
        Seen {
            start: value,
            end: value,
            range: [value; 2],
        }
    }

    /// A step is attempted.
    pub fn begin(&mut self) {
        self.range = [self.start; 2];
    }

    /// The value at a stage, last that at the end.
    #[inline(always)]
    pub fn see(&mut self, value: f64) {
        let [least, most] = &mut self.range;
        if value < *least || value.is_nan() {
            *least = value;
        }
        if value > *most || value.is_nan() {
            *most = value;
        }
        self.end = value;
    }

    /// The largest magnitude.
    pub fn size(&self) -> f64 {
        self.range[0].abs().max(self.range[1].abs())
    }
}

/// Takes down the exit functions at the stages of a step.
pub(crate) fn observer(seen: &mut [Seen]) -> impl FnMut(&ModeField) + '_ {
    |field| {
        // Nothing is seen in a region.
        if seen.is_empty() {
            return;
        }
        for (seen, value) in seen.iter_mut().zip(field.last_exits()) {
            seen.see(*value);
        }
    }
}
