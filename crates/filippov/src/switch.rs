//! Switches: the end of one motion and the start of the next.

use smallvec::SmallVec;

use crate::mode::Mode;

/// A switch: the end of one motion and the start of the next. Few states are kept without allocation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Switch {
    /// Its time.
    pub t: f64,
    /// State before.
    pub y_before: SmallVec<[f64; 4]>,
    /// State after.
    pub y_after: SmallVec<[f64; 4]>,
    /// What happened.
    pub kind: Kind,
    /// The surfaces that it happened on.
    pub surfaces: SmallVec<[usize; 2]>,
    /// Mode before.
    pub mode_before: Mode,
    /// Mode after.
    pub mode_after: Mode,
    /// The name of the action, if it was one.
    pub note: String,
    /// The rule of the decision that chose the mode after; empty for an action.
    pub rule: &'static str,
}

/// The word for what happened, as the field uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kind {
    /// From one region to the next, or across a further surface while sliding.
    Crossing,
    /// From a region, or from sliding on fewer surfaces, onto a surface.
    EnterSliding,
    /// Off the surface.
    ExitSliding,
    /// From sliding on one surface to sliding on another.
    SwitchSliding,
    /// The surface is touched and the mode stays.
    Grazing,
    /// Infinitely many switches in finite time, up to their limit.
    Accumulation,
    /// An action at a surface.
    Reset,
    /// An action at a known time.
    Clock,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 8] = [
        Kind::Crossing,
        Kind::EnterSliding,
        Kind::ExitSliding,
        Kind::SwitchSliding,
        Kind::Grazing,
        Kind::Accumulation,
        Kind::Reset,
        Kind::Clock,
    ];

    /// The kind of this name.
    pub fn named(name: &str) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The name used in tables.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Crossing => "crossing",
            Kind::EnterSliding => "enter_sliding",
            Kind::ExitSliding => "exit_sliding",
            Kind::SwitchSliding => "switch_sliding",
            Kind::Grazing => "grazing",
            Kind::Accumulation => "accumulation",
            Kind::Reset => "reset",
            Kind::Clock => "clock",
        }
    }

    /// The kind that leads from one mode to another.
    pub fn between(before: &Mode, after: &Mode) -> Kind {
        use std::cmp::Ordering::{Equal, Greater, Less};
        if before == after {
            return Kind::Grazing;
        }
        let (mut ended, mut begun) = (0, 0);
        for (before, after) in before.changes_to(after) {
            ended += usize::from(before == 0);
            begun += usize::from(after == 0);
        }
        match begun.cmp(&ended) {
            Greater => Kind::EnterSliding,
            Less => Kind::ExitSliding,
            Equal if begun == 0 => Kind::Crossing,
            Equal => Kind::SwitchSliding,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Kind, Mode};

    #[test]
    fn kinds_follow_the_codimension() {
        let mode = |entries: &[i8]| Mode::new(entries.to_vec());
        let kind = |a: &[i8], b: &[i8]| Kind::between(&mode(a), &mode(b));
        assert_eq!(kind(&[-1], &[1]), Kind::Crossing);
        assert_eq!(kind(&[-1], &[0]), Kind::EnterSliding);
        assert_eq!(kind(&[0], &[1]), Kind::ExitSliding);
        assert_eq!(kind(&[0, -1], &[0, 1]), Kind::Crossing);
        assert_eq!(kind(&[0, -1], &[1, 0]), Kind::SwitchSliding);
        assert_eq!(kind(&[1, -1], &[1, -1]), Kind::Grazing);
    }
}
