//! Folders of worlds.

use gs_worlds::deblur::{DeblurOptions, write};
use tempfile::{TempDir, tempdir};

/// A traced world with blur, in a folder of its own.
pub fn written(options: &DeblurOptions) -> TempDir {
    let folder = tempdir().expect("a temporary folder");
    write(folder.path(), options, |_, _| {}).expect("written");
    folder
}

/// The views that figures are quoted on; none where none is held out.
pub fn held_out(scene: &gs_datasets::Scene) -> &[gs_datasets::View] {
    scene.reported().map_or(&[], |split| &split.views)
}
