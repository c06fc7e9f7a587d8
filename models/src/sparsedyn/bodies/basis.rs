//! Functions of time that a free motion is a sum of.

/// Numbers of a motion by each function of time: a shift and a rotation vector.
pub const MOTION: usize = 6;

/// Columns of an even and of an accelerated motion before those of the spline.
pub const EVEN: usize = 2;

/// Values at `time` of the functions that a free motion with `knots` knots over `span` is a sum of: time since the
/// first frame, half its square, and `knots` smooth steps. All are zero in the first frame.
///
/// A step at a later knot changes nothing before it, so that what was learned of early times holds later ones until
/// they are seen.
pub fn free(span: [f64; 2], knots: usize, time: f64) -> Vec<f64> {
    let s = time - span[0];
    let (now, first) = (steps(span, knots + 1, time), steps(span, knots + 1, span[0]));
    let steps = now.iter().zip(&first).skip(1).map(|(now, first)| now - first);
    [s, 0.5 * s * s].into_iter().chain(steps).collect()
}

/// Sums of each of `knots` cubic B-splines and all later ones; the first is 1 at all times.
fn steps(span: [f64; 2], knots: usize, time: f64) -> Vec<f64> {
    let mut values = spline(span, knots, time);
    for k in (1..knots).rev() {
        values[k - 1] += values[k];
    }
    values
}

/// Values at `time` of `knots` cubic B-splines over `span`; outside it those at its nearer end. They sum to 1.
fn spline([first, last]: [f64; 2], knots: usize, time: f64) -> Vec<f64> {
    let mut basis = vec![0.0; knots];
    if knots < 4 {
        if let Some(constant) = basis.first_mut() {
            *constant = 1.0;
        }
        return basis;
    }
    let parts = (knots - 3) as f64;
    let share = if last > first { ((time - first) / (last - first)).clamp(0.0, 1.0) } else { 0.0 };
    let position = (share * parts).min(parts - 1e-9);
    let part = position.floor();
    let x = position - part;
    let weights = [
        (1.0 - x).powi(3) / 6.0,
        (3.0 * x.powi(3) - 6.0 * x * x + 4.0) / 6.0,
        (-3.0 * x.powi(3) + 3.0 * x * x + 3.0 * x + 1.0) / 6.0,
        x.powi(3) / 6.0,
    ];
    basis[part as usize..part as usize + 4].copy_from_slice(&weights);
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_sum_to_one_and_are_smooth() {
        for knots in [1, 4, 5, 9] {
            let mut before: Option<Vec<f64>> = None;
            for k in 0..=200 {
                let time = -0.1 + 1.2 * f64::from(k) / 200.0;
                let basis = spline([0.0, 1.0], knots, time);
                assert!((basis.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                if let Some(before) = before {
                    assert!(basis.iter().zip(before).all(|(a, b)| (a - b).abs() < 0.05), "{knots} knots at {time}");
                }
                before = Some(basis);
            }
        }
        assert!(spline([0.0, 1.0], 0, 0.3).is_empty());
    }

    #[test]
    fn a_free_motion_begins_at_rest_and_later_steps_change_no_earlier_time() {
        let span = [0.2, 1.0];
        assert_eq!(free(span, 8, 0.2), vec![0.0; EVEN + 8]);
        assert_eq!(free(span, 0, 0.7).len(), EVEN);
        let early = free(span, 8, 0.4);
        assert!(early[EVEN..].last().is_some_and(|step| step.abs() < 1e-12) && early[EVEN] > 0.0);
        let [end, after] = [1.0, 1.4].map(|time| free(span, 8, time)[EVEN..].to_vec());
        assert_eq!(end, after, "the spline rests after the last frame");
    }
}
