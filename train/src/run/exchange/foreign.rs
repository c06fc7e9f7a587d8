//! Files of Gaussians in formats that are not read: named, with the command that converts them.

use std::path::Path;

use anyhow::{Result, bail};

use super::READ;

/// Refuses a file of Gaussians in a format that is not read.
///
/// # Errors
/// A sentence with the format's name and the command that converts it; none for other files.
pub fn refuse_foreign(path: &Path) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let (found, command, to) = match ending.as_str() {
        "lcc" => ("an LCC file (XGRIDS)", "@playcanvas/splat-transform", "ply"),
        "gltf" => ("glTF as text with files beside it", "@gltf-transform/cli copy", "glb"),
        _ => return Ok(()),
    };
    bail!(
        "{}: expected a scene that is read ({READ}), found {found}; `npx {command} {} {}` converts it",
        path.display(),
        path.display(),
        path.with_extension(to).display()
    )
}
