//! The moving scene with the exposure that was learned beside it.

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_models::DynamicScene;
use gs_models::basis::MotionBasis;
use gs_models::taylormode::TaylorScene;

/// A moving scene that knows how long the shutter was open.
#[derive(Debug)]
pub struct ExposedScene {
    /// The scene.
    pub scene: TaylorScene,
    /// The exposure, the data set's unit of time.
    pub exposure: f64,
}

impl DynamicScene for ExposedScene {
    fn at(&self, t: f64) -> Gaussians {
        self.scene.at(t)
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        self.scene.velocity(t)
    }

    fn span(&self) -> Option<[f64; 2]> {
        self.scene.span()
    }

    fn at_times(&self, times: &[f64]) -> Vec<Gaussians> {
        self.scene.at_times(times)
    }

    fn basis(&self) -> Option<MotionBasis> {
        self.scene.basis()
    }

    fn exposure(&self) -> Option<f64> {
        Some(self.exposure)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor};
    use gs_models::taylormode::window::{described_powers, polynomials, powers_of};
    use gs_models::taylormode::{Contact, Remainder};
    use gs_splats::TimeFunction;

    use gs_train::run::exchange::time_function;

    /// Inside the window, at its edges, in the return past them and beyond it.
    const TIMES: [f64; 11] = [-2.0, -1.1, -1.0, -0.3, 0.0, 0.45, 0.9, 1.0, 1.05, 1.2, 1.9];

    /// Both sides compute in f64 with some ten operations of numbers below ten.
    #[test]
    fn functions_of_files_are_those_of_the_model() {
        let none = Tensor::zeros([1, 3], &Device::flex());
        let remainder = Remainder { weights: none, order: 3 };
        let contacts = [Contact { near: 0.2, far: 0.7 }, Contact { near: -0.1, far: -0.4 }];
        let described =
            described_powers(4).into_iter().chain(remainder.described()).chain(contacts.iter().map(Contact::described));
        let functions: Vec<TimeFunction> = described.map(|function| time_function(&function)).collect();
        for s in TIMES {
            let exact = polynomials(s, 4)
                .into_iter()
                .chain(remainder.functions(s))
                .chain(contacts.iter().map(|contact| contact.ramp(s)))
                .map(|sample| sample.value);
            let mut values: Vec<f64> = functions.iter().map(|function| function.at(s)).collect();
            let powers = values[..4].to_vec();
            let sum = |factors: Vec<f64>| factors.iter().zip(&powers).map(|(factor, power)| factor * power).sum();
            values.splice(..4, powers_of(4).into_iter().map(sum));
            for (index, (value, exact)) in values.into_iter().zip(exact).enumerate() {
                assert!((value - exact).abs() < 1e-12, "function {index} at s = {s}: {value}, not {exact}");
            }
        }
    }
}
