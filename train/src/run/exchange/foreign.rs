//! Files of Gaussians in formats that are not read: named, with the command that converts them.

use std::path::Path;

use anyhow::{Result, bail};

use super::READ;

/// Formats that splat-transform reads, by the endings of their files.
const FORMATS: [(&str, &str); 2] = [("sog", "a SOG file (PlayCanvas)"), ("lcc", "an LCC file (XGRIDS)")];

/// The file that makes a folder one of SOG.
const SOG: &str = "meta.json";

/// Refuses a file or folder of Gaussians in a format that is not read.
///
/// # Errors
/// A sentence with the format's name and the command that converts it; none for other files.
pub fn refuse_foreign(path: &Path) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    let convert = |found: &str, from: &Path| {
        let to = from.with_extension("ply");
        let to = to.file_name().unwrap_or_default().to_string_lossy().into_owned();
        bail!(
            "{}: expected a scene that is read ({READ}), found {found}; \
             `npx @playcanvas/splat-transform {} {to}` converts it",
            path.display(),
            from.display()
        )
    };
    let is_sog = |folder: &Path| folder.join(SOG).is_file() && folder.join("means_l.webp").is_file();
    if path.is_dir() {
        return if is_sog(path) { convert("a SOG folder (PlayCanvas)", &path.join(SOG)) } else { Ok(()) };
    }
    if path.ends_with(SOG) && path.parent().is_some_and(is_sog) {
        return convert("the description of a SOG folder (PlayCanvas)", path);
    }
    if ending == "gltf" {
        bail!(
            "{}: expected a scene that is read ({READ}), found glTF as text with files beside it; \
             `npx @gltf-transform/cli copy {} {}` makes one binary file of them",
            path.display(),
            path.display(),
            path.with_extension("glb").display()
        );
    }
    match FORMATS.iter().find(|(known, _)| *known == ending) {
        Some((_, name)) => convert(name, path),
        None => Ok(()),
    }
}
