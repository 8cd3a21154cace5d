use super::*;

fn share_load(normal: &SparseRows, rates: &[f64], here: &[f64]) -> Option<SharedLoad> {
    SharedLoads::new(normal)?.at(rates, here)
}

fn has_one_motion(normal: &SparseRows) -> bool {
    uniqueness(normal) != Uniqueness::Unknown
}

/// Two bodies of mass 1 that rub on the ground with strengths a and b, and on each other with c.
fn two_bodies([a, b, c]: [f64; 3]) -> SparseRows {
    SparseRows::from_dense(&[vec![-a, 0.0, -c], vec![0.0, -b, c], vec![-a, b, -2.0 * c]])
}

#[test]
fn contacts_of_a_loop_hold_as_long_as_some_shares_of_the_load_do() {
    let (normal, strengths) = (two_bodies([0.5, 0.7, 0.3]), [0.5, 0.7, 0.3]);
    let held = |p: f64, q: f64| {
        let shared = share_load(&normal, &[p, q, p - q], &[0.0; 3]).expect("friction");
        let [s1, s2, s12] = [0, 1, 2].map(|i| shared.signs[i]);
        assert!((p - 0.5 * s1 - 0.3 * s12).abs() < 1e-14);
        assert!((q - 0.7 * s2 + 0.3 * s12).abs() < 1e-14);
        // Of all solutions, those along (0.3 / 0.5, -0.3 / 0.7, -1), the least one in the norm of strengths and sizes.
        let (along, sizes) = ([0.6, -0.3 / 0.7, -1.0], [0.5, 0.7, 0.7]);
        let product: f64 = (0..3)
            .map(|i| strengths[i] * sizes[i] * along[i] * shared.signs[i])
            .sum();
        assert!(product.abs() < 1e-14);
        shared.reserves
    };
    // What body 1, body 2 and both together can take.
    for (p, q, used) in [
        (0.4, 0.0, 0.5),
        (0.8, 0.0, 1.0),
        (0.0, 0.5, 0.5),
        (0.0, -1.0, 1.0),
        (0.6, 0.6, 1.0),
        (-0.7, -0.2, 0.875),
        (1.6, 0.0, 2.0),
    ] {
        for reserve in held(p, q) {
            let reserve = reserve.expect("all three share");
            assert!((reserve - (1.0 - used)).abs() < 1e-14, "{p} {q}: {reserve}");
        }
    }
}

#[test]
fn contacts_outside_of_the_loop_keep_their_own_multipliers() {
    let mut rows = vec![vec![0.0; 5]; 5];
    for (i, row) in rows.iter_mut().enumerate().take(3) {
        two_bodies([1.0, 1.0, 1.0])
            .row(i)
            .for_each(|(j, v)| row[j] = v);
    }
    (rows[3][3], rows[3][4], rows[4][3], rows[4][4]) = (-2.0, 0.5, 0.5, -1.0);
    let normal = SparseRows::from_dense(&rows);
    let shared = share_load(&normal, &[0.2, 0.1, 0.1, 1.0, 0.0], &[0.0; 5]).expect("friction");
    assert_eq!(shared.reserves[3..], [None, None]);
    assert!(
        (shared.signs[3] - 4.0 / 7.0).abs() < 1e-14 && (shared.signs[4] - 2.0 / 7.0).abs() < 1e-14
    );
}

#[test]
fn loads_that_no_shares_carry_and_jumps_that_are_not_friction_have_none() {
    let normal = two_bodies([0.5, 0.7, 0.3]);
    assert_eq!(share_load(&normal, &[0.1, 0.1, 0.2], &[0.0; 3]), None);
    let turning = SparseRows::from_dense(&[vec![-1.0, 1.0], vec![1.0, -1.0 + 1e-14]]);
    assert!(share_load(&turning, &[0.1, -0.1], &[0.0; 2]).is_some());
    let attracting = SparseRows::from_dense(&[vec![1.0, 1.0], vec![1.0, 1.0]]);
    assert_eq!(share_load(&attracting, &[0.1, 0.1], &[0.0; 2]), None);
}

#[test]
fn friction_has_one_motion_though_its_contacts_be_redundant() {
    assert!(has_one_motion(&two_bodies([0.5, 0.7, 0.3])));
    assert!(has_one_motion(&SparseRows::from_dense(&vec![
        vec![-1.0; 4];
        4
    ])));
    assert!(!has_one_motion(&SparseRows::from_dense(&[
        vec![-1.0, 2.0],
        vec![2.0, -1.0]
    ])));
    assert!(!has_one_motion(&SparseRows::from_dense(&[
        vec![-1.0, -2.0],
        vec![2.0, 0.0]
    ])));
}

#[test]
fn what_is_known_of_a_matrix_is_what_is_found_anew() {
    let mut known = KnownUniqueness::default();
    let matrices: Vec<SparseRows> = (1..=12)
        .map(|k| two_bodies([0.1 * f64::from(k), 0.7, 0.3]))
        .chain([SparseRows::from_dense(&[vec![-1.0, 0.4], vec![0.3, -1.0]])])
        .chain([SparseRows::from_dense(&[vec![-1.0, 3.0], vec![3.0, -1.0]])])
        .collect();
    for _ in 0..2 {
        for matrix in matrices.iter().chain(matrices.iter().rev()) {
            assert_eq!(known.of(matrix), uniqueness(matrix));
            assert!(known.0.len() <= MOST_KNOWN);
        }
    }
}
