//! The search for the device that `auto` means.

use super::DeviceKind::{Flex, NdArray};
use super::{DeviceError, DeviceKind, Selected, probe};
#[cfg(feature = "cube")]
use super::{KINDS, adapters, choice, quietly, refusal};
#[cfg(feature = "cube")]
use burn::tensor::Device;

/// The best GPU that can train, else the first CPU backend that works.
pub(super) fn open_best() -> Result<Selected, DeviceError> {
    let mut passed = Vec::new();
    #[cfg(feature = "cube")]
    if let Some(selected) = best_gpu(&mut passed) {
        return Ok(selected);
    }
    for kind in [Flex, NdArray].into_iter().filter(|kind| kind.is_built()) {
        let device = kind.default_device();
        match probe(&device) {
            Ok(()) => return Ok(Selected { device, why: why_cpu(kind, &passed) }),
            Err(reason) => passed.push(format!("{kind} does not work here: {reason}")),
        }
    }
    Err(DeviceError::NotBuilt { kind: Flex })
}

#[cfg(feature = "cube")]
fn why_cpu(kind: DeviceKind, passed: &[String]) -> Option<String> {
    Some(choice::took_cpu(kind, passed))
}

/// A build without CubeCL has no GPU to choose.
#[cfg(not(feature = "cube"))]
fn why_cpu(_: DeviceKind, _: &[String]) -> Option<String> {
    None
}

/// The first of the [candidates](choice::candidates) that can train; the others are added to `passed`, each with its
/// reason. Only candidates are opened, one after the other.
#[cfg(feature = "cube")]
fn best_gpu(passed: &mut Vec<String>) -> Option<Selected> {
    let (mut described, mut devices) = (Vec::new(), Vec::new());
    for kind in KINDS.into_iter().filter(|kind| kind.is_built() && !kind.is_cpu()) {
        match quietly(|| kind.list()) {
            Ok(listed) if listed.is_empty() => passed.push(format!("{kind} finds no GPU")),
            Ok(listed) => {
                for (index, device) in listed.into_iter().enumerate() {
                    described.push(choice::Adapter { kind, index, class: adapters::class_of(&device) });
                    devices.push(device);
                }
            }
            Err(reason) => passed.push(format!("{kind} finds no GPU: {reason}")),
        }
    }
    passed.extend(choice::software(&described));
    for i in choice::candidates(&described, &KINDS) {
        match able(&devices[i]) {
            Ok(has) => {
                let why = choice::took_gpu(&described[i], &has, passed);
                return Some(Selected { device: devices.swap_remove(i), why: Some(why) });
            }
            Err(reason) => passed.push(format!("{} {reason}", described[i])),
        }
    }
    None
}

/// The abilities of a GPU that can train, or why it cannot, as the end of a sentence about it.
#[cfg(feature = "cube")]
fn able(device: &Device) -> Result<choice::Abilities, String> {
    let broken = |reason| format!("does not work here: {reason}");
    if let Some(reason) = refusal(device) {
        return Err(broken(reason));
    }
    let has = quietly(|| adapters::abilities(device)).map_err(broken)?;
    let has = has.ok_or_else(|| broken("it is no GPU".to_owned()))?;
    match choice::unfit(&has) {
        Some(reason) => Err(reason),
        None => probe(device).map_err(broken).map(|()| has),
    }
}
