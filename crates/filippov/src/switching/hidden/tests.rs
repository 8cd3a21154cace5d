//! The closed forms of two surfaces against the Taylor series of many, and the parts of both.

use super::basin::Basin;
use super::cell::{Cell, StepEnd};
use super::first_zero::{first_loss, value};
use super::strip::{Strip, StripEnd};
use super::{line, plane, space, Outcome};
use crate::cube::Bilinear;
use crate::cube::NormalFields;
use crate::patience::Patience;

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

fn mode_of(outcome: &Outcome) -> String {
    match outcome {
        Outcome::Region(mode) => mode.to_string(),
        Outcome::Sliding { mode, .. } => mode.to_string(),
        Outcome::OutwardSpiral { .. } => "spiral".into(),
        Outcome::AtRest => "at rest".into(),
        Outcome::Unknown => "unknown".into(),
    }
}

/// Two drivers that share nothing but the series within the square. The one for many surfaces does
/// not know spirals, and may not settle a cycle.
#[test]
fn two_surfaces_by_both_drivers() {
    let mut random = Random(1);
    let mut unknown = 0;
    for _ in 0..4000 {
        let fields = random.fields(2);
        let u = [2.0 * random.next(), 2.0 * random.next()];
        let exact = plane::limit(&fields, u, Patience::endless());
        let general = space::limit(&fields, &u, Patience::endless());
        if general == Outcome::Unknown {
            assert_eq!(mode_of(&exact), "spiral", "{fields:?} from {u:?}");
            unknown += 1;
            continue;
        }
        assert_eq!(mode_of(&exact), mode_of(&general), "{fields:?} from {u:?}");
    }
    assert!(unknown > 0 && unknown < 40, "{unknown} unknown");
}

#[test]
fn one_surface_by_both_drivers() {
    let mut random = Random(2);
    for _ in 0..2000 {
        let fields = random.fields(1);
        let u = 2.0 * random.next();
        let exact = line::limit(&fields, u);
        if fields.at(0)[0] < 0.0 && fields.at(1)[0] > 0.0 {
            // Repelling: both drivers move away from the zero.
            assert!(matches!(exact, Outcome::Region(_)));
        }
        assert_eq!(
            mode_of(&exact),
            mode_of(&space::limit(&fields, &[u], Patience::endless())),
            "{fields:?} from {u}"
        );
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
        let [minus, plus] = [fields.at(2), fields.at(3)];
        let strip = Strip {
            s,
            w,
            alpha: 0.5 * (minus[0] + plus[0]),
            beta: 0.5 * (plus[0] - minus[0]),
            p: 0.5 * (minus[1] + plus[1]),
            q: 0.5 * (plus[1] - minus[1]),
        };
        let mut u = vec![s, 1.0 + w];
        let mut cell = Cell::new(&fields, &[0, 1]);
        let steps = (0..200).find(|_| cell.advance(&mut u, None).1 == StepEnd::Border);
        match strip.pass(-1.0, 1.0) {
            StripEnd::Across { s, w } => {
                assert!(steps.is_some() && u[0] == s, "{strip:?}: {u:?}");
                assert!(
                    (u[1] - 1.0 - w).abs() < 1e-12 * (1.0 + w),
                    "{strip:?}: {u:?}"
                );
                ends[0] += 1;
            }
            StripEnd::Inwards { s } => {
                assert!(steps.is_some() && u[1] == 1.0, "{strip:?}: {u:?}");
                assert!((u[0] - s).abs() < 1e-11, "{strip:?}: {u:?} against {s}");
                ends[1] += 1;
            }
            StripEnd::Outwards { s } => {
                assert!(steps.is_none(), "{strip:?}: {u:?}");
                assert!((u[0] - s).abs() < 1e-6, "{strip:?}: {u:?} against {s}");
                ends[2] += 1;
            }
            StripEnd::AtRest => panic!("{strip:?}"),
        }
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
        let (dt, end) = cell.advance(&mut u, Some((1, 0.0)));
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
    assert_eq!(
        plane::limit(&fields, [0.0, 0.0], Patience::endless()),
        Outcome::AtRest
    );
    assert_eq!(
        space::limit(&fields, &[0.0, 0.0], Patience::endless()),
        Outcome::AtRest
    );
    assert_eq!(
        mode_of(&plane::limit(&fields, [1e-9, 1e-9], Patience::endless())),
        "++"
    );
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
                *(if basin.contains(at(middle)) {
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
