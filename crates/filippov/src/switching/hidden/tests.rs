//! Closed forms and certificates of few surfaces against the Taylor series of many, and the parts of both.

use super::around::Basin;
use super::cell::{Cell, StepEnd};
use super::first_zero::{first_loss, value};
use super::{exact, Outcome};
use crate::cube::Bilinear;
use crate::cube::NormalFields;

/// A generator with a seed: SplitMix64, uniform in [-1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn fields(&mut self, m: usize) -> NormalFields {
        let values = (0..m << m).map(|_| self.next()).collect();
        NormalFields::new(m, values).unwrap()
    }
}

fn limit(fields: &NormalFields, u: &[f64]) -> Outcome {
    super::limit(fields, u, &vec![1.0; u.len()])
}

fn mode_of(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Region(mode) => mode.to_string(),
        Outcome::Sliding { mode, .. } => mode.to_string(),
        Outcome::OutwardSpiral { .. } => "spiral".into(),
        Outcome::AtRest => "at rest".into(),
        Outcome::Unknown => "unknown".into(),
    }
}

/// The same fields beside one more surface that does not know of them and holds its component within the transition: Taylor
/// series in the place of closed forms, and other certificates.
fn beside_another(fields: &NormalFields) -> NormalFields {
    let m = fields.m();
    let values = (0..2 << m).flat_map(|pattern| {
        let mut at = fields.at(pattern % (1 << m)).to_vec();
        at.push(if pattern >> m == 1 { -1.0 } else { 1.0 });
        at
    });
    NormalFields::new(m + 1, values.collect()).unwrap()
}

/// The driver for more surfaces does not know spirals, and may not settle a cycle.
#[test]
fn two_surfaces_alone_and_beside_another() {
    let mut random = Random(1);
    let mut unknown = 0;
    for _ in 0..2000 {
        let fields = random.fields(2);
        let u = [2.0 * random.next(), 2.0 * random.next()];
        let exact = limit(&fields, &u);
        let general = limit(&beside_another(&fields), &[u[0], u[1], 0.1]);
        if general == Outcome::Unknown {
            assert_eq!(mode_of(&exact), "spiral", "{fields:?} from {u:?}");
            unknown += 1;
            continue;
        }
        let expected = mode_of(&exact) + "0";
        assert_eq!(expected, mode_of(&general), "{fields:?} from {u:?}");
    }
    assert!(unknown > 0 && unknown < 20, "{unknown} unknown");
}

#[test]
fn one_surface_alone_and_beside_another() {
    let mut random = Random(2);
    for _ in 0..2000 {
        let fields = random.fields(1);
        let u = 2.0 * random.next();
        let exact = limit(&fields, &[u]);
        if fields.at(0)[0] < 0.0 && fields.at(1)[0] > 0.0 {
            // Repelling: the motion goes away from the zero.
            assert!(matches!(exact, Outcome::Region(_)));
        }
        let general = limit(&beside_another(&fields), &[u, 0.1]);
        let expected = mode_of(&exact) + "0";
        assert_eq!(expected, mode_of(&general), "{fields:?} from {u}");
    }
}

/// A strip in closed form against the series: the same place where it is left.
#[test]
fn strips_are_solved() {
    let mut random = Random(3);
    let mut ends = [0; 3];
    for _ in 0..5000 {
        let fields = random.fields(2);
        // Above the square: the second component is clipped.
        let (s, w) = (random.next(), 1.0 + random.next());
        let mut exact = [s, 1.0 + w];
        let time = exact::pass(&fields, &[0, 1], &mut exact, None);
        let mut u = vec![s, 1.0 + w];
        let (mut cell, mut t) = (Cell::new(&fields, &[0, 1]), 0.0);
        let left = (0..200).any(|_| {
            let (dt, end) = cell.advance(&mut u, None, &mut 0);
            t += dt;
            end == StepEnd::Border
        });
        let what = format!("{fields:?}: {u:?} and {exact:?}");
        assert_eq!(left, time.is_some(), "{what}");
        assert!(
            time.is_none_or(|time| (time - t).abs() < 1e-10 * (1.0 + t)),
            "{what}"
        );
        let end = match time {
            Some(_) if exact[1] > 1.0 => 0,
            Some(_) => 1,
            None => 2,
        };
        let allowed = [1e-12 * exact[1], 1e-11, 1e-6][end];
        assert!((u[0] - exact[0]).abs() <= allowed, "{what}");
        assert!(end == 2 || (u[1] - exact[1]).abs() <= allowed, "{what}");
        ends[end] += 1;
    }
    assert!(ends.iter().all(|&n| n > 300), "{ends:?}");
}

/// In the square, two steps and one: the energy of a centre, x^2 + y^2, is kept to rounding.
#[test]
fn series_are_exact_to_rounding() {
    // x' = y, y' = -x.
    let fields = NormalFields::new(2, vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0]).unwrap();
    let mut cell = Cell::new(&fields, &[0, 0]);
    let (mut u, mut time) = (vec![0.5, 0.0], 0.0);
    let mut laps = 0;
    while laps < 20 {
        let (dt, end) = cell.advance(&mut u, Some((1, 0.0)), &mut 0);
        time += dt;
        laps += i32::from(end == StepEnd::Level);
        assert!((u[0].hypot(u[1]) - 0.5).abs() < 1e-14, "{u:?}");
    }
    assert!((time - 20.0 * std::f64::consts::PI).abs() < 1e-12, "{time}");
}

#[test]
fn the_first_of_several_zeros_is_found() {
    // (t - 0.3)(t - 0.3001)(t - 0.9), positive between the last two reversed: negative before 0.3
    // is not allowed, so with the opposite sign.
    let roots = [0.3, 0.3001, 0.9];
    let p = [
        roots[0] * roots[1] * roots[2],
        -(roots[0] * roots[1] + roots[0] * roots[2] + roots[1] * roots[2]),
        roots[0] + roots[1] + roots[2],
        -1.0,
    ];
    assert!(value(&p, 0.0) > 0.0);
    let found = first_loss(&p, 1.0, &mut 0).unwrap();
    assert!((found - 0.3).abs() < 1e-10, "{found}");
    assert_eq!(first_loss(&p, 0.29, &mut 0), None);
    // A zero at the start is divided out.
    let found = first_loss(&[0.0, 1.0, -2.0], 1.0, &mut 0).unwrap();
    assert!((found - 0.5).abs() < 1e-15);
    // A touch is no zero.
    assert_eq!(first_loss(&[0.25, -1.0, 1.0 + 1e-9], 1.0, &mut 0), None);
}

/// Rest at a point that does not attract is said, and a start beside it goes somewhere.
#[test]
fn rest_is_no_outcome() {
    // g = (x, y): repels from the middle.
    let fields = NormalFields::new(2, vec![-1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0]).unwrap();
    assert_eq!(limit(&fields, &[0.0, 0.0]), Outcome::AtRest);
    assert_eq!(limit(&beside_another(&fields), &[0.0; 3]), Outcome::AtRest);
    assert_eq!(mode_of(&limit(&fields, &[1e-9, 1e-9])), "++");
}

/// The form that defines a basin decreases along the motion from every point of its border.
#[test]
fn basins_are_entered() {
    let mut random = Random(4);
    let mut n_basins = 0;
    while n_basins < 500 {
        let bilinear = Bilinear::of_fields(&random.fields(2));
        let root = bilinear.root().filter(|root| root.in_square());
        let Some(root) = root.map(|root| root.point) else {
            continue;
        };
        let Some(basin) = Basin::around(&bilinear, root) else {
            continue;
        };
        n_basins += 1;
        for n in 0..24 {
            let angle = f64::from(n) * std::f64::consts::TAU / 24.0;
            let at = |r: f64| [root[0] + r * angle.cos(), root[1] + r * angle.sin()];
            let (mut inside, mut outside) = (0.0, 4.0);
            for _ in 0..60 {
                let middle = 0.5 * (inside + outside);
                *(if basin.energy(at(middle)) < basin.level {
                    &mut inside
                } else {
                    &mut outside
                }) = middle;
            }
            let u = at(inside);
            assert!(inside > 0.0 && u[0].abs() < 1.0 && u[1].abs() < 1.0);
            let g = bilinear.value(u);
            // A central difference is exact for a quadratic form.
            let moved = |t: f64| basin.energy([u[0] + t * g[0], u[1] + t * g[1]]);
            assert!(moved(0.1) < moved(-0.1), "{bilinear:?} at {u:?}");
        }
    }
}
