//! The scene in the layout of version 1.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::modular::{NAME, png, stamp};
use super::scene::*;

/// CRC-32C bit by bit, masked.
pub fn masked(bytes: &[u8]) -> u32 {
    let mut crc = !0_u32;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
        }
    }
    let crc = !crc;
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// A record around a content.
pub fn framed(content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    let (head, tail) = (masked(&length).to_le_bytes(), masked(content).to_le_bytes());
    [&length[..], &head, content, &tail].concat()
}

/// A message that is written field by field.
#[derive(Default)]
pub struct Message(pub Vec<u8>);

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value > 127 {
            self.0.push(value as u8 | 128);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    pub fn integer(mut self, field: u64, value: u64) -> Self {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    pub fn double(mut self, field: u64, value: f64) -> Self {
        self.varint(field << 3 | 1);
        self.0.extend(value.to_le_bytes());
        self
    }

    pub fn bytes(mut self, field: u64, bytes: &[u8]) -> Self {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend(bytes);
        self
    }

    /// An unpacked list.
    pub fn doubles(self, field: u64, values: &[f64]) -> Self {
        values.iter().fold(self, |message, value| message.double(field, *value))
    }

    pub fn transform(self, field: u64, pose: &glam::DMat4) -> Self {
        let inner = Message::default().doubles(1, &rows(pose));
        self.bytes(field, &inner.0)
    }
}

/// A compressed matrix.
pub fn matrix(shape: [usize; 3], values: &[f32]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let sides = shape.iter().fold(Message::default(), |message, side| message.integer(1, *side as u64));
    deflated(&Message::default().bytes(1, &data).bytes(2, &sides.0).0)
}

/// A zlib stream.
pub fn deflated(content: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(content).expect("packed");
    encoder.finish().expect("packed")
}

fn context() -> Message {
    let mut context = Message::default().bytes(1, NAME.as_bytes());
    for camera in cameras() {
        let calibration = Message::default()
            .integer(1, camera.number as u64)
            .doubles(2, &camera.intrinsic)
            .transform(3, &camera.place)
            .integer(4, WIDTH as u64)
            .integer(5, HEIGHT as u64)
            .integer(6, 2);
        context = context.bytes(2, &calibration.0);
    }
    for laser in lasers() {
        let mut calibration = Message::default().integer(1, laser.number as u64);
        calibration = match &laser.angles {
            Ok(angles) => calibration.doubles(2, angles),
            Err((low, high)) => calibration.double(3, *low).double(4, *high),
        };
        context = context.bytes(3, &calibration.transform(5, &laser.place).0);
    }
    context
}

/// The content of a frame.
pub fn frame(index: usize) -> Vec<u8> {
    let mut frame = Message::default().bytes(1, &context().0).integer(2, stamp(index) as u64);
    frame = frame.transform(3, &vehicle(middle(index)));
    for camera in cameras() {
        let time = exposure(index, &camera);
        let image = Message::default()
            .integer(1, camera.number as u64)
            .bytes(2, &png(&camera))
            .transform(3, &vehicle(time))
            .double(5, STAMP as f64 * 1e-6 + time);
        frame = frame.bytes(4, &image.0);
    }
    for laser in lasers() {
        let shape = [laser.rows, laser.columns, 4];
        let mut first = Message::default().bytes(2, &matrix(shape, &range_image(&laser, index)));
        if laser.number == 1 {
            first = first.bytes(4, &matrix([laser.rows, laser.columns, 6], &pose_image(&laser, index)));
        }
        let second = Message::default().bytes(2, &matrix(shape, &second_image(&laser, index)));
        let message = Message::default().integer(1, laser.number as u64).bytes(2, &first.0).bytes(3, &second.0);
        frame = frame.bytes(5, &message.0);
    }
    let (centre, heading) = label(index);
    let place = Message::default()
        .doubles(1, &[centre.x])
        .double(2, centre.y)
        .double(3, centre.z)
        .double(4, LABEL_SIZE.y)
        .double(5, LABEL_SIZE.x)
        .double(6, LABEL_SIZE.z)
        .double(7, heading);
    let label = Message::default().bytes(1, &place.0).integer(3, 1).bytes(4, b"the-box");
    frame.bytes(6, &label.0).0
}

/// Writes the segment; its file.
pub fn segment(root: &Path) -> PathBuf {
    let path = root.join(format!("segment-{NAME}_with_camera_labels.tfrecord"));
    let bytes: Vec<u8> = (0..FRAMES).flat_map(|index| framed(&frame(index))).collect();
    std::fs::write(&path, bytes).expect("written");
    path
}
