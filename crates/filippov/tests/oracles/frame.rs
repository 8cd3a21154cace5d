//! The normal components at an intersection of two surfaces, and the eight frames to see them in.

use std::ops::Neg;

use filippov::switching::{Bilinear, NormalFields};

/// The normal components of the four fields at an intersection of two surfaces, with each surface
/// scaled so that its largest component has magnitude 1. Decisions do not depend on such a scaling.
#[derive(Clone, Debug, PartialEq)]
pub struct Corners(NormalFields);

impl Corners {
    /// The four corners of fields at an intersection of two surfaces.
    pub fn new(fields: &NormalFields) -> Self {
        Corners(fields.scaled(&[0, 1].map(|j| 1.0 / fields.row_size(j))))
    }

    /// The canopy through them.
    pub fn canopy(&self) -> Bilinear {
        Bilinear::of_fields(&self.0)
    }

    /// f^k.
    pub fn at(&self, k: [i8; 2]) -> [f64; 2] {
        let f = self.0.in_region(&k);
        [f[0], f[1]]
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
        Corners(self.fields(&corners.0))
    }

    /// Unscaled normal components at an intersection of two surfaces seen in this frame.
    pub fn fields(&self, fields: &NormalFields) -> NormalFields {
        let seen = REGIONS.map(|k| {
            let f = fields.in_region(&self.back(k));
            self.of([f[0], f[1]])
        });
        NormalFields::new(2, seen.concat()).unwrap()
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
