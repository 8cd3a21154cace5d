//! Motion that winds around an intersection of two surfaces.

use crate::cube::NormalFields;

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

    /// The displacement sum_j t_j f^(j) of a lap from distance 1, with `fields[j]` the field of `regions[j]`. From the
    /// intersection the infinitely many laps of an outward spiral (gamma > 1) lead to distance (gamma - 1) delta by
    /// delta times this, in delta times its duration.
    pub fn displacement(&self, fields: [&[f64]; 4]) -> Vec<f64> {
        let component = |i: usize| (0..4).map(|n| self.times[n] * fields[n][i]).sum();
        (0..fields[0].len()).map(component).collect()
    }
}

/// The regions in the order in which rotating fields visit them.
fn cycle_from(fields: &NormalFields, first: [i8; 2]) -> Option<[[i8; 2]; 4]> {
    // Counter-clockwise, on both sides of the border between two regions.
    let rates = |n: usize| {
        let (region, next) = (CYCLE[n], CYCLE[(n + 1) % 4]);
        let crossed = usize::from(region[0] == next[0]);
        let rate = move |k: [i8; 2]| f64::from(next[crossed]) * fields.in_region(&k)[crossed];
        [region, next].map(rate)
    };
    let is_clockwise = rates(0)[0] < 0.0;
    let turn = if is_clockwise { -1.0 } else { 1.0 };
    if !(0..4).flat_map(rates).all(|rate| turn * rate > 0.0) {
        return None;
    }
    let start = CYCLE.iter().position(|&region| region == first)?;
    let step = if is_clockwise { 3 } else { 1 };
    Some([0, 1, 2, 3].map(|n| CYCLE[(start + step * n) % 4]))
}
