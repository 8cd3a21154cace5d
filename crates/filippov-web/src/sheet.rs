//! The surfaces in a window, as polylines, and what the fields do at them.

use filippov::{BothSides, FieldError, PiecewiseSystem, Setting};
use filippov_expr::sort_few;

use crate::dimensions::Window;

/// What the fields on both sides of a surface do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SheetKind {
    /// The motion crosses.
    Crossing,
    /// Both fields point to the surface: attracting sliding.
    Attracting,
    /// Both fields point away from it: repelling sliding.
    Repelling,
    /// A field is not finite, or what happens there is not a matter of fields alone.
    Unknown,
}

impl SheetKind {
    /// The name in replies.
    pub fn name(self) -> &'static str {
        match self {
            SheetKind::Crossing => "crossing",
            SheetKind::Attracting => "attracting",
            SheetKind::Repelling => "repelling",
            SheetKind::Unknown => "unknown",
        }
    }

    fn of(minus: f64, plus: f64) -> Self {
        match (minus, plus) {
            _ if !(minus.is_finite() && plus.is_finite()) => SheetKind::Unknown,
            _ if minus > 0.0 && plus < 0.0 => SheetKind::Attracting,
            _ if minus < 0.0 && plus > 0.0 => SheetKind::Repelling,
            _ => SheetKind::Crossing,
        }
    }
}

/// A point of a surface, with the normal components of the fields of both sides.
#[derive(Clone, Copy, Debug)]
pub struct SheetPoint {
    pub point: [f64; 2],
    pub minus: f64,
    pub plus: f64,
}

/// A part of a surface of one kind.
pub struct SheetPart {
    pub surface: usize,
    pub kind: SheetKind,
    pub points: Vec<SheetPoint>,
}

/// Column and row of a corner of a cell.
type Corner = (usize, usize);

/// A state nearer to a surface than this share of the window is on it.
const ON_SURFACE: f64 = 1e-7;
/// Steps of the search for a zero along an edge.
const MOST_STEPS: usize = 40;

/// The system at a time, looked at through a window.
pub struct Plane<'a> {
    pub system: &'a dyn PiecewiseSystem,
    pub window: &'a Window,
    pub t: f64,
    pub q: &'a [f64],
}

impl Plane<'_> {
    /// The signs of all surfaces at a state: switching functions may contain signs of others.
    pub fn signs(&self, x: &[f64]) -> Result<Vec<f64>, FieldError> {
        let d = self.system.n_surfaces();
        let (mut signs, mut h) = (vec![1.0; d], vec![0.0; d]);
        for _ in 0..d {
            let setting = Setting::new(&signs, self.q);
            self.system.surfaces(&setting.at(self.t, x), &mut h)?;
            let next = h.iter().map(|&h| if h < 0.0 { -1.0 } else { 1.0 });
            let next: Vec<f64> = next.collect();
            if next == signs {
                break;
            }
            signs = next;
        }
        Ok(signs)
    }

    /// The values of all switching functions at a point of the window.
    fn values(&self, point: [f64; 2]) -> Result<Vec<f64>, FieldError> {
        let x = self.window.state(point);
        let signs = self.signs(&x)?;
        let mut h = vec![0.0; signs.len()];
        let setting = Setting::new(&signs, self.q);
        self.system.surfaces(&setting.at(self.t, &x), &mut h)?;
        Ok(h)
    }

    /// The field at a point of the window, in its region.
    pub fn field(&self, point: [f64; 2]) -> Result<[f64; 2], FieldError> {
        let x = self.window.state(point);
        let signs = self.signs(&x)?;
        let mut dx = vec![0.0; x.len()];
        let setting = Setting::new(&signs, self.q);
        self.system.field(&setting.at(self.t, &x), &mut dx)?;
        Ok(self.window.point(&dx))
    }

    /// Those of the first `n` surfaces that a state is on, to a small share of the window.
    pub fn surfaces_at(
        &self,
        x: &[f64],
        signs: &[f64],
        n: usize,
    ) -> Result<Vec<usize>, FieldError> {
        let place = Setting::new(signs, self.q).at(self.t, x);
        let mut h = vec![0.0; signs.len()];
        self.system.surfaces(&place, &mut h)?;
        let (mut gradient, mut active) = (vec![0.0; x.len()], vec![true; signs.len()]);
        self.system.active(signs, &[], &mut active);
        let mut found = Vec::new();
        for j in (0..n).filter(|&j| active[j]) {
            self.system.gradient(j, &place, &mut gradient)?;
            let axes = self.window.axes.into_iter().enumerate();
            let across = axes
                .map(|(k, axis)| gradient[axis].abs() * (self.window.high[k] - self.window.low[k]));
            if h[j].abs() <= ON_SURFACE * across.sum::<f64>() {
                found.push(j);
            }
        }
        Ok(found)
    }

    /// The parts of the first `n` surfaces in the window.
    pub fn sheets(&self, n: usize) -> Result<Vec<SheetPart>, FieldError> {
        let cells = self.window.cells;
        let side = cells + 1;
        let mut values = Vec::with_capacity(side * side);
        for row in 0..side {
            for column in 0..side {
                values.push(self.values(self.corner((column, row)))?);
            }
        }
        let mut parts = Vec::new();
        for j in 0..n {
            for line in self.lines(j, &values)?.chains() {
                self.split(j, &line, &mut parts)?;
            }
        }
        Ok(parts)
    }

    /// The corner of a cell as a point.
    fn corner(&self, (column, row): Corner) -> [f64; 2] {
        let share = |index: usize| index as f64 / self.window.cells as f64;
        self.window.at([share(column), share(row)])
    }

    /// The zeros of h_j on the edges of the cells, joined within each cell, by the values at all corners.
    fn lines(&self, j: usize, values: &[Vec<f64>]) -> Result<Lines, FieldError> {
        let cells = self.window.cells;
        let side = cells + 1;
        let mut lines = Lines::default();
        // The point on each edge that was looked at, if there is one: two edges begin at each corner.
        let mut places = vec![None; 2 * side * side];
        for row in 0..cells {
            for column in 0..cells {
                // The corners, around the cell.
                let corners = [
                    (column, row),
                    (column + 1, row),
                    (column + 1, row + 1),
                    (column, row + 1),
                ];
                let mut ends = Vec::new();
                for k in 0..4 {
                    let (a, b) = (corners[k], corners[(k + 1) % 4]);
                    let at = |(column, row): (usize, usize)| values[row * side + column][j];
                    if (at(a) < 0.0) == (at(b) < 0.0) || !(at(a) - at(b)).is_finite() {
                        continue;
                    }
                    let (first, last) = (a.min(b), a.max(b));
                    let edge = 2 * (first.1 * side + first.0) + usize::from(first.0 == last.0);
                    let place = match places[edge] {
                        Some(place) => place,
                        None => {
                            let ends = [first, last].map(|end| (self.corner(end), at(end)));
                            let place = self.zero_between(j, ends)?;
                            let place = place.map(|point| lines.add(point));
                            places[edge] = Some(place);
                            place
                        }
                    };
                    ends.extend(place);
                }
                match ends[..] {
                    [a, b] => lines.join(a, b),
                    // A saddle: the two pairs in their order around the cell.
                    [a, b, c, d] => {
                        lines.join(a, b);
                        lines.join(c, d);
                    }
                    _ => {}
                }
            }
        }
        Ok(lines)
    }

    /// The zero of h_j on an edge; none where h_j jumps through zero.
    fn zero_between(
        &self,
        j: usize,
        [(mut a, mut ha), (mut b, mut hb)]: [([f64; 2], f64); 2],
    ) -> Result<Option<[f64; 2]>, FieldError> {
        let size = ha.abs().max(hb.abs());
        let mut middle = a;
        let mut least = f64::INFINITY;
        for step in 0..MOST_STEPS {
            // Secants, and every third time the middle.
            let share = if step % 3 == 2 { 0.5 } else { ha / (ha - hb) };
            middle = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
            let h = self.values(middle)?[j];
            least = h.abs();
            if least <= 1e-9 * size || least.is_nan() {
                break;
            }
            if (h < 0.0) == (ha < 0.0) {
                (a, ha) = (middle, h);
            } else {
                (b, hb) = (middle, h);
            }
        }
        Ok((least <= 1e-6 * size).then_some(middle))
    }

    /// A point of a surface with the normal components there.
    fn at_surface(
        &self,
        j: usize,
        point: [f64; 2],
        both: &mut BothSides,
    ) -> Result<(SheetPoint, bool), FieldError> {
        let x = self.window.state(point);
        let mut signs = self.signs(&x)?;
        let mut is_active = false;
        let mut active = vec![false; signs.len()];
        for side in [-1.0, 1.0] {
            signs[j] = side;
            self.system.active(&signs, &[], &mut active);
            is_active |= active[j];
        }
        let setting = Setting::new(&signs, self.q);
        self.system.both_sides(j, &setting.at(self.t, &x), both)?;
        let (minus, plus) = (both.normal_minus, both.normal_plus);
        Ok((SheetPoint { point, minus, plus }, is_active))
    }

    /// Splits a line into parts of one kind each, at the points where a field is tangent.
    fn split(
        &self,
        j: usize,
        line: &[[f64; 2]],
        parts: &mut Vec<SheetPart>,
    ) -> Result<(), FieldError> {
        let (n, d) = (self.window.rest.len(), self.system.n_surfaces());
        let mut both = BothSides::new(n, d);
        let switches = self.system.switches_at(j);
        // Runs of points at which the field depends on the side.
        let mut runs = vec![Vec::new()];
        for &point in line {
            let (at, is_active) = self.at_surface(j, point, &mut both)?;
            let last = runs.len() - 1;
            match is_active || !switches {
                true => runs[last].push(at),
                false if runs[last].is_empty() => {}
                false => runs.push(Vec::new()),
            }
        }
        for run in runs {
            let points = with_tangencies(&run);
            let mut open: Option<SheetPart> = None;
            for edge in points.windows(2) {
                let kind = match switches {
                    true => kind_between(&edge[0], &edge[1]),
                    false => SheetKind::Unknown,
                };
                if open.as_ref().is_some_and(|part| part.kind != kind) {
                    parts.extend(open.take());
                }
                let part = open.get_or_insert_with(|| SheetPart {
                    surface: j,
                    kind,
                    points: vec![edge[0]],
                });
                part.points.push(edge[1]);
            }
            parts.extend(open);
        }
        Ok(())
    }
}

fn kind_between(a: &SheetPoint, b: &SheetPoint) -> SheetKind {
    SheetKind::of(a.minus + b.minus, a.plus + b.plus)
}

/// The points with those between them at which a normal component vanishes, if it is linear in between.
fn with_tangencies(points: &[SheetPoint]) -> Vec<SheetPoint> {
    let mut all = Vec::with_capacity(points.len());
    for (index, at) in points.iter().enumerate() {
        if let Some(last) = index.checked_sub(1).map(|before| points[before]) {
            let zero = |a: f64, b: f64| (a * b < 0.0).then(|| a / (a - b));
            let zeros = [zero(last.minus, at.minus), zero(last.plus, at.plus)];
            let mut shares: Vec<f64> = zeros.into_iter().flatten().collect();
            sort_few(&mut shares, |a, b| a.total_cmp(b).is_lt());
            for share in shares {
                let between = |a: f64, b: f64| a + share * (b - a);
                let vanishes = |zero: Option<f64>| zero == Some(share);
                let exactly = |zero, value: f64| if vanishes(zero) { 0.0 } else { value };
                all.push(SheetPoint {
                    point: std::array::from_fn(|k| between(last.point[k], at.point[k])),
                    minus: exactly(zeros[0], between(last.minus, at.minus)),
                    plus: exactly(zeros[1], between(last.plus, at.plus)),
                });
            }
        }
        all.push(*at);
    }
    all
}

/// Points with at most two neighbours each.
#[derive(Default)]
struct Lines {
    points: Vec<[f64; 2]>,
    neighbours: Vec<Vec<usize>>,
}

impl Lines {
    fn add(&mut self, point: [f64; 2]) -> usize {
        self.points.push(point);
        self.neighbours.push(Vec::new());
        self.points.len() - 1
    }

    fn join(&mut self, a: usize, b: usize) {
        self.neighbours[a].push(b);
        self.neighbours[b].push(a);
    }

    /// The lines: open ones from end to end, closed ones with their first point again at the end.
    fn chains(&self) -> Vec<Vec<[f64; 2]>> {
        let mut is_used = vec![false; self.points.len()];
        let mut chains = Vec::new();
        let all = 0..self.points.len();
        let (ends, others): (Vec<_>, Vec<_>) = all.partition(|&p| self.neighbours[p].len() == 1);
        for start in ends.into_iter().chain(others) {
            if is_used[start] || self.neighbours[start].is_empty() {
                continue;
            }
            let (mut chain, mut here) = (Vec::new(), start);
            loop {
                is_used[here] = true;
                chain.push(self.points[here]);
                let next = self.neighbours[here].iter().find(|&&p| !is_used[p]);
                match next {
                    Some(&next) => here = next,
                    None => break,
                }
            }
            if chain.len() > 2 && self.neighbours[here].contains(&start) {
                chain.push(self.points[start]);
            }
            chains.push(chain);
        }
        chains
    }
}
