//! The union of all views' back-projected pixels, as a PLY file.

use super::view::MappedView;

/// Points as a PLY file's bytes, the number of them, and the number of pixels with a depth.
///
/// The share `keep` of the pixels with the highest confidence stays, at least one if there are any. A threshold on the confidence itself
/// would leave none where a network is unsure of everything. Of more than `most` every n-th stays.
pub(super) fn ply(views: &[MappedView], keep: f64, most: usize) -> (Vec<u8>, usize, usize) {
    let known = |view: &MappedView| -> Vec<usize> { (0..view.depth.len()).filter(|i| view.depth[*i] > 0.0).collect() };
    let mut all: Vec<f32> = views.iter().flat_map(|view| known(view).into_iter().map(|i| view.confidence[i])).collect();
    let pixels = all.len();
    let place = (((1.0 - keep) * pixels as f64) as usize).min(pixels.saturating_sub(1));
    let least = if pixels == 0 { 0.0 } else { *all.select_nth_unstable_by(place, f32::total_cmp).1 };
    let sure = |view: &MappedView| -> Vec<usize> {
        known(view).into_iter().filter(|index| view.confidence[*index] >= least).collect()
    };
    let kept: Vec<(&MappedView, usize)> =
        views.iter().flat_map(|view| sure(view).into_iter().map(move |index| (view, index))).collect();
    let count = kept.len().min(most);
    let mut bytes = header(count);
    for (view, index) in (0..count).map(|place| kept[place * kept.len() / count]) {
        let position = view.world(view.middle(index), f64::from(view.depth[index]));
        for value in position.as_vec3().to_array() {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(view.color[index]);
    }
    (bytes, count, pixels)
}

fn header(count: usize) -> Vec<u8> {
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    )
    .into_bytes()
}
