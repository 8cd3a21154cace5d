use super::*;

#[test]
fn terms_are_collected() {
    let mut g = Graph::new();
    let (x, y, two, three) = (g.state(0), g.state(1), g.constant(2.0), g.constant(3.0));
    let a = g.mul(two, x);
    let a = g.sub(a, y);
    let b = g.div(a, three);
    let sum = g.add(b, a);
    let sum = g.sub(three, sum);
    let form = LinearForm::of(&g, sum);
    assert_eq!(form.constant, 3.0);
    assert_eq!(form.terms.len(), 2);
    assert!((form.coefficient(x) + 8.0 / 3.0).abs() < 1e-15);
    assert!((form.coefficient(y) - 4.0 / 3.0).abs() < 1e-15);
}

/// 0.1 + 0.2 - 0.3 is 5.6e-17 in floating point; nothing of x is meant to be left.
#[test]
fn rounding_errors_are_no_terms() {
    let mut g = Graph::new();
    let x = g.state(0);
    let [a, b, c] = [0.1, 0.2, 0.3].map(|factor| {
        let factor = g.constant(factor);
        g.mul(factor, x)
    });
    let sum = g.add(a, b);
    let nothing = g.sub(sum, c);
    assert_eq!(
        LinearForm::of(&g, nothing),
        LinearForm {
            terms: vec![],
            constant: 0.0
        }
    );
}

/// x + x + ... doubled 60 times has 2^60 paths to x.
#[test]
fn shared_parts_are_visited_once() {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let mut sum = g.add(x, y);
    for _ in 0..60 {
        let left = g.sub(sum, y);
        sum = g.add(left, sum);
    }
    let form = LinearForm::of(&g, sum);
    assert_eq!(form.coefficient(x), 2.0_f64.powi(60));
}

#[test]
fn overflow_leaves_one_atom() {
    let mut g = Graph::new();
    let (x, big) = (g.state(0), g.constant(1e308));
    let a = g.mul(big, x);
    let mut sum = a;
    for _ in 0..3 {
        sum = g.add(sum, a);
    }
    assert_eq!(LinearForm::of(&g, sum).single_atom(), Some((sum, 1.0)));
}
