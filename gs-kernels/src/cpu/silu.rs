//! The activation SiLU, `y = x s(x)` with `s(x) = 1 / (1 + exp(-x))`, in one pass each way, sixteen numbers at once.

use rayon::prelude::*;

use crate::cpu::Real;
use crate::cpu::real::{LANES, LaneTask, Lanes, Number};

/// Numbers per task; a task is about 10 microseconds.
const BLOCK: usize = 1 << 14;

/// `y` of each of `values`.
pub fn forward<F: Real>(values: &[F]) -> Vec<F> {
    let mut out = vec![F::ZERO; values.len()];
    out.par_chunks_mut(BLOCK)
        .zip(values.par_chunks(BLOCK))
        .for_each(|(out, values)| F::with_lanes(Forward { values, out }));
    out
}

/// The gradient by `values` from `v` by the results: `v s (1 + x (1 - s))`.
///
/// # Panics
/// When there is not one gradient for each value.
pub fn backward<F: Real>(values: &[F], v: &[F]) -> Vec<F> {
    assert_eq!(values.len(), v.len(), "a gradient for each value");
    let mut out = vec![F::ZERO; values.len()];
    out.par_chunks_mut(BLOCK)
        .zip(values.par_chunks(BLOCK).zip(v.par_chunks(BLOCK)))
        .for_each(|(out, (values, v))| F::with_lanes(Backward { values, v, out }));
    out
}

struct Forward<'a, F> {
    values: &'a [F],
    out: &'a mut [F],
}

impl<F: Real> LaneTask<F> for Forward<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        each::<F, L, _>(self.out, [self.values], |[x]| x.mul(gate(x)));
    }
}

struct Backward<'a, F> {
    values: &'a [F],
    v: &'a [F],
    out: &'a mut [F],
}

impl<F: Real> LaneTask<F> for Backward<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        each::<F, L, _>(self.out, [self.values, self.v], |[x, v]| {
            let (s, one) = (gate(x), L::splat(F::ONE));
            v.mul(s).mul(x.mul_add(one.sub(s), one))
        });
    }
}

/// `s(x)`, from an exponential that cannot overflow.
#[inline(always)]
fn gate<L: Lanes>(x: L) -> L {
    let (zero, one) = (L::splat(L::Real::of(0.0)), L::splat(L::Real::of(1.0)));
    let e = x.abs().mul(L::splat(L::Real::of(-std::f64::consts::LOG2_E))).exp2_nonpositive();
    let above = one.div(one.add(e));
    L::select(x.ge(zero), above, e.mul(above))
}

/// `f` of each sixteen of `inputs`, into `out`; all are of one length.
#[inline(always)]
fn each<F: Real, L: Lanes<Real = F>, const N: usize>(out: &mut [F], inputs: [&[F]; N], f: impl Fn([L; N]) -> L) {
    let (whole, rest) = out.as_chunks_mut::<LANES>();
    let begun = whole.len() * LANES;
    for (block, out) in whole.iter_mut().enumerate() {
        f(inputs.map(|input| L::load(&input.as_chunks().0[block]))).store(out);
    }
    let padded = |input: &[F]| {
        let mut sixteen = [F::ZERO; LANES];
        sixteen[..rest.len()].copy_from_slice(&input[begun..]);
        L::load(&sixteen)
    };
    if !rest.is_empty() {
        let last = f(inputs.map(padded)).to_array();
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the formula in `f64`. An `f32` result has the error of an exponential, 2e-7, and of four roundings.
    #[test]
    fn values_and_slopes_are_those_of_the_formula() {
        let values: Vec<f64> = (0..777).map(|k| 0.1 * f64::from(k) - 38.8).chain([-700.0, 700.0]).collect();
        let s = |x: f64| 1.0 / (1.0 + (-x).exp());
        let expected: Vec<f64> = values.iter().map(|x| x * s(*x)).collect();
        let slopes: Vec<f64> = values.iter().map(|x| 3.0 * s(*x) * (1.0 + x * (1.0 - s(*x)))).collect();
        let near = |found: f64, expected: f64, bound: f64| (found - expected).abs() <= bound * expected.abs().max(1e-6);
        let gradients = vec![3.0; values.len()];
        let (found, by) = (forward(&values), backward(&values, &gradients));
        assert!(found.iter().zip(&expected).all(|(a, b)| near(*a, *b, 1e-14)));
        // Near its zero at -1.28 the slope is a difference of numbers of size 1.
        assert!(by.iter().zip(&slopes).all(|(a, b)| near(*a, *b, 1e-14) || (a - b).abs() < 1e-15));
        let single: Vec<f32> = values.iter().map(|x| *x as f32).collect();
        let (found, by) = (forward(&single), backward(&single, &vec![3.0; single.len()]));
        assert!(found.iter().zip(&expected).all(|(a, b)| near((*a).into(), *b, 1e-5)));
        assert!(by.iter().zip(&slopes).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5));
    }
}
