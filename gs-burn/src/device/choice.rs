//! The adapter that `auto` takes, from descriptions of all. Nothing here touches a device.

use std::fmt;

use super::DeviceKind;

/// The sort of an adapter, in the order in which `auto` prefers them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(dead_code)] // CUDA lists cards alone.
pub(crate) enum AdapterClass {
    /// A card with its own memory.
    Discrete,
    /// A part of the processor, with the processor's memory.
    Integrated,
    /// A share of a GPU in a virtual machine.
    Virtual,
    /// The driver does not say.
    Other,
    /// A program on the CPU that a graphics interface lists as a device: lavapipe, llvmpipe, SwiftShader, WARP.
    Software,
}

/// An adapter as a backend lists it, before it is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Adapter {
    /// Its backend.
    pub kind: DeviceKind,
    /// Its place in the backend's list, as in `cuda:1`.
    pub index: usize,
    /// Its sort.
    pub class: AdapterClass,
}

/// The statement of an open adapter about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Abilities {
    /// As the driver names it.
    pub name: String,
    /// Bytes on the device, if the driver says.
    pub memory: Option<u64>,
    /// Bytes that one binding holds.
    pub binding: u64,
    /// Storage buffers of a kernel.
    pub bindings: u32,
    /// Units of a cube.
    pub units: u32,
    /// Bytes of shared memory of a cube.
    pub shared: u64,
    /// Cubes along one axis.
    pub cubes: u32,
}

/// The needs of training: WebGPU's default limits, which the kernels keep, and room for a scene.
pub(super) const NEEDS: Abilities = Abilities {
    name: String::new(),
    // Half a million Gaussians of SH degree 3 take 0.5 GB with gradients and moments (944 bytes each), and their pairs
    // 0.4 GB.
    memory: Some(1 << 30),
    binding: 128 << 20,
    bindings: 7,
    units: 256,
    shared: 16 << 10,
    cubes: 65_535,
};

/// Names of software that some drivers list as another sort of device (a virtual machine that passes lavapipe on, say).
const SOFTWARE: [&str; 5] = ["llvmpipe", "lavapipe", "softpipe", "swiftshader", "basic render"];

/// The adapters that `auto` tries, best first: by class, then by the order of `kinds`, then as listed. Software is not
/// among them.
pub(super) fn candidates(adapters: &[Adapter], kinds: &[DeviceKind]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..adapters.len()).filter(|i| adapters[*i].class != AdapterClass::Software).collect();
    let place = |kind| kinds.iter().position(|known| *known == kind);
    order.sort_by_key(|i| (adapters[*i].class, place(adapters[*i].kind), adapters[*i].index));
    order
}

/// Why an adapter of these abilities cannot train, as the end of a sentence about it.
pub(super) fn unfit(has: &Abilities) -> Option<String> {
    let name = has.name.to_lowercase();
    if SOFTWARE.iter().any(|software| name.contains(software)) {
        return Some(format!("is software ({}), which is slower than the CPU backends", has.name));
    }
    let least = |what: &str, has: u64, needed: u64| (has < needed).then(|| format!("has {has} {what} of {needed}"));
    let memory = has.memory.unwrap_or(u64::MAX);
    least("bytes of memory", memory, NEEDS.memory.unwrap_or(0))
        .or_else(|| least("bytes in a binding", has.binding, NEEDS.binding))
        .or_else(|| least("buffers in a kernel", has.bindings.into(), NEEDS.bindings.into()))
        .or_else(|| least("units in a cube", has.units.into(), NEEDS.units.into()))
        .or_else(|| least("bytes of shared memory", has.shared, NEEDS.shared))
        .or_else(|| least("cubes along an axis", has.cubes.into(), NEEDS.cubes.into()))
}

/// A sentence about each adapter that is software.
pub(super) fn software(adapters: &[Adapter]) -> impl Iterator<Item = String> {
    let software = adapters.iter().filter(|adapter| adapter.class == AdapterClass::Software);
    software.map(|adapter| format!("{adapter} is software, which is slower than the CPU backends"))
}

/// The choice of `auto` and its reason: a GPU that `has` these abilities, after it `passed` over others.
pub(super) fn took_gpu(adapter: &Adapter, has: &Abilities, passed: &[String]) -> String {
    let memory = has.memory.map_or(String::new(), |bytes| format!(", {:.1} GB", bytes as f64 / 1e9));
    with_passed(format!("auto took {adapter}, {} ({}{memory})", has.name, adapter.class), passed)
}

/// The choice of `auto` and its reason: the CPU, because it `passed` over every adapter.
pub(super) fn took_cpu(kind: DeviceKind, passed: &[String]) -> String {
    with_passed(format!("auto took {kind}, on the CPU"), passed)
}

fn with_passed(taken: String, passed: &[String]) -> String {
    if passed.is_empty() { taken } else { format!("{taken}: {}", passed.join("; ")) }
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.kind, self.index)
    }
}

impl fmt::Display for AdapterClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Other => "GPU of unknown sort",
            Self::Software => "software",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::AdapterClass::{Discrete, Integrated, Other, Software, Virtual};
    use super::DeviceKind::{Cuda, Flex, Vulkan, Wgpu};
    use super::*;

    const KINDS: [DeviceKind; 3] = [Cuda, Vulkan, Wgpu];

    fn adapter(kind: DeviceKind, index: usize, class: AdapterClass) -> Adapter {
        Adapter { kind, index, class }
    }

    fn card() -> Abilities {
        Abilities { name: "A Card".into(), memory: Some(8_000_000_000), ..NEEDS }
    }

    fn taken(adapters: &[Adapter]) -> Vec<String> {
        candidates(adapters, &KINDS).into_iter().map(|i| adapters[i].to_string()).collect()
    }

    #[test]
    fn a_card_goes_before_a_part_of_the_processor_and_cuda_before_the_rest() {
        let laptop = [
            adapter(Wgpu, 0, Integrated),
            adapter(Wgpu, 1, Discrete),
            adapter(Vulkan, 0, Other),
            adapter(Vulkan, 1, Virtual),
            adapter(Cuda, 0, Discrete),
            adapter(Cuda, 1, Discrete),
        ];
        assert_eq!(taken(&laptop), ["cuda:0", "cuda:1", "wgpu:1", "wgpu:0", "vulkan:1", "vulkan:0"]);
    }

    #[test]
    fn software_is_never_a_candidate() {
        let server = [adapter(Vulkan, 0, Software), adapter(Wgpu, 0, Software)];
        assert!(taken(&server).is_empty());
        let why = took_cpu(Flex, &software(&server).collect::<Vec<_>>());
        assert_eq!(
            why,
            "auto took flex, on the CPU: vulkan:0 is software, which is slower than the CPU backends; wgpu:0 is software, which is \
             slower than the CPU backends"
        );
        let passed_on = Abilities { name: "Virtio-GPU Venus (llvmpipe (LLVM 15.0.6, 256 bits))".into(), ..card() };
        assert!(unfit(&passed_on).is_some_and(|reason| reason.starts_with("is software")));
    }

    #[test]
    fn an_adapter_below_one_need_is_passed_over_by_that_need() {
        assert_eq!(unfit(&card()), None);
        assert_eq!(unfit(&Abilities { memory: None, ..card() }), None, "a driver need not say");
        for (has, word) in [
            (Abilities { memory: Some(512 << 20), ..card() }, "bytes of memory"),
            (Abilities { binding: 64 << 20, ..card() }, "bytes in a binding"),
            (Abilities { bindings: 4, ..card() }, "buffers"),
            (Abilities { units: 128, ..card() }, "units"),
            (Abilities { shared: 8 << 10, ..card() }, "shared memory"),
            (Abilities { cubes: 1024, ..card() }, "cubes"),
        ] {
            let reason = unfit(&has).expect("below a need");
            assert!(reason.contains(word), "{reason}");
        }
    }

    #[test]
    fn the_reason_names_the_card_and_what_was_passed_over() {
        let one = adapter(Wgpu, 1, Discrete);
        assert_eq!(took_gpu(&one, &card(), &[]), "auto took wgpu:1, A Card (discrete GPU, 8.0 GB)");
        let silent = Abilities { memory: None, ..card() };
        let why = took_gpu(&one, &silent, &["cuda finds no GPU".into()]);
        assert_eq!(why, "auto took wgpu:1, A Card (discrete GPU): cuda finds no GPU");
    }
}
