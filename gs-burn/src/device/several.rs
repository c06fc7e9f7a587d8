//! Several devices of one kind.

use burn::tensor::Device;

use super::{DeviceChoice, DeviceError, DeviceKind, quietly};

/// The devices that follow the one called `name`, `count` with that one: of a GPU kind those with the next indices, of
/// a CPU kind the same one again.
///
/// # Errors
/// When one of them does not exist or does not work; when `name` is auto and `count` more than one.
pub fn beside(name: &str, count: usize) -> Result<Vec<Device>, DeviceError> {
    let choice: DeviceChoice = name.parse()?;
    if choice.kind == DeviceKind::Auto && count > 1 {
        return Err(DeviceError::SeveralOfAuto { count });
    }
    let at = |offset: usize| match choice.kind.is_cpu() {
        true => choice,
        false => DeviceChoice { index: Some(choice.index.unwrap_or(0) + offset), ..choice },
    };
    (1..count).map(|offset| at(offset).open()).collect()
}

/// Whether `device` is one of CUDA's.
pub fn is_cuda(device: &Device) -> bool {
    let kind = DeviceKind::Cuda;
    kind.is_built() && quietly(|| kind.list()).is_ok_and(|devices| devices.contains(device))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_several_devices_is_named() {
        assert!(beside("auto", 1).expect("none").is_empty());
        assert_eq!(beside("auto", 2), Err(DeviceError::SeveralOfAuto { count: 2 }));
        assert!(matches!(beside("flax", 2), Err(DeviceError::Unknown { .. })));
    }

    #[test]
    #[cfg(feature = "flex")]
    fn the_processor_is_there_as_often_as_asked() {
        assert_eq!(beside("flex", 3).expect("the processor").len(), 2);
        assert!(!is_cuda(&Device::flex()));
    }
}
