//! The scene in the layout of version 2.

use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use parquet::basic::{ConvertedType, Repetition, Type as Kind};
use parquet::data_type::{ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::file::properties::{WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use super::scene::*;

/// The name of the segment.
pub const NAME: &str = "10023947602400723454_1120_000_1140_000";

/// Writes cells of some rows into a group.
type Writer = Box<dyn Fn(&mut SerializedRowGroupWriter<'_, File>, Range<usize>)>;

/// Cells of a column; lists may be empty.
pub struct Cells {
    pub kind: Kind,
    pub rows: usize,
    is_list: bool,
    write: Writer,
}

pub type Columns = Vec<(String, Cells)>;

/// A value in each row.
pub fn flat<T: DataType>(values: impl IntoIterator<Item = impl Into<T::T>>) -> Cells {
    cells::<T>(values.into_iter().map(|value| vec![value.into()]).collect(), false)
}

/// A list in each row.
pub fn lists<T: DataType>(lists: impl IntoIterator<Item = Vec<T::T>>) -> Cells {
    cells::<T>(lists.into_iter().collect(), true)
}

fn cells<T: DataType>(cells: Vec<Vec<T::T>>, is_list: bool) -> Cells {
    let (kind, rows) = (T::get_physical_type(), cells.len());
    Cells { kind, rows, is_list, write: Box::new(move |group, rows| column::<T>(group, cells[rows].to_vec(), is_list)) }
}

impl Cells {
    fn described(&self, name: &str) -> Type {
        let leaf = |name: &str| {
            let builder = Type::primitive_type_builder(name, self.kind).with_repetition(Repetition::OPTIONAL);
            builder.build().expect("a column")
        };
        if !self.is_list {
            return leaf(name);
        }
        let group = |name: &str, repetition, inner: Type, converted| {
            let builder = Type::group_type_builder(name).with_repetition(repetition).with_converted_type(converted);
            builder.with_fields(vec![Arc::new(inner)]).build().expect("a list")
        };
        let inner = group("list", Repetition::REPEATED, leaf("element"), ConvertedType::NONE);
        group(name, Repetition::OPTIONAL, inner, ConvertedType::LIST)
    }
}

fn column<T: DataType>(group: &mut SerializedRowGroupWriter<'_, File>, cells: Vec<Vec<T::T>>, is_list: bool) {
    let (mut definitions, mut repetitions, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for cell in cells {
        if cell.is_empty() {
            definitions.push(0);
            repetitions.push(0);
        }
        for (index, value) in cell.into_iter().enumerate() {
            definitions.push(if is_list { 3 } else { 1 });
            repetitions.push(i16::from(index > 0));
            values.push(value);
        }
    }
    let mut writer = group.next_column().expect("open").expect("a column");
    let repetitions = is_list.then_some(&repetitions[..]);
    writer.typed::<T>().write_batch(&values, Some(&definitions), repetitions).expect("written");
    writer.close().expect("closed");
}

/// How a file is written.
#[derive(Clone, Copy)]
pub struct Style {
    pub version: WriterVersion,
    pub dictionary: bool,
    /// Rows in a group, and bytes in a page.
    pub group: usize,
    pub page: usize,
}

pub const PLAIN: Style = Style { version: WriterVersion::PARQUET_1_0, dictionary: false, group: 1000, page: 1 << 20 };

/// Writes the columns of a component.
pub fn write(root: &Path, component: &str, columns: &[(String, Cells)], style: Style) {
    let folder = root.join(component);
    std::fs::create_dir_all(&folder).expect("a folder");
    let fields = columns.iter().map(|(name, cells)| Arc::new(cells.described(name))).collect();
    let schema = Type::group_type_builder("schema").with_fields(fields).build().expect("a schema");
    let properties = WriterProperties::builder()
        .set_writer_version(style.version)
        .set_dictionary_enabled(style.dictionary)
        .set_data_page_size_limit(style.page)
        .set_write_batch_size(16)
        .build();
    let file = File::create(folder.join(format!("{NAME}.parquet"))).expect("a file");
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).expect("a writer");
    let rows = columns[0].1.rows;
    for start in (0..rows).step_by(style.group) {
        let mut group = writer.next_row_group().expect("a group");
        for (_, cells) in columns {
            (cells.write)(&mut group, start..(start + style.group).min(rows));
        }
        group.close().expect("closed");
    }
    writer.close().expect("closed");
}

/// Each frame with each of some sensors.
fn each<T>(sensors: &[T]) -> impl Iterator<Item = (usize, &T)> + Clone {
    (0..FRAMES).flat_map(move |frame| sensors.iter().map(move |sensor| (frame, sensor)))
}

pub fn stamp(frame: usize) -> i64 {
    STAMP + INTERVAL * frame as i64
}

fn named(component: &str, columns: Vec<(&str, Cells)>) -> Columns {
    let full = |name: &str| match name.starts_with("key.") {
        true => name.to_string(),
        false => format!("[{component}Component].{name}"),
    };
    columns.into_iter().map(|(name, cells)| (full(name), cells)).collect()
}

/// The columns of all components.
pub fn components() -> Vec<(&'static str, Columns)> {
    let (lasers, cameras) = (lasers(), cameras());
    let of_vehicle = || flat::<Int64Type>((0..FRAMES).map(stamp));
    let pose = |t: f64| rows(&vehicle(t));
    let scans = each(&lasers);
    let sides = |l: &Laser, channels: i32| vec![l.rows as i32, l.columns as i32, channels];
    let images = |image: fn(&Laser, usize) -> Vec<f32>| {
        lists::<FloatType>(scans.clone().map(move |(frame, laser)| image(laser, frame)))
    };
    let shots = each(&cameras);
    let intrinsics = |i: usize| flat::<DoubleType>(cameras.iter().map(|camera| camera.intrinsic[i]));
    let names = ["f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3"].map(|name| format!("intrinsic.{name}"));
    let mut calibration =
        vec![("key.camera_name", flat::<Int32Type>(cameras.iter().map(|camera| camera.number as i32)))];
    calibration.extend(names.iter().enumerate().map(|(i, name)| (name.as_str(), intrinsics(i))));
    calibration.extend([
        ("extrinsic.transform", lists::<DoubleType>(cameras.iter().map(|camera| rows(&camera.place)))),
        ("width", flat::<Int32Type>([WIDTH as i32; 2])),
        ("height", flat::<Int32Type>([HEIGHT as i32; 2])),
    ]);
    let bound = |of: fn(&(f64, f64)) -> f64| {
        // As in the data set, where the bounds of given angles are there too.
        let bounds = |laser: &Laser| match &laser.angles {
            Ok(angles) => (angles[0], angles[angles.len() - 1]),
            Err(bounds) => *bounds,
        };
        flat::<DoubleType>(lasers.iter().map(|laser| of(&bounds(laser))))
    };
    let labels: Vec<_> = (0..FRAMES).map(label).collect();
    let of_box = |value: &dyn Fn(usize) -> f64| flat::<DoubleType>((0..FRAMES).map(value));
    let vehicle_pose = vec![
        ("key.segment_context_name", flat::<ByteArrayType>([NAME; FRAMES])),
        ("key.frame_timestamp_micros", of_vehicle()),
        ("world_from_vehicle.transform", lists::<DoubleType>((0..FRAMES).map(|frame| pose(middle(frame))))),
    ];
    let lidar = vec![
        ("key.frame_timestamp_micros", flat::<Int64Type>(scans.clone().map(|(frame, _)| stamp(frame)))),
        ("key.laser_name", flat::<Int32Type>(scans.clone().map(|(_, laser)| laser.number as i32))),
        ("range_image_return1.values", images(range_image)),
        ("range_image_return1.shape", lists::<Int32Type>(scans.clone().map(|(_, laser)| sides(laser, 4)))),
        ("range_image_return2.values", images(second_image)),
        ("range_image_return2.shape", lists::<Int32Type>(scans.clone().map(|(_, laser)| sides(laser, 4)))),
    ];
    let top = &lasers[0];
    let lidar_pose = vec![
        ("key.frame_timestamp_micros", of_vehicle()),
        ("key.laser_name", flat::<Int32Type>([1; FRAMES])),
        ("range_image_return1.values", lists::<FloatType>((0..FRAMES).map(|frame| pose_image(top, frame)))),
        ("range_image_return1.shape", lists::<Int32Type>((0..FRAMES).map(|_| sides(top, 6)))),
    ];
    let lidar_calibration = vec![
        ("key.laser_name", flat::<Int32Type>(lasers.iter().map(|laser| laser.number as i32))),
        ("extrinsic.transform", lists::<DoubleType>(lasers.iter().map(|laser| rows(&laser.place)))),
        ("beam_inclination.min", bound(|bounds| bounds.0)),
        ("beam_inclination.max", bound(|bounds| bounds.1)),
        (
            "beam_inclination.values",
            lists::<DoubleType>(lasers.iter().map(|laser| laser.angles.clone().unwrap_or_default())),
        ),
    ];
    let seconds = |frame: usize, camera: &Camera| STAMP as f64 * 1e-6 + exposure(frame, camera);
    let camera_image = vec![
        ("key.frame_timestamp_micros", flat::<Int64Type>(shots.clone().map(|(frame, _)| stamp(frame)))),
        ("key.camera_name", flat::<Int32Type>(shots.clone().map(|(_, camera)| camera.number as i32))),
        ("image", flat::<ByteArrayType>(shots.clone().map(|(_, camera)| png(camera)))),
        ("pose.transform", lists::<DoubleType>(shots.clone().map(|(f, camera)| pose(exposure(f, camera))))),
        ("pose_timestamp", flat::<DoubleType>(shots.map(|(frame, camera)| seconds(frame, camera)))),
    ];
    let lidar_box = vec![
        ("key.frame_timestamp_micros", of_vehicle()),
        ("key.laser_object_id", flat::<ByteArrayType>(["the-box"; FRAMES])),
        ("box.center.x", of_box(&|frame| labels[frame].0.x)),
        ("box.center.y", of_box(&|frame| labels[frame].0.y)),
        ("box.center.z", of_box(&|frame| labels[frame].0.z)),
        ("box.size.x", of_box(&|_| LABEL_SIZE.x)),
        ("box.size.y", of_box(&|_| LABEL_SIZE.y)),
        ("box.size.z", of_box(&|_| LABEL_SIZE.z)),
        ("box.heading", of_box(&|frame| labels[frame].1)),
        ("type", flat::<Int32Type>([1; FRAMES])),
    ];
    vec![
        ("vehicle_pose", named("VehiclePose", vehicle_pose)),
        ("lidar", named("LiDAR", lidar)),
        ("lidar_pose", named("LiDARPose", lidar_pose)),
        ("lidar_calibration", named("LiDARCalibration", lidar_calibration)),
        ("camera_image", named("CameraImage", camera_image)),
        ("camera_calibration", named("CameraCalibration", calibration)),
        ("lidar_box", named("LiDARBox", lidar_box)),
    ]
}

/// The photo of a camera. PNG keeps it exactly; the reader tells the format by the content.
pub fn png(camera: &Camera) -> Vec<u8> {
    static PHOTOS: LazyLock<[Vec<u8>; 2]> = LazyLock::new(|| {
        cameras().map(|camera| {
            let mut bytes = std::io::Cursor::new(Vec::new());
            photo(&camera).write_to(&mut bytes, image::ImageFormat::Png).expect("encoded");
            bytes.into_inner()
        })
    });
    PHOTOS[camera.number as usize - 1].clone()
}

/// Writes all components.
pub fn segment(root: &Path, style: Style) {
    for (component, columns) in components() {
        write(root, component, &columns, style);
    }
}
