//! Enclosures hold every value and every rate of the pieces that they are made for.
#![allow(clippy::unwrap_used)]

mod support;

use filippov_expr::{
    BinaryOp, Enclosure, EnclosureProgram, Graph, Interval, Motion, NodeId, UnaryOp,
};
use proptest::prelude::*;
use support::{build, recipes, values, Point, N_STATES};

/// States that move along straight lines for a while.
struct Line {
    from: Point,
    direction: Vec<f64>,
    length: f64,
}

impl Line {
    fn at(&self, share: f64) -> Point {
        self.from.moved(&self.direction, share * self.length)
    }
}

impl Motion for Line {
    fn time(&self) -> Interval {
        Interval::hull(self.from.t, self.at(1.0).t)
    }

    fn state(&self, index: usize) -> Enclosure {
        Enclosure {
            value: Interval::hull(self.from.x[index], self.at(1.0).x[index]),
            rate: Interval::point(self.direction[index]),
        }
    }
}

/// A point up to rounding.
struct Rounded<'a>(&'a Point);

impl Rounded<'_> {
    fn around(value: f64) -> Interval {
        Interval::around(value, 2.0 * f64::EPSILON * value.abs())
    }
}

impl Motion for Rounded<'_> {
    fn time(&self) -> Interval {
        Rounded::around(self.0.t)
    }

    fn state(&self, index: usize) -> Enclosure {
        Enclosure {
            value: Rounded::around(self.0.x[index]),
            rate: Interval::ZERO,
        }
    }
}

fn enclosures(
    (g, nodes): (&Graph, &[NodeId]),
    motion: &dyn Motion,
    from: &Point,
) -> Vec<Enclosure> {
    let program = EnclosureProgram::compile(g, nodes).unwrap();
    let mut out = vec![Enclosure::UNKNOWN; nodes.len()];
    program.eval(motion, &from.signs(g.n_surfaces()), &from.p, &mut out);
    out
}

proptest! {
    #![proptest_config(support::config(500))]

    #[test]
    fn every_value_and_every_difference_quotient_is_enclosed(
        recipe in recipes(30),
        from in support::points(),
        direction in prop::collection::vec(-2.0..2.0, N_STATES),
        length in prop::sample::select(vec![1.0, 0.1, 1e-3]),
    ) {
        let (g, nodes) = build(&recipe);
        let line = Line { from, direction, length };
        let bounds = enclosures((&g, &nodes), &line, &line.from);
        let points: Vec<Point> = (0..=8).map(|k| line.at(f64::from(k) / 8.0)).collect();
        let samples: Vec<Vec<f64>> = points.iter().map(|point| values(&g, &nodes, point)).collect();
        // What rounding makes of the values: the width of their enclosures around single points.
        let rounded: Vec<Vec<Enclosure>> = points.iter().map(|point| enclosures((&g, &nodes), &Rounded(point), point)).collect();
        for (k, bound) in bounds.iter().enumerate() {
            // input 0 moves in no known way
            if !bound.value.is_bounded() {
                continue;
            }
            for (pair, rounded) in samples.windows(2).zip(rounded.windows(2)) {
                let (a, b) = (pair[0][k], pair[1][k]);
                prop_assert!(bound.value.lo <= a && a <= bound.value.hi, "node {k}: {a} not in {:?}", bound.value);
                if bound.rate.is_bounded() {
                    // the mean value theorem: a difference quotient is a rate
                    let quotient = (b - a) / (length / 8.0);
                    let width: f64 = rounded.iter().map(|at| at[k].value.hi - at[k].value.lo).sum();
                    let size = a.abs() + b.abs() + bound.value.hi - bound.value.lo + 1e-300;
                    let rounding = (8.0 * width + 1e-12 * size) / length;
                    prop_assert!(
                        bound.rate.lo - rounding <= quotient && quotient <= bound.rate.hi + rounding,
                        "node {k}: {quotient} not in {:?}", bound.rate
                    );
                }
            }
        }
    }

    #[test]
    fn one_operation_is_enclosed(
        op in prop::sample::select(UnaryOp::ALL.to_vec()),
        centre in prop_oneof![-1.5..1.5, -40.0..40.0],
        radius in prop_oneof![Just(0.0), 0.0..1e-6, 0.0..0.5, 0.0..20.0],
    ) {
        let range = Interval::around(centre, radius).unary(op);
        for k in 0..=200 {
            let value = op.apply(centre + radius * (f64::from(k) / 100.0 - 1.0));
            if range.is_bounded() {
                prop_assert!(range.lo <= value && value <= range.hi, "{op:?}: {value} not in {range:?}");
            }
        }
    }

    #[test]
    fn two_operands_are_enclosed(
        op in prop::sample::select(BinaryOp::ALL.to_vec()),
        a in -3.0..3.0_f64, da in 0.0..1.0_f64,
        b in prop_oneof![-3.0..3.0_f64, (-4..5).prop_map(f64::from)],
        db in prop_oneof![Just(0.0), 0.0..1.0_f64],
    ) {
        let range = Interval::hull(a, a + da).binary(op, Interval::hull(b, b + db));
        // Rounding must not take a sample beyond the end.
        let sample = |from: f64, length: f64, i: i32| (from + length * f64::from(i) / 10.0).min(from + length);
        for i in 0..=10 {
            for k in 0..=10 {
                let value = op.apply(sample(a, da, i), sample(b, db, k));
                if range.is_bounded() {
                    prop_assert!(range.lo <= value && value <= range.hi, "{op:?}: {value} not in {range:?}");
                }
            }
        }
    }
}

/// The bounds shrink with the piece: the value's excess in proportion, which is what the search relies on.
/// Sums of many signs and parameters are numbers in the enclosures that read them.
#[test]
fn what_signs_make_of_a_value_is_enclosed() {
    let mut g = Graph::new();
    let mut sum = g.parameter(1);
    for k in 0..20_u32 {
        let (sign, weight) = (g.sign_of(k % 3), g.constant(0.1 * f64::from(k + 1)));
        let term = g.mul(sign, weight);
        sum = g.add(sum, term);
    }
    let (x, y) = (g.state(0), g.state(1));
    let product = g.mul(sum, x);
    let rate = g.add(product, y);
    for pattern in 0..8 {
        let sign = |bit: usize| if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let from = Point {
            t: 0.0,
            x: vec![0.4, -0.3, 0.0],
            p: vec![0.0, 0.25],
            signs: (0..3).map(sign).collect(),
        };
        let line = Line {
            from: from.clone(),
            direction: vec![1.0, 2.0, 0.0],
            length: 0.1,
        };
        let program = EnclosureProgram::compile(&g, &[rate, sum]).unwrap();
        let mut out = [Enclosure::UNKNOWN; 2];
        program.eval(&line, &from.signs, &from.p, &mut out);
        let mut own = 0.25;
        for k in 0..20 {
            own += from.signs[k % 3] * (0.1 * (k + 1) as f64);
        }
        assert_eq!(out[1], Enclosure::constant(own));
        for share in [0.0, 0.5, 1.0] {
            let at = line.at(share);
            let value = own * at.x[0] + at.x[1];
            assert!(out[0].value.lo <= value && value <= out[0].value.hi);
        }
        assert!(out[0].value.hi - out[0].value.lo < 0.1 * (own.abs() + 2.0) + 1e-12);
        assert!((out[0].rate.lo - own - 2.0).abs() < 1e-12);
    }
}

#[test]
fn bounds_are_tight_for_short_pieces() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let (sine, product) = (g.unary(UnaryOp::Sin, x), g.mul(x, y));
    let h = g.add(sine, product);
    let from = Point {
        t: 0.0,
        x: vec![0.3, -0.7, 0.0],
        p: vec![0.0, 0.0],
        signs: vec![1.0],
    };
    let exact = 0.3_f64.sin() - 0.21;
    let rate = 0.3_f64.cos() - 0.7 + 2.0 * 0.3;
    for length in [1e-2, 1e-4, 1e-6] {
        let line = Line {
            from: from.clone(),
            direction: vec![1.0, 2.0, 0.0],
            length,
        };
        let bound = enclosures((&g, &[h]), &line, &line.from)[0];
        assert!(bound.value.lo <= exact && exact <= bound.value.hi);
        assert!(bound.value.hi - bound.value.lo < 6.0 * length);
        assert!(bound.rate.lo <= rate && rate <= bound.rate.hi);
        assert!(bound.rate.hi - bound.rate.lo < 12.0 * length);
    }
}
