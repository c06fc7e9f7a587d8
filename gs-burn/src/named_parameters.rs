//! The learned tensors of any module, by path.
//!
//! A module's learned tensors are its float `Param`s; plain tensors and numbers in it are constants. The path of a
//! parameter joins the fields that lead to it, such as `method.motion.position` or `mlp.layers.0.weight`; an `Option`
//! adds nothing to it. The optimiser, checkpoints, byte counts and the check for NaN all walk a module this way, so a
//! new network adds no line to any of them.
//!
//! Parameters have different ranks. A list of them holds each as a table `[rows, columns]`: the first axis, and all
//! others together. Reshaping to and from a table copies nothing.

use std::collections::BTreeMap;
use std::convert::Infallible;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param, ParamId};
use burn::tensor::{Device, Gradients, Tensor};

use crate::ops::sum::mark_not_finite;

/// A learned tensor and its path in its module.
#[derive(Debug, Clone)]
pub struct NamedParameter {
    /// Names of the fields that lead to it, joined by dots.
    pub path: String,
    /// Its own shape.
    pub shape: Vec<usize>,
    /// Its values as a table `[shape[0], product of the rest]`, outside autodiff.
    pub table: Tensor<2>,
}

impl NamedParameter {
    fn new<const D: usize>(path: String, tensor: Tensor<D>) -> Self {
        Self { path, shape: tensor.dims().to_vec(), table: to_table(tensor.inner()) }
    }

    /// Bytes of its values.
    pub fn bytes(&self) -> usize {
        self.shape.iter().product::<usize>() * self.table.dtype().size()
    }
}

/// The learned tensors of `module`, in the order of its fields.
pub fn named_parameters<M: Module>(module: &M) -> Vec<NamedParameter> {
    struct Visitor {
        path: Path,
        found: Vec<NamedParameter>,
    }
    impl ModuleVisitor for Visitor {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            self.found.push(NamedParameter::new(self.path.joined(), param.val()));
        }
        fn enter_module(&mut self, name: &str, _container_type: &str) {
            self.path.enter(name);
        }
        fn exit_module(&mut self, _name: &str, _container_type: &str) {
            self.path.exit();
        }
    }
    let mut visitor = Visitor { path: Path::default(), found: Vec::new() };
    module.visit(&mut visitor);
    visitor.found
}

/// Bytes of all learned tensors of `module`.
pub fn parameter_bytes<M: Module>(module: &M) -> usize {
    named_parameters(module).iter().map(NamedParameter::bytes).sum()
}

/// The module with `f(path, table)` in place of each learned tensor.
///
/// `f` receives and returns values outside autodiff; a parameter on an autodiff device becomes a leaf of a new graph,
/// which requires a gradient if it did before. The module is consumed, so that `f` is the only owner of a tensor
/// without other owners and can change it in place. The first axis may change its length; among the others, the second
/// absorbs a change of the number of columns (a table of SH coefficients grows by whole coefficients).
///
/// # Panics
/// When the columns of a returned table do not fit the parameter's other axes.
pub fn map_parameters<M: Module>(module: M, mut f: impl FnMut(&str, Tensor<2>) -> Tensor<2>) -> M {
    let mapped = try_map_parameters(module, |parameter| {
        let NamedParameter { path, table, .. } = parameter;
        Ok::<_, Infallible>(f(&path, table))
    });
    match mapped {
        Ok(module) => module,
        Err(never) => match never {},
    }
}

/// [`map_parameters`] with an `f` that may fail, such as one that reads a file; `f` also gets the parameter's shape.
///
/// # Errors
/// The first error of `f`, which is not called again after it.
///
/// # Panics
/// As [`map_parameters`].
pub fn try_map_parameters<M: Module, E>(
    module: M,
    f: impl FnMut(NamedParameter) -> Result<Tensor<2>, E>,
) -> Result<M, E> {
    struct Mapper<F, E> {
        path: Path,
        f: F,
        error: Option<E>,
    }
    impl<F: FnMut(NamedParameter) -> Result<Tensor<2>, E>, E> ModuleMapper for Mapper<F, E> {
        fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
            if self.error.is_some() {
                return param;
            }
            let (id, tensor, mapper): (ParamId, Tensor<D>, _) = param.consume();
            let (shape, is_autodiff, is_leaf) = (tensor.dims(), tensor.is_autodiff(), tensor.is_require_grad());
            let device = tensor.device();
            let path = self.path.joined();
            match (self.f)(NamedParameter::new(path.clone(), tensor)) {
                Ok(table) => {
                    let mut tensor = from_table(table.inner(), shape, &path);
                    if is_autodiff {
                        tensor = tensor.autodiff();
                    }
                    if is_leaf {
                        tensor = tensor.require_grad();
                    }
                    Param::from_mapped_value(id, tensor, mapper)
                }
                Err(error) => {
                    self.error = Some(error);
                    // The module is dropped, so any tensor will do.
                    Param::from_mapped_value(id, Tensor::empty(shape, &device), mapper)
                }
            }
        }
        fn enter_module(&mut self, name: &str, _container_type: &str) {
            self.path.enter(name);
        }
        fn exit_module(&mut self, _name: &str, _container_type: &str) {
            self.path.exit();
        }
    }
    let mut mapper = Mapper { path: Path::default(), f, error: None };
    let module = module.map(&mut mapper);
    mapper.error.map_or(Ok(module), Err)
}

/// Gradients of a module's learned tensors by path, each a table as in [`NamedParameter`], outside autodiff.
#[derive(Debug, Default)]
pub struct NamedGradients {
    tables: BTreeMap<String, Tensor<2>>,
}

impl NamedGradients {
    /// Takes the gradients of `module`'s leaves out of a finished backward pass. A leaf that the loss does not reach
    /// has gradient zero; a parameter outside autodiff, or one that is frozen, has none.
    pub fn take<M: Module>(module: &M, gradients: &mut Gradients) -> Self {
        struct Visitor<'a> {
            path: Path,
            gradients: &'a mut Gradients,
            tables: BTreeMap<String, Tensor<2>>,
        }
        impl ModuleVisitor for Visitor<'_> {
            fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
                let leaf = param.val();
                if !leaf.is_require_grad() {
                    return;
                }
                let gradient = leaf.grad_remove(self.gradients).unwrap_or_else(|| leaf.inner().zeros_like());
                self.tables.insert(self.path.joined(), to_table(gradient));
            }
            fn enter_module(&mut self, name: &str, _container_type: &str) {
                self.path.enter(name);
            }
            fn exit_module(&mut self, _name: &str, _container_type: &str) {
                self.path.exit();
            }
        }
        let mut visitor = Visitor { path: Path::default(), gradients, tables: BTreeMap::new() };
        module.visit(&mut visitor);
        Self { tables: visitor.tables }
    }

    /// The gradient of one parameter.
    pub fn get(&self, path: &str) -> Option<&Tensor<2>> {
        self.tables.get(path)
    }

    /// Inserts or replaces a gradient, for gradients from outside the graph.
    pub fn insert(&mut self, path: impl Into<String>, table: Tensor<2>) {
        self.tables.insert(path.into(), table);
    }

    /// Adds gradients to those of the same path; others are inserted. For parts of a backward pass that were computed
    /// apart.
    pub fn add(&mut self, others: Self) {
        for (path, table) in others.tables {
            let sum = match self.tables.remove(&path) {
                Some(own) => own + table,
                None => table,
            };
            self.tables.insert(path, sum);
        }
    }

    /// The same gradients on `device`.
    pub fn to_device(self, device: &Device) -> Self {
        Self { tables: self.tables.into_iter().map(|(path, table)| (path, table.to_device(device))).collect() }
    }

    /// The same gradients with `prefix.` before every path.
    pub fn under(self, prefix: &str) -> Self {
        Self { tables: self.tables.into_iter().map(|(path, table)| (format!("{prefix}.{path}"), table)).collect() }
    }

    /// Removes a gradient, so that its parameter does not change in the next update.
    pub fn remove(&mut self, path: &str) -> Option<Tensor<2>> {
        self.tables.remove(path)
    }

    /// All gradients, by path.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Tensor<2>)> {
        self.tables.iter().map(|(path, table)| (path.as_str(), table))
    }

    /// One number `[1]` that is finite only if every gradient is, for a caller that reads other numbers too; see
    /// [`finiteness`].
    pub fn finiteness(&self) -> Option<Tensor<1>> {
        finiteness(self.tables.values().cloned())
    }

    /// Whether every gradient is finite; see [`all_finite`].
    pub fn all_finite(&self) -> bool {
        all_finite(self.tables.values().cloned())
    }
}

/// Whether every number of `tables` is finite, with one read from the device for all of them.
pub fn all_finite(tables: impl IntoIterator<Item = Tensor<2>>) -> bool {
    finiteness(tables).is_none_or(|mark| mark.into_data().iter::<f64>().all(f64::is_finite))
}

/// One number `[1]`, still on the device: 0 if all numbers of `tables` are finite, else NaN; `None` without numbers.
pub fn finiteness(tables: impl IntoIterator<Item = Tensor<2>>) -> Option<Tensor<1>> {
    let filled = tables.into_iter().filter(|table| !table.dims().contains(&0));
    filled.fold(None, |mark, table| Some(mark_not_finite(mark, table)))
}

/// The path of fields to the current position of a walk.
#[derive(Default)]
struct Path(Vec<String>);

impl Path {
    fn enter(&mut self, name: &str) {
        self.0.push(name.into());
    }

    fn exit(&mut self) {
        self.0.pop();
    }

    fn joined(&self) -> String {
        self.0.join(".")
    }
}

/// `[shape[0], product of the rest]`.
fn to_table<const D: usize>(tensor: Tensor<D>) -> Tensor<2> {
    let shape = tensor.dims();
    let table = [shape[0], shape[1..].iter().product()];
    // In Burn's `reshape` a 0 means "as before".
    if shape.contains(&0) { Tensor::zeros(table, (&tensor.device(), tensor.dtype())) } else { tensor.reshape(table) }
}

fn from_table<const D: usize>(table: Tensor<2>, mut shape: [usize; D], path: &str) -> Tensor<D> {
    let [rows, columns] = table.dims();
    shape[0] = rows;
    if D > 1 {
        let others: usize = shape[2..].iter().product();
        shape[1] = columns / others.max(1);
    }
    let fits = shape[1..].iter().product::<usize>() == columns;
    assert!(fits, "{columns} columns do not fit the axes of {path}, {shape:?}");
    if shape.contains(&0) { Tensor::zeros(shape, (&table.device(), table.dtype())) } else { table.reshape(shape) }
}
