//! Connected components of a matrix, ordered for small bandwidth.

use super::SparseRows;

/// Unknowns that are coupled with one another and with no others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Component {
    /// Its unknowns in the order of elimination.
    pub unknowns: Vec<usize>,
    /// Largest distance from the diagonal of an entry in that order.
    pub bandwidth: usize,
}

/// The connected components of a square matrix, each in the order of Cuthill and McKee, reversed.
///
/// The order starts at an end of the component, found by walking to its farthest unknown twice. The graph is
/// that of the entries of A and its transpose.
///
/// Reference: Cuthill, McKee, *Reducing the bandwidth of sparse symmetric matrices* (1969); George, Liu (1981).
pub fn components(matrix: &SparseRows) -> Vec<Component> {
    let neighbours = Neighbours::of(matrix);
    let mut walk = Walk {
        neighbours: &neighbours,
        reached: vec![usize::MAX; neighbours.len()],
        round: 0,
    };
    let mut is_placed = vec![false; neighbours.len()];
    let mut position = vec![0; neighbours.len()];
    let mut found = Vec::new();
    for start in 0..neighbours.len() {
        if is_placed[start] {
            continue;
        }
        let mut order = Vec::new();
        walk.from(start, &mut order);
        if order.len() > 1 {
            for _ in 0..2 {
                let end = order[order.len() - 1];
                walk.from(end, &mut order);
            }
        }
        order.reverse();
        for (place, &i) in order.iter().enumerate() {
            is_placed[i] = true;
            position[i] = place;
        }
        let distances = order.iter().flat_map(|&i| {
            let here = position[i];
            let others = neighbours.of_unknown(i).iter().map(|&j| position[j]);
            others.map(move |there| here.abs_diff(there))
        });
        let bandwidth = distances.max().unwrap_or(0);
        found.push(Component {
            unknowns: order,
            bandwidth,
        });
    }
    found
}

/// The components with what couples their unknowns, which are in increasing order.
pub fn coupled_blocks(matrix: &SparseRows) -> Vec<(Vec<usize>, SparseRows)> {
    let parts = components(matrix).into_iter().map(|component| {
        let mut unknowns = component.unknowns;
        unknowns.sort_unstable();
        let block = matrix.principal(&unknowns).into_owned();
        (unknowns, block)
    });
    parts.collect()
}

impl SparseRows {
    /// The unknowns in blocks of at most `most` that are not coupled with one another, in increasing order.
    pub(crate) fn in_small_blocks(&self, most: usize) -> Vec<usize> {
        let blocks = components(self).into_iter().map(|block| block.unknowns);
        let mut found: Vec<usize> = blocks
            .filter(|block| block.len() <= most)
            .flatten()
            .collect();
        found.sort_unstable();
        found
    }
}

/// For each unknown the others that it meets in a row or a column, those with few neighbours first.
struct Neighbours {
    /// Where the list of each unknown starts in `lists`, and where it ends.
    ranges: Vec<(usize, usize)>,
    lists: Vec<usize>,
}

impl Neighbours {
    fn of(matrix: &SparseRows) -> Self {
        let n = matrix.n_rows();
        let mut degrees = vec![0; n];
        for i in 0..n {
            for &j in matrix.columns(i).iter().filter(|&&j| j != i) {
                degrees[i] += 1;
                degrees[j] += 1;
            }
        }
        let mut ranges = Vec::with_capacity(n);
        let mut start = 0;
        for &degree in &degrees {
            ranges.push((start, start));
            start += degree;
        }
        let mut lists = vec![0; start];
        let mut add = |i: usize, j: usize| {
            lists[ranges[i].1] = j;
            ranges[i].1 += 1;
        };
        for i in 0..n {
            for &j in matrix.columns(i).iter().filter(|&&j| j != i) {
                add(i, j);
                add(j, i);
            }
        }
        // An unknown that is met in a row and in a column is in the list twice.
        for range in &mut ranges {
            let list = &mut lists[range.0..range.1];
            list.sort_unstable();
            let mut kept = 0;
            for k in 0..list.len() {
                if k == 0 || list[k] != list[kept - 1] {
                    list[kept] = list[k];
                    kept += 1;
                }
            }
            range.1 = range.0 + kept;
        }
        let degree = |j: usize| ranges[j].1 - ranges[j].0;
        for &(start, end) in &ranges {
            lists[start..end].sort_by_key(|&j| degree(j));
        }
        Neighbours { ranges, lists }
    }

    fn len(&self) -> usize {
        self.ranges.len()
    }

    fn of_unknown(&self, i: usize) -> &[usize] {
        let (start, end) = self.ranges[i];
        &self.lists[start..end]
    }
}

/// Breadth-first walks.
struct Walk<'a> {
    neighbours: &'a Neighbours,
    /// The round in which an unknown was reached last.
    reached: Vec<usize>,
    round: usize,
}

impl Walk<'_> {
    /// Writes the unknowns that are reached from `start`, in order.
    fn from(&mut self, start: usize, order: &mut Vec<usize>) {
        self.round += 1;
        self.reached[start] = self.round;
        order.clear();
        order.push(start);
        let mut next = 0;
        while next < order.len() {
            for &j in self.neighbours.of_unknown(order[next]) {
                if self.reached[j] != self.round {
                    self.reached[j] = self.round;
                    order.push(j);
                }
            }
            next += 1;
        }
    }
}
