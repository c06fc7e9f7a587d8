//! Objects before a plain background: photos that are transparent around them, sets that are rendered without
//! surroundings, or filmed before a screen of one colour.

use gs_datasets::View;

use crate::pixels::{color, counts, median_color};

/// Largest difference of a channel from the background's colour, of 255, that is still background: above rounding and
/// the noise of a lossy file, below the shade of a bright object. Likewise the largest alpha.
const SAME: u8 = 6;

/// Share of the pixels along the image border that must have the background's colour: an object may be cut by the
/// border.
const BORDER: f64 = 0.9;

/// Share of the photos whose border must be plain: a few may show the object as large as the image.
const PHOTOS: f64 = 0.8;

/// One mask for each view, 255 where the photo is not transparent; where most photos have no transparent pixels, 255
/// where it differs from a background that has one colour in all views. `None` if there is neither.
///
/// Pixels that `View::mask` ignores count as background.
pub fn foreground_masks(views: &[View]) -> Option<Vec<Option<Vec<u8>>>> {
    let most = |count: usize| count as f64 >= PHOTOS * views.len() as f64;
    let transparent = views.iter().filter(|view| view.alpha.is_some()).count();
    if transparent > 0 && most(transparent) {
        return Some(masks(views, |view, pixel| view.alpha.as_ref().is_none_or(|alpha| alpha[pixel] > SAME)));
    }
    let color = background_color(views)?;
    let plain = views.iter().filter(|view| is_plain(view, color)).count();
    most(plain).then(|| masks(views, |view, pixel| !is_same(view, pixel, color)))
}

/// For each view, 255 at the pixels that count and for which `shows` is true.
fn masks(views: &[View], shows: impl Fn(&View, usize) -> bool) -> Vec<Option<Vec<u8>>> {
    let level = |view: &View, pixel: usize| if counts(view, pixel) && shows(view, pixel) { 255 } else { 0 };
    let mask = |view: &View| (0..view.width * view.height).map(|pixel| level(view, pixel)).collect();
    views.iter().map(|view| Some(mask(view))).collect()
}

/// The median colour along the borders of all views.
fn background_color(views: &[View]) -> Option<[u8; 3]> {
    let colors: Vec<[u8; 3]> = views.iter().flat_map(|view| border(view).map(|pixel| color(view, pixel))).collect();
    median_color(&colors)
}

fn is_plain(view: &View, color: [u8; 3]) -> bool {
    let same = border(view).filter(|pixel| is_same(view, *pixel, color)).count();
    same as f64 >= BORDER * border(view).count() as f64
}

fn is_same(view: &View, pixel: usize, color: [u8; 3]) -> bool {
    self::color(view, pixel).iter().zip(color).all(|(a, b)| a.abs_diff(b) <= SAME)
}

/// The pixels of the image's outermost rows and columns.
fn border(view: &View) -> impl Iterator<Item = usize> {
    let (width, height) = (view.width, view.height);
    let rows = (0..width).flat_map(move |x| [x, height.saturating_sub(1) * width + x]);
    let columns = (0..height).flat_map(move |y| [y * width, y * width + width.saturating_sub(1)]);
    rows.chain(columns).filter(move |pixel| *pixel < width * height)
}

#[cfg(test)]
mod tests {
    use gs_base::Intrinsics;
    use gs_datasets::RgbImage8;

    use super::*;

    fn view(color: impl Fn(usize, usize) -> [u8; 3]) -> View {
        let (width, height) = (12, 8);
        let data = (0..width * height).flat_map(|pixel| color(pixel % width, pixel / width)).collect();
        let intrinsics = Intrinsics { fx: 10.0, fy: 10.0, cx: 6.0, cy: 4.0 };
        View::new(glam::DMat4::IDENTITY, intrinsics, RgbImage8 { width, height, data })
    }

    fn object(x: usize, y: usize) -> bool {
        (4..8).contains(&x) && (2..6).contains(&y)
    }

    /// Alpha tells a black object from black surroundings, and an object that most borders cut.
    #[test]
    fn transparent_pixels_are_the_background() {
        let shows = |x: usize, y: usize| x >= 2 && y != 3;
        let alpha: Vec<u8> = (0..96).map(|pixel| if shows(pixel % 12, pixel / 12) { 255 } else { 0 }).collect();
        let black = View { alpha: Some(alpha.clone()), ..view(|_, _| [0; 3]) };
        let masks = foreground_masks(&[black.clone(), black.clone()]).expect("photos with alpha");
        assert!(masks.iter().all(|mask| mask.as_deref() == Some(&alpha[..])));
        // One opaque photo of six is filled by the object; one of two says that alpha means nothing.
        let full = view(|x, y| [x as u8 * 20, y as u8 * 30, 7]);
        let mut six = vec![black.clone(); 5];
        six.push(full.clone());
        let masks = foreground_masks(&six).expect("photos with alpha");
        assert!(masks[5].as_ref().is_some_and(|mask| mask.iter().all(|level| *level == 255)));
        assert!(foreground_masks(&[black, full]).is_none());
    }

    #[test]
    fn an_object_before_a_screen_is_told_from_it() {
        for screen in [[255, 255, 255], [0, 0, 0], [20, 180, 30]] {
            let views = vec![view(|x, y| if object(x, y) { [120, 90, 60] } else { screen }); 3];
            let masks = foreground_masks(&views).expect("a plain background");
            let mask = masks[1].as_ref().expect("a mask");
            assert!((0..96).all(|pixel| (mask[pixel] > 0) == object(pixel % 12, pixel / 12)));
        }
    }

    #[test]
    fn surroundings_are_no_plain_background() {
        let room = view(|x, y| [(x * 20) as u8, (y * 30) as u8, 90]);
        assert!(foreground_masks(std::slice::from_ref(&room)).is_none());
        // One photo before a screen does not make a studio.
        let plain = view(|_, _| [0, 0, 0]);
        assert!(foreground_masks(&[plain, room.clone(), room]).is_none());
        assert!(foreground_masks(&[]).is_none());
    }
}
