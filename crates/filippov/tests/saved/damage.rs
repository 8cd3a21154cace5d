//! Damage to bytes: as it happens, and as somebody would do it who can compute a checksum.

use filippov_expr::container::{resealed, sections_of};

/// Where a section has its length, and where its contents begin.
const LENGTH: usize = 4;
const CONTENTS: usize = 12;

/// One damaged byte string per number.
pub struct Damage {
    state: u64,
}

impl Damage {
    pub fn new(case: u64) -> Self {
        let mut damage = Damage {
            state: case.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1,
        };
        damage.next();
        damage
    }

    /// One of the sources, damaged, and whether its checksum is right all the same. Most have
    /// a right checksum, and sections whose lengths are right.
    pub fn of_one(&mut self, sources: &[Vec<u8>]) -> (Vec<u8>, bool) {
        let mut bytes = sources[self.below(sources.len())].clone();
        match self.below(8) {
            0 => {
                let all = 0..bytes.len();
                self.change(&mut bytes, all, sources);
                (bytes, false)
            }
            1 => {
                let all = 0..bytes.len() - 4;
                self.change(&mut bytes, all, sources);
                match resealed(&bytes) {
                    Some(sealed) => (sealed, true),
                    None => (bytes, false),
                }
            }
            _ => {
                for _ in 0..=self.below(2) {
                    self.change_contents(&mut bytes, sources);
                }
                match resealed(&bytes) {
                    Some(sealed) => (sealed, true),
                    None => (bytes, false),
                }
            }
        }
    }

    /// Changes what is in a section, and writes its length again.
    fn change_contents(&mut self, bytes: &mut Vec<u8>, sources: &[Vec<u8>]) {
        let sections = sections_of(bytes);
        let section = sections[self.below(sections.len())].clone();
        let before = bytes.len();
        self.change(bytes, section.start + CONTENTS..section.end, sources);
        let length = (section.len() + bytes.len() - before - CONTENTS) as u64;
        let place = section.start + LENGTH;
        bytes[place..place + 8].copy_from_slice(&length.to_le_bytes());
    }

    fn change(&mut self, bytes: &mut Vec<u8>, range: std::ops::Range<usize>, sources: &[Vec<u8>]) {
        if range.is_empty() {
            return;
        }
        let mut place = range.start + self.below(range.len());
        // Most bytes are the zeros of small numbers.
        while bytes[place] == 0 && self.below(4) > 0 {
            place = range.start + self.below(range.len());
        }
        let room = range.end - place;
        match self.below(16) {
            0 | 10 | 11 => bytes[place] ^= 1 << self.below(8),
            1 => bytes[place] = self.next() as u8,
            2 | 3 | 12 => bytes[place] = self.below(8) as u8,
            // The neighbour of an index, or another operation.
            13..=15 => bytes[place] = bytes[place].wrapping_add([1, 255, 2, 254][self.below(4)]),
            4 | 5 if room >= 4 => {
                let value = [0, 1, 2, 3, 5, 8, 1 << 16, u32::MAX][self.below(8)];
                bytes[place..place + 4].copy_from_slice(&value.to_le_bytes());
            }
            6 if room >= 8 => {
                let values = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300, 1e-320];
                let value = values[self.below(values.len())];
                bytes[place..place + 8].copy_from_slice(&value.to_bits().to_le_bytes());
            }
            7 => {
                let count = 1 + self.below(room.min(24));
                bytes.drain(place..place + count);
            }
            8 => {
                let count = 1 + self.below(room.min(24));
                let part = bytes[place..place + count].to_vec();
                bytes.splice(place..place, part);
            }
            _ => {
                let other = &sources[self.below(sources.len())];
                let from = self.below(other.len());
                let count = (1 + self.below(24)).min(other.len() - from).min(room);
                bytes[place..place + count].copy_from_slice(&other[from..from + count]);
            }
        }
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    /// The next number of splitmix64.
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }
}
