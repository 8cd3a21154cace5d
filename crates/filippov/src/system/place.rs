//! Where the functions of a system are evaluated.

use crate::mode::Signs;

/// What a motion holds constant: the signs of its region, and the discrete states between actions.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'p> {
    /// The entry `s_j` is the sign of h_j: it selects the smooth field. On surfaces slid on it may be a multiplier.
    pub signs: &'p [f64],
    /// The discrete states; empty if the system has none.
    pub q: &'p [f64],
}

impl<'p> Setting<'p> {
    /// These signs and discrete states.
    pub fn new(signs: &'p [f64], q: &'p [f64]) -> Self {
        Setting { signs, q }
    }

    /// The setting of a system that has no discrete states.
    pub fn of_signs(signs: &'p [f64]) -> Self {
        Setting { signs, q: &[] }
    }

    /// The same discrete states with other signs.
    #[must_use]
    pub fn with_signs<'s>(self, signs: &'s [f64]) -> Setting<'s>
    where
        'p: 's,
    {
        Setting { signs, q: self.q }
    }

    /// The place at a point.
    #[inline(always)]
    pub fn at<'s>(self, t: f64, x: &'s [f64]) -> Place<'s>
    where
        'p: 's,
    {
        Place {
            t,
            x,
            signs: self.signs,
            q: self.q,
        }
    }
}

/// A setting that is kept with a field.
#[derive(Clone, Debug)]
pub(crate) struct OwnSetting {
    pub signs: Signs,
    /// Empty for most systems, and then it takes no memory.
    q: Vec<f64>,
}

impl OwnSetting {
    pub fn new(setting: Setting<'_>) -> Self {
        OwnSetting {
            signs: Signs::from_slice(setting.signs),
            q: setting.q.to_vec(),
        }
    }

    /// Takes over another setting of the same system.
    #[inline(always)]
    pub fn set(&mut self, setting: Setting<'_>) {
        self.signs.copy_from_slice(setting.signs);
        if !setting.q.is_empty() {
            self.set_discrete(setting.q);
        }
    }

    /// Takes over other discrete states.
    pub fn set_discrete(&mut self, q: &[f64]) {
        self.q.copy_from_slice(q);
    }

    #[inline(always)]
    pub fn get(&self) -> Setting<'_> {
        Setting {
            signs: &self.signs,
            q: &self.q,
        }
    }

    /// The place at a point.
    #[inline(always)]
    pub fn at<'p>(&'p self, t: f64, x: &'p [f64]) -> Place<'p> {
        self.get().at(t, x)
    }
}

/// The argument of every function of a system: a point (t, x), the signs of a region, and the discrete states.
///
/// The point may lie slightly beyond the border of the region: the signs alone select the smooth field.
///
/// # Example
/// ```
/// use filippov::{ClosureSystem, PiecewiseSystem, Place};
/// // x' = 0.3 - sign(x)
/// let system = ClosureSystem::new(1, 1, |_t, _x, s, dx| dx[0] = 0.3 - s[0], |_t, x, h| h[0] = x[0]);
/// let mut dx = [0.0];
/// let above = Place::new(0.0, &[-1e-12], &[1.0]);
/// system.field(&above, &mut dx)?;
/// assert_eq!(dx, [-0.7]);
/// # Ok::<(), filippov::FieldError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Place<'p> {
    /// The time.
    pub t: f64,
    /// The state.
    pub x: &'p [f64],
    /// The entry `s_j` is the sign of h_j: it selects the smooth field. On surfaces slid on it may be a multiplier.
    pub signs: &'p [f64],
    /// The discrete states; empty if the system has none.
    pub q: &'p [f64],
}

impl<'p> Place<'p> {
    /// A place in a system that has no discrete states.
    pub fn new(t: f64, x: &'p [f64], signs: &'p [f64]) -> Self {
        Setting::of_signs(signs).at(t, x)
    }

    /// The signs and the discrete states.
    #[inline(always)]
    pub fn setting(&self) -> Setting<'p> {
        Setting {
            signs: self.signs,
            q: self.q,
        }
    }

    /// The same setting at another point.
    #[inline(always)]
    #[must_use]
    pub fn moved<'s>(&self, t: f64, x: &'s [f64]) -> Place<'s>
    where
        'p: 's,
    {
        Place { t, x, ..*self }
    }

    /// The same point with other signs.
    #[inline(always)]
    #[must_use]
    pub fn with_signs<'s>(&self, signs: &'s [f64]) -> Place<'s>
    where
        'p: 's,
    {
        Place { signs, ..*self }
    }
}
