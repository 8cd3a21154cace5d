#![allow(clippy::unwrap_used)]

use super::{resealed, Container, Tag, Writer, VERSION};
use crate::error::ExprError;

const CONTENT: Tag = Tag(*b"TEST");
const FIRST: Tag = Tag(*b"ONE ");
const SECOND: Tag = Tag(*b"TWO ");

fn sample() -> Vec<u8> {
    let mut writer = Writer::new(CONTENT);
    writer.section(FIRST);
    writer.byte(7);
    writer.number(42);
    writer.text("größer");
    writer.section(SECOND);
    writer.floats(&[0.5, f64::NEG_INFINITY]);
    writer.finish()
}

fn error(bytes: &[u8]) -> ExprError {
    match Container::open(bytes, CONTENT) {
        Ok(_) => panic!("was opened"),
        Err(error) => error,
    }
}

#[test]
fn what_was_written_is_read() {
    let bytes = sample();
    let mut container = Container::open(&bytes, CONTENT).unwrap();
    let mut first = container.section(FIRST).unwrap();
    assert_eq!(first.byte().unwrap(), 7);
    assert_eq!(first.index(43, "too large").unwrap(), 42);
    assert_eq!(first.text().unwrap(), "größer");
    first.finish().unwrap();
    let mut second = container.section(SECOND).unwrap();
    assert_eq!(second.floats().unwrap(), [0.5, f64::NEG_INFINITY]);
    second.finish().unwrap();
    container.finish().unwrap();
}

#[test]
fn every_change_of_one_bit_and_every_cut_is_found() {
    let bytes = sample();
    for place in 0..bytes.len() {
        for bit in 0..8 {
            let mut changed = bytes.clone();
            changed[place] ^= 1 << bit;
            error(&changed);
        }
        error(&bytes[..place]);
    }
}

#[test]
fn what_is_wrong_is_named() {
    let bytes = sample();
    assert_eq!(error(b""), ExprError::UnknownFormat);
    assert_eq!(error(b"FILEXPR\x02"), ExprError::UnknownFormat);
    let text = String::from_utf8_lossy(&bytes).replace('\r', "");
    assert_eq!(error(text.as_bytes()), ExprError::UnknownFormat);

    let mut other = bytes.clone();
    other[8] += 1;
    let found = VERSION + 1;
    assert_eq!(error(&other), ExprError::OtherVersion { found });

    let declared = Some(bytes.len() as u64);
    let found = bytes.len() - 1;
    assert_eq!(
        error(&bytes[..found]),
        ExprError::WrongLength { found, declared }
    );
    let (found, declared) = (10, None);
    assert_eq!(
        error(&bytes[..found]),
        ExprError::WrongLength { found, declared }
    );

    let mut flipped = bytes.clone();
    flipped[45] ^= 1;
    assert_eq!(error(&flipped), ExprError::WrongChecksum);

    let (found, expected) = (CONTENT, FIRST);
    assert_eq!(
        Container::open(&bytes, FIRST).err(),
        Some(ExprError::OtherContent { found, expected })
    );
}

#[test]
fn sections_are_read_in_order_and_to_their_ends() {
    let bytes = sample();
    let damaged = |found: Result<(), ExprError>, expected: &str| match found {
        Err(ExprError::Damaged { detail, .. }) => assert_eq!(detail, expected),
        other => panic!("{other:?}"),
    };
    let open = || Container::open(&bytes, CONTENT).unwrap();
    damaged(
        open().section(SECOND).map(drop),
        "another section stands in its place",
    );
    damaged(open().finish(), "a section too many");
    let mut container = open();
    let mut first = container.section(FIRST).unwrap();
    damaged(first.clone().finish(), "more bytes than expected");
    damaged(
        first.clone().count(1).map(drop),
        "more entries than there are bytes for",
    );
    first.byte().unwrap();
    damaged(first.index(42, "too large").map(drop), "too large");
    container.section(SECOND).unwrap();
    damaged(container.section(SECOND).map(drop), "is missing");
}

/// A right checksum does not make the lengths of the sections right.
#[test]
fn lengths_of_sections_have_to_add_up() {
    for (place, value) in [(32, 200), (32, 3), (36, 1), (24, 9), (24, 1)] {
        let mut changed = sample();
        changed[place] = value;
        let sealed = resealed(&changed).unwrap();
        assert!(
            matches!(error(&sealed), ExprError::Damaged { .. }),
            "byte {place} = {value}"
        );
    }
}
