//! The words for what happened. The decisions have their table in `tests/switching_cases.rs` and `tests/two_folds.rs`.

use super::Kind;
use crate::Mode;

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
