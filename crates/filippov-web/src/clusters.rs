//! Groups of points that lie near one another.

/// The group of each point, counted from 0 in the order of the first points: two points are in one group if a chain of points leads
/// from one to the other in which neighbours differ by at most `reach` in every component.
///
/// So the points of a cycle, which lie all along it, are one group.
pub fn clusters(points: &[Vec<f64>], reach: &[f64]) -> Vec<usize> {
    let mut parents: Vec<usize> = (0..points.len()).collect();
    let is_near = |a: &[f64], b: &[f64]| {
        let mut components = a.iter().zip(b).zip(reach);
        components.all(|((a, b), reach)| (a - b).abs() <= *reach)
    };
    for (b, point) in points.iter().enumerate() {
        for a in (0..b).filter(|&a| is_near(&points[a], point)) {
            let (root_a, root_b) = (root(&mut parents, a), root(&mut parents, b));
            parents[root_a.max(root_b)] = root_a.min(root_b);
        }
    }
    let (mut names, mut next) = (vec![None; points.len()], 0);
    let name = |index: usize| {
        *names[root(&mut parents, index)].get_or_insert_with(|| {
            next += 1;
            next - 1
        })
    };
    (0..points.len()).map(name).collect()
}

fn root(parents: &mut [usize], mut index: usize) -> usize {
    while parents[index] != index {
        parents[index] = parents[parents[index]];
        index = parents[index];
    }
    index
}

#[cfg(test)]
mod tests {
    use super::clusters;

    #[test]
    fn a_chain_of_neighbours_is_one_group() {
        let circle = (0..60).map(|k| f64::from(k) / 60.0 * std::f64::consts::TAU);
        let mut points: Vec<Vec<f64>> = circle.map(|a| vec![a.cos(), a.sin()]).collect();
        points.insert(7, vec![5.0, 0.0]);
        points.push(vec![5.0, 0.1]);
        let groups = clusters(&points, &[0.12, 0.12]);
        assert_eq!(groups[0], 0);
        assert_eq!((groups[7], groups[61]), (1, 1));
        assert_eq!(groups.iter().filter(|&&group| group == 0).count(), 60);
    }

    #[test]
    fn points_out_of_reach_are_apart_also_in_neighbouring_boxes() {
        let points = [vec![-0.05], vec![0.06], vec![0.155]];
        assert_eq!(clusters(&points, &[0.1]), [0, 1, 1]);
    }
}
