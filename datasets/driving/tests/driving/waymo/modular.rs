//! The scene in the layout of version 2.

use std::fs::File;
use std::path::Path;
use std::sync::{Arc, LazyLock};

use parquet::basic::{ConvertedType, Repetition, Type as Kind};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::file::properties::{WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;

use super::scene::*;

/// The name of the segment.
pub const NAME: &str = "10023947602400723454_1120_000_1140_000";

/// Cells of a column; lists may be empty, and a flat cell is a list of one value or none.
pub enum Cells {
    Integers(Vec<i64>),
    Shorts(Vec<i32>),
    Numbers(Vec<Option<f64>>),
    Bytes(Vec<Vec<u8>>),
    Floats(Vec<Vec<f32>>),
    Doubles(Vec<Vec<f64>>),
    Sides(Vec<Vec<i32>>),
}

pub type Columns = Vec<(String, Cells)>;

impl Cells {
    fn len(&self) -> usize {
        match self {
            Self::Integers(cells) => cells.len(),
            Self::Shorts(cells) => cells.len(),
            Self::Numbers(cells) => cells.len(),
            Self::Bytes(cells) => cells.len(),
            Self::Floats(cells) => cells.len(),
            Self::Doubles(cells) => cells.len(),
            Self::Sides(cells) => cells.len(),
        }
    }

    fn described(&self, name: &str) -> Type {
        let leaf = |name: &str, kind: Kind| {
            Type::primitive_type_builder(name, kind).with_repetition(Repetition::OPTIONAL).build().expect("a column")
        };
        let (kind, is_list) = match self {
            Self::Integers(_) => (Kind::INT64, false),
            Self::Shorts(_) => (Kind::INT32, false),
            Self::Numbers(_) => (Kind::DOUBLE, false),
            Self::Bytes(_) => (Kind::BYTE_ARRAY, false),
            Self::Floats(_) => (Kind::FLOAT, true),
            Self::Doubles(_) => (Kind::DOUBLE, true),
            Self::Sides(_) => (Kind::INT32, true),
        };
        if !is_list {
            return leaf(name, kind);
        }
        let group = |name: &str, repetition, inner: Type, converted| {
            let builder = Type::group_type_builder(name).with_repetition(repetition).with_converted_type(converted);
            builder.with_fields(vec![Arc::new(inner)]).build().expect("a list")
        };
        let inner = group("list", Repetition::REPEATED, leaf("element", kind), ConvertedType::NONE);
        group(name, Repetition::OPTIONAL, inner, ConvertedType::LIST)
    }

    fn write(&self, group: &mut SerializedRowGroupWriter<'_, File>, rows: std::ops::Range<usize>) {
        let single = |values: Vec<_>| values;
        match self {
            Self::Integers(c) => column::<Int64Type>(group, single(c[rows].iter().map(|v| vec![*v]).collect()), false),
            Self::Shorts(c) => column::<Int32Type>(group, c[rows].iter().map(|v| vec![*v]).collect(), false),
            Self::Numbers(c) => {
                column::<DoubleType>(group, c[rows].iter().map(|v| v.iter().copied().collect()).collect(), false)
            }
            Self::Bytes(c) => column::<ByteArrayType>(
                group,
                c[rows].iter().map(|v| vec![ByteArray::from(v.clone())]).collect(),
                false,
            ),
            Self::Floats(c) => column::<FloatType>(group, c[rows].to_vec(), true),
            Self::Doubles(c) => column::<DoubleType>(group, c[rows].to_vec(), true),
            Self::Sides(c) => column::<Int32Type>(group, c[rows].to_vec(), true),
        }
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
    let rows = columns[0].1.len();
    for start in (0..rows).step_by(style.group) {
        let mut group = writer.next_row_group().expect("a group");
        for (_, cells) in columns {
            cells.write(&mut group, start..(start + style.group).min(rows));
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
    let of_vehicle: Vec<i64> = (0..FRAMES).map(stamp).collect();
    let pose = |t: f64| rows(&vehicle(t));
    let scans = each(&lasers);
    let stamps = || Cells::Integers(scans.clone().map(|(frame, _)| stamp(frame)).collect());
    let numbers = || Cells::Shorts(scans.clone().map(|(_, laser)| laser.number as i32).collect());
    let sides = |channels: i32| {
        Cells::Sides(scans.clone().map(|(_, l)| vec![l.rows as i32, l.columns as i32, channels]).collect())
    };
    let images = |image: &dyn Fn(&Laser, usize) -> Vec<f32>| {
        Cells::Floats(scans.clone().map(|(frame, laser)| image(laser, frame)).collect())
    };
    let shots = each(&cameras);
    let top = [&lasers[0]];
    let turns = each(&top);
    let intrinsics = |i: usize| Cells::Numbers(cameras.iter().map(|camera| Some(camera.intrinsic[i])).collect());
    let mut calibration: Vec<(&str, Cells)> =
        vec![("key.camera_name", Cells::Shorts(cameras.iter().map(|camera| camera.number as i32).collect()))];
    let names = ["f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3"].map(|name| format!("intrinsic.{name}"));
    calibration.extend(names.iter().enumerate().map(|(i, name)| (name.as_str(), intrinsics(i))));
    calibration.extend([
        ("extrinsic.transform", Cells::Doubles(cameras.iter().map(|camera| rows(&camera.place)).collect())),
        ("width", Cells::Shorts(vec![WIDTH as i32; 2])),
        ("height", Cells::Shorts(vec![HEIGHT as i32; 2])),
    ]);
    let bound = |of: fn(&(f64, f64)) -> f64| {
        // As in the data set, where the bounds of given angles are there too.
        let bounds = |laser: &Laser| match &laser.angles {
            Ok(angles) => (angles[0], angles[angles.len() - 1]),
            Err(bounds) => *bounds,
        };
        Cells::Numbers(lasers.iter().map(|laser| Some(of(&bounds(laser)))).collect())
    };
    let labels: Vec<_> = (0..FRAMES).map(label).collect();
    let of_box = |value: &dyn Fn(usize) -> f64| Cells::Numbers((0..FRAMES).map(|f| Some(value(f))).collect());
    vec![
        (
            "vehicle_pose",
            named(
                "VehiclePose",
                vec![
                    ("key.segment_context_name", Cells::Bytes(vec![NAME.into(); FRAMES])),
                    ("key.frame_timestamp_micros", Cells::Integers(of_vehicle.clone())),
                    (
                        "world_from_vehicle.transform",
                        Cells::Doubles((0..FRAMES).map(|frame| pose(middle(frame))).collect()),
                    ),
                ],
            ),
        ),
        (
            "lidar",
            named(
                "LiDAR",
                vec![
                    ("key.frame_timestamp_micros", stamps()),
                    ("key.laser_name", numbers()),
                    ("range_image_return1.values", images(&range_image)),
                    ("range_image_return1.shape", sides(4)),
                    ("range_image_return2.values", images(&second_image)),
                    ("range_image_return2.shape", sides(4)),
                ],
            ),
        ),
        (
            "lidar_pose",
            named(
                "LiDARPose",
                vec![
                    ("key.frame_timestamp_micros", Cells::Integers(of_vehicle.clone())),
                    ("key.laser_name", Cells::Shorts(vec![1; FRAMES])),
                    (
                        "range_image_return1.values",
                        Cells::Floats(turns.clone().map(|(frame, laser)| pose_image(laser, frame)).collect()),
                    ),
                    (
                        "range_image_return1.shape",
                        Cells::Sides(turns.map(|(_, l)| vec![l.rows as i32, l.columns as i32, 6]).collect()),
                    ),
                ],
            ),
        ),
        (
            "lidar_calibration",
            named(
                "LiDARCalibration",
                vec![
                    ("key.laser_name", Cells::Shorts(lasers.iter().map(|laser| laser.number as i32).collect())),
                    ("extrinsic.transform", Cells::Doubles(lasers.iter().map(|laser| rows(&laser.place)).collect())),
                    ("beam_inclination.min", bound(|bounds| bounds.0)),
                    ("beam_inclination.max", bound(|bounds| bounds.1)),
                    (
                        "beam_inclination.values",
                        Cells::Doubles(lasers.iter().map(|laser| laser.angles.clone().unwrap_or_default()).collect()),
                    ),
                ],
            ),
        ),
        (
            "camera_image",
            named(
                "CameraImage",
                vec![
                    ("key.frame_timestamp_micros", Cells::Integers(shots.clone().map(|(f, _)| stamp(f)).collect())),
                    ("key.camera_name", Cells::Shorts(shots.clone().map(|(_, c)| c.number as i32).collect())),
                    ("image", Cells::Bytes(shots.clone().map(|(_, camera)| png(camera)).collect())),
                    ("pose.transform", Cells::Doubles(shots.clone().map(|(f, c)| pose(exposure(f, c))).collect())),
                    (
                        "pose_timestamp",
                        Cells::Numbers(shots.map(|(f, c)| Some(STAMP as f64 * 1e-6 + exposure(f, c))).collect()),
                    ),
                ],
            ),
        ),
        ("camera_calibration", named("CameraCalibration", calibration)),
        (
            "lidar_box",
            named(
                "LiDARBox",
                vec![
                    ("key.frame_timestamp_micros", Cells::Integers(of_vehicle)),
                    ("key.laser_object_id", Cells::Bytes(vec![b"the-box".to_vec(); FRAMES])),
                    ("box.center.x", of_box(&|frame| labels[frame].0.x)),
                    ("box.center.y", of_box(&|frame| labels[frame].0.y)),
                    ("box.center.z", of_box(&|frame| labels[frame].0.z)),
                    ("box.size.x", of_box(&|_| LABEL_SIZE.x)),
                    ("box.size.y", of_box(&|_| LABEL_SIZE.y)),
                    ("box.size.z", of_box(&|_| LABEL_SIZE.z)),
                    ("box.heading", of_box(&|frame| labels[frame].1)),
                    ("type", Cells::Shorts(vec![1; FRAMES])),
                ],
            ),
        ),
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
