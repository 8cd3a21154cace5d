//! Random normal components for every situation at an intersection of two surfaces.
#![allow(dead_code, clippy::unwrap_used)]

use filippov::switching::NormalFields;

use crate::oracles::Frame;

/// A small generator with a seed (SplitMix64), so that every run is the same.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Random(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.between(0.0, 1.0)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.between(0.0, 1.0)).cos()
    }

    pub fn normals<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.normal())
    }

    pub fn fields(&mut self, m: usize) -> NormalFields {
        let values = (0..m << m).map(|_| self.normal()).collect();
        NormalFields::new(m, values).unwrap()
    }

    pub fn frame(&mut self) -> Frame {
        let n = (self.bits() % 8) as usize;
        Frame::all().nth(n).unwrap()
    }

    /// 10 to a power uniform in [-decades, decades).
    pub fn ratio(&mut self, decades: f64) -> f64 {
        10.0_f64.powf(self.between(-decades, decades))
    }
}

/// The canopy of two surfaces, each g = a + b X + c Y + d X Y with X, Y counted from `centre`.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    pub centre: [f64; 2],
    pub a: [f64; 2],
    pub b: [f64; 2],
    pub c: [f64; 2],
    pub d: [f64; 2],
}

impl Around {
    pub fn fields(&self) -> NormalFields {
        let corner = |x: f64, y: f64| {
            let (x, y) = (x - self.centre[0], y - self.centre[1]);
            [0, 1].map(|j: usize| self.a[j] + self.b[j] * x + (self.c[j] + self.d[j] * x) * y)
        };
        let corners = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
        ];
        NormalFields::new(2, corners.concat()).unwrap()
    }
}

/// Fields with sliding that arrives at the intersection, and its mode.
pub fn entry(random: &mut Random) -> (NormalFields, [i8; 2]) {
    loop {
        let mut values = random.normals::<8>();
        values = values.map(|value| value * random.ratio(0.5));
        // (--) and (+-): the first surface attracts.
        (values[0], values[2]) = (values[0].abs(), -values[2].abs());
        if random.between(0.0, 1.0) < 0.5 {
            // More of Figure 4.5, by symmetry: one of the fields leads away from the second surface.
            (values[1], values[3]) = (values[1].abs(), -values[3].abs());
        }
        if values[0] * values[3] - values[2] * values[1] > 0.0 {
            let frame = random.frame();
            let fields = NormalFields::new(2, values.to_vec()).unwrap();
            return (frame.fields(&fields), frame.of([0, -1]));
        }
    }
}

/// An exit: fields at the event and a little later, the root, the start of the hidden dynamics, and a
/// scaling for which the root was stable before.
pub struct Exit {
    pub at: NormalFields,
    pub after: NormalFields,
    pub root: [f64; 2],
    pub start: [f64; 2],
    pub kappa: [f64; 2],
}

impl Exit {
    fn seen(
        at: Around,
        after: Around,
        start: [f64; 2],
        kappa: [f64; 2],
        random: &mut Random,
    ) -> Self {
        let frame = random.frame();
        let exchanged = |v: [f64; 2]| if frame.exchange { [v[1], v[0]] } else { v };
        Exit {
            at: frame.fields(&at.fields()),
            after: frame.fields(&after.fields()),
            root: frame.of(at.centre),
            start: frame.of(start),
            kappa: exchanged(kappa),
        }
    }
}

/// The root leaves through a side.
pub fn exit_side(random: &mut Random) -> Exit {
    let later = 1e-5;
    loop {
        let [b0, b1, c0, c1, d0, d1] = random.normals::<6>();
        if b0 * c1 - c0 * b1 <= 0.02 || b0.min(c1) >= 0.0 || c1.abs() < 0.05 {
            continue;
        }
        let y = random.between(-0.95, 0.95);
        let centred = |x: f64| Around {
            centre: [x, y],
            a: [0.0; 2],
            b: [b0, b1],
            c: [c0, c1],
            d: [d0, d1],
        };
        let kappa = stable_scaling(random, [b0, c1]);
        return Exit::seen(
            centred(1.0),
            centred(1.0 + later),
            [1.0 - later, y],
            kappa,
            random,
        );
    }
}

/// The root meets the saddle. The time to pass the place where it was grows as the root of 1/later.
pub fn exit_fold(random: &mut Random) -> Exit {
    let later = 1e-4;
    loop {
        let [b, c, d0, d1, rho] = random.normals::<5>();
        if b.abs().min(c.abs()).min(rho.abs()) < 0.1 || (b > 0.0 && rho * c > 0.0) {
            continue;
        }
        // Twice the distance of the curves g_1 = 0 and g_2 = 0 is this times x^2.
        let gap = b / (c * c) * (d1 / rho - d0);
        if gap.abs() < 0.1 {
            continue;
        }
        let centre = [random.between(-0.9, 0.9), random.between(-0.9, 0.9)];
        let parted = |distance: f64| Around {
            centre,
            a: [0.0, -rho * c * distance * gap.signum()],
            b: [b, rho * b],
            c: [c, rho * c],
            d: [d0, d1],
        };
        let kappa = stable_scaling(random, [b, rho * c]);
        return Exit::seen(parted(0.0), parted(later), centre, kappa, random);
    }
}

/// The root loses its stability for all scalings.
pub fn exit_stability(random: &mut Random) -> Exit {
    loop {
        let [c0, d0, d1] = random.normals::<3>();
        let centre = [random.between(-0.9, 0.9), random.between(-0.9, 0.9)];
        let g12 = c0 + d0 * centre[0];
        let (g21, g22) = (-random.normal().abs(), random.normal().abs());
        let far = g12.min(c0 - d0).min(g22).min(-g21).min((c0 + d0).abs());
        if far < 0.05 {
            continue;
        }
        let with_diagonal = |g11: f64| Around {
            centre,
            a: [0.0; 2],
            b: [g11, g21],
            c: [g12, g22],
            d: [d0, d1],
        };
        let start = centre.map(|v| v + 1e-6 * random.normal());
        let kappa = [1.0, random.ratio(1.0)];
        return Exit::seen(
            with_diagonal(0.0),
            with_diagonal(1e-7),
            start,
            kappa,
            random,
        );
    }
}

/// Rotating fields.
pub fn rotation(random: &mut Random) -> NormalFields {
    let signs = [1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0];
    let direction = if random.between(0.0, 1.0) < 0.5 {
        1.0
    } else {
        -1.0
    };
    let sizes = random.normals::<8>();
    let values = (0..8).map(|i| direction * signs[i] * (0.05 + sizes[i].abs()));
    NormalFields::new(2, values.collect()).unwrap()
}

/// A scaling for which the root with these diagonal entries of G is stable.
fn stable_scaling(random: &mut Random, [g11, g22]: [f64; 2]) -> [f64; 2] {
    let margin = 10.0_f64.powf(random.between(0.02, 2.0));
    let ratio = match (g11 < 0.0, g22 < 0.0) {
        (true, true) => random.ratio(1.5),
        (true, false) => -g11 / g22 / margin,
        _ => -g11 / g22 * margin,
    };
    [1.0 / ratio.sqrt(), ratio.sqrt()]
}
