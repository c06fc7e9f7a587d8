//! Bodies of a moving scene whose objects follow no path that could be told before training: the parts of the moving positions that
//! stand apart from each other. Each gets a [common motion](super::common_motion), which begins at rest.

use glam::DVec3;

/// Distance at which positions are of one body, in median distances to the nearest other position: gaps of a hull are narrower.
const APART: f64 = 4.0;

/// Most positions that are looked at, evenly spread over all: every pair of them is.
pub const MOST: usize = 5000;

/// Least share of all positions that a body has: smaller parts are fragments of a hull.
const LEAST: f64 = 0.1;

/// The bodies among `positions`, each by the indices of its positions, the largest first; all as one body where no part is large enough.
pub fn bodies(positions: &[DVec3]) -> Vec<Vec<usize>> {
    let reach = APART * median_nearest(positions);
    let mut body = vec![usize::MAX; positions.len()];
    let mut found: Vec<Vec<usize>> = Vec::new();
    for start in 0..positions.len() {
        if body[start] != usize::MAX {
            continue;
        }
        body[start] = found.len();
        let mut members = vec![start];
        let mut next = 0;
        while let Some(&from) = members.get(next) {
            next += 1;
            for to in 0..positions.len() {
                if body[to] == usize::MAX && positions[from].distance_squared(positions[to]) <= reach * reach {
                    body[to] = found.len();
                    members.push(to);
                }
            }
        }
        found.push(members);
    }
    found.retain(|members| members.len() as f64 >= LEAST * positions.len() as f64);
    found.sort_by_key(|members| std::cmp::Reverse(members.len()));
    if found.is_empty() && !positions.is_empty() { vec![(0..positions.len()).collect()] } else { found }
}

/// Median over the positions of the distance to the nearest other one; 0 for fewer than two.
fn median_nearest(positions: &[DVec3]) -> f64 {
    let nearest = |i: usize| {
        let others = positions.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, other)| other.distance_squared(positions[i])).fold(f64::INFINITY, f64::min)
    };
    let mut distances: Vec<f64> = (0..positions.len()).map(nearest).filter(|d| d.is_finite()).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).map_or(0.0, |square| square.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(corner: DVec3, edge: i32) -> impl Iterator<Item = DVec3> {
        let places = (0..edge).flat_map(move |x| (0..edge).flat_map(move |y| (0..edge).map(move |z| [x, y, z])));
        places.map(move |place| corner + 0.1 * DVec3::from(place.map(f64::from)))
    }

    #[test]
    fn bodies_stand_apart_and_fragments_are_none() {
        let positions: Vec<DVec3> =
            cube(DVec3::ZERO, 4).chain(cube(DVec3::X * 2.0, 3)).chain([DVec3::Y * 5.0, DVec3::Y * 5.1]).collect();
        let found = bodies(&positions);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [64, 27]);
        assert!(found[1].iter().all(|index| positions[*index].x > 1.0));
    }

    #[test]
    fn few_or_equal_positions_are_one_body() {
        assert!(bodies(&[]).is_empty());
        assert_eq!(bodies(&[DVec3::ONE]), [[0]]);
        assert_eq!(bodies(&[DVec3::ONE; 5]), [[0, 1, 2, 3, 4]]);
        // Twenty pairs far from each other: none has a tenth of all, so they are one body.
        let pairs: Vec<DVec3> = (0..40).map(|i| DVec3::X * f64::from(100 * (i / 2) + i % 2)).collect();
        assert_eq!(bodies(&pairs), [(0..40).collect::<Vec<_>>()]);
    }
}
