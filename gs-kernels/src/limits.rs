//! The limits of the kernels, as sentences. Operations of a tensor library return tensors, not results, so these end in
//! panics; a program distinguishes them from faults by [`is_limit`].

/// The end of every such sentence.
const ADVICE: &str = "use fewer or smaller Gaussians, or a smaller image";

/// More pairs of tile and Gaussian than a signed 32-bit offset counts.
pub fn too_many_pairs(pairs: Option<u64>) -> String {
    let found = pairs.map_or(String::new(), |pairs| format!(", found {pairs}"));
    format!("expected at most 2^31 pairs of tile and Gaussian{found}: {ADVICE}")
}

/// A buffer above the size that the device, or every graphics API, can bind.
pub fn buffer_too_large(what: &str, bytes: u64, most: u64) -> String {
    format!("{what} needs {bytes} bytes on the device, and one buffer holds at most {most}: {ADVICE}")
}

/// More Gaussians than the buffers of a device hold.
pub fn too_many_gaussians(gaussians: u64, sh_degree: usize, bytes: u64, most: u64) -> String {
    format!(
        "{gaussians} Gaussians of SH degree {sh_degree} do not fit this device, whose buffers hold at most {bytes} bytes: at most {most} \
         fit; lower density.cap or model.sh_degree"
    )
}

/// Whether a panic's message is a sentence of this module.
pub fn is_limit(message: &str) -> bool {
    message.ends_with(ADVICE)
}
