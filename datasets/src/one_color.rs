//! Photos without anything to see: black ones, white ones, wholly transparent ones.

use std::path::Path;

use gs_base::counted;

use crate::error::DatasetError;
use crate::pixels::Photo;

/// The colour (0 to 255) of a photo that has no other.
pub(crate) fn of(photo: &Photo) -> Option<[f32; 3]> {
    let (width, height) = photo.size();
    let mut row = vec![0.0; 3 * width];
    photo.copy_row(0, &mut row);
    let color = [row[0], row[1], row[2]];
    let is_uniform = (0..height).all(|y| {
        photo.copy_row(y, &mut row);
        row.as_chunks::<3>().0.iter().all(|pixel| *pixel == color)
    });
    is_uniform.then_some(color)
}

/// Refuses a scene whose photos are all of one colour. `colors` has an entry for each training photo, as [`of`] gives
/// it.
pub(crate) fn refuse(scene: &Path, mut colors: impl Iterator<Item = Option<[f32; 3]>>) -> Result<(), DatasetError> {
    let Some(Some(color)) = colors.next() else { return Ok(()) };
    let mut count = 1;
    for other in colors {
        if other != Some(color) {
            return Ok(());
        }
        count += 1;
    }
    let [r, g, b] = color.map(f32::round);
    let photos = counted(count, "training photo");
    let found = format!(
        "one colour all over {photos}, red {r}, green {g}, blue {b} (of 255): nothing can be learned from them"
    );
    Err(DatasetError::malformed(scene, "photos", "photos that show something", found))
}
