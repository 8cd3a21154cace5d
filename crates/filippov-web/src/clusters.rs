//! Groups of points that lie near one another.

use std::collections::BTreeMap;

/// The group of each point, counted from 0 in the order of the first points: two points are in one group if a chain of points leads
/// from one to the other in which neighbours differ by at most `reach` in every component.
///
/// So the points of a cycle, which lie all along it, are one group.
pub fn clusters(points: &[Vec<f64>], reach: &[f64]) -> Vec<usize> {
    // Points in one box of the size of the reach, and in boxes beside it, are compared.
    let box_of = |point: &[f64]| -> Vec<i64> {
        let components = point.iter().zip(reach);
        components
            .map(|(value, reach)| (value / reach).floor() as i64)
            .collect()
    };
    let mut boxes: BTreeMap<Vec<i64>, Vec<usize>> = BTreeMap::new();
    for (index, point) in points.iter().enumerate() {
        boxes.entry(box_of(point)).or_default().push(index);
    }
    let mut parents: Vec<usize> = (0..points.len()).collect();
    let is_near = |a: &[f64], b: &[f64]| {
        let mut components = a.iter().zip(b).zip(reach);
        components.all(|((a, b), reach)| (a - b).abs() <= *reach)
    };
    for (place, own) in &boxes {
        for (other, members) in boxes.range(place.clone()..) {
            let first = other.first().zip(place.first());
            if first.is_some_and(|(other, place)| other - place > 1) {
                break;
            }
            let mut steps = other.iter().zip(place);
            if !steps.all(|(other, place)| (other - place).abs() <= 1) {
                continue;
            }
            for &a in own {
                for &b in members {
                    let (root_a, root_b) = (root(&mut parents, a), root(&mut parents, b));
                    if root_a != root_b && is_near(&points[a], &points[b]) {
                        parents[root_a.max(root_b)] = root_a.min(root_b);
                    }
                }
            }
        }
    }
    let mut names = BTreeMap::new();
    let roots = (0..points.len()).map(|index| root(&mut parents, index));
    let roots: Vec<usize> = roots.collect();
    for &root in &roots {
        let next = names.len();
        names.entry(root).or_insert(next);
    }
    roots.iter().map(|root| names[root]).collect()
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
