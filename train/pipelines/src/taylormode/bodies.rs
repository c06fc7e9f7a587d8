//! Bodies of a moving scene whose objects follow no path that could be told before training: the parts of the moving
//! positions that stand apart from each other. Each gets a [common motion](super::common_motion), which begins at rest.

use std::num::NonZero;

use gs_base::median;
use gs_models::flux4d::actors::dbscan;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Distance at which positions are of one body, in median distances to the nearest other position: gaps of a hull are
/// narrower.
const APART: f64 = 4.0;

/// Least share of all positions that a body has: smaller parts are fragments of a hull.
const LEAST: f64 = 0.1;

/// The bodies among `positions`, each by the indices of its positions, the largest first; all as one body where no part
/// is large enough or most positions coincide.
pub fn bodies(positions: &[[f32; 3]]) -> Vec<Vec<usize>> {
    if positions.is_empty() {
        return Vec::new();
    }
    // One position is enough for a cluster, so that clusters are what hangs together.
    let labels = median_nearest(positions).and_then(|nearest| dbscan(positions, APART * nearest, 1).ok());
    let mut found: Vec<Vec<usize>> = Vec::new();
    for (index, label) in labels.iter().flatten().enumerate() {
        let label = label.expect("every position is of a cluster") as usize;
        found.resize_with(found.len().max(label + 1), Vec::new);
        found[label].push(index);
    }
    found.retain(|members| members.len() as f64 >= LEAST * positions.len() as f64);
    found.sort_by_key(|members| std::cmp::Reverse(members.len()));
    if found.is_empty() { vec![(0..positions.len()).collect()] } else { found }
}

/// Median over the positions of the distance to the nearest other one; `None` for fewer than two.
fn median_nearest(positions: &[[f32; 3]]) -> Option<f64> {
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(positions);
    // The nearest of all is the position itself.
    let two = NonZero::new(2).expect("a positive constant");
    let nearest = |position| {
        let near = tree.nearest_n::<SquaredEuclidean>(position, two);
        near.get(1).map(|other| f64::from(other.distance).sqrt())
    };
    median(positions.iter().filter_map(nearest).collect())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn cube(corner: Vec3, edge: i32) -> impl Iterator<Item = [f32; 3]> {
        let places = (0..edge).flat_map(move |x| (0..edge).flat_map(move |y| (0..edge).map(move |z| [x, y, z])));
        places.map(move |place| (corner + 0.1 * Vec3::from(place.map(|index| index as f32))).to_array())
    }

    #[test]
    fn bodies_stand_apart_and_fragments_are_none() {
        let fragment = [[0.0, 5.0, 0.0], [0.0, 5.1, 0.0]];
        let positions: Vec<[f32; 3]> = cube(Vec3::ZERO, 4).chain(cube(Vec3::X * 2.0, 3)).chain(fragment).collect();
        let found = bodies(&positions);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [64, 27]);
        assert!(found[1].iter().all(|index| positions[*index][0] > 1.0));
    }

    #[test]
    fn few_or_equal_positions_are_one_body() {
        assert!(bodies(&[]).is_empty());
        assert_eq!(bodies(&[[1.0; 3]]), [[0]]);
        assert_eq!(bodies(&[[1.0; 3]; 5]), [[0, 1, 2, 3, 4]]);
        // Twenty pairs far from each other: none has a tenth of all, so they are one body.
        let pairs: Vec<[f32; 3]> =
            (0..40_u8).map(|i| [100.0 * f32::from(i / 2) + f32::from(i % 2), 0.0, 0.0]).collect();
        assert_eq!(bodies(&pairs), [(0..40).collect::<Vec<_>>()]);
    }
}
