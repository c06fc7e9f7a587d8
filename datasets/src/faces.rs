//! Pinhole views of photos by fisheye lenses and of panoramas.
//!
//! A photo that shows at most [`ONE_VIEW`] to each side of its optical axis becomes one view, as wide and as high as
//! the photo is through its middle: the corners of a fisheye photo reach farther out and are left out, as pinhole views
//! by other programs leave them out. A wider photo becomes the faces of a cube around the camera, each as large as the
//! part of it that the photo shows. The resolution of all views, pixels per radian on their axis, is that of the middle
//! of the photo: nothing is lost there, and the six faces of a panorama have 1.2 times its pixels.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use gs_base::Intrinsics;

use crate::face::{Face, Window};
use crate::lens::Lens;
use crate::projection::Projection;
use crate::undistort::Undistortion;

/// Widest angle to a side of the axis in one pinhole view, radians: 110 degrees across. There the view has three pixels
/// for one of the photo, along a line from the middle; farther out it soon has ten.
const ONE_VIEW: f64 = 55.0 * PI / 180.0;

/// Points along each side of a face at which it is looked at.
const GRID: usize = 64;

/// Least share of a face that a photo shows: below it is a strip of four degrees along one side, which the view beside
/// it nearly shows.
const COVERED_MIN: f64 = 0.05;

/// The faces of a cube, by name and by their x and z axes in the photo's camera axes.
const SIDES: [(&str, DVec3, DVec3); 6] = [
    ("_front", DVec3::X, DVec3::Z),
    ("_right", DVec3::NEG_Z, DVec3::X),
    ("_back", DVec3::NEG_X, DVec3::NEG_Z),
    ("_left", DVec3::Z, DVec3::NEG_X),
    ("_up", DVec3::X, DVec3::NEG_Y),
    ("_down", DVec3::X, DVec3::Y),
];

/// The views of a photo of `size` pixels with these intrinsics; none of a pinhole's, which needs no other view, and of
/// a photo that shows nothing.
pub(crate) fn of(lens: &Lens, intrinsics: Intrinsics, size: (usize, usize)) -> Vec<Face> {
    if lens.projection == Projection::Pinhole {
        return Vec::new();
    }
    let photo = Undistortion::wide(lens, intrinsics, size);
    let focal = (intrinsics.fx * intrinsics.fy).sqrt() * lens.projection.central_scale();
    let longest = size.0.max(size.1) as f64;
    if let Some(window) = whole(&photo) {
        return vec![Face::of("", DMat3::IDENTITY, window, focal, longest)];
    }
    let sides = SIDES.iter().filter_map(|(ending, x, z)| {
        let rotation = DMat3::from_cols(*x, z.cross(*x), *z);
        Some(Face::of(ending, rotation, shown(&photo, rotation)?, focal, longest))
    });
    sides.collect()
}

/// The window of all that a photo shows along the axes through its middle; `None` where that is wider than one view.
fn whole(photo: &Undistortion) -> Option<Window> {
    let reach = |side: DVec3| Some(photo.angle_towards(side)).filter(|angle| *angle <= ONE_VIEW).map(f64::tan);
    let along = |axis: DVec3| Some((-reach(-axis)?, reach(axis)?)).filter(|(low, high)| low < high);
    Some([along(DVec3::X)?, along(DVec3::Y)?])
}

/// The window of all that a photo shows of a face; `None` where that is next to nothing.
fn shown(photo: &Undistortion, rotation: DMat3) -> Option<Window> {
    let at = |cell: usize| (2.0 * cell as f64 + 1.0) / GRID as f64 - 1.0;
    let is_shown = |x: usize, y: usize| photo.of_ray(rotation * DVec3::new(at(x), at(y), 1.0)).is_some();
    let cells: Vec<(usize, usize)> =
        (0..GRID * GRID).map(|i| (i % GRID, i / GRID)).filter(|(x, y)| is_shown(*x, *y)).collect();
    if (cells.len() as f64) < COVERED_MIN * (GRID * GRID) as f64 {
        return None;
    }
    // With the cells around, of which a part may be shown.
    let bounds = |places: Vec<usize>| {
        let low = places.iter().min().map_or(0, |low| low.saturating_sub(1));
        let high = places.iter().max().map_or(GRID, |high| (high + 2).min(GRID));
        (2.0 * low as f64 / GRID as f64 - 1.0, 2.0 * high as f64 / GRID as f64 - 1.0)
    };
    let (columns, rows) = cells.into_iter().unzip();
    Some([bounds(columns), bounds(rows)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distortion::Distortion;

    fn lens(projection: Projection, focal: f64, size: (usize, usize)) -> Lens {
        let (width, height) = (size.0 as f64, size.1 as f64);
        let intrinsics = [focal, focal, 0.5 * width, 0.5 * height];
        Lens { projection, ..Lens::of(intrinsics, (width, height), Distortion::default()) }
    }

    fn views(lens: &Lens, size: (usize, usize)) -> Vec<Face> {
        of(lens, lens.intrinsics(size.0 as f64, size.1 as f64).expect("sound"), size)
    }

    /// A fisheye photo of this many degrees across.
    fn fisheye(degrees: f64) -> Vec<Face> {
        let size = (200, 150);
        views(&lens(Projection::Fisheye, 100.0 / (0.5 * degrees).to_radians(), size), size)
    }

    #[test]
    fn a_narrow_photo_is_one_view_of_its_angle_and_resolution() {
        let [face] = &fisheye(100.0)[..] else { panic!("one view") };
        assert!((face.across() - 100.0).abs() < 1e-6 && face.ending.is_empty(), "{face:?}");
        // 100 pixels for 50 degrees, and 2 tan(50) = 2.384 of them wide.
        assert!((face.intrinsics.fx - 114.59).abs() < 0.1 && face.size.0 == 273, "{face:?}");
        assert_eq!(face.rotation, DMat3::IDENTITY);
    }

    #[test]
    fn a_wide_photo_is_the_faces_that_it_shows() {
        let names = |faces: &[Face]| faces.iter().map(|face| face.ending).collect::<Vec<_>>().concat();
        assert_eq!(names(&fisheye(150.0)), "_front_right_left_up_down");
        assert_eq!(names(&fisheye(115.0)), "_front_right_left");
        let size = (400, 200);
        let panorama = views(&lens(Projection::Equirectangular, 1.0, size), size);
        assert_eq!(names(&panorama), "_front_right_back_left_up_down");
        for face in &panorama {
            assert_eq!(face.size, (127, 127));
            assert!((face.across() - 90.0).abs() < 1e-6 && face.intrinsics.fx == 63.5, "{face:?}");
        }
        // 57.5 degrees to the right: the face there begins at 45, and its photo ends 12.5 degrees further.
        let right = &fisheye(115.0)[1];
        assert!(right.size.0 < 3 * right.size.1 / 8 && right.intrinsics.cx > right.size.0 as f64, "{right:?}");
    }

    #[test]
    fn faces_are_turned_and_not_mirrored() {
        for (ending, x, z) in SIDES {
            let rotation = DMat3::from_cols(x, z.cross(x), z);
            assert!((rotation.determinant() - 1.0).abs() < 1e-12, "{ending}");
        }
    }

    #[test]
    fn no_view_is_much_larger_than_the_photo() {
        // A lens whose radius hardly grows beyond 10 degrees.
        let size = (200, 150);
        let flat = Distortion { k: [-10.0, 60.0, -160.0, 160.0], ..Distortion::default() };
        let lens = Lens { distortion: flat, ..lens(Projection::Fisheye, 2000.0, size) };
        for face in views(&lens, size) {
            assert!(face.size.0.max(face.size.1) <= 400, "{face:?}");
        }
    }
}
