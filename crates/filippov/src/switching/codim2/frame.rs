//! The normal components at an intersection of two surfaces, and the eight frames to see them in.

use std::ops::Neg;

use crate::switching::normal_fields::NormalFields;
use crate::switching::resolution::Undecided;

/// The normal components of the four fields at an intersection of two surfaces, with each surface
/// scaled so that its largest component has magnitude 1. Decisions do not depend on such a scaling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    values: [[f64; 2]; 4],
}

impl Corners {
    /// The four corners of fields at an intersection of two surfaces.
    ///
    /// # Errors
    /// If there are not two surfaces, or if all fields are tangent to one of them.
    pub fn new(fields: &NormalFields) -> Result<Self, Undecided> {
        if fields.m() != 2 {
            return Err(Undecided::Shape {
                m: fields.m(),
                found: fields.groups().iter().map(|g| g.values.len()).sum(),
            });
        }
        let sizes = [fields.row_size(0), fields.row_size(1)];
        if let Some(surface) = sizes.iter().position(|&size| size == 0.0) {
            return Err(Undecided::Tangent { surface });
        }
        let corner = |pattern: usize| [0, 1].map(|j: usize| fields.at(pattern)[j] / sizes[j]);
        Ok(Corners {
            values: [0, 1, 2, 3].map(corner),
        })
    }

    /// f^k.
    pub fn at(&self, k: [i8; 2]) -> [f64; 2] {
        self.values[pattern_of(&k)]
    }
}

/// One of the eight frames at an intersection of two surfaces: exchange the surfaces or not, then
/// change the sign of each h_j or not.
///
/// Modes, multipliers, states of the hidden dynamics and normal components all transform as vectors.
/// Each decision tree is stated in a normal frame: transform, decide, transform the mode back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Are the surfaces exchanged?
    pub exchange: bool,
    /// Is the sign of h_1, of h_2 changed, counted after the exchange?
    pub reflect: [bool; 2],
}

/// The four regions, in the order of their patterns.
const REGIONS: [[i8; 2]; 4] = [[-1, -1], [1, -1], [-1, 1], [1, 1]];

impl Frame {
    /// All of them; those without exchange first.
    pub fn all() -> impl Iterator<Item = Frame> {
        (0..8_u8).map(|bits| Frame {
            exchange: bits & 4 != 0,
            reflect: [bits & 2 != 0, bits & 1 != 0],
        })
    }

    /// A vector seen in this frame.
    pub fn of<T: Neg<Output = T> + Copy>(&self, v: [T; 2]) -> [T; 2] {
        self.reflected(self.exchanged(v))
    }

    /// A vector of this frame in the original one.
    pub fn back<T: Neg<Output = T> + Copy>(&self, v: [T; 2]) -> [T; 2] {
        self.exchanged(self.reflected(v))
    }

    /// The normal components seen in this frame.
    pub fn corners(&self, corners: &Corners) -> Corners {
        Corners {
            values: REGIONS.map(|k| self.of(corners.at(self.back(k)))),
        }
    }

    /// Unscaled normal components at an intersection of two surfaces seen in this frame.
    ///
    /// # Errors
    /// If there are not two surfaces.
    pub fn fields(&self, fields: &NormalFields) -> Result<NormalFields, Undecided> {
        if fields.m() != 2 {
            return Err(Undecided::Shape {
                m: fields.m(),
                found: fields.groups().iter().map(|g| g.values.len()).sum(),
            });
        }
        let seen = REGIONS.map(|k| {
            let f = fields.in_region(&self.back(k));
            self.of([f[0], f[1]])
        });
        NormalFields::new(2, seen.concat())
    }

    fn exchanged<T: Copy>(&self, v: [T; 2]) -> [T; 2] {
        if self.exchange {
            [v[1], v[0]]
        } else {
            v
        }
    }

    fn reflected<T: Neg<Output = T> + Copy>(&self, v: [T; 2]) -> [T; 2] {
        let side = |j: usize| if self.reflect[j] { -v[j] } else { v[j] };
        [side(0), side(1)]
    }
}

/// The number of the pattern with these signs.
fn pattern_of(signs: &[i8; 2]) -> usize {
    usize::from(signs[0] > 0) | usize::from(signs[1] > 0) << 1
}
