//! Positions against the outlines of an object: a position is not where most photos that see it show the background.

use gs_datasets::{PointCloud, View};
use gs_multiview::{Pinhole, foreground_masks};

/// Largest share of the photos that see a position and show the background there. The positions of a sweep are exact to
/// a pixel or two, which puts those of a rim outside some of the outlines.
const MISSED: f64 = 0.1;

/// The outlines of what stands before a transparent or plain background.
pub struct Outlines {
    /// Cameras, and for each pixel 0 where the background is.
    views: Vec<(Pinhole, Vec<u8>)>,
}

impl Outlines {
    /// `None` where the background is neither transparent nor plain.
    pub fn of(views: &[View]) -> Option<Self> {
        let masks = foreground_masks(views)?;
        let of_view = |(view, mask): (&View, Option<Vec<u8>>)| {
            let mut shown = mask?;
            // A pixel that does not count says nothing, also not that the background is there.
            let ignored = view.mask.iter().flat_map(|mask| mask.iter().enumerate().filter(|(_, counts)| **counts == 0));
            ignored.for_each(|(pixel, _)| shown[pixel] = 255);
            Some((Pinhole::new(view), shown))
        };
        Some(Self { views: views.iter().zip(masks).filter_map(of_view).collect() })
    }

    /// Whether the photos that see `position` show the object there.
    pub fn admit(&self, position: [f32; 3]) -> bool {
        let position = glam::Vec3::from(position).as_dvec3();
        let shown = self.views.iter().filter_map(|(camera, mask)| Some(mask[camera.sees(position)?.0] > 0));
        let (seen, missed) = shown.fold((0, 0), |(seen, missed), shown| (seen + 1, missed + usize::from(!shown)));
        f64::from(missed as u32) <= MISSED * f64::from(seen as u32)
    }

    /// The points that are admitted.
    pub fn within(&self, points: PointCloud) -> PointCloud {
        let rows = points.positions.into_iter().zip(points.colors).filter(|(position, _)| self.admit(*position));
        let (positions, colors) = rows.unzip();
        PointCloud { positions, colors }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};
    use gs_base::Intrinsics;
    use gs_datasets::RgbImage8;

    use super::*;

    /// A camera at a distance of 4 that looks at the origin from an angle about z, and sees a ball of radius 1 on
    /// black.
    fn view(angle: f64) -> View {
        let size = 40;
        let eye = 4.0 * DVec3::new(angle.cos(), angle.sin(), 0.0);
        let c2w = DMat4::look_to_rh(eye, -eye.normalize(), DVec3::Z).inverse()
            * DMat4::from_diagonal(glam::dvec4(1., -1., -1., 1.));
        let intrinsics = Intrinsics { fx: 40.0, fy: 40.0, cx: 20.0, cy: 20.0 };
        let inside = |i: usize| {
            let (x, y) = ((i % size) as f64 - 19.5, (i / size) as f64 - 19.5);
            // The tangent of the ball's outline: 1 / sqrt(15).
            (x * x + y * y).sqrt() / 40.0 < 15f64.sqrt().recip()
        };
        let data = (0..size * size).flat_map(|i| [if inside(i) { 200 } else { 0 }; 3]).collect();
        let image = RgbImage8 { width: size, height: size, data };
        View::new(c2w, intrinsics, image)
    }

    #[test]
    fn only_what_outlines_hold_is_admitted() {
        let views: Vec<View> = (0..12).map(|k| view(f64::from(k) * std::f64::consts::TAU / 12.0)).collect();
        let outlines = Outlines::of(&views).expect("a plain background");
        let positions = [[0.0, 0.0, 0.0], [0.6, 0.5, 0.3], [1.6, 0.0, 0.0], [0.0, 0.0, 1.4], [50.0, 50.0, 50.0]];
        let admitted: Vec<bool> = positions.into_iter().map(|position| outlines.admit(position)).collect();
        assert_eq!(admitted, [true, true, false, false, true], "what no photo sees is not contradicted");
        let points = PointCloud { positions: positions.to_vec(), colors: (0..5).map(|k| [k; 3]).collect() };
        assert_eq!(outlines.within(points).colors, [[0; 3], [1; 3], [4; 3]]);
    }

    #[test]
    fn a_background_with_structure_has_no_outlines() {
        let mut views: Vec<View> = (0..4).map(|k| view(f64::from(k))).collect();
        for view in &mut views {
            view.image.data.iter_mut().enumerate().for_each(|(i, level)| *level = (i * 37 % 251) as u8);
        }
        assert!(Outlines::of(&views).is_none());
    }
}
