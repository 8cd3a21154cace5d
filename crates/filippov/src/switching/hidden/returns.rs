//! Returns of the hidden dynamics of two surfaces to a half line through the root.

use crate::tolerances::{AT_THE_ROOT, CYCLE, FAR_OUT, MOST_RETURNS, RETURNS_TO_A_CYCLE};

/// Distances from the root at which the motion returns to the half line y = P.y, x > P.x.
///
/// g_2 has one sign on it and orbits of the plane do not cross, so the distances are monotone. One
/// return that is not further out than the one before proves that the motion stays bounded.
#[derive(Debug, Default)]
pub(super) struct Returns {
    last: Option<f64>,
    count: usize,
    contracts: bool,
}

/// What the returns say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Nothing yet.
    Open,
    /// The motion stays bounded, and tends to the root if that is stable.
    ToTheRoot,
    /// The motion tends to a cycle.
    ToACycle,
    /// The motion has come far out.
    Far,
    /// It was watched long enough.
    TooMany,
}

impl Returns {
    /// Is it proved that the motion stays bounded?
    pub fn contracts(&self) -> bool {
        self.contracts
    }

    /// Notes a return at this distance.
    pub fn note(&mut self, distance: f64) -> Verdict {
        let Some(last) = self.last.replace(distance) else {
            return Verdict::Open;
        };
        self.count += 1;
        self.contracts |= distance <= last;
        if (distance - last).abs() <= CYCLE * last {
            Verdict::ToACycle
        } else if self.contracts && (distance < AT_THE_ROOT || self.count > RETURNS_TO_A_CYCLE) {
            Verdict::ToTheRoot
        } else if distance > FAR_OUT {
            Verdict::Far
        } else if self.count > MOST_RETURNS {
            Verdict::TooMany
        } else {
            Verdict::Open
        }
    }
}
