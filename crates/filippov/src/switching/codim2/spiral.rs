//! Motion that winds around an intersection of two surfaces: one lap, the end of infinitely many inward
//! laps, the start of infinitely many outward laps.

use crate::switching::normal_fields::NormalFields;

/// One lap around the intersection under constant fields, through all four regions.
///
/// In each region let j be the surface that is reached next, at distance d: this takes t = d/|f_j|, and
/// the next distance is t |f_i| with i the other surface. After four regions the distance is
/// gamma times the first one. The lap is stated for a first distance of 1.
///
/// Reference: Guglielmi, Hairer (2022), formulas (6.1) to (6.3), corrected in
/// `docs/theory/intersections.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lap {
    /// The regions in the order in which they are visited.
    pub regions: [[i8; 2]; 4],
    /// Time spent in each of them per unit of the first distance.
    pub times: [f64; 4],
    /// Last distance over first distance: below 1 the intersection attracts in finite time.
    pub gamma: f64,
    /// The sum of the times.
    pub duration: f64,
}

/// A displacement of the state that consists of motion in several regions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// The regions.
    pub regions: [[i8; 2]; 4],
    /// Time spent in each of them.
    pub times: [f64; 4],
}

/// Counter-clockwise; clockwise is the reverse.
const CYCLE: [[i8; 2]; 4] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];

impl Lap {
    /// The lap that starts where the motion enters region `first`, on the border to the region
    /// before it. `None` if the fields do not rotate.
    pub fn around(fields: &NormalFields, first: [i8; 2]) -> Option<Lap> {
        let regions = cycle_from(fields, first)?;
        let mut distance = 1.0;
        let mut times = [0.0; 4];
        for (n, region) in regions.iter().enumerate() {
            let next = regions[(n + 1) % 4];
            let hit = usize::from(region[0] == next[0]);
            let f = fields.in_region(region);
            times[n] = distance / f[hit].abs();
            distance = times[n] * f[1 - hit].abs();
        }
        Some(Lap {
            regions,
            times,
            gamma: distance,
            duration: times.iter().sum(),
        })
    }

    /// From distance `delta` to the end of all laps on the intersection, if the motion is attracted
    /// (gamma < 1): times delta t_j/(1 - gamma). The state has to be projected onto the
    /// intersection then. Under fields that vary the error is a multiple of delta^2.
    pub fn inward(&self, delta: f64) -> Option<Jump> {
        (self.gamma < 1.0).then(|| self.jump(delta / (1.0 - self.gamma)))
    }

    /// From the intersection to distance (gamma - 1) delta by the infinitely many laps of an
    /// outward spiral (gamma > 1): the times are those of one lap from distance delta, a free
    /// parameter.
    pub fn outward(&self, delta: f64) -> Option<Jump> {
        (self.gamma > 1.0).then(|| self.jump(delta))
    }

    fn jump(&self, factor: f64) -> Jump {
        Jump {
            regions: self.regions,
            times: self.times.map(|t| factor * t),
        }
    }
}

impl Jump {
    /// The time that it takes.
    pub fn duration(&self) -> f64 {
        self.times.iter().sum()
    }

    /// The displacement sum_j t_j f^(j), with `fields[j]` the field of `regions[j]`.
    pub fn displacement(&self, fields: [&[f64]; 4]) -> Vec<f64> {
        let component = |i: usize| (0..4).map(|n| self.times[n] * fields[n][i]).sum();
        (0..fields[0].len()).map(component).collect()
    }
}

/// The end of the laps from two estimates of it, the second one from one lap later:
/// (second - gamma^2 first)/(1 - gamma^2). This removes the error in delta^2 and leaves one in delta^3.
pub fn extrapolated_jump(first: &[f64], second: &[f64], gamma: f64) -> Vec<f64> {
    let square = gamma * gamma;
    let pairs = first.iter().zip(second);
    pairs
        .map(|(a, b)| (b - square * a) / (1.0 - square))
        .collect()
}

/// The regions in the order in which rotating fields visit them.
fn cycle_from(fields: &NormalFields, first: [i8; 2]) -> Option<[[i8; 2]; 4]> {
    let leads = |region: [i8; 2], next: [i8; 2]| {
        let crossed = usize::from(region[0] == next[0]);
        let towards = |k: [i8; 2]| f64::from(next[crossed]) * fields.in_region(&k)[crossed] > 0.0;
        towards(region) && towards(next)
    };
    let start = CYCLE.iter().position(|&region| region == first)?;
    let counter_clockwise = [0, 1, 2, 3].map(|n| CYCLE[(start + n) % 4]);
    let clockwise = [0, 1, 2, 3].map(|n| CYCLE[(start + 4 - n) % 4]);
    let rotates = |cycle: &[[i8; 2]; 4]| (0..4).all(|n| leads(cycle[n], cycle[(n + 1) % 4]));
    [counter_clockwise, clockwise].into_iter().find(rotates)
}
