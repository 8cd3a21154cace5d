//! Modes: a region of smooth motion, or sliding on a set of surfaces.

use std::fmt;
use std::sync::Arc;

use smallvec::SmallVec;

/// The signs handed to a field; few are kept without allocation.
pub type Signs = SmallVec<[f64; FEW]>;
const FEW: usize = 8;

/// A mode: one entry per surface, +1 where h > 0, -1 where h < 0, 0 while sliding on h = 0.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Mode(Entries);

/// The most surfaces whose entries are copied as a whole: modes are copied and compared at every switch.
const SHORT: usize = 15;

/// The entries of a mode. Beyond `length` short ones are zero, so that equal modes are equal as a whole.
#[derive(Clone, PartialEq, Eq, Hash)]
enum Entries {
    Short {
        length: u8,
        entries: [i8; SHORT],
    },
    /// Shared by all copies, of which a run keeps several of every switch.
    Long(Arc<[i8]>),
}

impl Default for Mode {
    fn default() -> Self {
        Mode::of(&[])
    }
}

impl Mode {
    /// A mode from its entries, each -1, 0 or +1.
    pub fn new(entries: Vec<i8>) -> Self {
        Mode::of(&entries)
    }

    fn of(entries: &[i8]) -> Self {
        let length = entries.len();
        if length > SHORT {
            return Mode(Entries::Long(entries.into()));
        }
        let mut short = [0; SHORT];
        short[..length].copy_from_slice(entries);
        Mode(Entries::Short {
            length: length as u8,
            entries: short,
        })
    }

    /// The entries.
    #[inline]
    pub fn entries(&self) -> &[i8] {
        match &self.0 {
            Entries::Short { length, entries } => &entries[..usize::from(*length)],
            Entries::Long(entries) => entries,
        }
    }

    fn entries_mut(&mut self) -> &mut [i8] {
        match &mut self.0 {
            Entries::Short { length, entries } => &mut entries[..usize::from(*length)],
            Entries::Long(entries) => Arc::make_mut(entries),
        }
    }

    /// The surface slid on, if exactly one is.
    pub fn sliding(&self) -> Option<usize> {
        let mut zeros = self.sliding_set();
        let first = zeros.next();
        first.filter(|_| zeros.next().is_none())
    }

    /// The surfaces slid on.
    pub fn sliding_set(&self) -> impl Iterator<Item = usize> + '_ {
        let entries = self.entries();
        let mut from = 0;
        std::iter::from_fn(move || {
            let found = next_zero(entries, from)?;
            from = found + 1;
            Some(found)
        })
    }

    /// Entries that another mode has otherwise: those of this one, and those of the other.
    pub(crate) fn changes_to<'m>(&'m self, other: &'m Mode) -> impl Iterator<Item = (i8, i8)> + 'm {
        // Equal words of entries are passed at once.
        let (words, rest) = self.entries().as_chunks::<8>();
        let (others, others_rest) = other.entries().as_chunks();
        let differing = words.iter().zip(others).filter(|(a, b)| a != b);
        let pairs = differing.flat_map(|(a, b)| a.iter().zip(b));
        let pairs = pairs.chain(rest.iter().zip(others_rest));
        pairs.filter(|(a, b)| a != b).map(|(a, b)| (*a, *b))
    }

    /// Number of surfaces slid on.
    pub fn codimension(&self) -> usize {
        self.sliding_set().count()
    }

    /// The entries of the first `n` surfaces, as a mode of these.
    #[must_use]
    pub fn first(&self, n: usize) -> Mode {
        let entries = self.entries();
        Mode::of(&entries[..n.min(entries.len())])
    }

    /// The same mode with entry `j` replaced.
    #[must_use]
    pub fn with(&self, j: usize, entry: i8) -> Mode {
        let mut mode = self.clone();
        mode.set(j, entry);
        mode
    }

    /// The same mode on the sides of these surfaces that a pattern says: +1 where the bit of a surface is set, else -1.
    #[must_use]
    pub(crate) fn on_sides(&self, surfaces: &[usize], pattern: usize) -> Mode {
        let mut mode = self.clone();
        for (bit, &j) in surfaces.iter().enumerate() {
            mode.set(j, if pattern >> bit & 1 == 1 { 1 } else { -1 });
        }
        mode
    }

    /// The signs handed to the field: +1.0 or -1.0 per surface, a zero entry as +1.0.
    pub fn signs(&self) -> Signs {
        let mut signs = match self.entries().len() {
            few @ ..=FEW => Signs::from_buf_and_len([1.0; FEW], few),
            many => Signs::from_elem(1.0, many),
        };
        self.write_signs(&mut signs);
        signs
    }

    /// Writes the signs handed to the field over those of another mode.
    #[inline]
    pub(crate) fn write_signs(&self, signs: &mut Signs) {
        let entries = self.entries();
        signs.resize(entries.len(), 1.0);
        for (sign, &entry) in signs.iter_mut().zip(entries) {
            *sign = sign_of(entry);
        }
    }

    /// Sets entry `j`.
    pub(crate) fn set(&mut self, j: usize, entry: i8) {
        self.entries_mut()[j] = entry;
    }
}

/// -1.0 or, also for a zero, 1.0.
#[inline]
fn sign_of(entry: i8) -> f64 {
    f64::from_bits(1.0_f64.to_bits() | u64::from(entry as u8) << 56 & (1 << 63))
}

/// The first entry from here on that is 0. Words of entries without one are passed at once.
#[inline]
fn next_zero(entries: &[i8], mut from: usize) -> Option<usize> {
    // The entries that are not 0 are odd.
    const ODD: u64 = u64::from_ne_bytes([1; 8]);
    loop {
        let rest = entries.get(from..)?;
        match rest.first_chunk() {
            Some(word) if u64::from_ne_bytes(word.map(|e| e as u8)) & ODD == ODD => from += 8,
            _ => return rest.iter().position(|&e| e == 0).map(|k| from + k),
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        self.entries().iter().try_for_each(|e| {
            out.write_str(match e {
                1 => "+",
                0 => "0",
                _ => "-",
            })
        })
    }
}

impl fmt::Debug for Mode {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "Mode({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::Mode;

    /// Modes of up to 40 surfaces, with entries as a generator of random numbers has them.
    fn modes() -> impl Iterator<Item = Vec<i8>> {
        (0..600_u64).map(|k| {
            let mut state = k.wrapping_mul(6_364_136_223_846_793_005);
            let entries = (0..k % 41).map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(k);
                // Few zeros, so that there are words without one.
                [0, 1, -1, 1, 1, -1, -1, 1][(state >> 61) as usize]
            });
            entries.collect()
        })
    }

    #[test]
    fn words_hide_no_entry() {
        for entries in modes() {
            let mode = Mode::new(entries.clone());
            let zeros = (0..entries.len()).filter(|&j| entries[j] == 0);
            assert!(mode.sliding_set().eq(zeros.clone()));
            assert_eq!(mode.codimension(), zeros.count());
            let sides = entries.iter().map(|&e| if e < 0 { -1.0 } else { 1.0 });
            assert!(mode.signs().into_iter().eq(sides));
            for j in 0..entries.len() {
                let other = mode.with(j, -1);
                let changes: Vec<_> = mode.changes_to(&other).collect();
                let expected: &[(i8, i8)] = &[(entries[j], -1)];
                assert_eq!(changes, expected[usize::from(entries[j] == -1)..]);
            }
        }
    }
}
