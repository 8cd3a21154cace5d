use super::*;

/// x - 1, its positive part, and the surfaces that they make.
fn ramp(g: &mut Graph) -> (NodeId, NodeId) {
    let (x, one, zero) = (g.state(0), g.constant(1.0), g.constant(0.0));
    let over = g.sub(x, one);
    let ramp = g.maximum(over, zero);
    (over, ramp)
}

fn kinds(split: &Split) -> Vec<Kind> {
    split.regions.iter().map(|region| region.kind).collect()
}

#[test]
fn a_ramp_is_zero_on_one_side() {
    let mut g = Graph::new();
    let (_, ramp) = ramp(&mut g);
    let mut regions = Regions::new(g, vec![], vec![]);
    let split = regions.split(ramp, 100, false);
    assert!(split.is_complete);
    assert_eq!(kinds(&split), [Kind::Zero, Kind::Positive]);
    assert_eq!(split.regions[0].signs, [Some(-1.0)]);
    assert_eq!(split.regions[0].value, Some(0.0));
}

#[test]
fn combinations_that_no_point_has_are_left_out() {
    let mut g = Graph::new();
    let (x, one, two) = (g.state(0), g.constant(1.0), g.constant(2.0));
    let (first, second) = (g.sub(x, one), g.sub(x, two));
    let (first, second) = (g.sign(first), g.sign(second));
    let difference = g.sub(first, second);
    // Zero only where x < 1 and x > 2.
    let never = g.add(difference, two);
    let mut regions = Regions::new(g, vec![], vec![]);
    assert!(kinds(&regions.split(never, 100, false))
        .iter()
        .all(|&kind| kind == Kind::Positive));
    assert_eq!(kinds(&regions.split(difference, 100, false)).len(), 3);
}

#[test]
fn what_cannot_cancel_is_not_split() {
    let mut g = Graph::new();
    let (y, (_, ramp)) = (g.state(1), ramp(&mut g));
    let sum = g.add(y, ramp);
    let mut regions = Regions::new(g, vec![], vec![]);
    assert_eq!(kinds(&regions.split(sum, 100, false)), [Kind::Varies]);
    assert_eq!(kinds(&regions.split(sum, 100, true)).len(), 2);
}

/// `sum_k weight(k) sign(x_k) + constant`.
fn votes(n: u32, constant: f64, weight: impl Fn(u32) -> f64) -> (Graph, NodeId) {
    let mut g = Graph::new();
    let mut sum = g.constant(constant);
    for k in 0..n {
        let x = g.state(k);
        let (sign, weight) = (g.sign(x), g.constant(weight(k)));
        let term = g.mul(weight, sign);
        sum = g.add(sum, term);
    }
    (g, sum)
}

#[test]
fn a_search_that_is_given_up_says_so() {
    let (g, sum) = votes(30, 0.5, |k| (1.0 + f64::from(k)).sqrt());
    let mut regions = Regions::new(g, vec![], vec![]);
    assert!(!regions.split(sum, 100, false).is_complete);
}

#[test]
fn votes_are_decided_without_looking_at_each_combination() {
    let weights: [fn(u32) -> f64; 3] =
        [|_| 1.0, |k| f64::from(k % 3) + 1.0, |k| 0.25 * f64::from(k)];
    for weight in weights {
        let (g, sum) = votes(200, 0.1, weight);
        let split = Regions::new(g, vec![], vec![]).split(sum, 1, false);
        assert!(split.is_complete);
        assert_eq!(kinds(&split), [Kind::Varies]);
    }
    // No common step: the sums are enumerated.
    let root = |k: u32| (1.0 + f64::from(k)).sqrt();
    let (g, sum) = votes(20, 0.1, root);
    assert!(
        Regions::new(g, vec![], vec![])
            .split(sum, 1, false)
            .is_complete
    );
    let (g, sum) = votes(8, root(2) - root(5), root);
    let split = Regions::new(g, vec![], vec![]).split(sum, 10_000, false);
    assert!(!kinds(&split).contains(&Kind::Zero));
    let (g, sum) = votes(5, 1.0, |_| 1.0);
    assert!(kinds(&Regions::new(g, vec![], vec![]).split(sum, 1000, false)).contains(&Kind::Zero));
}

#[test]
fn a_sign_matters_where_the_field_reads_it() {
    let mut g = Graph::new();
    let (over, ramp) = ramp(&mut g);
    let Switching::Surface { index, .. } = g.switch(ramp) else {
        panic!("the ramp has a surface")
    };
    let (one, two) = (g.constant(1.0), g.constant(2.0));
    let reads = g.select(index, 1.0, one, two);
    let Switching::Surface { index: outer, .. } = g.switch(over) else {
        panic!("x - 1 has a surface")
    };
    // Where x < 1 the field is 2 whatever the inner sign is.
    let guarded = g.select(outer, 1.0, reads, two);
    let mut below = vec![None; g.n_surfaces()];
    below[outer as usize] = Some(-1.0);
    let mut regions = Regions::new(g, vec![], vec![]);
    assert!(regions.matters(&[reads], &below, index));
    assert!(!regions.matters(&[guarded], &below, index));
}

#[test]
fn values_of_discrete_states() {
    let mut g = Graph::new();
    let (level, half, one) = (g.parameter(0), g.constant(0.5), g.constant(1.0));
    let x = g.state(0);
    let beside = g.sub(x, level);
    let sign = g.sign(beside);
    let (moved, step) = (g.sub(level, half), g.mul(half, sign));
    let floor = g.add(moved, step);
    let (whole, between) = (g.sub(floor, one), g.sub(floor, half));
    let mut regions = Regions::new(g, vec![], vec![Discrete::Whole]);
    assert_eq!(
        kinds(&regions.split(whole, 100, false)),
        [Kind::Zero, Kind::Zero]
    );
    assert_eq!(
        kinds(&regions.split(between, 100, false)),
        [Kind::Varies, Kind::Varies]
    );
    assert!(!regions.used_parameters());
}

#[test]
fn a_threshold_given_by_a_parameter_is_its_value() {
    let mut g = Graph::new();
    let (threshold, (_, ramp)) = (g.parameter(0), ramp(&mut g));
    let above = g.sub(ramp, threshold);
    for (value, kind) in [(0.0, Kind::Zero), (0.5, Kind::Negative)] {
        let mut regions = Regions::new(g.clone(), vec![value], vec![]);
        assert!(kinds(&regions.split(above, 100, false)).contains(&kind));
        assert!(regions.used_parameters());
    }
}

#[test]
fn jumps() {
    let mut g = Graph::new();
    let (x, (_, ramp)) = (g.state(0), ramp(&mut g));
    let (low, high, zero) = (g.constant(-2.0), g.constant(3.0), g.constant(0.0));
    let above = g.maximum(x, low);
    let clipped = g.minimum(above, high);
    let size = g.abs(x);
    let wave = g.unary(UnaryOp::Sin, size);
    let Switching::Surface { index, .. } = g.switch(x) else {
        panic!("x has a surface")
    };
    let step = g.select(index, 1.0, high, zero);
    let sum = g.add(clipped, step);
    // x in one region, 0 in the other, as two terms that jump and cancel.
    let (up, down) = (
        g.select(index, 1.0, high, zero),
        g.select(index, 1.0, zero, high),
    );
    let cancelled = g.add(up, down);
    let mut regions = Regions::new(g, vec![], vec![]);
    for continuous in [ramp, clipped, size, wave, cancelled] {
        assert_eq!(regions.jumps_at(continuous), None);
    }
    assert_eq!(regions.jumps_at(step), Some(index));
    assert_eq!(regions.jumps_at(sum), Some(index));
}

#[test]
fn jumps_where_some_signs_are_fixed() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let (size, side) = (g.abs(x), g.sign(x));
    let [Switching::Surface { index: at_x, .. }, Switching::Surface { index: at_y, .. }] =
        [x, y].map(|state| g.switch(state))
    else {
        panic!("states have surfaces")
    };
    let field = g.select(at_y, 1.0, side, size);
    // A surface that jumps where x changes its sign, and that the field reads.
    let shifted = g.add(y, side);
    let nested = g.sign(shifted);
    let mut regions = Regions::new(g, vec![], vec![]);
    let mut jumps = |root, y: f64| {
        let mut signs = vec![None; at_y as usize + 1];
        signs[at_y as usize] = Some(y);
        regions.jump_across(&[root], &signs, at_x)
    };
    assert!(jumps(field, 1.0));
    assert!(!jumps(field, -1.0));
    assert!(!jumps(size, 1.0));
    assert!(jumps(nested, 1.0));
}

#[test]
fn edges() {
    let mut g = Graph::new();
    let (x, (over, ramp)) = (g.state(0), ramp(&mut g));
    let (size, two) = (g.abs(over), g.constant(2.0));
    let root = g.unary(UnaryOp::Sqrt, size);
    let root_of_ramp = g.unary(UnaryOp::Sqrt, ramp);
    let cube_root = g.unary(UnaryOp::Cbrt, over);
    let bent = g.abs(cube_root);
    let reciprocal = g.div(two, size);
    let plain = g.unary(UnaryOp::Sqrt, x);
    let Switching::Surface { index, .. } = g.switch(over) else {
        panic!("x - 1 has a surface")
    };
    let one = g.constant(1.0);
    let (stiff, square) = (g.select(index, 1.0, one, two), g.mul(x, x));
    let inside = g.mul(stiff, square);
    let inside = g.add(inside, one);
    let inside = g.unary(UnaryOp::Sqrt, inside);
    let far = g.add(size, one);
    let (log, log1p) = (g.unary(UnaryOp::Log, far), g.unary(UnaryOp::Log1p, size));
    let mut regions = Regions::new(g, vec![], vec![]);
    assert_eq!(regions.edge(log), None);
    assert_eq!(regions.edge(log1p), None);
    assert_eq!(regions.edge(root), Some(Edge::Domain(root)));
    assert_eq!(regions.edge(root_of_ramp), Some(Edge::Domain(root_of_ramp)));
    assert_eq!(regions.edge(bent), Some(Edge::Singular(cube_root)));
    assert!(matches!(regions.edge(reciprocal), Some(Edge::Singular(_))));
    assert_eq!(regions.edge(plain), None);
    assert_eq!(regions.edge(inside), None);
    assert_eq!(regions.edge(size), None);
}

#[test]
fn knots_in_a_row_are_passed_in_their_order() {
    let mut g = Graph::new();
    let x = g.state(0);
    for k in 0..20 {
        let knot = g.constant(f64::from(k));
        let beyond = g.sub(x, knot);
        g.sign(beyond);
    }
    let mut regions = Regions::new(g, vec![], vec![]);
    let found = regions.combinations(30).unwrap();
    assert_eq!(found.len(), 21);
    let sums: Vec<f64> = found.iter().map(|signs| signs.iter().sum()).collect();
    assert!(sums.windows(2).all(|pair| pair[1] == pair[0] + 2.0));
    assert_eq!(regions.combinations(20), None);
}
