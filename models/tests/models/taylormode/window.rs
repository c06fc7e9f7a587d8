//! Outside the window no order may be worse than order 1, and inside the chosen one fits.

use gs_models::taylormode::window::{FADE, best_line, continued, polynomials, powers_of};

/// Frames of one recording, the middles of equal parts of the window.
const FRAMES: usize = 16;

type Motion = Box<dyn Fn(f64) -> f64>;

/// Motions in one coordinate over `s`.
fn motions() -> Vec<(&'static str, Motion)> {
    vec![
        ("sinusoid", Box::new(|s: f64| (2.0 * s + 0.4).sin())),
        ("sinusoid, one period", Box::new(|s: f64| (3.1 * s + 0.7).sin())),
        ("circle, x", Box::new(|s: f64| (2.5 * s).cos())),
        ("circle, y", Box::new(|s: f64| (2.5 * s).sin())),
        ("ballistic", Box::new(|s: f64| 0.7 * s - 1.3 * s * s)),
        ("bounce", Box::new(|s: f64| (2.0 * s).sin().abs())),
    ]
}

/// Coefficients `0..=order` of the least squares fit to the frames.
fn fit(motion: &dyn Fn(f64) -> f64, order: usize) -> Vec<f64> {
    let n = order + 1;
    let mut system = vec![vec![0.0; n + 1]; n];
    for frame in 0..FRAMES {
        let s = (frame as f64 + 0.5) * 2.0 / FRAMES as f64 - 1.0;
        let basis: Vec<f64> =
            std::iter::once(1.0).chain(polynomials(s, order).iter().map(|sample| sample.value)).collect();
        for i in 0..n {
            (0..n).for_each(|j| system[i][j] += basis[i] * basis[j]);
            system[i][n] += basis[i] * motion(s);
        }
    }
    // Gauss and Jordan; a Gram matrix needs no pivots.
    for i in 0..n {
        let pivot = system[i].clone();
        for (row, other) in system.iter_mut().enumerate() {
            let factor = other[i] / pivot[i];
            if row == i {
                other.iter_mut().for_each(|x| *x /= pivot[i]);
            } else {
                other.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
            }
        }
    }
    system.iter().map(|row| row[n]).collect()
}

fn position(coefficients: &[f64], s: f64) -> f64 {
    let series = coefficients[1..].iter().zip(polynomials(s, coefficients.len() - 1)).map(|(c, b)| c * b.value);
    coefficients[0] + series.sum::<f64>()
}

/// Root mean square and largest error over `|s|` in `range`.
fn errors(motion: &dyn Fn(f64) -> f64, coefficients: &[f64], range: [f64; 2]) -> [f64; 2] {
    let steps = 400;
    let places = (0..=steps).flat_map(|i| {
        let s = range[0] + (range[1] - range[0]) * i as f64 / steps as f64;
        [s, -s]
    });
    let errors: Vec<f64> = places.map(|s| (position(coefficients, s) - motion(s)).abs()).collect();
    let mean = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    [mean.sqrt(), errors.iter().fold(0.0, |a: f64, b| a.max(*b))]
}

#[test]
fn no_order_extrapolates_worse_than_order_one() {
    let mut worst = [0.0_f64; 2];
    for (name, motion) in motions() {
        let line = errors(&motion, &fit(&motion, 1), [1.0, 3.0]);
        for order in 2..=5 {
            let found = errors(&motion, &fit(&motion, order), [1.0, 3.0]);
            for i in 0..2 {
                worst[i] = worst[i].max(found[i] / line[i]);
                let what = ["mean", "largest"][i];
                let ratio = found[i] / line[i];
                assert!(ratio <= 1.1, "{name}: the {what} error of order {order} is {ratio:.3} times that of order 1");
            }
        }
    }
    println!("extrapolation against order 1: mean error up to {:.3}, largest up to {:.3} times", worst[0], worst[1]);
}

/// Without the continuation the same fits are useless outside, so the test above tests something.
#[test]
fn bare_polynomials_do_extrapolate_worse() {
    let motion = |s: f64| (3.1 * s + 0.7).sin();
    let [line, cubic] = [1, 5].map(|order| {
        let c = fit(&motion, order);
        let s: f64 = 2.0;
        let powers = |powers: &Vec<f64>| powers.iter().enumerate().map(|(k, p)| p * s.powi(k as i32 + 1)).sum::<f64>();
        let value = c[0] + c[1..].iter().zip(&powers_of(order)).map(|(c, p)| c * powers(p)).sum::<f64>();
        (value - motion(s)).abs()
    });
    assert!(cubic > 1.5 * line, "order 5 is off by {cubic}, order 1 by {line}");
}

#[test]
fn smooth_motion_is_met_inside_at_order_five() {
    for (name, motion) in motions().into_iter().filter(|(name, _)| *name != "bounce") {
        let [mean, _] = errors(&motion, &fit(&motion, 5), [0.0, 1.0]);
        // One percent of the motion's extent, which is 2.
        assert!(mean <= 0.02, "{name}: off by {mean}");
    }
}

#[test]
fn value_and_slope_are_continuous() {
    for order in 1..=12 {
        for edge in [-1.0, 1.0, -1.0 - FADE, 1.0 + FADE] {
            let at = |s: f64| *polynomials(s, order).last().expect("at least one polynomial");
            let (before, after) = (at(edge - 1e-9), at(edge + 1e-9));
            assert!((before.value - after.value).abs() < 1e-6, "value of order {order} at {edge}");
            assert!((before.slope - after.slope).abs() < 1e-6, "slope of order {order} at {edge}");
        }
    }
    // Order 1 is a straight line everywhere.
    for s in [-7.0, -1.2, 0.3, 1.1, 50.0] {
        let sample = polynomials(s, 1)[0];
        assert!((sample.value - s).abs() < 1e-12 && (sample.slope - 1.0).abs() < 1e-12, "s = {s}");
    }
}

#[test]
fn the_line_is_the_best_one() {
    for order in 1..=12 {
        let last = |s: f64| *polynomials(s, order).last().expect("at least one polynomial");
        let numeric = best_line(|s| last(s).value);
        let far = 10.0;
        // Far outside, a polynomial is its line.
        assert!((numeric[0] + numeric[1] * far - last(far).value).abs() < 1e-6, "line of order {order}");
    }
    let untouched = continued(
        0.5,
        || unreachable!("inside the window there is no line"),
        |s| gs_models::taylormode::window::Sample { value: s, slope: 1.0 },
    );
    assert_eq!(untouched.value, 0.5);
}

/// Their slopes are derivatives, they are zero at the centre, and Taylor's coefficients give the same values.
#[test]
fn polynomials_are_sums_of_powers() {
    const ORDER: usize = 12;
    for i in -10..=10 {
        let s = f64::from(i) / 10.0;
        let [before, here, after] = [s - 1e-6, s, s + 1e-6].map(|s| polynomials(s.clamp(-1.0, 1.0), ORDER));
        let width = (s + 1e-6).min(1.0) - (s - 1e-6).max(-1.0);
        for (k, powers) in powers_of(ORDER).iter().enumerate() {
            let sum: f64 = powers.iter().enumerate().map(|(j, factor)| factor * s.powi(j as i32 + 1)).sum();
            assert!((sum - here[k].value).abs() < 1e-11, "order {} at {s}: {sum} {:?}", k + 1, here[k]);
            let difference = (after[k].value - before[k].value) / width;
            // Differences at the edges are one-sided: half a step times the curvature, at most k^3 / 3.
            assert!((difference - here[k].slope).abs() < 1e-3, "order {} at {s}: {difference} {:?}", k + 1, here[k]);
        }
    }
    assert!(polynomials(0.0, ORDER).iter().all(|sample| sample.value == 0.0));
}
