//! A simplified graph with its merged surfaces gives what plain floating-point arithmetic gives.
#![allow(clippy::unwrap_used)]

mod support;

use filippov_expr::{BinaryOp, Graph, UnaryOp};
use proptest::prelude::*;
use support::{build, points, recipes, values, Point};

/// A value computed as it is written, and a bound of the relative error it may have collected.
#[derive(Clone, Copy)]
struct Plain {
    value: f64,
    /// Estimated absolute error of either evaluation, to first order.
    error: f64,
}

/// The recipe of `support::build` in plain arithmetic. `None` where a sign is too close to call, or where
/// the evaluation is too ill-conditioned for a comparison to mean anything.
fn evaluate(recipe: &[(u8, u8, u8)], at: &Point) -> Option<Vec<Plain>> {
    let exact = |value| Plain { value, error: 0.0 };
    let mut plain: Vec<Plain> = [at.t, at.p[0], at.p[1], 0.75].map(exact).into();
    plain.extend(at.x.iter().copied().map(exact));
    plain.extend([0.5, -1.25, 2.0, 3.0, 0.0].map(exact));
    for &(op, a, b) in recipe {
        let (a, b) = (
            plain[a as usize % plain.len()],
            plain[b as usize % plain.len()],
        );
        let apply = |f: &dyn Fn(f64, f64) -> f64| {
            let value = f(a.value, b.value);
            // The error of the operands as the change of the value, and some ulp for the operation itself.
            let (da, db) = (
                a.error + 1e-14 * a.value.abs(),
                b.error + 1e-14 * b.value.abs(),
            );
            let change = [(da, 0.0), (-da, 0.0), (0.0, db), (0.0, -db)]
                .map(|(da, db)| (f(a.value + da, b.value + db) - value).abs())
                .into_iter()
                .fold(0.0, f64::max);
            Plain {
                value,
                error: 2.0 * change + 1e-14 * value.abs(),
            }
        };
        let difference = apply(&|a, b| a - b);
        let clear =
            |h: Plain| (h.value == 0.0 || h.value.abs() > 1e-6 + 10.0 * h.error).then_some(h.value);
        let op = op as usize % 40;
        let result = match op {
            0..=6 => apply(&|a, b| BinaryOp::ALL[op].apply(a, b)),
            7..=28 => apply(&|a, _| UnaryOp::ALL[op - 7].apply(a)),
            29 => match clear(a)? {
                // a zero that is one by cancellation only has a surface, whose sign is never 0
                0.0 => return None,
                h => Plain {
                    value: h.signum(),
                    error: 0.0,
                },
            },
            30 => Plain {
                value: a.value.abs(),
                ..a
            },
            31 if clear(difference)? >= 0.0 => a,
            31 => b,
            32 if clear(difference)? <= 0.0 => a,
            32 => b,
            33 | 34 => apply(&|a, b| a + b),
            35 | 36 => difference,
            _ => apply(&|a, b| a * b),
        };
        if !result.value.is_finite()
            || result.value.abs() > 1e6
            || result.error.is_nan()
            || result.error > 1e-6
        {
            return None;
        }
        plain.push(result);
    }
    Some(plain)
}

/// The signs that the surfaces have at a point: a surface depends on the signs of earlier ones only.
fn true_signs(g: &Graph, at: &Point) -> Option<Vec<f64>> {
    let mut signs: Vec<f64> = Vec::new();
    for j in 0..g.n_surfaces() as u32 {
        let mut known = signs.clone();
        known.resize(g.n_surfaces(), 1.0);
        let h = values(
            g,
            &[g.surface(j)],
            &Point {
                signs: known,
                ..at.clone()
            },
        )[0];
        signs.push(if h.abs() > 1e-9 {
            h.signum()
        } else {
            return None;
        });
    }
    Some(signs)
}

proptest! {
    #![proptest_config(support::config(2000))]

    #[test]
    fn values_are_those_of_plain_arithmetic(recipe in recipes(12), at in points()) {
        let Some(plain) = evaluate(&recipe, &at) else { return Err(TestCaseError::reject("not comparable")) };
        let (g, nodes) = build(&recipe);
        let Some(signs) = true_signs(&g, &at) else { return Err(TestCaseError::reject("on a surface")) };
        let at = Point { signs: if signs.is_empty() { vec![1.0] } else { signs }, ..at };
        for (k, (found, plain)) in values(&g, &nodes, &at).into_iter().zip(&plain).enumerate() {
            let close = (found - plain.value).abs() <= 10.0 * plain.error + 1e-13 * plain.value.abs();
            prop_assert!(close, "node {k}: {found}, plain {} +- {}", plain.value, plain.error);
        }
        // One surface each: of two that are proportional everywhere, one would be missing in the table.
        for j in 0..g.n_surfaces() as u32 {
            let mut again = g.clone();
            let here = again.surface(j);
            let switching = again.switch(here);
            prop_assert_eq!(switching, filippov_expr::Switching::Surface { index: j, orientation: 1.0 });
            let scale = again.constant(-0.3);
            let scaled = again.mul(scale, here);
            let switching = again.switch(scaled);
            let expected = filippov_expr::Switching::Surface { index: j, orientation: -1.0 };
            prop_assert_eq!(switching, expected, "{}", again.text(scaled, &Default::default()));
        }
    }

    /// Fixing the signs changes nothing but the need for them.
    #[test]
    fn fixed_signs_give_the_same_values(recipe in recipes(25), at in points()) {
        // 0 * x drops the sign of a zero, which atan2 and a division would show.
        prop_assume!(recipe.iter().all(|step| !matches!(step.0 % 40, 3 | 5)));
        let (mut g, nodes) = build(&recipe);
        let signs = at.signs(g.n_surfaces());
        let fixed: Vec<Option<f64>> = signs.iter().copied().map(Some).collect();
        let smooth = g.at_signs(&nodes, &fixed);
        prop_assert!(g.sign_dependencies(&smooth, &signs).iter().all(|depends| !depends));
        let (a, b) = (values(&g, &nodes, &at), values(&g, &smooth, &at));
        for (a, b) in a.into_iter().zip(b) {
            // Folding may multiply constants in another order, and drop a 0 * NaN.
            let close = (a - b).abs() <= 1e-6 * (1.0 + a.abs());
            prop_assert!(close || !a.is_finite() || !b.is_finite() || a.abs() > 1e6, "{a} {b}");
        }
    }

    /// A sign that is reported not to matter does not: changing it changes no bit.
    #[test]
    fn other_signs_do_not_matter(recipe in recipes(30), at in points()) {
        let (g, nodes) = build(&recipe);
        let roots = &nodes[nodes.len() - 2..];
        let signs = at.signs(g.n_surfaces());
        let depends = g.sign_dependencies(roots, &signs);
        let before = values(&g, roots, &at);
        for j in (0..signs.len()).filter(|&j| !depends[j]) {
            let mut changed = signs.clone();
            changed[j] = -changed[j];
            let after = values(&g, roots, &Point { signs: changed, ..at.clone() });
            prop_assert!(before.iter().zip(&after).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }
}
