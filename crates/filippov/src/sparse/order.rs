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
    let neighbours = neighbours(matrix);
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
        let mut order = walk.from(start);
        for _ in 0..2 {
            let end = order[order.len() - 1];
            order = walk.from(end);
        }
        order.reverse();
        for (place, &i) in order.iter().enumerate() {
            is_placed[i] = true;
            position[i] = place;
        }
        let distances = order.iter().flat_map(|&i| {
            let here = position[i];
            let others = neighbours[i].iter().map(|&j| position[j]);
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
        let block = matrix.principal(&unknowns);
        (unknowns, block)
    });
    parts.collect()
}

/// For each unknown the others it meets in a row or a column, those with few neighbours first.
fn neighbours(matrix: &SparseRows) -> Vec<Vec<usize>> {
    let mut lists: Vec<Vec<usize>> = vec![Vec::new(); matrix.n_rows()];
    for i in 0..matrix.n_rows() {
        for &j in matrix.columns(i).iter().filter(|&&j| j != i) {
            lists[i].push(j);
            lists[j].push(i);
        }
    }
    for list in &mut lists {
        list.sort_unstable();
        list.dedup();
    }
    let degrees: Vec<usize> = lists.iter().map(Vec::len).collect();
    for list in &mut lists {
        list.sort_by_key(|&j| degrees[j]);
    }
    lists
}

/// Breadth-first walks.
struct Walk<'a> {
    neighbours: &'a [Vec<usize>],
    /// The round in which an unknown was reached last.
    reached: Vec<usize>,
    round: usize,
}

impl Walk<'_> {
    fn from(&mut self, start: usize) -> Vec<usize> {
        self.round += 1;
        self.reached[start] = self.round;
        let mut order = vec![start];
        let mut next = 0;
        while next < order.len() {
            for &j in &self.neighbours[order[next]] {
                if self.reached[j] != self.round {
                    self.reached[j] = self.round;
                    order.push(j);
                }
            }
            next += 1;
        }
        order
    }
}
