//! What a decision at an intersection costs: `decision_costs NAME N` decides N random points of one situation, and prints
//! the nanoseconds that each took, the median of many groups; without arguments it lists the situations. Run by
//! `benchmarks/decisions.py`.

use std::hint::black_box;
use std::time::{Duration, Instant};

use filippov::switching::{admissible, resolve, ExitKind, Incoming, NormalFields};

/// Distinct points of each situation.
const POINTS: usize = 64;

/// Groups of decisions are no longer repeated after this time.
const LONGEST: Duration = Duration::from_millis(500);

/// Fields with the way in which a motion arrives.
type Point = (NormalFields, Incoming);

/// A name, and a random point if it belongs there.
type Situation = (&'static str, fn(&mut Random) -> Option<Point>);

const SITUATIONS: [Situation; 10] = [
    ("one surface", |random| {
        let values = vec![random.next().abs(), random.next()];
        Some((fields(1, values)?, corner(&[-1])))
    }),
    ("entry, one mode", |random| {
        only_if(entry(random)?, |n| n == 1)
    }),
    ("entry, several", |random| {
        only_if(entry(random)?, |n| n > 1)
    }),
    ("corner, one mode", |random| {
        only_if(reached(random, 2)?, |n| n == 1)
    }),
    ("corner, several", |random| {
        only_if(reached(random, 2)?, |n| n > 1)
    }),
    ("start", |random| {
        let values = (0..8).map(|_| random.next()).collect();
        only_if((fields(2, values)?, Incoming::Start), |n| n == 1)
    }),
    ("exit at a side", |random| exit(random, ExitKind::Side)),
    ("exit at a fold", |random| exit(random, ExitKind::Fold)),
    ("degenerate", |random| {
        let (point, incoming) = entry(random)?;
        // The component that decides whether a root exists vanishes.
        let mut values = point.values().to_vec();
        values[7] = 0.0;
        let point = fields(2, values)?;
        resolve(&point, &incoming, &[1.0, 1.0]).ok()?;
        Some((point, incoming))
    }),
    ("three surfaces", |random| reached(random, 3)),
];

/// Sliding on the first surface reaches the second.
fn entry(random: &mut Random) -> Option<Point> {
    let mut values: Vec<f64> = (0..8).map(|_| random.next()).collect();
    (values[0], values[2]) = (values[0].abs(), -values[2].abs());
    let arrives = values[0] * values[3] - values[2] * values[1] > 0.0;
    let incoming = Incoming::Face {
        mode: vec![0, -1],
        multipliers: vec![(values[0] + values[2]) / (values[0] - values[2])],
    };
    arrives.then_some((fields(2, values)?, incoming))
}

/// The first region reaches all surfaces at once.
fn reached(random: &mut Random, m: usize) -> Option<Point> {
    let mut values: Vec<f64> = (0..m << m).map(|_| random.next()).collect();
    values[..m]
        .iter_mut()
        .for_each(|value| *value = value.abs());
    Some((fields(m, values)?, corner(&vec![-1; m])))
}

/// A stable root at a side, or one that meets another root.
fn exit(random: &mut Random, kind: ExitKind) -> Option<Point> {
    let [mut b, c, d] = [0, 1, 2].map(|_| [random.next(), random.next()]);
    let root = match kind {
        ExitKind::Side => [1.0, 0.9 * random.next()],
        _ => [0.9 * random.next(), 0.9 * random.next()],
    };
    if kind == ExitKind::Fold {
        b[0] = b[1] * c[0] / c[1];
    }
    let determinant = b[0] * c[1] - c[0] * b[1];
    if kind == ExitKind::Side && determinant < 0.02 || b[0] + c[1] > -0.1 || c[1].abs() < 0.05 {
        return None;
    }
    let values = (0..4).flat_map(|pattern| {
        let side = |bit: usize| if pattern >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let (x, y) = (side(0) - root[0], side(1) - root[1]);
        [0, 1].map(|j| b[j] * x + c[j] * y + d[j] * x * y)
    });
    let incoming = Incoming::Exit {
        kind,
        lambda: root.to_vec(),
        drift: Some(vec![1.0, 0.0]),
    };
    let fields = fields(2, values.collect())?;
    resolve(&fields, &incoming, &[1.0, 1.0]).ok()?;
    Some((fields, incoming))
}

fn only_if(point: Point, holds: fn(usize) -> bool) -> Option<Point> {
    let resolution = resolve(&point.0, &point.1, &[1.0, 1.0]).ok()?;
    (holds(admissible(&point.0).len()) && resolution.margin > 1e-3).then_some(point)
}

fn corner(region: &[i8]) -> Incoming {
    let region = region.to_vec();
    Incoming::Corner { region }
}

fn fields(m: usize, values: Vec<f64>) -> Option<NormalFields> {
    NormalFields::new(m, values).ok()
}

/// SplitMix64, uniform in [-1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[allow(clippy::print_stdout)]
fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let situation = SITUATIONS
        .iter()
        .find(|one| Some(&one.0.to_owned()) == arguments.first());
    let Some((_, make)) = situation else {
        SITUATIONS.iter().for_each(|(name, _)| println!("{name}"));
        return;
    };
    let n: usize = arguments
        .get(1)
        .and_then(|n| n.parse().ok())
        .unwrap_or(10_000);
    let mut random = Random(1);
    let mut points = Vec::new();
    while points.len() < POINTS {
        points.extend(make(&mut random));
    }
    let mut times = Vec::new();
    let begin = Instant::now();
    while times.len() < n / POINTS && begin.elapsed() < LONGEST {
        let start = Instant::now();
        for (fields, incoming) in &points {
            let kappa = vec![1.0; fields.m()];
            let _ = black_box(resolve(black_box(fields), incoming, &kappa));
        }
        times.push(start.elapsed().as_secs_f64() * 1e9 / POINTS as f64);
    }
    times.sort_by(f64::total_cmp);
    if let Some(median) = times.get(times.len() / 2) {
        println!("{median}");
    }
}
