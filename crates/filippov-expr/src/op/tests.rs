use super::*;

#[test]
fn names_lead_back() {
    for op in UnaryOp::ALL {
        assert_eq!(UnaryOp::from_name(op.name()), Some(op));
        assert_eq!(UnaryOp::ALL[op as usize], op);
    }
    for op in BinaryOp::ALL {
        assert_eq!(BinaryOp::from_name(op.name()), Some(op));
        assert_eq!(BinaryOp::ALL[op as usize], op);
    }
    assert_eq!(UnaryOp::from_name("asin"), Some(UnaryOp::Asin));
    assert_eq!(BinaryOp::from_name("pow"), Some(BinaryOp::Pow));
    assert_eq!(UnaryOp::from_name("gamma"), None);
    assert_eq!(BinaryOp::from_name("fmod"), None);
}

/// Reference values computed with 60 digits.
#[test]
fn inverse_hyperbolic_cosine_keeps_its_digits() {
    for (a, expected) in [
        (1.0, 0.0),
        (1.0 + 1.0 / 1_048_576.0, 0.001_381_067_822_247_581_2),
        (1.5, 0.962_423_650_119_206_9),
        (1e10, 23.718_998_110_500_4),
        (1e300, 691.468_675_078_773_7),
    ] {
        let found = UnaryOp::Acosh.apply(a);
        assert!(
            (found - expected).abs() <= 4.0 * f64::EPSILON * expected,
            "{a}: {found}"
        );
    }
    assert!(UnaryOp::Acosh.apply(0.5).is_nan());
    assert!(UnaryOp::Acosh.apply(-3.0).is_nan());
    assert!(UnaryOp::Acosh.apply(f64::NAN).is_nan());
}

#[test]
fn powers_are_those_of_numpy() {
    let pow = |a, b| BinaryOp::Pow.apply(a, b);
    assert!(pow(-2.0, 0.5).is_nan());
    assert_eq!(pow(-2.0, 3.0), -8.0);
    assert_eq!(pow(0.0, 0.0), 1.0);
    assert_eq!(pow(0.0, -1.0), f64::INFINITY);
    assert_eq!(pow(f64::NAN, 0.0), 1.0);
}
