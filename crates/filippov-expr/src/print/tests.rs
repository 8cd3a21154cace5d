use crate::{BinaryOp, Graph, Names, NodeId, UnaryOp};

type Make = fn(&mut Graph, NodeId, NodeId, NodeId) -> NodeId;

#[test]
fn brackets_only_where_needed() {
    let cases: [(Make, &str); 22] = [
        (
            |g, a, b, c| {
                let s = g.add(a, b);
                g.mul(s, c)
            },
            "c*(a + b)",
        ),
        (
            |g, a, b, c| {
                let s = g.sub(b, c);
                g.sub(a, s)
            },
            "a - (b - c)",
        ),
        (
            |g, a, b, c| {
                let s = g.sub(a, b);
                g.sub(s, c)
            },
            "a - b - c",
        ),
        (
            |g, a, b, c| {
                let s = g.add(b, c);
                g.add(a, s)
            },
            "a + b + c",
        ),
        (
            |g, a, b, c| {
                let s = g.div(b, c);
                g.div(a, s)
            },
            "a/(b/c)",
        ),
        (
            |g, a, b, c| {
                let s = g.div(a, b);
                g.div(s, c)
            },
            "a/b/c",
        ),
        (
            |g, a, b, c| {
                let s = g.mul(b, c);
                g.div(a, s)
            },
            "a/(b*c)",
        ),
        (
            |g, a, b, c| {
                let s = g.mul(b, c);
                g.mul(a, s)
            },
            "a*b*c",
        ),
        (
            |g, a, b, c| {
                let s = g.div(b, c);
                g.mul(a, s)
            },
            "a*(b/c)",
        ),
        (
            |g, a, b, _| {
                let s = g.neg(a);
                g.mul(s, b)
            },
            "-a*b",
        ),
        (
            |g, a, b, _| {
                let s = g.add(a, b);
                g.neg(s)
            },
            "-(a + b)",
        ),
        (
            |g, a, b, _| {
                let m = g.constant(-2.0);
                let s = g.mul(m, b);
                g.add(a, s)
            },
            "a - 2*b",
        ),
        (
            |g, a, b, _| {
                let m = g.constant(-2.0);
                let s = g.mul(m, b);
                g.sub(a, s)
            },
            "a + 2*b",
        ),
        (
            |g, a, b, _| {
                let m = g.constant(-2.0);
                let s = g.div(m, b);
                g.add(a, s)
            },
            "a - 2/b",
        ),
        (|g, a, _, _| g.mul(a, a), "a**2"),
        (
            |g, a, _, _| {
                let e = g.constant(3.0);
                g.pow(a, e)
            },
            "a*a**2",
        ),
        (
            |g, a, b, _| {
                let s = g.add(a, b);
                g.mul(s, s)
            },
            "(a + b)**2",
        ),
        (
            |g, a, b, _| {
                let s = g.neg(b);
                g.pow(a, s)
            },
            "a**(-b)",
        ),
        (
            |g, a, b, _| {
                let s = g.mul(a, b);
                let e = g.constant(1.5);
                g.pow(s, e)
            },
            "(a*b)**1.5",
        ),
        (
            |g, a, b, c| {
                let s = g.pow(b, c);
                g.pow(a, s)
            },
            "a**(b**c)",
        ),
        (
            |g, a, b, c| {
                let s = g.pow(a, b);
                g.pow(s, c)
            },
            "(a**b)**c",
        ),
        (
            |g, a, b, _| {
                let s = g.sub(a, b);
                let s = g.unary(UnaryOp::Sin, s);
                g.binary(BinaryOp::Atan2, s, b)
            },
            "arctan2(sin(a - b), b)",
        ),
    ];
    let names = Names {
        states: ["a", "b", "c"].map(String::from).to_vec(),
        parameters: vec![],
    };
    for (make, expected) in cases {
        let mut g = Graph::new();
        let (a, b, c) = (g.state(0), g.state(1), g.state(2));
        let id = make(&mut g, a, b, c);
        assert_eq!(g.text(id, &names), expected);
    }
}

#[test]
fn leaves_and_numbers() {
    let mut g = Graph::new();
    let names = Names {
        states: vec!["y".into()],
        parameters: vec![],
    };
    for (id, expected) in [
        (g.time(), "t"),
        (g.state(0), "y"),
        (g.state(1), "x[1]"),
        (g.parameter(3), "p[3]"),
        (g.input(2), "v[2]"),
        (g.sign_of(5), "s[5]"),
        (g.constant(2.0), "2"),
        (g.constant(-0.1), "-0.1"),
        (g.constant(1e300), "1e300"),
        (g.constant(1.5e-9), "1.5e-9"),
        (g.constant(f64::NAN), "nan"),
        (g.constant(f64::NEG_INFINITY), "-inf"),
    ] {
        assert_eq!(g.text(id, &names), expected);
    }
}

#[test]
fn switching_reads_like_the_source() {
    let mut g = Graph::new();
    let names = Names {
        states: vec!["x".into(), "v".into()],
        parameters: vec!["F".into()],
    };
    let (x, v, force) = (g.state(0), g.state(1), g.parameter(0));
    let belt = g.constant(0.2);
    let slip = g.sub(v, belt);
    let sign = g.sign(slip);
    let friction = g.mul(force, sign);
    assert_eq!(g.text(friction, &names), "sign(v - 0.2)*F");
    let minus_x = g.neg(x);
    let rate = g.sub(minus_x, friction);
    assert_eq!(g.text(rate, &names), "-x - sign(v - 0.2)*F");
    let abs = g.abs(slip);
    assert_eq!(g.text(abs, &names), "abs(v - 0.2)");
    let choice = g.select(7, 1.0, x, v);
    assert_eq!(g.text(choice, &names), "where(s[7] > 0, x, v)");
}

/// x squared 60 times is a text of 2^60 letters if it is written out.
#[test]
fn exponential_texts_are_cut() {
    let mut g = Graph::new();
    let (mut a, b) = (g.state(0), g.state(1));
    for _ in 0..60 {
        let sum = g.add(a, b);
        a = g.mul(sum, a);
    }
    let text = g.text(a, &Names::default());
    assert!(text.ends_with("...") && text.len() < 5000);
}
