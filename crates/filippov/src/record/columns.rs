//! Switches and segments of a run: the latest as they are, the earlier ones of a long run in columns.
//!
//! Most switches of a run are of few sorts, and so are its segments. A column keeps the number of the sort, and the sort is kept once.
//! Of a switch with two states that is 30 bytes, of a segment as many.

use std::collections::HashMap;
use std::hash::Hash;

use smallvec::SmallVec;

use super::segment::Segment;
use crate::mode::Mode;
use crate::switch::{Kind, Switch};

/// So many rows are kept as they are; twice as many, and the earlier half goes into columns. Searches of a running motion look back
/// at fewer ([`crate::tolerances::FEW_SWITCHES`], [`crate::tolerances::LATEST_SWITCHES`]).
const PLAIN: usize = 1024;

/// The switches of a run in order of time.
pub type Switches = Rows<SwitchColumns>;

/// The segments of a run in order of time.
pub type Segments = Rows<SegmentColumns>;

/// Rows in columns.
pub trait Columns: Default {
    /// One row.
    type Row: Clone;
    /// How many rows there are.
    fn n_rows(&self) -> usize;
    /// Adds a row.
    fn push(&mut self, row: &Self::Row);
    /// A row, which is there.
    fn at(&self, index: usize) -> Self::Row;
    /// Gives back the room that is not used.
    fn shrink_to_fit(&mut self);
}

/// A list of rows: the first ones in columns, the latest as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows<C: Columns> {
    packed: C,
    latest: Vec<C::Row>,
}

impl<C: Columns> Default for Rows<C> {
    fn default() -> Self {
        Rows::with_capacity(0)
    }
}

impl<C: Columns> Rows<C> {
    /// No rows, with room for so many.
    pub(crate) fn with_capacity(room: usize) -> Self {
        Rows {
            packed: C::default(),
            latest: Vec::with_capacity(room),
        }
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.packed.n_rows() + self.latest.len()
    }

    /// Are there none?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The row of this index, if there is one.
    pub fn get(&self, index: usize) -> Option<C::Row> {
        (index < self.len()).then(|| self.at(index))
    }

    /// The row of this index.
    ///
    /// # Panics
    /// If there are not so many.
    pub fn at(&self, index: usize) -> C::Row {
        let n = self.packed.n_rows();
        match index.checked_sub(n) {
            Some(place) => self.latest[place].clone(),
            None => self.packed.at(index),
        }
    }

    /// The first row.
    pub fn first(&self) -> Option<C::Row> {
        self.get(0)
    }

    /// The last row.
    pub fn last(&self) -> Option<C::Row> {
        self.get(self.len().checked_sub(1)?)
    }

    /// All rows, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = C::Row> + DoubleEndedIterator + '_ {
        (0..self.len()).map(|index| self.at(index))
    }

    /// Adds a row.
    #[inline]
    pub(crate) fn push(&mut self, row: C::Row) {
        self.latest.push(row);
    }

    /// The latest rows, of which there are [`PLAIN`] or all.
    #[inline]
    pub(crate) fn latest(&self) -> &[C::Row] {
        &self.latest
    }

    /// The same, to be changed.
    #[inline]
    pub(crate) fn latest_mut(&mut self) -> &mut [C::Row] {
        &mut self.latest
    }

    /// Forgets all but the latest `n` rows.
    pub(crate) fn forget_before(&mut self, n: usize) {
        self.packed = C::default();
        self.latest.drain(..self.latest.len().saturating_sub(n));
    }

    /// Puts earlier rows into columns, if there are many of them.
    #[inline]
    pub(crate) fn pack_earlier(&mut self) {
        if self.latest.len() >= 2 * PLAIN {
            self.pack_before(PLAIN);
        }
    }

    /// Puts all rows into columns without spare room: a list that may be kept for long, beside many others.
    pub(crate) fn pack(&mut self) {
        self.pack_before(0);
        self.latest = Vec::new();
        self.packed.shrink_to_fit();
    }

    #[cold]
    #[inline(never)]
    fn pack_before(&mut self, n_left: usize) {
        let n = self.latest.len() - n_left;
        self.latest[..n]
            .iter()
            .for_each(|row| self.packed.push(row));
        self.latest.drain(..n);
    }
}

/// Values that repeat: each is kept once, and has a number.
#[derive(Clone, Debug)]
struct Sorts<T> {
    list: Vec<T>,
    numbers: HashMap<T, u32>,
}

impl<T> Default for Sorts<T> {
    fn default() -> Self {
        Sorts {
            list: Vec::new(),
            numbers: HashMap::new(),
        }
    }
}

impl<T: Clone + Eq + Hash> Sorts<T> {
    fn number(&mut self, value: T) -> u32 {
        if let Some(&number) = self.numbers.get(&value) {
            return number;
        }
        let number = self.list.len() as u32;
        self.list.push(value.clone());
        self.numbers.insert(value, number);
        number
    }

    fn of(&self, number: u32) -> &T {
        &self.list[number as usize]
    }
}

impl<T: PartialEq> PartialEq for Sorts<T> {
    fn eq(&self, other: &Self) -> bool {
        self.list == other.list
    }
}

/// What a switch is, apart from its place.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct SortOfSwitch {
    kind: Kind,
    surfaces: SmallVec<[usize; 2]>,
    mode_before: Mode,
    mode_after: Mode,
    note: String,
    rule: &'static str,
    n_states: usize,
}

/// Switches in columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SwitchColumns {
    t: Vec<f64>,
    sort: Vec<u32>,
    sorts: Sorts<SortOfSwitch>,
    /// The states before, one after the other.
    before: Vec<f64>,
    /// The switches at which the state jumps, and the states after these.
    jumps: Vec<usize>,
    after: Vec<f64>,
}

impl Columns for SwitchColumns {
    type Row = Switch;

    fn n_rows(&self) -> usize {
        self.t.len()
    }

    fn push(&mut self, row: &Switch) {
        let (before, after) = (&row.y_before, &row.y_after);
        let pairs = || before.iter().zip(after);
        if pairs().any(|(before, after)| before.to_bits() != after.to_bits()) {
            self.jumps.push(self.t.len());
            self.after.extend_from_slice(after);
        }
        self.before.extend_from_slice(before);
        self.t.push(row.t);
        self.sort.push(self.sorts.number(SortOfSwitch {
            kind: row.kind,
            surfaces: row.surfaces.clone(),
            mode_before: row.mode_before.clone(),
            mode_after: row.mode_after.clone(),
            note: row.note.clone(),
            rule: row.rule,
            n_states: before.len(),
        }));
    }

    fn at(&self, index: usize) -> Switch {
        let sort = self.sorts.of(self.sort[index]).clone();
        let n = sort.n_states;
        let y_before = &self.before[index * n..][..n];
        let y_after = match self.jumps.binary_search(&index) {
            Ok(jump) => &self.after[jump * n..][..n],
            Err(_) => y_before,
        };
        Switch {
            t: self.t[index],
            y_before: SmallVec::from_slice(y_before),
            y_after: SmallVec::from_slice(y_after),
            kind: sort.kind,
            surfaces: sort.surfaces,
            mode_before: sort.mode_before,
            mode_after: sort.mode_after,
            note: sort.note,
            rule: sort.rule,
        }
    }

    fn shrink_to_fit(&mut self) {
        self.t.shrink_to_fit();
        self.sort.shrink_to_fit();
        self.before.shrink_to_fit();
        self.jumps.shrink_to_fit();
        self.after.shrink_to_fit();
    }
}

/// Segments in columns. They tile the time: a segment ends where the next one starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SegmentColumns {
    t_start: Vec<f64>,
    first_step: Vec<usize>,
    /// The end of the last one, and one past its last step.
    end: (f64, usize),
    /// The mode, and how many multipliers there are.
    sort: Vec<u32>,
    sorts: Sorts<(Mode, usize)>,
    /// The multipliers of each segment and its discrete states, one after the other; and where those of each segment end.
    numbers: Vec<f64>,
    ends: Vec<usize>,
}

impl SegmentColumns {
    /// When a segment starts, and one past its last step.
    fn bounds(&self, index: usize) -> (f64, usize) {
        let next = self.first_step.get(index + 1);
        (self.t_start[index], *next.unwrap_or(&self.end.1))
    }
}

impl Columns for SegmentColumns {
    type Row = Segment;

    fn n_rows(&self) -> usize {
        self.t_start.len()
    }

    fn push(&mut self, row: &Segment) {
        self.t_start.push(row.t_start);
        self.first_step.push(row.steps.0);
        self.end = (row.t_end, row.steps.1);
        let sort = (row.mode.clone(), row.multipliers.len());
        self.sort.push(self.sorts.number(sort));
        self.numbers.extend_from_slice(&row.multipliers);
        self.numbers.extend_from_slice(&row.discrete);
        self.ends.push(self.numbers.len());
    }

    fn at(&self, index: usize) -> Segment {
        let (mode, n_multipliers) = self.sorts.of(self.sort[index]).clone();
        let from = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        let numbers = &self.numbers[from..self.ends[index]];
        let (multipliers, discrete) = numbers.split_at(n_multipliers);
        let (t_start, last_step) = self.bounds(index);
        Segment {
            t_start,
            t_end: *self.t_start.get(index + 1).unwrap_or(&self.end.0),
            mode,
            steps: (self.first_step[index], last_step),
            multipliers: SmallVec::from_slice(multipliers),
            discrete: discrete.to_vec(),
        }
    }

    fn shrink_to_fit(&mut self) {
        self.t_start.shrink_to_fit();
        self.first_step.shrink_to_fit();
        self.sort.shrink_to_fit();
        self.numbers.shrink_to_fit();
        self.ends.shrink_to_fit();
    }
}

impl Segments {
    /// How many segments come first of which this holds, asked with the start of a segment and one past its last step.
    pub(crate) fn partition_point(&self, holds: impl Fn(f64, usize) -> bool) -> usize {
        let n = self.packed.n_rows();
        let (mut low, mut high) = (0, self.len());
        while low < high {
            let middle = low + (high - low) / 2;
            let (t_start, last_step) = match middle.checked_sub(n) {
                Some(place) => (self.latest[place].t_start, self.latest[place].steps.1),
                None => self.packed.bounds(middle),
            };
            match holds(t_start, last_step) {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn switch(k: usize) -> Switch {
        let y = k as f64;
        Switch {
            t: y,
            y_before: SmallVec::from_slice(&[y, -0.0]),
            y_after: SmallVec::from_slice(&[y, if k.is_multiple_of(3) { 0.0 } else { -0.0 }]),
            kind: Kind::Crossing,
            surfaces: SmallVec::from_slice(&[k % 2]),
            mode_before: Mode::new(vec![1, -1]),
            mode_after: Mode::new(vec![-1, 1 - 2 * (k % 2) as i8]),
            note: if k.is_multiple_of(5) {
                "tick".into()
            } else {
                String::new()
            },
            rule: "one_surface",
        }
    }

    fn segment(k: usize) -> Segment {
        Segment {
            t_start: k as f64,
            t_end: k as f64 + 1.0,
            mode: Mode::new(vec![(k % 3) as i8 - 1]),
            steps: (2 * k, 2 * k + 2),
            multipliers: (0..k % 3).map(|j| j as f64).collect(),
            discrete: vec![k as f64; 2],
        }
    }

    #[test]
    fn rows_are_the_same_in_columns() {
        let n = 3 * PLAIN - 1;
        let (mut switches, mut segments) = (Switches::default(), Segments::default());
        for k in 0..n {
            switches.push(switch(k));
            segments.push(segment(k));
            switches.pack_earlier();
            segments.pack_earlier();
        }
        for is_packed in [false, true] {
            if is_packed {
                switches.pack();
                segments.pack();
            }
            assert_eq!(
                switches.latest().len(),
                if is_packed { 0 } else { n - PLAIN }
            );
            assert_eq!((switches.len(), segments.len()), (n, n));
            assert!(switches.iter().eq((0..n).map(switch)));
            assert!(segments.iter().eq((0..n).map(segment)));
            let signs = |k: usize| switches.at(k).y_after[1].is_sign_negative();
            assert!(
                (0..n).all(|k| signs(k) != (k % 3 == 0)),
                "zeros keep their signs"
            );
            let found = segments.partition_point(|t_start, _| t_start <= 1500.5);
            assert_eq!(found, 1501);
            assert_eq!(segments.partition_point(|_, last| last <= 3001), 1500);
            assert_eq!(
                (switches.get(n), segments.last()),
                (None, Some(segment(n - 1)))
            );
        }
    }
}
