//! A known world: a plane, a box that moves from frame to frame, and a vehicle that drives and turns while its lasers
//! do.

use std::f64::consts::PI;

use glam::{DMat3, DMat4, DVec3};

/// Frames, and microseconds between them.
pub const FRAMES: usize = 3;
pub const STAMP: i64 = 1_550_000_000_000_000;
pub const INTERVAL: i64 = 100_000;

/// The vehicle at the middle of the first sweep. Data sets have positions of thousands of metres.
pub const START: DVec3 = DVec3::new(5012.25, -3021.5, 61.75);

/// Height of the plane.
pub const GROUND: f64 = START.z - 0.4;

/// Size of the box, and its centre and heading by frame. It stands still within a sweep.
pub const SIZE: DVec3 = DVec3::new(4.5, 2.0, 1.6);

/// Size of the label: it reaches beyond the box by 5 mm above and below, where labels have no margin for rounding.
pub const LABEL_SIZE: DVec3 = DVec3::new(SIZE.x, SIZE.y, SIZE.z + 0.01);

pub fn box_pose(frame: usize) -> (DVec3, f64) {
    let t = frame as f64;
    (START + DVec3::new(11.0 + 0.8 * t, 4.0 - 0.1 * t, 0.4), 0.7 + 0.05 * t)
}

/// Seconds after the first time stamp, of the middle of a sweep.
pub fn middle(frame: usize) -> f64 {
    0.1 * frame as f64 + 0.05
}

/// Roll, pitch and yaw, and position of the vehicle, seconds after the first time stamp.
pub fn motion(t: f64) -> ([f64; 3], DVec3) {
    let t = t - middle(0);
    let place = START + DVec3::new(9.0 * t, 3.0 * t - 2.0 * t * t, 0.1 * t);
    ([0.02 - 0.1 * t, -0.03 + 0.2 * t, 0.4 + 0.5 * t], place)
}

/// Vehicle to world: columns of Rz(yaw) Ry(pitch) Rx(roll), written out.
pub fn vehicle(t: f64) -> DMat4 {
    let ([roll, pitch, yaw], place) = motion(t);
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    let turn = DMat3::from_cols(
        DVec3::new(cy * cp, sy * cp, -sp),
        DVec3::new(cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr),
        DVec3::new(cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr),
    );
    DMat4::from_cols(turn.x_axis.extend(0.0), turn.y_axis.extend(0.0), turn.z_axis.extend(0.0), place.extend(1.0))
}

/// A laser: its number, place on the vehicle, and angles of its rows from the bottom up, or their bounds.
pub struct Laser {
    pub number: i64,
    pub place: DMat4,
    pub angles: Result<Vec<f64>, (f64, f64)>,
    pub rows: usize,
    pub columns: usize,
}

pub fn lasers() -> [Laser; 2] {
    let top = DMat4::from_translation(DVec3::new(1.4, 0.1, 1.9)) * DMat4::from_rotation_z(2.6);
    let front = DMat4::from_translation(DVec3::new(3.9, -0.2, 0.5))
        * DMat4::from_rotation_z(-0.4)
        * DMat4::from_rotation_y(0.05);
    let angles: Vec<f64> = (0..12).map(|row| -0.32 + 0.03 * f64::from(row) + 0.0003 * f64::from(row * row)).collect();
    [
        Laser { number: 1, place: top, rows: angles.len(), columns: 90, angles: Ok(angles) },
        Laser { number: 2, place: front, rows: 8, columns: 40, angles: Err((-0.6, 0.2)) },
    ]
}

impl Laser {
    /// The direction of a pixel in the axes of the laser: rows from the top down, columns clockwise from behind the
    /// vehicle's axis.
    pub fn direction(&self, row: usize, column: usize) -> DVec3 {
        let from_below = self.rows - 1 - row;
        let angle = match &self.angles {
            Ok(angles) => angles[from_below],
            Err((low, high)) => low + (high - low) * (from_below as f64 + 0.5) / self.rows as f64,
        };
        let yaw = self.place.x_axis.y.atan2(self.place.x_axis.x);
        let azimuth = PI - (column as f64 + 0.5) * 2.0 * PI / self.columns as f64 - yaw;
        DVec3::new(azimuth.cos() * angle.cos(), azimuth.sin() * angle.cos(), angle.sin())
    }

    /// The share of a turn at which a column is measured. The data set has moved the points of all but the first laser
    /// to the middle.
    pub fn part(&self, column: usize) -> f64 {
        if self.number == 1 { (column as f64 + 0.5) / self.columns as f64 } else { 0.5 }
    }
}

/// A pixel that hits something.
pub struct Hit {
    pub row: usize,
    pub column: usize,
    pub range: f64,
    /// World.
    pub point: DVec3,
    /// Seconds after the first time stamp.
    pub time: f64,
    pub on_box: bool,
}

/// Farthest hit, metres.
pub const FAR: f64 = 60.0;

/// The hits of a laser in a frame, by rows.
pub fn hits(laser: &Laser, frame: usize) -> Vec<Hit> {
    let mut hits = Vec::new();
    for row in 0..laser.rows {
        for column in 0..laser.columns {
            let time = 0.1 * (frame as f64 + laser.part(column));
            let pose = vehicle(time) * laser.place;
            let (from, along) = (pose.w_axis.truncate(), pose.transform_vector3(laser.direction(row, column)));
            let ground = (GROUND - from.z) / along.z;
            let solid = enter(from, along, frame);
            let candidates =
                [(ground, false), (solid, true)].into_iter().filter(|(range, _)| (0.5..FAR).contains(range));
            let Some((range, on_box)) = candidates.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
            hits.push(Hit { row, column, range, point: from + range * along, time, on_box });
        }
    }
    hits
}

/// Where a ray enters the box; infinity where it does not.
fn enter(from: DVec3, along: DVec3, frame: usize) -> f64 {
    let (centre, yaw) = box_pose(frame);
    let turn = DMat3::from_rotation_z(-yaw);
    let (from, along) = (turn * (from - centre), turn * along);
    let (a, b) = ((-0.5 * SIZE - from) / along, (0.5 * SIZE - from) / along);
    let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
    if near <= far { near } else { f64::INFINITY }
}

/// The box in the vehicle's axes: centre and heading, which the vehicle turns into the box's heading in the world.
pub fn label(frame: usize) -> (DVec3, f64) {
    let (centre, yaw) = box_pose(frame);
    let pose = vehicle(middle(frame));
    let across = DMat3::from_mat4(pose).transpose() * DVec3::new(-yaw.sin(), yaw.cos(), 0.0);
    (pose.inverse().transform_point3(centre), (-across.x).atan2(across.y))
}

/// How far a point on the box moves until the next frame.
pub fn flow(frame: usize, point: DVec3) -> DVec3 {
    let ((centre, yaw), (later, turned)) = (box_pose(frame), box_pose(frame + 1));
    later + DMat3::from_rotation_z(turned - yaw) * (point - centre) - point
}

/// A camera: its number, place, and `[fu, fv, cu, cv, k1, k2, p1, p2, k3]`.
pub struct Camera {
    pub number: i64,
    pub place: DMat4,
    pub intrinsic: [f64; 9],
}

pub const WIDTH: usize = 60;
pub const HEIGHT: usize = 40;

pub fn cameras() -> [Camera; 2] {
    let at = |z: f64| DMat4::from_translation(DVec3::new(1.6, 0.0, 2.0)) * DMat4::from_rotation_z(z);
    let lens = [50.0, 51.0, 31.0, 19.0, 0.12, -0.05, 0.002, -0.001, 0.01];
    let mut pinhole = [45.0, 45.0, 30.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    pinhole[2] = 29.0;
    [
        Camera { number: 1, place: at(0.02) * DMat4::from_rotation_y(0.1), intrinsic: lens },
        Camera { number: 2, place: at(0.8) * DMat4::from_rotation_y(0.15), intrinsic: pinhole },
    ]
}

/// Seconds after the first time stamp at which an image is taken.
pub fn exposure(frame: usize, camera: &Camera) -> f64 {
    0.1 * frame as f64 + 0.03 + 0.01 * camera.number as f64
}

/// The colour that an ideal image has at x and y of the plane z = 1 (right and down), 0 to 255.
pub fn paint(x: f64, y: f64) -> [f64; 3] {
    [128.0 + 120.0 * x, 128.0 + 120.0 * y, 128.0 + 60.0 * (x - y)]
}

/// The photo of a camera, as the lens shows the ideal image.
pub fn photo(camera: &Camera) -> image::RgbImage {
    let [fu, fv, cu, cv, ..] = camera.intrinsic;
    image::RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |u, v| {
        let seen = ((f64::from(u) + 0.5 - cu) / fu, (f64::from(v) + 0.5 - cv) / fv);
        // The inverse of the lens by fixed points; its slope is far below 1.
        let (mut x, mut y) = seen;
        for _ in 0..100 {
            let (dx, dy) = lens(camera, x, y);
            (x, y) = (x + seen.0 - dx, y + seen.1 - dy);
        }
        image::Rgb(paint(x, y).map(|value| value.round().clamp(0.0, 255.0) as u8))
    })
}

/// OpenCV's lens model.
fn lens(camera: &Camera, x: f64, y: f64) -> (f64, f64) {
    let [.., k1, k2, p1, p2, k3] = camera.intrinsic;
    let r2 = x * x + y * y;
    let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
    (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y)
}

/// A transform as files have it, row by row.
pub fn rows(pose: &DMat4) -> Vec<f64> {
    pose.transpose().to_cols_array().to_vec()
}

/// The range image of a laser: range, intensity (the row), elongation, and whether the pixel is in a zone without
/// labels (column 0).
pub fn range_image(laser: &Laser, frame: usize) -> Vec<f32> {
    let mut image = vec![-1.0; 4 * laser.rows * laser.columns];
    for hit in hits(laser, frame) {
        let unlabelled = if hit.column == 0 { 1.0 } else { -1.0 };
        let pixel = [hit.range as f32, hit.row as f32, 0.0, unlabelled];
        image[4 * (hit.row * laser.columns + hit.column)..][..4].copy_from_slice(&pixel);
    }
    image
}

/// The second return: one pixel, a metre behind the first hit.
pub fn second_image(laser: &Laser, frame: usize) -> Vec<f32> {
    let mut image = vec![0.0; 4 * laser.rows * laser.columns];
    let hit = &hits(laser, frame)[0];
    image[4 * (hit.row * laser.columns + hit.column)] = hit.range as f32 + 1.0;
    image
}

/// The image of poses of a laser: roll, pitch, yaw, x, y, z.
pub fn pose_image(laser: &Laser, frame: usize) -> Vec<f32> {
    let pixel = |column: usize| {
        let (angles, place) = motion(0.1 * (frame as f64 + laser.part(column)));
        angles.into_iter().chain(place.to_array()).map(|value| value as f32)
    };
    (0..laser.rows).flat_map(|_| (0..laser.columns).flat_map(pixel)).collect()
}
