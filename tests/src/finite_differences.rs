//! Central differences, the judge of every gradient.

use burn::tensor::Tensor;

use crate::devices::Place;
use crate::tolerance::{GRADIENT_DIFFERENCES, largest, values};

/// Steps tried in turn until one agrees. The best differs by element: curvature wants a small one, rounding a large
/// one, and an image jumps where a pixel crosses the alpha cut-off within the step. A wrong gradient agrees with none.
const STEPS: [f64; 4] = [1e-5, 1e-6, 1e-4, 1e-7];

/// How a function runs within a step, which says how many of an argument's entries may need a step after the first. A
/// gradient that is only nearly right agrees by luck at a step whose error happens to match, so the steps may not hide
/// many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Smooth: every entry must agree at the first step.
    Smooth,
    /// With jumps, as an image has at the cut-off of alpha: a quarter of the entries beyond one of them may need a
    /// further step. The most measured was 4 of 16, a camera's: each of its entries moves every pixel past cut-offs.
    Cut,
}

impl Course {
    fn most(self, entries: u32) -> u32 {
        match self {
            Self::Smooth => 0,
            Self::Cut => 1 + entries / 4,
        }
    }
}

/// [`assert_course_derivative`] of an image, which may be cut.
#[track_caller]
pub fn assert_derivative(what: &str, at: &[f64], gradient: &[f64], samples: usize, f: impl Fn(&[f64]) -> f64) {
    assert_course_derivative(what, Course::Cut, at, gradient, samples, f);
}

/// Asserts that `gradient` is the derivative of `f` at `at`, for about `samples` elements spread over all of them, to
/// [`GRADIENT_DIFFERENCES`] of its largest entry.
#[track_caller]
pub fn assert_course_derivative(
    what: &str,
    course: Course,
    at: &[f64],
    gradient: &[f64],
    samples: usize,
    f: impl Fn(&[f64]) -> f64,
) {
    assert_eq!(at.len(), gradient.len(), "number of entries of the gradient by {what}");
    let scale = largest(gradient);
    assert!(scale > 0.0, "{what}: the gradient is all zero, the test would prove nothing");
    let mut x = at.to_vec();
    // A stride with no factor 2 or 3 visits every column of a row-major array of 3, 4, 8 or 48 columns.
    let stride = (at.len() / samples..).find(|s| s % 2 != 0 && s % 3 != 0).expect("there are many primes");
    let (mut entries, mut further) = (0_u32, 0_u32);
    for i in (0..at.len()).step_by(stride) {
        let mut tried = Vec::new();
        let agreed = STEPS.iter().any(|h| {
            x[i] = at[i] + h;
            let up = f(&x);
            x[i] = at[i] - h;
            let down = f(&x);
            x[i] = at[i];
            let difference = (up - down) / (2.0 * h);
            tried.push((*h, difference));
            (gradient[i] - difference).abs() <= GRADIENT_DIFFERENCES * scale
        });
        assert!(agreed, "{what}[{i}]: {}, largest {scale}; differences by step: {tried:?}", gradient[i]);
        entries += 1;
        further += u32::from(tried.len() > 1);
    }
    assert!(further <= course.most(entries), "{what}: {further} of {entries} entries disagree at the first step");
}

/// [`assert_course_derivatives`] of an image, which may be cut.
#[track_caller]
pub fn assert_derivatives<const N: usize>(
    what: &str,
    place: &Place,
    arguments: [(&str, &[f64]); N],
    samples: usize,
    f: impl Fn([Tensor<1>; N]) -> Tensor<1>,
) {
    assert_course_derivatives(what, Course::Cut, place, arguments, samples, f);
}

/// [`assert_course_derivative`] for a function of named arguments, by each of them. `f` receives flat leaves of
/// `place`, which it gives their shapes.
#[track_caller]
pub fn assert_course_derivatives<const N: usize>(
    what: &str,
    course: Course,
    place: &Place,
    arguments: [(&str, &[f64]); N],
    samples: usize,
    f: impl Fn([Tensor<1>; N]) -> Tensor<1>,
) {
    let leaves = |numbers: [&[f64]; N]| numbers.map(|numbers| place.leaf(numbers, [numbers.len()]));
    let at = arguments.map(|(_, numbers)| numbers);
    let tracked = leaves(at);
    let gradients = f(tracked.clone()).backward();
    for (k, (name, numbers)) in arguments.into_iter().enumerate() {
        let gradient = values(&tracked[k].grad(&gradients).expect("the function depends on every argument"));
        let what = format!("{name}, {what} on {}", place.name);
        assert_course_derivative(&what, course, numbers, &gradient, samples, |x| {
            let mut moved = at;
            moved[k] = x;
            values(&f(leaves(moved)))[0]
        });
    }
}
