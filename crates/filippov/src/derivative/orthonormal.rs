//! Orthonormal bases of what some columns span.

use crate::tolerances::GONE;
use crate::vectors::dot;

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
}

/// Which columns become part of a basis.
#[derive(Clone, Copy)]
pub(super) struct Choice {
    /// So many of them are taken in their order; then that with the longest part normal to those before.
    pub in_order: usize,
    /// So many at most.
    pub most: usize,
    /// Those whose normal part is rounding beside this number or beside the longest column are left out; else only those where it is
    /// zero.
    pub size: Option<f64>,
}

/// An orthonormal basis of what columns with n entries span, by the method of Gram and Schmidt, each product taken twice.
pub(super) fn orthonormal(columns: &[Vec<f64>], n: usize, choice: Choice) -> Orthonormal {
    let count = columns.len();
    let unit = |i: usize| (0..count).map(move |k| f64::from(u8::from(k == i)));
    // Behind each column stands of which combination of the given ones it is made.
    let rows = columns.iter().enumerate();
    let mut rows: Vec<Vec<f64>> = rows
        .map(|(i, column)| column[..n].iter().copied().chain(unit(i)).collect())
        .collect();
    let length = |row: &[f64]| dot(&row[..n], &row[..n]).sqrt();
    let longest = rows.iter().map(|row| length(row)).fold(0.0, f64::max);
    let shortest = choice.size.map_or(0.0, |size| GONE * longest.max(size));
    let mut found = Orthonormal {
        columns: Vec::new(),
        order: Vec::new(),
        lengths: Vec::new(),
        change: Vec::new(),
    };
    let mut open: Vec<usize> = (0..count).collect();
    let mut made: Vec<Vec<f64>> = Vec::new();
    while made.len() < choice.most && !open.is_empty() {
        let longer = |a: &usize, b: &usize| {
            let (a, b) = (length(&rows[open[*a]]), length(&rows[open[*b]]));
            a.total_cmp(&b)
        };
        let next = match open[0] < choice.in_order {
            true => 0,
            false => (0..open.len()).max_by(longer).unwrap_or(0),
        };
        let k = open.remove(next);
        for unit in &made {
            subtract(&mut rows[k], unit, n);
        }
        let r = length(&rows[k]);
        if r <= shortest {
            continue;
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
    found
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
    let longest_first = Choice {
        in_order: 0,
        most: n,
        size: Some(size),
    };
    orthonormal(&rows, n, longest_first).columns.len()
}
