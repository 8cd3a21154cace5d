//! Where a run begins or ends at something that a changed run misses.

use super::extended::{Column, Extended};
use super::piece::{Piece, Surroundings};
use crate::error::FieldError;
use crate::record::InstantRecord;
use crate::tolerances::AT_SIDE;

/// Why derivatives are those of one side: what the start or the end of a run coincides with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Borders {
    /// Surfaces on which the run starts and that it leaves, where the field jumps: derivatives by the start.
    pub starts_on: Vec<usize>,
    /// An action at the initial time, which a run that begins later misses: derivatives by the initial time.
    pub starts_at_action: bool,
    /// A clock ticks at the initial time, before or after which the motion is another: derivatives by the start.
    pub starts_at_tick: bool,
    /// The last instant is at the end, and a changed run has it later: all derivatives there.
    pub ends_at_instant: bool,
}

impl Borders {
    /// Are derivatives those of both sides?
    pub fn is_empty(&self) -> bool {
        *self == Borders::default()
    }
}

/// Does an instant at the initial time, from which a run by these columns begins, do something that one which begins later misses?
pub(super) fn is_missed_later(
    extended: &Extended,
    record: &InstantRecord,
    start: f64,
    kinds: &[Column],
) -> bool {
    let mut acts = record.acts.iter();
    let changes = acts.any(|act| extended.moves(act.index)) || record.field[0] != record.field[1];
    record.t[0] == start && !record.acts.is_empty() && changes && kinds.contains(&Column::Start)
}

/// Does a clock tick at the initial time, at another time for some of these columns, and change the motion?
pub(super) fn ticks_at_start(
    around: &Surroundings,
    piece: &mut Piece,
    (t, z): (f64, &[f64]),
    kinds: &[Column],
) -> Result<bool, FieldError> {
    let extended = piece.extended;
    let ticks = extended.ticks_at(&piece.at(t, z));
    let moves = |kind: &Column, tick: &Vec<f64>| match *kind {
        Column::Start => true,
        Column::State(i) => tick[i] != 0.0,
        Column::Parameter(p) => tick[extended.n + p] != 0.0,
    };
    if !kinds
        .iter()
        .any(|kind| ticks.iter().any(|tick| moves(kind, tick)))
    {
        return Ok(false);
    }
    let q = extended.discrete_before(t, (&z[..extended.n], &piece.q))?;
    let mut earlier = Piece::new(around, &piece.mode, &q);
    let [now, before] = [
        (piece.rates(t, z)?, piece.surfaces(t, z)?),
        (earlier.rates(t, z)?, earlier.surfaces(t, z)?),
    ];
    let mut sides = now.1.iter().zip(&before.1);
    Ok(differ(&now.0, &before.0) || sides.any(|(now, before)| now * before < 0.0))
}

/// Do two vectors differ by more than rounding?
pub(super) fn differ(one: &[f64], other: &[f64]) -> bool {
    let size = one
        .iter()
        .chain(other)
        .fold(0.0_f64, |most, v| most.max(v.abs()));
    let mut entries = one.iter().zip(other);
    entries.any(|(a, b)| (a - b).abs() > AT_SIDE * size)
}
