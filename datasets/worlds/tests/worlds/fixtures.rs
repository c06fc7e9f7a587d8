//! Folders of worlds.

use std::path::{Path, PathBuf};

use gs_worlds::deblur::{DeblurOptions, write};
use tempfile::TempDir;

/// A folder that disappears with the test.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }
}

/// A traced world with blur, in a folder of its own.
pub fn written(options: &DeblurOptions) -> Folder {
    let folder = Folder::new();
    write(folder.path(), options, |_, _| {}).expect("written");
    folder
}

/// The views that figures are quoted on; none where none is held out.
pub fn held_out(scene: &gs_datasets::Scene) -> &[gs_datasets::View] {
    scene.reported().map_or(&[], |split| &split.views)
}
