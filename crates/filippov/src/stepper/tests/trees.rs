//! Rooted trees, the elementary weights of methods, and what order asks of them.

/// A rooted tree by its branches, which are in order.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tree(Vec<Tree>);

impl Tree {
    /// Number of vertices.
    pub fn order(&self) -> usize {
        1 + self.0.iter().map(Tree::order).sum::<usize>()
    }

    /// The density: the order times the densities of the branches.
    pub fn density(&self) -> f64 {
        let branches = self.0.iter().map(Tree::density);
        self.order() as f64 * branches.product::<f64>()
    }

    /// The weights at the stages. A vertex with one branch takes `single`, with several `matrix`; for a Runge-Kutta
    /// method both are A, for a Rosenbrock method A + Gamma and A (Hairer, Wanner 1996, theorem IV.7.3).
    pub fn weights(&self, matrix: &[Vec<f64>], single: &[Vec<f64>]) -> Vec<f64> {
        let rows = if self.0.len() == 1 { single } else { matrix };
        let mut product = vec![1.0; matrix.len()];
        for branch in &self.0 {
            let inner = branch.weights(matrix, single);
            for (product, row) in product.iter_mut().zip(rows) {
                *product *= dot(row, &inner);
            }
        }
        product
    }
}

/// All trees up to an order: 1, 1, 2, 4, 9, 20, 48, 115 of orders 1, 2, ...
pub fn trees(order: usize) -> Vec<Tree> {
    let mut known = vec![Tree(Vec::new())];
    for size in 2..=order {
        let mut forests = Vec::new();
        collect_forests(&known, size - 1, 0, &mut Vec::new(), &mut forests);
        known.extend(forests.into_iter().map(Tree));
    }
    known
}

/// Multisets of trees with that many vertices together.
fn collect_forests(
    known: &[Tree],
    left: usize,
    from: usize,
    chosen: &mut Vec<Tree>,
    found: &mut Vec<Vec<Tree>>,
) {
    if left == 0 {
        found.push(chosen.clone());
        return;
    }
    for (i, tree) in known.iter().enumerate().skip(from) {
        if tree.order() <= left {
            chosen.push(tree.clone());
            collect_forests(known, left - tree.order(), i, chosen, found);
            chosen.pop();
        }
    }
}

/// Inner product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[test]
fn there_are_as_many_trees_as_there_should_be() {
    let all = trees(8);
    let counts: Vec<usize> = (1..=8)
        .map(|order| all.iter().filter(|tree| tree.order() == order).count())
        .collect();
    assert_eq!(counts, [1, 1, 2, 4, 9, 20, 48, 115]);
}
