//! Burn's CPU tensors as slices, and vectors as Burn tensors, without copies if the memory allows it.
//!
//! The CPU kernels take slices only. [`HostBackend`] is the common interface of Flex and NdArray; every kernel trait of
//! [`crate::ops`] is implemented once, for all `HostBackend`s.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, BackendTypes, TensorMetadata};
use burn::tensor::{Element, Shape};
use gs_kernels::cpu::Real;

/// A backend whose tensors are in the memory of this process.
pub trait HostBackend:
    Backend + BackendTypes<FloatTensorPrimitive: HostTensor, IntTensorPrimitive: HostTensor>
{
}

/// A tensor whose elements can be borrowed.
pub trait HostTensor: TensorMetadata + Sized {
    /// The same values in row-major order; the tensor itself when they already are.
    fn contiguous(self) -> Self;
    /// The elements of a contiguous tensor.
    ///
    /// # Panics
    /// When the tensor is not contiguous or holds another type.
    fn elements<E: HostElement>(&self) -> &[E];
    /// The elements of a contiguous tensor for writing; copies them first when another tensor shares them.
    ///
    /// # Panics
    /// When the tensor is not contiguous or holds another type.
    fn elements_mut<E: HostElement>(&mut self) -> &mut [E];
    /// Takes over a vector.
    fn from_vec<E: HostElement>(values: Vec<E>, shape: Shape) -> Self;
}

/// An element of a [`HostTensor`] that kernels use.
pub trait HostElement: Element {
    /// Elements of a contiguous Flex tensor of this type.
    #[cfg(feature = "flex")]
    fn in_flex(tensor: &burn_flex::FlexTensor) -> Option<&[Self]>;
    /// The same, for writing.
    #[cfg(feature = "flex")]
    fn in_flex_mut(tensor: &mut burn_flex::FlexTensor) -> Option<&mut [Self]>;
    /// Elements of a contiguous NdArray tensor of this type.
    #[cfg(feature = "ndarray")]
    fn in_ndarray(tensor: &burn_ndarray::NdArrayTensor) -> Option<&[Self]>;
    /// The same, for writing.
    #[cfg(feature = "ndarray")]
    fn in_ndarray_mut(tensor: &mut burn_ndarray::NdArrayTensor) -> Option<&mut [Self]>;
}

/// A float the kernels compute in and tensors hold.
pub trait HostFloat: HostElement + Real {}
impl HostFloat for f32 {}
impl HostFloat for f64 {}

/// Takes over a vector as a float tensor.
pub fn float_tensor<B: HostBackend>(values: Vec<impl HostFloat>, shape: impl Into<Shape>) -> FloatTensor<B> {
    HostTensor::from_vec(values, shape.into())
}

/// Takes over a vector as an int tensor.
pub fn int_tensor<B: HostBackend>(values: Vec<i32>) -> IntTensor<B> {
    let len = values.len();
    HostTensor::from_vec(values, Shape::new([len]))
}

/// Evaluates `$body` with `$float` standing for the element type of the float tensor `$tensor`.
macro_rules! with_float {
    ($tensor:expr, $float:ident => $body:expr) => {
        match burn::backend::TensorMetadata::dtype(&$tensor) {
            burn::tensor::DType::F32 => {
                type $float = f32;
                $body
            }
            burn::tensor::DType::F64 => {
                type $float = f64;
                $body
            }
            other => panic!("Gaussian splatting on the CPU computes in f32 or f64, not in {other:?}"),
        }
    };
}
pub(crate) use with_float;

macro_rules! host_element {
    ($element:ident, $variant:ident) => {
        impl HostElement for $element {
            #[cfg(feature = "flex")]
            fn in_flex(tensor: &burn_flex::FlexTensor) -> Option<&[Self]> {
                tensor.as_slice()
            }
            #[cfg(feature = "flex")]
            fn in_flex_mut(tensor: &mut burn_flex::FlexTensor) -> Option<&mut [Self]> {
                let (start, end) = tensor.layout().contiguous_offsets()?;
                (tensor.dtype() == Self::dtype()).then(|| &mut tensor.storage_mut::<Self>()[start..end])
            }
            #[cfg(feature = "ndarray")]
            fn in_ndarray(tensor: &burn_ndarray::NdArrayTensor) -> Option<&[Self]> {
                let burn_ndarray::NdArrayTensor::$variant(storage) = tensor else { return None };
                storage.view().to_slice()
            }
            #[cfg(feature = "ndarray")]
            fn in_ndarray_mut(tensor: &mut burn_ndarray::NdArrayTensor) -> Option<&mut [Self]> {
                let burn_ndarray::NdArrayTensor::$variant(storage) = tensor else { return None };
                storage.ensure_owned().as_slice_mut()
            }
        }
    };
}
host_element!(f32, F32);
host_element!(f64, F64);
host_element!(i32, I32);

#[cfg(any(feature = "flex", feature = "ndarray"))]
fn expect<T, E: Element>(slice: Option<T>, dtype: burn::tensor::DType) -> T {
    slice.unwrap_or_else(|| panic!("expected contiguous elements of type {:?}, found type {dtype:?}", E::dtype()))
}

#[cfg(feature = "flex")]
mod flex {
    use super::*;
    use burn::tensor::TensorData;
    use burn_flex::{Flex, FlexTensor};

    impl HostBackend for Flex {}

    impl HostTensor for FlexTensor {
        fn contiguous(self) -> Self {
            // A contiguous part of a larger buffer needs no copy; `to_contiguous` would make one.
            if self.layout().contiguous_offsets().is_some() { self } else { self.to_contiguous() }
        }
        fn elements<E: HostElement>(&self) -> &[E] {
            expect::<_, E>(E::in_flex(self), self.dtype())
        }
        fn elements_mut<E: HostElement>(&mut self) -> &mut [E] {
            let dtype = self.dtype();
            expect::<_, E>(E::in_flex_mut(self), dtype)
        }
        fn from_vec<E: HostElement>(values: Vec<E>, shape: Shape) -> Self {
            FlexTensor::from_data(TensorData::new(values, shape))
        }
    }
}

#[cfg(feature = "ndarray")]
mod ndarray {
    use super::*;
    use burn::tensor::TensorData;
    use burn_ndarray::{NdArray, NdArrayTensor};

    impl HostBackend for NdArray {}

    impl HostTensor for NdArrayTensor {
        fn contiguous(self) -> Self {
            /// Row-major copy unless it already is.
            macro_rules! standard {
                ($($variant:ident),*) => {
                    match self {
                        $(NdArrayTensor::$variant(storage) if storage.view().to_slice().is_none() => {
                            storage.view().as_standard_layout().into_owned().into_shared().into()
                        })*
                        standard => standard,
                    }
                };
            }
            standard!(F32, F64, I32)
        }
        fn elements<E: HostElement>(&self) -> &[E] {
            expect::<_, E>(E::in_ndarray(self), self.dtype())
        }
        fn elements_mut<E: HostElement>(&mut self) -> &mut [E] {
            let dtype = self.dtype();
            expect::<_, E>(E::in_ndarray_mut(self), dtype)
        }
        fn from_vec<E: HostElement>(values: Vec<E>, shape: Shape) -> Self {
            NdArrayTensor::from_data(TensorData::new(values, shape))
        }
    }
}
