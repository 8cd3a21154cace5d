//! Redundant contacts share a load: their multipliers are not determined one by one. Friction that closes a loop makes some.
//!
//! Two bodies that rub on the ground and on each other have three contacts and two velocities. At rest the equations
//! N s = -nu of their multipliers s then have many solutions or none, and those in [-1, 1] all give the same motion:
//! for friction N = -S D with S symmetric and semidefinite, D > 0 and diagonal, and what N does not see moves nothing.
//! Of the solutions one is taken that depends smoothly on the point, that of least norm (s, D C s) with C the
//! largest entries of the rows of N; the damped relay problem (`relay.rs`) finds the same one, and the least in the
//! cube where that is at a border.
//!
//! One elimination finds it. The rows of N (D C)^-1/2 are made orthonormal, the most independent first: N s = -nu is then
//! Q (D C)^1/2 s = c with c from as many equations as are independent, and s = (D C)^-1/2 Q^T c. The contacts give way
//! together, where c leaves the image of the cube: with g_i the columns of Q (D C)^1/2 that is so where some q has
//!
//! ```text
//! |q . c| > sum over i of |q . g_i|.
//! ```
//!
//! Only those q matter that are normal to as many independent g_i as fix their direction: the normals of the facets.
//!
//! Reference: G. M. Ziegler, *Lectures on Polytopes* (1995), section 7.3 (zonotopes); for the uniqueness of the motion,
//! Cottle, Pang, Stone, *The Linear Complementarity Problem* (1992), section 3.1.

use crate::cube::{is_p_matrix, symmetrising_scale};
use crate::page::IS_PAGE;
use crate::sparse::{coupled_blocks, is_positive_definite, SparseRows, SparseSolver};
use crate::tolerances::{DEFINITE_PIVOT, EPS, MOST_IN_LOOP};
use crate::vectors::dot;

/// The multipliers of surfaces some of which are redundant.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedLoad {
    /// Signs with N s = -nu, of least norm where there are several; not always in [-1, 1].
    pub signs: Vec<f64>,
    /// For each surface whose contacts share their load, the share of their strength that is not used:
    /// negative where they give way. `None` where the multiplier is the only one.
    pub reserves: Vec<Option<f64>>,
}

/// The surfaces of a loop, and for each facet the factors by which their nu count.
pub type PartsTaken = (Vec<usize>, Vec<Vec<f64>>);

/// What the multipliers of surfaces follow from, for one N.
#[derive(Clone)]
pub struct SharedLoads {
    normal: SparseRows,
    /// Surfaces with multipliers of their own, and their equations.
    regular: Vec<usize>,
    solver: SparseSolver,
    loops: Vec<Loop>,
    /// The signs of these surfaces act on no rate; they are kinks, for instance. Each coincides with a surface that the motion
    /// slides on.
    idle: Vec<usize>,
}

impl SharedLoads {
    /// `None` if the jumps are not those of friction.
    pub fn new(normal: &SparseRows) -> Option<Self> {
        let is_idle = idle(normal, |i| DEFINITE_PIVOT * largest(normal, i));
        let (idle, acting): (Vec<usize>, Vec<usize>) =
            (0..normal.n_rows()).partition(|&j| is_idle[j]);
        let (mut regular, mut loops) = (Vec::new(), Vec::new());
        for (places, block) in coupled_blocks(&normal.principal(&acting)) {
            let surfaces = places.into_iter().map(|place| acting[place]);
            match SparseSolver::default().factor(&block) {
                Ok(()) => regular.extend(surfaces),
                Err(_) => loops.push(Loop::new(surfaces.collect(), &block)?),
            }
        }
        regular.sort_unstable();
        let mut solver = SparseSolver::for_all_pivots();
        solver.factor(&normal.principal(&regular)).ok()?;
        Some(SharedLoads {
            normal: normal.clone(),
            regular,
            solver,
            loops,
            idle,
        })
    }

    /// The N that it was made for.
    pub fn normal(&self) -> &SparseRows {
        &self.normal
    }

    /// The surfaces whose signs act on no rate.
    pub fn idle(&self) -> &[usize] {
        &self.idle
    }

    /// The surfaces with multipliers of their own.
    pub fn regular(&self) -> &[usize] {
        &self.regular
    }

    /// For each loop, the parts of its strength that a load takes. Each part belongs to a facet and is a sum over the surfaces of the loop
    /// of a factor times nu. The reserve of the loop is one minus the largest size of a part. `None` if too many contacts share one load.
    pub fn parts_taken(&self) -> Option<Vec<PartsTaken>> {
        let parts = self.loops.iter().map(Loop::parts_taken);
        parts.collect()
    }

    /// The surfaces of the contacts that share a load.
    pub(super) fn loops(&self) -> impl Iterator<Item = &[usize]> {
        self.loops.iter().map(|contacts| &contacts.surfaces[..])
    }

    /// Multipliers with N s = -nu, 0 for those that act on no rate, the rates being `rates` at the signs `here`; `None` if there
    /// are none, or if too many contacts share one load.
    pub fn at(&mut self, rates: &[f64], here: &[f64]) -> Option<SharedLoad> {
        let (mut signs, mut reserves) = (here.to_vec(), vec![None; rates.len()]);
        let nu: Vec<f64> = (0..rates.len())
            .map(|i| rates[i] - self.normal.dot(i, here))
            .collect();
        let mut change: Vec<f64> = self.regular.iter().map(|&i| -rates[i]).collect();
        self.solver.solve(&mut change);
        for (&i, change) in self.regular.iter().zip(change) {
            signs[i] += change;
        }
        for contacts in &self.loops {
            if contacts.surfaces.len() > MOST_IN_LOOP {
                return None;
            }
            let load = contacts.load(&nu);
            for (place, &i) in contacts.surfaces.iter().enumerate() {
                signs[i] = contacts.sign(place, &load);
                reserves[i] = Some(contacts.reserve(&load));
            }
        }
        self.idle.iter().for_each(|&i| signs[i] = 0.0);
        let change: Vec<f64> = signs.iter().zip(here).map(|(s, here)| s - here).collect();
        let slides = |i: usize| {
            let of_signs: f64 = self.normal.row(i).map(|(_, value)| value.abs()).sum();
            let size = nu[i].abs() + self.normal.magnitude(i, &signs) + EPS.sqrt() * of_signs;
            let rate = rates[i] + self.normal.dot(i, &change);
            rate.abs() <= DEFINITE_PIVOT.sqrt() * size
        };
        (0..rates.len())
            .all(slides)
            .then_some(SharedLoad { signs, reserves })
    }
}

/// Which surfaces have a sign that acts on no rate by more than `noise` of that rate?
pub(super) fn idle(normal: &SparseRows, noise: impl Fn(usize) -> f64) -> Vec<bool> {
    let mut is_idle = vec![true; normal.n_rows()];
    for i in 0..normal.n_rows() {
        let noise = noise(i);
        let acting = normal.row(i).filter(|(_, value)| value.abs() > noise);
        acting.for_each(|(j, _)| is_idle[j] = false);
    }
    is_idle
}

/// The largest entry of a row.
pub(super) fn largest(matrix: &SparseRows, i: usize) -> f64 {
    matrix.row(i).fold(0.0, |size, (_, v)| size.max(v.abs()))
}

fn negative(matrix: &SparseRows) -> SparseRows {
    matrix.with_columns_scaled(&vec![-1.0; matrix.n_columns()])
}

/// Is the solution of a relay problem the only one?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Uniqueness {
    /// It is.
    Certain,
    /// There are others with the same rates, and so the same motion: redundant contacts share their load.
    OfMotion,
    /// Not known.
    Unknown,
}

/// Matrices about which is known how many solutions there are, those asked about last.
#[derive(Debug, Default)]
pub struct KnownUniqueness(Vec<(SparseRows, Uniqueness)>);

impl Clone for KnownUniqueness {
    /// A copy of a run finds out by itself.
    fn clone(&self) -> Self {
        KnownUniqueness::default()
    }
}

/// So many are kept: a run comes back to few sets of contacts that act on one another.
const MOST_KNOWN: usize = 8;

impl KnownUniqueness {
    /// What N says of the solutions, found now or before.
    pub(super) fn of(&mut self, normal: &SparseRows) -> Uniqueness {
        // What is found at once need not be kept.
        if normal.is_diagonal() || IS_PAGE {
            return uniqueness(normal);
        }
        let place = self.0.iter().position(|(known, _)| known == normal);
        let known = match place {
            Some(place) => self.0.remove(place),
            None => (normal.clone(), uniqueness(normal)),
        };
        let answer = known.1;
        self.0.truncate(MOST_KNOWN - 1);
        self.0.insert(0, known);
        answer
    }
}

/// What N says of the solutions for every nu: one if -N is a P-matrix, one motion if it is so in some components, and becomes
/// symmetric and semidefinite by a scaling of the columns in the others.
pub(super) fn uniqueness(normal: &SparseRows) -> Uniqueness {
    if normal.is_diagonal() && (0..normal.n_rows()).all(|i| normal.diagonal(i) < 0.0) {
        return Uniqueness::Certain;
    }
    let is_p = |block: &SparseRows| is_p_matrix(&negative(block)) == Some(true);
    if is_p(normal) {
        return Uniqueness::Certain;
    }
    let mut blocks = coupled_blocks(normal).into_iter();
    match blocks.all(|(_, block)| is_p(&block) || friction_scale(&block).is_some()) {
        true => Uniqueness::OfMotion,
        false => Uniqueness::Unknown,
    }
}

/// The scaling of columns that makes -N of one component symmetric and semidefinite: 1 / D.
fn friction_scale(normal: &SparseRows) -> Option<Vec<f64>> {
    let negative = negative(normal);
    let scale = symmetrising_scale(&negative)?;
    let scaled = negative.with_columns_scaled(&scale);
    let transposed = scaled.transposed();
    let sizes: Vec<f64> = (0..scaled.n_rows()).map(|i| scaled.diagonal(i)).collect();
    let is_symmetric = (0..scaled.n_rows()).all(|i| {
        scaled.row(i).all(|(j, value)| {
            let mirrored = transposed.row(i).find(|entry| entry.0 == j);
            let difference = value - mirrored.map_or(0.0, |entry| entry.1);
            difference.abs() <= DEFINITE_PIVOT * (sizes[i] * sizes[j]).sqrt()
        })
    });
    let less: Vec<f64> = sizes.iter().map(|v| -DEFINITE_PIVOT.sqrt() * v).collect();
    let is_friction = is_symmetric && is_positive_definite(&scaled.less_diagonal(&less));
    is_friction.then_some(scale)
}

/// Do the contacts of each loop stay together? The gradients of their surfaces depend on one another as the rows of N do, so
/// that what is slid on are fewer surfaces than there are contacts. Rows of N alone may be dependent where motions differ.
pub fn stay_together(normal: &SparseRows, gradients: &SparseRows, loops: &[Vec<usize>]) -> bool {
    let rank = |matrix: &SparseRows, contacts: &[usize]| {
        let rows: Vec<Vec<f64>> = contacts.iter().map(|&i| dense(matrix, i)).collect();
        independent(&rows).0.len()
    };
    let mut loops = loops.iter();
    loops.all(|contacts| rank(gradients, contacts) == rank(normal, contacts))
}

/// Contacts of one component with N of less than full rank.
#[derive(Clone)]
struct Loop {
    surfaces: Vec<usize>,
    /// Contacts that determine the others, in the order of elimination, with their rows in terms of Q.
    leading: Vec<(usize, Vec<f64>)>,
    /// The columns of Q, one for each contact.
    columns: Vec<Vec<f64>>,
    /// The roots of the weights of the norm.
    weights: Vec<f64>,
    /// The normals q of the facets, in units of what all contacts together can take in that direction.
    facets: Vec<Vec<f64>>,
}

impl Loop {
    /// `None` if the jumps are not those of friction.
    fn new(surfaces: Vec<usize>, normal: &SparseRows) -> Option<Self> {
        let scale = friction_scale(normal)?;
        let weight = |(i, scale): (usize, &f64)| (largest(normal, i) / scale).sqrt();
        let weights: Vec<f64> = scale.iter().enumerate().map(weight).collect();
        let inverse: Vec<f64> = weights.iter().map(|weight| 1.0 / weight).collect();
        let scaled = normal.with_columns_scaled(&inverse);
        let rows: Vec<Vec<f64>> = (0..weights.len()).map(|i| dense(&scaled, i)).collect();
        let (leading, directions) = independent(&rows);
        let in_terms = |vector: &[f64]| directions.iter().map(|q| dot(q, vector)).collect();
        let leading = leading.into_iter().map(|i| (i, in_terms(&rows[i])));
        let leading: Vec<(usize, Vec<f64>)> = leading.collect();
        let columns = (0..weights.len()).map(|i| directions.iter().map(|q| q[i]).collect());
        let columns: Vec<Vec<f64>> = columns.collect();
        let mut facets = Vec::new();
        if surfaces.len() <= MOST_IN_LOOP {
            let scaled = columns.iter().zip(&weights);
            let images = scaled.map(|(column, weight)| column.iter().map(|v| weight * v).collect());
            add_facets(&images.collect::<Vec<_>>(), 0, &mut Vec::new(), &mut facets);
        }
        Some(Loop {
            surfaces,
            leading,
            columns,
            weights,
            facets,
        })
    }

    /// c, the load in terms of Q.
    fn load(&self, nu: &[f64]) -> Vec<f64> {
        let own: Vec<f64> = self.surfaces.iter().map(|&i| nu[i]).collect();
        self.load_of(&own)
    }

    /// The same, from the rates of its own contacts.
    fn load_of(&self, nu: &[f64]) -> Vec<f64> {
        let mut load = Vec::with_capacity(self.leading.len());
        for (k, (i, row)) in self.leading.iter().enumerate() {
            let known = dot(&row[..k], &load);
            load.push((-nu[*i] - known) / row[k]);
        }
        load
    }

    /// The multiplier of a contact in the solution of least norm.
    fn sign(&self, place: usize, load: &[f64]) -> f64 {
        dot(&self.columns[place], load) / self.weights[place]
    }

    fn parts_taken(&self) -> Option<PartsTaken> {
        let loads = (0..self.surfaces.len()).map(|place| {
            let mut nu = vec![0.0; self.surfaces.len()];
            nu[place] = 1.0;
            self.load_of(&nu)
        });
        let loads: Vec<Vec<f64>> = loads.collect();
        let of_normal = |normal: &Vec<f64>| loads.iter().map(|load| dot(load, normal)).collect();
        let parts = self.facets.iter().map(of_normal);
        (!self.facets.is_empty()).then(|| (self.surfaces.clone(), parts.collect()))
    }

    /// One less the part of the strength of all contacts together that the load takes.
    fn reserve(&self, load: &[f64]) -> f64 {
        let used = self.facets.iter().map(|normal| dot(load, normal).abs());
        1.0 - used.fold(0.0, f64::max)
    }
}

/// The facets of the image of the cube: normals to as many independent images of its edges as fix a direction. `chosen` are
/// orthonormal and span those chosen before `from`.
fn add_facets(
    images: &[Vec<f64>],
    from: usize,
    chosen: &mut Vec<Vec<f64>>,
    facets: &mut Vec<Vec<f64>>,
) {
    let rank = images[0].len();
    if chosen.len() + 1 == rank {
        let unit = |k: usize| (0..rank).map(|i| f64::from(u8::from(i == k))).collect();
        let rests = (0..rank).map(|k| beside(unit(k), chosen));
        let Some(normal) = rests.max_by(|a, b| dot(a, a).total_cmp(&dot(b, b))) else {
            return;
        };
        let strength: f64 = images.iter().map(|image| dot(image, &normal).abs()).sum();
        facets.push(normal.iter().map(|v| v / strength).collect());
        return;
    }
    for i in from..images.len() {
        let rest = beside(images[i].clone(), chosen);
        let size = dot(&rest, &rest).sqrt();
        if size > DEFINITE_PIVOT.sqrt() * dot(&images[i], &images[i]).sqrt() {
            chosen.push(rest.iter().map(|v| v / size).collect());
            add_facets(images, i + 1, chosen, facets);
            chosen.pop();
        }
    }
}

/// Which rows determine the others, the most independent first, and the orthonormal vector that each adds to those before.
/// A row is redundant if the share of it that is left beside the others is rounding.
fn independent(rows: &[Vec<f64>]) -> (Vec<usize>, Vec<Vec<f64>>) {
    let size = |row: &[f64]| dot(row, row).sqrt();
    let (mut leading, mut basis) = (Vec::new(), Vec::new());
    let mut rest = rows.to_vec();
    loop {
        let share = |i: &usize| size(&rest[*i]) / size(&rows[*i]).max(f64::MIN_POSITIVE);
        let most = (0..rows.len()).max_by(|a, b| share(a).total_cmp(&share(b)));
        let Some(i) = most.filter(|i| share(i) > DEFINITE_PIVOT) else {
            return (leading, basis);
        };
        let length = size(&rest[i]);
        leading.push(i);
        basis.push(rest[i].iter().map(|v| v / length).collect());
        rest = rest.into_iter().map(|row| beside(row, &basis)).collect();
    }
}

/// What is left of a vector beside those that are orthonormal; twice, as rounding is left the first time.
fn beside(mut vector: Vec<f64>, orthonormal: &[Vec<f64>]) -> Vec<f64> {
    for own in orthonormal.iter().chain(orthonormal) {
        let share = dot(own, &vector);
        vector
            .iter_mut()
            .zip(own)
            .for_each(|(v, own)| *v -= share * own);
    }
    vector
}

/// A row with its zeros.
fn dense(matrix: &SparseRows, i: usize) -> Vec<f64> {
    let mut row = vec![0.0; matrix.n_columns()];
    matrix.row(i).for_each(|(j, value)| row[j] = value);
    row
}

#[cfg(test)]
mod tests;
