//! The points that depth priors place: one for each pixel of the training cameras' first frames, in a PLY file.
//!
//! Each view's depth has a scale and a shift of its own, so a surface that several views see lies there several times, as in the
//! unions that feed-forward reconstructors write.

use super::super::tracer::camera::Camera;

/// Points with colours, in the bytes of a PLY file's vertices: x, y, z (f32, little-endian), red, green, blue.
#[derive(Debug, Default)]
pub(super) struct Points {
    vertices: Vec<u8>,
    count: usize,
}

impl Points {
    /// Adds the pixels of one view whose depth is known. `depth` is `[height, width]` camera z, 0 where unknown; `colors` are encoded.
    pub fn add(&mut self, camera: &Camera, depth: &[f32], colors: &[[u8; 3]]) {
        for (index, (z, color)) in depth.iter().zip(colors).enumerate().filter(|(_, (z, _))| **z > 0.0) {
            let (x, y) = (index % camera.width, index / camera.width);
            let ray = camera.ray(x as f64 + 0.5, y as f64 + 0.5);
            let distance = f64::from(*z) / camera.depth(&ray, 1.0);
            for value in ray.at(distance).as_vec3().to_array() {
                self.vertices.extend(value.to_le_bytes());
            }
            self.vertices.extend(color);
            self.count += 1;
        }
    }

    /// The bytes of the file.
    pub fn ply(&self) -> Vec<u8> {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n\
             property float x\nproperty float y\nproperty float z\n\
             property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            self.count
        );
        [header.as_bytes(), &self.vertices].concat()
    }
}
