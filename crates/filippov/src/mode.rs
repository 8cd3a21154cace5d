//! Modes: a region of smooth motion, or sliding on a set of surfaces.

use std::fmt;

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
    Short { length: u8, entries: [i8; SHORT] },
    Long(Box<[i8]>),
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
            Entries::Long(entries) => entries,
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
        let entries = self.entries().iter().enumerate();
        entries.filter(|(_, &e)| e == 0).map(|(j, _)| j)
    }

    /// Number of surfaces slid on.
    pub fn codimension(&self) -> usize {
        self.entries().iter().filter(|&&e| e == 0).count()
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
        for (sign, &entry) in signs.iter_mut().zip(self.entries()) {
            *sign = if entry < 0 { -1.0 } else { 1.0 };
        }
        signs
    }

    /// Sets entry `j`.
    pub(crate) fn set(&mut self, j: usize, entry: i8) {
        self.entries_mut()[j] = entry;
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
