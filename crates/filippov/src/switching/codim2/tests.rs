//! Frames, and what is refused. The trees have their tests in `tests/intersection_trees.rs`.

use super::{
    enter, leave_at_fold, leave_at_side, leave_where_unstable, Bilinear, Corners, Frame, Lap,
};
use crate::switching::{NormalFields, Undecided};

/// f_j^k = bias_j - k_j - k_i/4 with i the other surface: both attract unless the bias is large.
fn attracting(bias: [f64; 2]) -> NormalFields {
    let regions = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
    let f = |[p, q]: [f64; 2]| [bias[0] - p - 0.25 * q, bias[1] - q - 0.25 * p];
    NormalFields::new(2, regions.map(f).concat()).unwrap()
}

fn corners(fields: &NormalFields) -> Corners {
    Corners::new(fields).unwrap()
}

#[test]
fn frames_undo_themselves() {
    let v = [2.0, -3.0];
    let seen: Vec<[f64; 2]> = Frame::all().map(|frame| frame.of(v)).collect();
    assert!(
        (0..8).all(|i| (0..i).all(|j| seen[i] != seen[j])),
        "{seen:?}"
    );
    for frame in Frame::all() {
        assert_eq!(frame.back(frame.of(v)), v);
    }
}

/// g of the transformed fields at the transformed multipliers is the transformed g.
#[test]
fn fields_transform_as_vectors() {
    let values = vec![0.3, -1.0, 2.0, 0.7, -0.2, 1.5, 0.9, -0.4];
    let fields = NormalFields::new(2, values).unwrap();
    let lambda = [0.3, -0.8];
    let g = Bilinear::of_fields(&fields).value(lambda);
    for frame in Frame::all() {
        let seen = frame.fields(&fields).unwrap();
        let found = Bilinear::of_fields(&seen).value(frame.of(lambda));
        let expected = frame.of(g);
        assert!(
            (0..2).all(|j| (found[j] - expected[j]).abs() < 1e-15),
            "{frame:?}"
        );
    }
}

#[test]
fn what_is_no_entry_is_refused() {
    let fields = attracting([0.2, 0.3]);
    assert_eq!(
        enter(&corners(&fields), [0, -1]).unwrap().leaf,
        "E.A/root/trap"
    );
    // The second surface moves away: sliding does not reach it.
    let leaving = attracting([0.2, -1.5]);
    let refused = enter(&corners(&leaving), [0, -1]).unwrap_err();
    assert_eq!(refused, Undecided::NotArriving { surface: 1 });
    // No sliding on the first surface.
    let crossing = attracting([1.5, 0.0]);
    let refused = enter(&corners(&crossing), [0, -1]).unwrap_err();
    assert_eq!(refused, Undecided::NotArriving { surface: 0 });
    let refused = enter(&corners(&crossing), [-1, 0]);
    assert!(refused.is_ok(), "{refused:?}");
}

#[test]
fn what_is_no_exit_is_refused() {
    let corners = corners(&attracting([0.2, 0.3]));
    let inside = [0.2, 0.3];
    assert_eq!(leave_at_side(&corners, inside), Err(Undecided::NotAnExit));
    assert_eq!(
        leave_where_unstable(&corners, inside),
        Err(Undecided::NotAnExit)
    );
    // A double root with both diagonal entries positive was not stable before.
    let fields = NormalFields::new(2, vec![-3.0, -2.0, 0.0, 1.0, 0.0, -1.0, 3.0, 2.0]).unwrap();
    let corners = Corners::new(&fields).unwrap();
    assert_eq!(
        leave_at_fold(&corners, [0.0, 0.0]),
        Err(Undecided::NotAnExit)
    );
}

#[test]
fn degenerate_data_are_refused() {
    let tangent = NormalFields::new(2, vec![1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0]).unwrap();
    assert_eq!(
        Corners::new(&tangent),
        Err(Undecided::Tangent { surface: 1 })
    );
    let three = NormalFields::new(3, vec![1.0; 24]).unwrap();
    assert!(matches!(
        Corners::new(&three),
        Err(Undecided::Shape { m: 3, .. })
    ));
    assert!(Lap::around(&attracting([0.0, 0.0]), [-1, -1]).is_none());
    // The same equation twice, with zeros in the square; and without: two surfaces that are both
    // crossed.
    let same = NormalFields::new(2, vec![1.0, 2.0, -1.0, -2.0, 0.5, 1.0, -0.5, -1.0]).unwrap();
    assert!(Bilinear::of_fields(&same).is_undetermined());
    let crossed = NormalFields::new(2, vec![1.0; 8]).unwrap();
    assert!(!Bilinear::of_fields(&crossed).is_undetermined());
}
