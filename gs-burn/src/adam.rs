//! Adam (Kingma and Ba 2015) for any module, with a rate for each path and moments that follow rows.
//!
//! Burn's own optimisers keep moments by parameter id and tensor shape. Training copies and removes Gaussians, and an
//! optimiser that cannot follow would restart each time. The moments are therefore kept here by path, and
//! [`Adam::follow`] changes their rows. The update itself is [`adam_step`], which works in place.
//!
//! ```
//! use burn::module::Module;
//! use gs_burn::adam::{Adam, AdamRate};
//! use gs_burn::NamedGradients;
//! # use burn::tensor::Tensor;
//! # fn one_step<M: Module>(module: M, mut adam: Adam, loss: impl Fn(&M) -> Tensor<1>) -> (M, Adam) {
//! // The module lives outside autodiff; its parameters are leaves of one step's graph.
//! let tracked = module.clone().train();
//! let mut gradients = loss(&tracked).backward();
//! let gradients = NamedGradients::take(&tracked, &mut gradients);
//! // Nobody else may hold a tensor that is to be updated in place.
//! drop(tracked);
//! let module = adam.step(module, gradients, |path| match path {
//!     "gaussians.means" => Some(AdamRate::new(1.6e-4)),
//!     path if path.starts_with("gaussians.") => Some(AdamRate::new(1e-3)),
//!     _ => None,
//! });
//! # (module, adam) }
//! ```

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::Tensor;

use crate::named_parameters::{NamedGradients, map_parameters};
use crate::ops::adam::{AdamConfig, FirstColumns, adam_step};
use crate::row_map::RowMap;

/// Learning rate and decays of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdamRate {
    /// Learning rate, in the parameter's unit per step. With 0 the moments are updated and the parameter is not.
    pub lr: f64,
    /// Decay of the first moment, 0 to 1.
    pub beta1: f64,
    /// Decay of the second moment, 0 to 1.
    pub beta2: f64,
    /// Added to the root of the second moment; keeps a parameter without gradients where it is.
    pub eps: f64,
    /// Number of first columns of the parameter's table with a learning rate of their own, and that rate. The SH
    /// coefficients are one tensor with two rates, one for the base colour and one for the rest.
    pub first_columns: Option<(usize, f64)>,
}

impl AdamRate {
    /// `lr` with the values of 3DGS: 0.9, 0.999 and 1e-15. Gradients of a mean over a million pixels are tiny, so the
    /// usual `eps` of 1e-8 would dominate them.
    pub fn new(lr: f64) -> Self {
        Self { lr, beta1: 0.9, beta2: 0.999, eps: 1e-15, first_columns: None }
    }

    fn config(&self, step: u64) -> AdamConfig {
        AdamConfig { lr: self.lr, beta1: self.beta1, beta2: self.beta2, eps: self.eps, step, first_columns: None }
    }
}

/// The moments of one parameter, tables `[rows, columns]` as in [`NamedParameter`](crate::NamedParameter).
#[derive(Debug, Clone)]
pub struct Moments {
    /// Running mean of the gradient.
    pub first: Tensor<2>,
    /// Running mean of the squared gradient.
    pub second: Tensor<2>,
}

/// The optimiser's state. A checkpoint stores both fields.
#[derive(Debug, Clone, Default)]
pub struct Adam {
    /// Moments by path; a parameter that was never updated has none, which means zero.
    pub moments: BTreeMap<String, Moments>,
    /// Updates so far. One count serves all paths: a parameter whose moments begin late, or are reset, has the bias
    /// correction of the others.
    pub updates: u64,
}

impl Adam {
    /// An optimiser before its first update.
    pub fn new() -> Self {
        Self::default()
    }

    /// One update of each parameter of `module` that has a gradient and a rate; all others, and their moments, do not
    /// change.
    ///
    /// # Panics
    /// When a gradient or the moments have another shape than the parameter.
    pub fn step<M: Module>(
        &mut self,
        module: M,
        mut gradients: NamedGradients,
        rate: impl Fn(&str) -> Option<AdamRate>,
    ) -> M {
        self.advance();
        map_parameters(module, |path, table| self.updated(path, table, &mut gradients, &rate))
    }

    /// Begins an update whose parts follow by [`update_under`](Self::update_under).
    pub fn advance(&mut self) {
        self.updates += 1;
    }

    /// The part of an update for the module at the path `root` of a tree; gradients, moments and rates are keyed by the
    /// path in the tree. The gradients used are removed.
    ///
    /// # Panics
    /// As [`step`](Self::step); and before the first [`advance`](Self::advance).
    pub fn update_under<M: Module>(
        &mut self,
        root: &str,
        module: M,
        gradients: &mut NamedGradients,
        rate: impl Fn(&str) -> Option<AdamRate>,
    ) -> M {
        map_parameters(module, |path, table| self.updated(&format!("{root}.{path}"), table, gradients, &rate))
    }

    fn updated(
        &mut self,
        path: &str,
        table: Tensor<2>,
        gradients: &mut NamedGradients,
        rate: &impl Fn(&str) -> Option<AdamRate>,
    ) -> Tensor<2> {
        let Some((gradient, rate)) = gradients.remove(path).zip(rate(path)) else { return table };
        if table.dims().contains(&0) {
            return table;
        }
        self.update(path, table, gradient, &rate)
    }

    fn update(&mut self, path: &str, table: Tensor<2>, gradient: Tensor<2>, rate: &AdamRate) -> Tensor<2> {
        let shape = table.dims();
        assert_eq!(gradient.dims(), shape, "shape of the gradient of {path}");
        // Removed from the map, so that each buffer has one owner and is updated in place.
        let Moments { first, second } = self
            .moments
            .remove(path)
            .unwrap_or_else(|| Moments { first: table.zeros_like(), second: table.zeros_like() });
        assert_eq!(first.dims(), shape, "shape of the moments of {path}: they did not follow its rows");
        let first_columns = rate.first_columns.map(|(count, lr)| FirstColumns { row: shape[1], count, lr });
        let config = AdamConfig { first_columns, ..rate.config(self.updates) };
        let (table, first, second) = adam_step(table, gradient, first, second, &config);
        self.moments.insert(path.into(), Moments { first, second });
        table
    }

    /// Changes the rows of the moments of parameter `path`, or of all parameters under it.
    pub fn follow(&mut self, path: &str, rows: &RowMap) {
        for moments in self.under(path) {
            for table in [&mut moments.first, &mut moments.second] {
                *table = rows.select_moments(table.clone());
            }
        }
    }

    /// Appends zero columns, up to `columns`, to the moments of parameter `path`.
    pub fn widen(&mut self, path: &str, columns: usize) {
        for moments in self.under(path) {
            for table in [&mut moments.first, &mut moments.second] {
                let [rows, present] = table.dims();
                if present < columns {
                    let options = (&table.device(), table.dtype());
                    *table = Tensor::cat(vec![table.clone(), Tensor::zeros([rows, columns - present], options)], 1);
                }
            }
        }
    }

    /// Resets the moments of parameter `path`, or of all under it, to zero.
    pub fn forget(&mut self, path: &str) {
        self.moments.retain(|found, _| !is_under(found, path));
    }

    fn under<'a>(&'a mut self, path: &'a str) -> impl Iterator<Item = &'a mut Moments> {
        self.moments.iter_mut().filter(move |(found, _)| is_under(found, path)).map(|(_, moments)| moments)
    }
}

/// Whether `found` is `path` or is under it.
fn is_under(found: &str, path: &str) -> bool {
    found.strip_prefix(path).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}
