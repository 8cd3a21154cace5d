//! Redundant contacts, as where friction closes a loop: multipliers that share the load.
//!
//! Two bodies that rub on the ground and on each other have three contacts and two velocities. At rest the equations
//! N s = -nu of their multipliers s then have many solutions or none, and those in [-1, 1] all give the same motion:
//! for friction N = -S D with S symmetric and semidefinite, D > 0 and diagonal, and what N does not see moves nothing.
//! Of the solutions one is taken that depends smoothly on the point, that of least norm (s, D C s) with C the
//! largest entries of the rows of N; the damped relay problem (`relay.rs`) finds the same one, and the least in the
//! cube where that is at a border. The contacts give way together, where no solution in the cube is left: with
//! S = L L^T and L w = nu that is so where some q has
//!
//! ```text
//! |q . w| > sum over i of D_i |q . L_i|,      L_i the rows of L.
//! ```
//!
//! Only those q matter that are normal to as many independent rows of L as fix their direction: the normals of the
//! facets of the image of the cube.
//!
//! Reference: G. M. Ziegler, *Lectures on Polytopes* (1995), section 7.3 (zonotopes); for the uniqueness of the motion,
//! Cottle, Pang, Stone, *The Linear Complementarity Problem* (1992), section 3.1.

use super::relay::{largest, negative, with_diagonal, RelayProblem, RelaySolution, SOLVED};
use crate::cube::{is_p_matrix, symmetrising_scale};
use crate::cube::{Matrix, Vector};
use crate::sparse::{coupled_blocks, is_positive_definite, SparseRows, SparseSolver};
use crate::tolerances::{DEFINITE_PIVOT, EPS, MOST_IN_LOOP, REDUNDANT_PIVOT};

/// The multipliers of surfaces some of which are redundant.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedLoad {
    /// Signs with N s = -nu, of least norm where there are several; not always in [-1, 1].
    pub signs: Vec<f64>,
    /// For each surface whose contacts share their load, the share of their strength that is not used:
    /// negative where they give way. `None` where the multiplier is the only one.
    pub reserves: Vec<Option<f64>>,
}

/// What the multipliers of surfaces follow from, for one N.
pub struct SharedLoads {
    normal: SparseRows,
    parts: Vec<Part>,
    /// Surfaces whose signs have no effect, as kinks: they are in the place of others that are slid on.
    idle: Vec<usize>,
}

/// Surfaces that act on one another.
struct Part {
    surfaces: Vec<usize>,
    block: SparseRows,
    law: PartLaw,
}

enum PartLaw {
    Determined(Box<SparseSolver>),
    Shared(Loop),
}

impl SharedLoads {
    /// `None` if the jumps are not those of friction, or if too many contacts close one loop.
    pub fn new(normal: &SparseRows) -> Option<Self> {
        let (acting, idle): (Vec<usize>, Vec<usize>) =
            (0..normal.n_rows()).partition(|&j| has_effect(normal, j));
        let parts = coupled_blocks(&normal.principal(&acting)).into_iter();
        let parts = parts.map(|(places, block)| {
            let mut solver = SparseSolver::default();
            let law = match solver.factor(&block) {
                Ok(()) => PartLaw::Determined(Box::new(solver)),
                Err(_) => PartLaw::Shared(Loop::new(&block)?),
            };
            Some(Part {
                surfaces: places.into_iter().map(|place| acting[place]).collect(),
                block,
                law,
            })
        });
        Some(SharedLoads {
            parts: parts.collect::<Option<_>>()?,
            normal: normal.clone(),
            idle,
        })
    }

    /// The N that it was made for.
    pub fn normal(&self) -> &SparseRows {
        &self.normal
    }

    /// Multipliers with N s = -nu, the rates being `rates` at the signs `here`; `None` if there are none.
    pub fn at(&mut self, rates: &[f64], here: &[f64]) -> Option<SharedLoad> {
        let (mut signs, mut reserves) = (here.to_vec(), vec![None; rates.len()]);
        for part in &mut self.parts {
            let of_part = |values: &[f64]| part.surfaces.iter().map(|&i| values[i]).collect();
            let (rates, here): (Vec<f64>, Vec<f64>) = (of_part(rates), of_part(here));
            let (found, reserve) = match &mut part.law {
                PartLaw::Determined(solver) => {
                    let mut change: Vec<f64> = rates.iter().map(|rate| -rate).collect();
                    solver.solve(&mut change);
                    let pairs = change.iter().zip(&here);
                    (pairs.map(|(change, here)| here + change).collect(), None)
                }
                PartLaw::Shared(contacts) => {
                    let nu = rates.iter().enumerate();
                    let nu: Vec<f64> = nu.map(|(i, v)| v - part.block.dot(i, &here)).collect();
                    let found = contacts.least_signs(&part.block, &nu)?;
                    (found, Some(contacts.reserve(&nu)))
                }
            };
            for (&i, sign) in part.surfaces.iter().zip(found) {
                (signs[i], reserves[i]) = (sign, reserve);
            }
        }
        self.idle.iter().for_each(|&i| signs[i] = 0.0);
        let change: Vec<f64> = signs.iter().zip(here).map(|(s, here)| s - here).collect();
        let slides = |&i: &usize| {
            let rate = rates[i] + self.normal.dot(i, &change);
            rate.abs() <= REDUNDANT_PIVOT.sqrt() * scale(&self.normal, i, rates[i], &change)
        };
        let all_slide = self.idle.iter().all(slides);
        all_slide.then_some(SharedLoad { signs, reserves })
    }
}

/// The size of a rate and of what signs contribute to it, and of the rounding of signs of size 1.
fn scale(normal: &SparseRows, i: usize, rate: f64, signs: &[f64]) -> f64 {
    let of_signs: f64 = normal.row(i).map(|(_, value)| value.abs()).sum();
    rate.abs() + normal.magnitude(i, signs) + EPS.sqrt() * of_signs
}

/// Does the sign of surface j act on any rate?
fn has_effect(normal: &SparseRows, j: usize) -> bool {
    (0..normal.n_rows()).any(|i| {
        let mut entries = normal.row(i);
        entries.any(|(k, value)| k == j && value.abs() > REDUNDANT_PIVOT * largest(normal, i))
    })
}

/// Is the motion that solves a relay problem with this N the only one, though its signs may not be? So it is if -N is a
/// P-matrix, or becomes symmetric and semidefinite by a scaling of the columns, in each component.
pub fn has_one_motion(normal: &SparseRows) -> bool {
    coupled_blocks(normal).into_iter().all(|(_, block)| {
        let block = negative(&block);
        is_p_matrix(&block) == Some(true) || is_semidefinite(&block)
    })
}

fn is_semidefinite(block: &SparseRows) -> bool {
    let Some(scale) = symmetrising_scale(block) else {
        return false;
    };
    let scaled = block.with_columns_scaled(&scale);
    let transposed = scaled.transposed();
    let is_symmetric = (0..scaled.n_rows()).all(|i| {
        scaled.row(i).all(|(j, value)| {
            let mirrored = transposed.row(i).find(|entry| entry.0 == j);
            let size = (scaled.diagonal(i) * scaled.diagonal(j)).sqrt();
            (value - mirrored.map_or(0.0, |entry| entry.1)).abs() <= REDUNDANT_PIVOT * size
        })
    });
    let more: Vec<f64> = (0..scaled.n_rows())
        .map(|i| -DEFINITE_PIVOT.sqrt() * scaled.diagonal(i))
        .collect();
    is_symmetric && is_positive_definite(&with_diagonal(&scaled, &more))
}

/// Do the surfaces whose contacts share a load stay together? Their gradients depend on one another as the rows of N do, so
/// that what is slid on are fewer surfaces than there are contacts. Rows of N alone may be dependent where motions differ.
pub(crate) fn stay_together(
    normal: &SparseRows,
    gradients: &SparseRows,
    sticking: &[usize],
) -> bool {
    let rows = |matrix: &SparseRows, places: &[usize]| {
        let picked = places.iter().map(|&place| matrix.row(sticking[place]));
        let picked = picked.map(|row| row.collect::<Vec<(usize, f64)>>());
        rank(picked.collect(), matrix.n_columns())
    };
    let parts = coupled_blocks(&normal.principal(sticking)).into_iter();
    let mut parts = parts.filter(|(_, block)| SparseSolver::default().factor(block).is_err());
    parts.all(|(places, _)| rows(gradients, &places) == rows(normal, &places))
}

/// The rank of a few sparse rows, each taken in units of its largest entry.
fn rank(rows: Vec<Vec<(usize, f64)>>, n_columns: usize) -> usize {
    let mut rows: Vec<Vec<f64>> = rows
        .into_iter()
        .map(|entries| {
            let size = entries
                .iter()
                .fold(0.0_f64, |size, (_, v)| size.max(v.abs()));
            let mut row = vec![0.0; n_columns];
            entries.iter().for_each(|&(j, v)| row[j] = v / size);
            row
        })
        .collect();
    let mut rank = 0;
    while rank < rows.len() {
        let largest = (rank..rows.len())
            .flat_map(|i| (0..n_columns).map(move |j| (i, j)))
            .max_by(|a, b| rows[a.0][a.1].abs().total_cmp(&rows[b.0][b.1].abs()));
        let Some((i, j)) = largest.filter(|&(i, j)| rows[i][j].abs() > REDUNDANT_PIVOT) else {
            break;
        };
        rows.swap(rank, i);
        let pivot = rows[rank].clone();
        for row in &mut rows[rank + 1..] {
            let factor = row[j] / pivot[j];
            row.iter_mut()
                .zip(&pivot)
                .for_each(|(v, p)| *v -= factor * p);
            row[j] = 0.0;
        }
        rank += 1;
    }
    rank
}

/// Makes the solution of a relay problem whose motion alone is unique one of modes: what does not slip sticks, though
/// its sign may be -1 or +1. Where the strength of all contacts together is just used up, the entries stay degenerate.
pub(super) fn let_stick(problem: &RelayProblem, solution: &mut RelaySolution) {
    let sticks = |i: &usize| {
        let rounding = SOLVED * problem.rounding(&solution.signs, *i);
        solution.modes[*i] == 0 || solution.rates[*i].abs() <= rounding
    };
    let sticking: Vec<usize> = (0..problem.nu.len()).filter(sticks).collect();
    let here: Vec<f64> = sticking.iter().map(|&i| solution.signs[i]).collect();
    let rates: Vec<f64> = sticking
        .iter()
        .map(|&i| problem.nu[i] + problem.n.dot(i, &solution.signs))
        .collect();
    let normal = problem.n.principal(&sticking);
    let is_singular = |block: &SparseRows| SparseSolver::default().factor(block).is_err();
    let loops = coupled_blocks(&normal).into_iter();
    let loops = loops.filter(|(_, block)| is_singular(block));
    solution.n_sharing = loops.map(|(surfaces, _)| surfaces.len()).max().unwrap_or(0);
    let loads = SharedLoads::new(&normal);
    let Some(shared) = loads.and_then(|mut loads| loads.at(&rates, &here)) else {
        return;
    };
    for (&i, reserve) in sticking.iter().zip(&shared.reserves) {
        if reserve.is_some_and(|reserve| reserve > REDUNDANT_PIVOT.sqrt()) {
            (solution.modes[i], solution.rates[i]) = (0, 0.0);
            solution.degenerate.retain(|&degenerate| degenerate != i);
        }
    }
}

/// Contacts of one component with -N = S D, S = L L^T of less than full rank.
struct Loop {
    /// The rows of L, as many entries each as its rank.
    rows: Vec<Vector>,
    /// Rows that determine the others, in the order of elimination.
    leading: Vec<usize>,
    /// D.
    strengths: Vec<f64>,
    /// C, the largest entries of the rows of N.
    sizes: Vec<f64>,
    /// The normals q of the facets, with what all contacts together can take in that direction.
    facets: Vec<(Vector, f64)>,
}

impl Loop {
    /// `None` if the jumps are not those of friction, or there are too many.
    fn new(normal: &SparseRows) -> Option<Self> {
        let m = normal.n_rows();
        if m > MOST_IN_LOOP {
            return None;
        }
        let scale = symmetrising_scale(&negative(normal))?;
        let mut rest = Matrix::zeros(m);
        for i in 0..m {
            normal
                .row(i)
                .for_each(|(j, value)| rest[(i, j)] = -value * scale[j]);
        }
        let sizes: Vec<f64> = (0..m).map(|i| rest[(i, i)]).collect();
        if !sizes.iter().all(|size| *size > 0.0) || !is_symmetric(&rest) {
            return None;
        }
        let (mut rows, mut leading) = (vec![Vector::new(); m], Vec::new());
        // Cholesky's factors with the largest pivot first.
        loop {
            let share = |i: &usize| rest[(*i, *i)] / sizes[*i];
            let candidates = (0..m).filter(|i| !leading.contains(i));
            let pivot = candidates.max_by(|a, b| share(a).total_cmp(&share(b)));
            let Some(pivot) = pivot.filter(|pivot| share(pivot) > REDUNDANT_PIVOT) else {
                break;
            };
            let root = rest[(pivot, pivot)].sqrt();
            let column: Vector = (0..m).map(|i| rest[(i, pivot)] / root).collect();
            for i in 0..m {
                let entry = if leading.contains(&i) { 0.0 } else { column[i] };
                rows[i].push(entry);
                for j in 0..m {
                    rest[(i, j)] -= column[i] * column[j];
                }
            }
            leading.push(pivot);
        }
        let is_left = |i: &usize| rest[(*i, *i)] < -REDUNDANT_PIVOT * sizes[*i];
        if (0..m).any(|i| is_left(&i)) {
            return None;
        }
        let strengths: Vec<f64> = scale.iter().map(|scale| 1.0 / scale).collect();
        Some(Loop {
            facets: facets(&rows, &strengths, leading.len()),
            rows,
            leading,
            strengths,
            sizes: (0..m).map(|i| largest(normal, i)).collect(),
        })
    }

    /// w with L w = nu.
    fn reduced(&self, nu: &[f64]) -> Vector {
        let mut w = Vector::new();
        for (k, &i) in self.leading.iter().enumerate() {
            let known: f64 = self.rows[i].iter().zip(&w).map(|(l, w)| l * w).sum();
            w.push((nu[i] - known) / self.rows[i][k]);
        }
        w
    }

    /// The solution of N s = -nu of least norm; `None` if there is none.
    fn least_signs(&self, normal: &SparseRows, nu: &[f64]) -> Option<Vec<f64>> {
        let first = self.solve(nu)?;
        let rest: Vec<f64> = (0..nu.len())
            .map(|i| nu[i] + normal.dot(i, &first))
            .collect();
        let size = |i: usize| scale(normal, i, nu[i], &first);
        if (0..nu.len()).any(|i| rest[i].abs() > REDUNDANT_PIVOT.sqrt() * size(i)) {
            return None;
        }
        // The matrix has the square of the condition of the contacts: one correction.
        let pairs = self.solve(&rest)?.into_iter().zip(first);
        Some(pairs.map(|(correction, sign)| sign + correction).collect())
    }

    /// s = C^-1 L u with (L^T D C^-1 L) u = w.
    fn solve(&self, nu: &[f64]) -> Option<Vec<f64>> {
        let rank = self.leading.len();
        let mut gram = Matrix::zeros(rank);
        let weights = self.strengths.iter().zip(&self.sizes);
        for (row, (strength, size)) in self.rows.iter().zip(weights) {
            for a in 0..rank {
                for b in 0..rank {
                    gram[(a, b)] += strength / size * row[a] * row[b];
                }
            }
        }
        let u = gram.solve(&self.reduced(nu))?;
        let rows = self.rows.iter().zip(&self.sizes);
        Some(rows.map(|(row, size)| dot(row, &u) / size).collect())
    }

    /// One less the part of the strength of all contacts together that the load takes.
    fn reserve(&self, nu: &[f64]) -> f64 {
        let w = self.reduced(nu);
        let used = self.facets.iter();
        let used = used.map(|(normal, strength)| dot(&w, normal).abs() / strength);
        1.0 - used.fold(0.0, f64::max)
    }
}

/// The facets of the image of the cube: normals to as many independent rows as fix a direction.
fn facets(rows: &[Vector], strengths: &[f64], rank: usize) -> Vec<(Vector, f64)> {
    let mut facets = Vec::new();
    for pattern in 0_u32..1 << rows.len() {
        if pattern.count_ones() as usize + 1 != rank {
            continue;
        }
        let chosen = (0..rows.len()).filter(|i| pattern >> i & 1 == 1);
        let chosen: Vec<&Vector> = chosen.map(|i| &rows[i]).collect();
        if let Some(normal) = common_normal(&chosen, rank) {
            let taken = rows.iter().zip(strengths);
            let taken = taken.map(|(row, strength)| strength * dot(row, &normal).abs());
            let strength = taken.sum();
            facets.push((normal, strength));
        }
    }
    facets
}

/// Is it, up to rounding, with the diagonal as the measure?
fn is_symmetric(matrix: &Matrix) -> bool {
    let pairs = (0..matrix.n()).flat_map(|i| (0..i).map(move |j| (i, j)));
    pairs.into_iter().all(|(i, j)| {
        let size = (matrix[(i, i)] * matrix[(j, j)]).sqrt();
        (matrix[(i, j)] - matrix[(j, i)]).abs() <= REDUNDANT_PIVOT * size
    })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The direction normal to n - 1 vectors of n entries; `None` if they are dependent.
fn common_normal(vectors: &[&Vector], n: usize) -> Option<Vector> {
    let mut rows: Vec<Vector> = vectors.iter().map(|v| (*v).clone()).collect();
    let mut free: Vec<usize> = (0..n).collect();
    let mut pivots = Vec::new();
    for k in 0..rows.len() {
        let size = dot(vectors[k], vectors[k]).sqrt();
        let (place, &column) = free
            .iter()
            .enumerate()
            .max_by(|a, b| rows[k][*a.1].abs().total_cmp(&rows[k][*b.1].abs()))?;
        if rows[k][column].abs() <= REDUNDANT_PIVOT.sqrt() * size {
            return None;
        }
        free.remove(place);
        pivots.push(column);
        let lead = rows[k].clone();
        for (other, row) in rows.iter_mut().enumerate() {
            let factor = row[column] / lead[column];
            if other != k && factor != 0.0 {
                row.iter_mut()
                    .zip(&lead)
                    .for_each(|(r, l)| *r -= factor * l);
            }
        }
    }
    let &[last] = free.as_slice() else {
        return None;
    };
    let mut normal: Vector = (0..n).map(|_| 0.0).collect();
    normal[last] = 1.0;
    for (row, &column) in rows.iter().zip(&pivots) {
        normal[column] = -row[last] / row[column];
    }
    Some(normal)
}

#[cfg(test)]
mod tests;
