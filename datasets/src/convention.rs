//! Conventions of camera poses: which way a matrix leads, and which way its camera's axes point.

use std::fmt;
use std::str::FromStr;

use glam::{DMat3, DMat4, DVec3};

/// The direction of a camera's axis, as seen in the photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraAxis {
    /// To the right in the photo.
    Right,
    /// To the left.
    Left,
    /// Down.
    Down,
    /// Up.
    Up,
    /// Into the scene.
    Forward,
    /// Away from the scene.
    Back,
}

impl CameraAxis {
    const ALL: [Self; 6] = [Self::Right, Self::Left, Self::Down, Self::Up, Self::Forward, Self::Back];

    /// The direction in OpenCV axes (x right, y down, z forward).
    fn direction(self) -> DVec3 {
        match self {
            Self::Right => DVec3::X,
            Self::Left => DVec3::NEG_X,
            Self::Down => DVec3::Y,
            Self::Up => DVec3::NEG_Y,
            Self::Forward => DVec3::Z,
            Self::Back => DVec3::NEG_Z,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Left => "left",
            Self::Down => "down",
            Self::Up => "up",
            Self::Forward => "forward",
            Self::Back => "back",
        }
    }
}

/// The meaning of the pose matrices in a file. As text: `c2w-opencv`, `c2w-opengl`, `w2c-opencv`, `w2c-opengl`, or
/// three axes in place of the last word, `c2w-down-right-back`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PoseConvention {
    /// Whether a matrix leads from the world to the camera; otherwise from the camera to the world.
    pub world_to_camera: bool,
    /// The directions of the camera's x, y and z axis. Those of a left-handed camera belong to a left-handed world, as
    /// Unity's do.
    pub axes: [CameraAxis; 3],
}

/// OpenCV's camera axes, also COLMAP's.
pub(crate) const OPENCV: [CameraAxis; 3] = [CameraAxis::Right, CameraAxis::Down, CameraAxis::Forward];

/// OpenGL's camera axes, also Blender's and nerfstudio's.
pub(crate) const OPENGL: [CameraAxis; 3] = [CameraAxis::Right, CameraAxis::Up, CameraAxis::Back];

/// LLFF's camera axes.
pub(crate) const LLFF: [CameraAxis; 3] = [CameraAxis::Down, CameraAxis::Right, CameraAxis::Back];

impl PoseConvention {
    /// All 96 conventions, the usual ones first, those of left-handed cameras last.
    pub fn all() -> Vec<Self> {
        let mut axes: Vec<[CameraAxis; 3]> = vec![OPENGL, OPENCV, LLFF];
        for hand in [1.0, -1.0] {
            for x in CameraAxis::ALL {
                for y in CameraAxis::ALL {
                    let third = CameraAxis::ALL.into_iter().find(|z| hand_of([x, y, *z]) == hand);
                    axes.extend(third.map(|z| [x, y, z]).filter(|found| !axes.contains(found)));
                }
            }
        }
        axes.into_iter().flat_map(|axes| [false, true].map(|world_to_camera| Self { world_to_camera, axes })).collect()
    }

    /// Camera to world in OpenCV axes, of a file's matrix. A file whose world has the other hand than ours has the x
    /// axis of its world negated.
    pub fn to_c2w(self, file: DMat4) -> DMat4 {
        let c2w = if self.world_to_camera { file.inverse() } else { file };
        let c2w = c2w * DMat4::from_mat3(self.matrix().transpose());
        if c2w.determinant() < 0.0 { DMat4::from_scale(mirrored(DVec3::ONE)) * c2w } else { c2w }
    }

    /// Whether the world of a file's matrix has the other hand than ours.
    pub fn mirrors(self, file: DMat4) -> bool {
        (file.determinant() < 0.0) != (hand_of(self.axes) < 0.0)
    }

    /// A camera (camera to world, OpenCV axes) that was read by this convention as another one reads it, or `None` as
    /// it is; in a world of our hand.
    pub fn reread(self, by: Option<Self>, c2w: DMat4) -> DMat4 {
        let file = self.to_file(c2w);
        if by.is_some() || self.mirrors(file) { by.unwrap_or(self).to_c2w(file) } else { c2w }
    }

    /// The file's matrix of a camera (camera to world, OpenCV axes), in a world of our hand.
    pub fn to_file(self, c2w: DMat4) -> DMat4 {
        let file = c2w * DMat4::from_mat3(self.matrix());
        if self.world_to_camera { file.inverse() } else { file }
    }

    /// OpenCV axes of a vector in the file's camera axes.
    fn matrix(self) -> DMat3 {
        let [x, y, z] = self.axes.map(CameraAxis::direction);
        DMat3::from_cols(x, y, z)
    }
}

/// 1 of right-handed axes, -1 of left-handed ones, 0 of others.
fn hand_of([x, y, z]: [CameraAxis; 3]) -> f64 {
    x.direction().cross(y.direction()).dot(z.direction())
}

/// A position in the mirrored world.
pub fn mirrored(position: DVec3) -> DVec3 {
    position * DVec3::new(-1.0, 1.0, 1.0)
}

impl fmt::Display for PoseConvention {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.world_to_camera { "w2c-" } else { "c2w-" })?;
        match self.axes {
            OPENCV => f.write_str("opencv"),
            OPENGL => f.write_str("opengl"),
            axes => f.write_str(&axes.map(CameraAxis::name).join("-")),
        }
    }
}

impl FromStr for PoseConvention {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "expected c2w or w2c, then opencv, opengl or three axes, as in \
                     c2w-opencv and w2c-right-down-forward, found {text:?}"
            )
        };
        let (way, axes) = text.split_once('-').ok_or_else(wrong)?;
        let world_to_camera = match way {
            "c2w" => false,
            "w2c" => true,
            _ => return Err(wrong()),
        };
        let axes = match axes {
            "opencv" => OPENCV,
            "opengl" => OPENGL,
            names => {
                let axis = |name: &str| CameraAxis::ALL.into_iter().find(|axis| axis.name() == name);
                let found: Option<Vec<CameraAxis>> = names.split('-').map(axis).collect();
                found.and_then(|found| found.try_into().ok()).filter(|axes| hand_of(*axes) != 0.0).ok_or_else(wrong)?
            }
        };
        Ok(Self { world_to_camera, axes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_convention_has_a_text_of_its_own_and_leads_back() {
        let pose = DMat4::from_rotation_translation(
            glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0),
            DVec3::new(1.0, -2.0, 3.0),
        );
        let all = PoseConvention::all();
        assert_eq!(all.len(), 96);
        for (i, convention) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|other| other != convention), "{convention} twice");
            assert_eq!(convention.to_string().parse(), Ok(*convention));
            let back = convention.to_c2w(convention.to_file(pose));
            assert!(back.abs_diff_eq(pose, 1e-12), "{convention}");
        }
    }

    #[test]
    fn opengl_looks_along_its_negative_z_axis() {
        let file = DMat4::from_translation(DVec3::new(0.0, 0.0, 5.0));
        let c2w =
            "c2w-opengl".parse::<PoseConvention>().map(|convention| convention.to_c2w(file)).expect("a convention");
        assert_eq!(c2w.transform_vector3(DVec3::Z), DVec3::NEG_Z);
        assert_eq!(c2w.transform_vector3(DVec3::Y), DVec3::NEG_Y);
        for wrong in ["", "opencv", "c2w", "w2c-", "c2w-right-left-back", "c2w-right-left-up", "c2w-right-down"] {
            assert!(wrong.parse::<PoseConvention>().is_err(), "{wrong}");
        }
    }
}
