//! The textbook cases of the decision at one surface.

use filippov::switching::Arrival;

use Arrival::{ExitMinus, ExitPlus, Region, Start, TwoFold};

/// Label, derivatives of h along f-, along f+, arrival, the entry that follows, all candidates.
pub type Row = (
    &'static str,
    &'static [f64],
    &'static [f64],
    Arrival,
    i8,
    &'static [i8],
);

pub const FIRST_ORDER: &[Row] = &[
    ("I (+,+) from R-", &[1.0], &[2.0], Region(-1), 1, &[1]),
    ("I (-,-) from R+", &[-1.0], &[-2.0], Region(1), -1, &[-1]),
    ("I (+,-) from R-", &[1.0], &[-3.0], Region(-1), 0, &[0]),
    ("I (+,-) from R+", &[1.0], &[-3.0], Region(1), 0, &[0]),
    ("I (+,-) at a start", &[1.0], &[-3.0], Start, 0, &[0]),
    ("I (+,+) at a start", &[1.0], &[3.0], Start, 1, &[1]),
    ("I (-,-) at a start", &[-1.0], &[-3.0], Start, -1, &[-1]),
    ("I (-,+), rising mean", &[-1.0], &[3.0], Start, 1, &[-1, 1]),
    (
        "I (-,+), falling mean",
        &[-3.0],
        &[1.0],
        Start,
        -1,
        &[-1, 1],
    ),
];

/// A second derivative decides.
pub const TANGENCIES: &[Row] = &[
    (
        "II from sliding, B1 < 0",
        &[0.0, -1.0],
        &[-2.0],
        ExitMinus,
        -1,
        &[-1],
    ),
    (
        "II from R-, grazing",
        &[0.0, -1.0],
        &[-2.0],
        Region(-1),
        -1,
        &[-1],
    ),
    (
        "II from R-, next to repulsion",
        &[0.0, -1.0],
        &[2.0],
        Region(-1),
        -1,
        &[-1, 1],
    ),
    (
        "II from R+, B1 < 0",
        &[0.0, -1.0],
        &[-2.0],
        Region(1),
        -1,
        &[-1],
    ),
    (
        "II from R+, B1 > 0",
        &[0.0, 1.0],
        &[-2.0],
        Region(1),
        0,
        &[0],
    ),
    (
        "II at a start, B1 > 0, A2 > 0",
        &[0.0, 1.0],
        &[2.0],
        Start,
        1,
        &[1],
    ),
    (
        "III from sliding, B2 > 0",
        &[2.0],
        &[0.0, 1.0],
        ExitPlus,
        1,
        &[1],
    ),
    (
        "III from R+, grazing",
        &[2.0],
        &[0.0, 1.0],
        Region(1),
        1,
        &[1],
    ),
    (
        "III from R+, next to repulsion",
        &[-2.0],
        &[0.0, 1.0],
        Region(1),
        1,
        &[-1, 1],
    ),
    (
        "III from R-, B2 > 0",
        &[2.0],
        &[0.0, 1.0],
        Region(-1),
        1,
        &[1],
    ),
    (
        "III from R-, B2 < 0",
        &[2.0],
        &[0.0, -1.0],
        Region(-1),
        0,
        &[0],
    ),
    (
        "III at a start, B2 < 0, A1 < 0",
        &[-2.0],
        &[0.0, -1.0],
        Start,
        -1,
        &[-1],
    ),
    (
        "IV fold away from both",
        &[0.0, -1.0],
        &[0.0, 1.0],
        Region(-1),
        -1,
        &[-1, 1],
    ),
    (
        "IV the same from R+",
        &[0.0, -1.0],
        &[0.0, 1.0],
        Region(1),
        1,
        &[-1, 1],
    ),
    (
        "IV both to R-",
        &[0.0, -1.0],
        &[0.0, -2.0],
        Region(-1),
        -1,
        &[-1],
    ),
    (
        "IV both to R+",
        &[0.0, 1.0],
        &[0.0, 2.0],
        Region(1),
        1,
        &[1],
    ),
    (
        "IV sliding begins",
        &[0.0, 1.0],
        &[0.0, -2.0],
        Start,
        0,
        &[0],
    ),
];

/// Third and higher derivatives decide.
pub const HIGHER: &[Row] = &[
    (
        "II from sliding, touch",
        &[0.0, 0.0, 1.0],
        &[-2.0],
        ExitMinus,
        0,
        &[0],
    ),
    (
        "II from R-, cubic contact",
        &[0.0, 0.0, 1.0],
        &[2.0],
        Region(-1),
        1,
        &[1],
    ),
    (
        "II from R-, cubic onto sliding",
        &[0.0, 0.0, 1.0],
        &[-2.0],
        Region(-1),
        0,
        &[0],
    ),
    (
        "II from sliding, odd order 3",
        &[0.0, 0.0, 0.0, -1.0],
        &[-2.0],
        ExitMinus,
        -1,
        &[-1],
    ),
    (
        "II from sliding, even order 4",
        &[0.0, 0.0, 0.0, 0.0, 1.0],
        &[-2.0],
        ExitMinus,
        0,
        &[0],
    ),
    (
        "IV sliding begins, of different orders",
        &[0.0, 0.0, 0.0, 1.0],
        &[0.0, -1.0],
        Start,
        0,
        &[0],
    ),
    (
        "III from sliding, touch",
        &[2.0],
        &[0.0, 0.0, -1.0],
        ExitPlus,
        0,
        &[0],
    ),
    (
        "III from R+, cubic contact",
        &[-2.0],
        &[0.0, 0.0, -1.0],
        Region(1),
        -1,
        &[-1],
    ),
    (
        "III from R+, cubic onto sliding",
        &[2.0],
        &[0.0, 0.0, -1.0],
        Region(1),
        0,
        &[0],
    ),
    (
        "III from sliding, odd order 3",
        &[2.0],
        &[0.0, 0.0, 0.0, 1.0],
        ExitPlus,
        1,
        &[1],
    ),
    (
        "III from sliding, even order 4",
        &[2.0],
        &[0.0, 0.0, 0.0, 0.0, -1.0],
        ExitPlus,
        0,
        &[0],
    ),
];

/// All derivatives along f- vanish.
pub const RESTING: &[Row] = &[
    ("f+ leaves, at a start", &[0.0], &[1.0], Start, 1, &[-1, 1]),
    (
        "f+ leaves, from R-",
        &[0.0],
        &[1.0],
        Region(-1),
        -1,
        &[-1, 1],
    ),
    ("f+ presses", &[0.0], &[-1.0], Region(1), 0, &[0]),
    (
        "f+ leaves tangentially, at a start",
        &[0.0],
        &[0.0, 1.0],
        Start,
        1,
        &[-1, 1],
    ),
    (
        "f+ leaves tangentially, from R+",
        &[0.0],
        &[0.0, 1.0],
        Region(1),
        1,
        &[-1, 1],
    ),
    (
        "f+ turns back, at a start",
        &[0.0],
        &[0.0, -1.0],
        Start,
        -1,
        &[-1],
    ),
    (
        "f+ presses no more",
        &[0.0],
        &[0.0, 1.0],
        ExitPlus,
        1,
        &[-1, 1],
    ),
    (
        "f+ presses no more, both components zero",
        &[0.0],
        &[0.0, 1.0],
        TwoFold,
        1,
        &[-1, 1],
    ),
];

/// All rows.
pub fn rows() -> impl Iterator<Item = &'static Row> {
    let low = FIRST_ORDER.iter().chain(TANGENCIES).chain(RESTING);
    low.chain(HIGHER)
}
