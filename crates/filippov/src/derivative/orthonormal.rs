//! Orthonormal bases of what some columns span.

use crate::tolerances::GONE;
use crate::vectors::dot;

/// In which order the columns are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// As they are given.
    Given,
    /// The one with the longest part normal to those before.
    Longest,
    /// So many as they are given, and then the longest.
    GivenThenLongest(usize),
}

/// An orthonormal basis.
pub(super) struct Orthonormal {
    /// Its columns.
    pub columns: Vec<Vec<f64>>,
    /// Which of the given ones each of them was made of.
    pub order: Vec<usize>,
    /// The lengths of their parts normal to those before.
    pub lengths: Vec<f64>,
    /// Each of the columns as a combination of the given ones.
    pub change: Vec<Vec<f64>>,
    /// The length of the longest given one.
    longest: f64,
}

impl Orthonormal {
    /// Is the length of one of them rounding?
    pub fn has_rounding(&self) -> bool {
        self.lengths.iter().any(|&r| r <= GONE * self.longest)
    }
}

/// An orthonormal basis of the space of columns with n entries, of at most so many; by the method of Gram and Schmidt, each product
/// taken twice. Columns whose length is rounding are left out, but for [`Order::Given`], where no length of zero is allowed: then there
/// is none.
pub(super) fn orthonormal(
    columns: &[Vec<f64>],
    n: usize,
    most: usize,
    order: Order,
) -> Option<Orthonormal> {
    let count = columns.len();
    let unit = |i: usize| (0..count).map(move |k| f64::from(k == i));
    // Behind each column stands of which combination of the given ones it is made.
    let rows = columns.iter().enumerate();
    let mut rows: Vec<Vec<f64>> = rows
        .map(|(i, column)| column[..n].iter().copied().chain(unit(i)).collect())
        .collect();
    let length = |row: &[f64]| dot(&row[..n], &row[..n]).sqrt();
    let longest = rows.iter().map(|row| length(row)).fold(0.0, f64::max);
    let mut found = Orthonormal {
        columns: Vec::new(),
        order: Vec::new(),
        lengths: Vec::new(),
        change: Vec::new(),
        longest,
    };
    let mut open: Vec<usize> = (0..count).collect();
    let mut made: Vec<Vec<f64>> = Vec::new();
    while made.len() < most && !open.is_empty() {
        let is_given = match order {
            Order::Given => true,
            Order::Longest => false,
            Order::GivenThenLongest(known) => made.len() < known,
        };
        let by_length = |a: &usize, b: &usize| length(&rows[*a]).total_cmp(&length(&rows[*b]));
        let next = match is_given {
            true => 0,
            false => {
                let longest = open.iter().copied().max_by(by_length)?;
                open.iter().position(|&k| k == longest)?
            }
        };
        let k = open.remove(next);
        for unit in &made {
            subtract(&mut rows[k], unit, n);
        }
        let r = length(&rows[k]);
        if r == 0.0 || !is_given && r <= GONE * longest {
            if order == Order::Given {
                return None;
            }
            break;
        }
        let row: Vec<f64> = rows[k].iter().map(|v| v / r).collect();
        found.columns.push(row[..n].to_vec());
        found.change.push(row[n..].to_vec());
        found.order.push(k);
        found.lengths.push(r);
        for &other in &open {
            subtract(&mut rows[other], &row, n);
        }
        made.push(row);
    }
    Some(found)
}

fn subtract(row: &mut [f64], unit: &[f64], n: usize) {
    let product = dot(&row[..n], &unit[..n]);
    let entries = row.iter_mut().zip(unit);
    entries.for_each(|(entry, v)| *entry -= product * v);
}

/// The rank of a square matrix, given by its rows; numbers that are rounding beside `size` are zero.
pub(super) fn rank(rows: &[f64], n: usize, size: f64) -> usize {
    let is_there = |row: &&[f64]| row.iter().any(|v| v.abs() > GONE * size);
    let rows = rows.chunks_exact(n.max(1)).filter(is_there);
    let rows: Vec<Vec<f64>> = rows.map(<[f64]>::to_vec).collect();
    orthonormal(&rows, n, n, Order::Longest).map_or(0, |found| found.columns.len())
}
