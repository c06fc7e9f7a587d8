//! A segment as both versions give it.

use std::collections::BTreeMap;

use glam::{DMat3, DMat4};

use super::calibration::{CameraCalibration, LaserCalibration};

/// The LiDAR on the roof, the only one with a pose for each pixel.
pub(crate) const TOP: i64 = 1;

/// Names of cameras and lasers; their numbers begin with 1.
pub(crate) const CAMERAS: [&str; 8] =
    ["FRONT", "FRONT_LEFT", "FRONT_RIGHT", "SIDE_LEFT", "SIDE_RIGHT", "REAR_LEFT", "REAR", "REAR_RIGHT"];
pub(crate) const LASERS: [&str; 5] = ["TOP", "FRONT", "SIDE_LEFT", "SIDE_RIGHT", "REAR"];

/// Labels of boxes by their number.
pub(crate) const LABELS: [&str; 5] = ["TYPE_UNKNOWN", "TYPE_VEHICLE", "TYPE_PEDESTRIAN", "TYPE_SIGN", "TYPE_CYCLIST"];

/// Farthest position, metres: twice the circumference of the Earth.
const POSITION_MAX: f64 = 8e7;

/// Largest element of R^T R - 1 of a rotation. Single precision leaves 1e-6; a matrix in another order is off by 1.
const ROTATION_MAX: f64 = 1e-3;

/// The description of a segment, known before a sweep or an image is read.
#[derive(Debug)]
pub(crate) struct Parts {
    pub name: String,
    /// By the camera's number.
    pub cameras: BTreeMap<i64, CameraCalibration>,
    /// By the laser's number.
    pub lasers: BTreeMap<i64, LaserCalibration>,
    /// Times ascending.
    pub frames: Vec<FramePart>,
    /// Omissions, in sentences.
    pub warnings: Vec<String>,
}

/// A frame.
#[derive(Debug)]
pub(crate) struct FramePart {
    /// Unix time of the first column of the TOP laser, microseconds.
    pub stamp: i64,
    /// Vehicle to world.
    pub pose: DMat4,
    /// By the camera's number.
    pub images: BTreeMap<i64, ImagePart>,
    /// Whether any laser has a range image.
    pub has_sweep: bool,
}

/// An image before it is decoded.
#[derive(Debug)]
pub(crate) struct ImagePart {
    /// Vehicle to world at `time`.
    pub pose: DMat4,
    /// Unix seconds.
    pub time: f64,
}

/// One return of one laser in one frame.
pub(crate) struct Scan {
    pub laser: i64,
    /// Channels: range (metres), intensity, elongation, whether the pixel is in a zone without labels.
    pub image: RangeImage,
    /// Of the TOP laser, channels: roll, pitch, yaw (radians), x, y, z (metres), vehicle to world.
    pub pose: Option<RangeImage>,
}

/// An image with any channels, `[rows, columns, channels]`.
#[derive(Debug, Clone)]
pub(crate) struct RangeImage {
    pub rows: usize,
    pub columns: usize,
    pub channels: usize,
    pub values: Vec<f32>,
}

impl RangeImage {
    /// An image whose shape holds its values.
    ///
    /// # Errors
    /// A piece of a sentence: what is found.
    pub fn new(shape: &[i64], values: Vec<f32>) -> Result<Self, String> {
        let sides: Vec<usize> = shape.iter().filter_map(|side| usize::try_from(*side).ok()).collect();
        let wrong = || format!("the shape {shape:?} on {} values", values.len());
        let &[rows, columns, channels] = &sides[..] else { return Err(wrong()) };
        let count = rows.checked_mul(columns).and_then(|count| count.checked_mul(channels));
        if sides.len() != shape.len() || count != Some(values.len()) {
            return Err(wrong());
        }
        Ok(Self { rows, columns, channels, values })
    }

    /// The channels of a pixel.
    pub fn pixel(&self, row: usize, column: usize) -> &[f32] {
        &self.values[(row * self.columns + column) * self.channels..][..self.channels]
    }
}

/// A labelled box, in the vehicle's axes at the pose of its frame.
pub(crate) struct BoxPart {
    pub id: String,
    /// Place in [`LABELS`].
    pub kind: i64,
    pub centre: [f64; 3],
    /// Length, width, height.
    pub size: [f64; 3],
    pub heading: f64,
}

/// The rigid transform of 16 numbers, row by row; `None` where they are none.
pub(crate) fn rigid(values: &[f64]) -> Option<DMat4> {
    let pose = DMat4::from_cols_array(values.try_into().ok()?).transpose();
    let turn = DMat3::from_mat4(pose);
    let off = (turn.transpose() * turn - DMat3::IDENTITY).to_cols_array();
    let is_rotation = off.iter().all(|value| value.abs() <= ROTATION_MAX) && turn.determinant() > 0.0;
    let at = pose.w_axis.truncate();
    let is_placed = at.abs().max_element() <= POSITION_MAX && at.is_finite();
    (is_rotation && is_placed && pose.row(3).to_array() == [0.0, 0.0, 0.0, 1.0]).then_some(pose)
}

/// The number of a sensor by its name.
pub(crate) fn number(names: &[&str], name: &[u8]) -> Option<i64> {
    names.iter().position(|known| known.as_bytes() == name).map(|place| place as i64 + 1)
}

/// The name of a sensor by its number.
pub(crate) fn name(names: &[&'static str], number: i64) -> Option<&'static str> {
    names.get(usize::try_from(number.checked_sub(1)?).ok()?).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_is_read_by_rows() {
        let pose = rigid(&[0., -1., 0., 5., 1., 0., 0., 6., 0., 0., 1., 7., 0., 0., 0., 1.]).expect("rigid");
        assert_eq!(pose.transform_point3(glam::DVec3::X).to_array(), [5.0, 7.0, 7.0]);
        assert!(rigid(&[0.0; 16]).is_none() && rigid(&[1.0; 15]).is_none());
        let mut mirrored = DMat4::IDENTITY.to_cols_array();
        mirrored[0] = -1.0;
        assert!(rigid(&mirrored).is_none());
        let mut far = DMat4::IDENTITY.to_cols_array();
        far[3] = f64::NAN;
        assert!(rigid(&far).is_none());
    }

    #[test]
    fn names_and_numbers() {
        assert_eq!((number(&LASERS, b"REAR"), name(&LASERS, 5)), (Some(5), Some("REAR")));
        assert_eq!((number(&LASERS, b"rear"), name(&LASERS, 0), name(&LASERS, i64::MIN)), (None, None, None));
    }
}
