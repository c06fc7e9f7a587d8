//! Segments with mistakes: one sentence each.

use std::fs;
use std::path::Path;

use gs_driving::{DrivingLog, LogOptions};
use parquet::basic::Type as Kind;
use parquet::data_type::{ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type};

use super::modular::{self, Cells, Columns, NAME, PLAIN, components, flat, lists, write};
use super::record::{self, Message, framed};
use super::scene::*;

fn segment() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    modular::segment(folder.path(), PLAIN);
    folder
}

fn columns(component: &str) -> Columns {
    let mut all = components();
    let place = all.iter().position(|(name, _)| *name == component).expect("a component");
    all.swap_remove(place).1
}

/// All that is said about a segment when it is opened and a frame is read.
fn said(path: &Path) -> String {
    let log = match DrivingLog::open(path, &LogOptions::default()) {
        Ok(log) => log,
        Err(error) => return error.to_string(),
    };
    let sweep = log.labelled_sweep(0).err().map(|error| error.to_string());
    let image = (!log.cameras().is_empty()).then(|| log.image(0, 0).err()).flatten().map(|error| error.to_string());
    sweep.into_iter().chain(image).chain(log.warnings().iter().cloned()).collect::<Vec<_>>().join("\n")
}

#[test]
fn missing_components() {
    let needed = ["lidar", "lidar_pose", "lidar_calibration", "camera_calibration"];
    for component in needed {
        let folder = segment();
        fs::remove_dir_all(folder.path().join(component)).expect("removed");
        let said = said(folder.path());
        assert!(said.contains(&format!("{component}/{NAME}.parquet: cannot read")), "{said}");
    }
    let folder = segment();
    fs::remove_dir_all(folder.path().join("vehicle_pose")).expect("removed");
    assert!(said(folder.path()).contains("expected a driving log"));
    // Without images there are points without colours, and without boxes there are no labels.
    for component in ["camera_image", "lidar_box"] {
        let folder = segment();
        fs::remove_dir_all(folder.path().join(component)).expect("removed");
        let log = DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened");
        let sweep = log.labelled_sweep(0).expect("a sweep");
        let has_cameras = !log.cameras().is_empty();
        assert_eq!((has_cameras, sweep.labels.is_some()), (component == "lidar_box", component == "camera_image"));
    }
}

#[test]
fn every_missing_column_is_named() {
    for (component, columns) in components() {
        for left_out in 0..columns.len() {
            let name = &columns[left_out].0;
            if name == "key.segment_context_name" || name.contains("return2") {
                continue;
            }
            let folder = segment();
            let mut columns = self::columns(component);
            columns.remove(left_out);
            write(folder.path(), component, &columns, PLAIN);
            let said = said(folder.path());
            assert!(said.contains(name.as_str()) && said.contains("no such column"), "{component}, {name}: {said}");
            assert!(said.lines().all(|line| line.len() < 500), "{said}");
        }
    }
}

#[test]
fn columns_of_another_type() {
    for (component, columns) in components() {
        for changed in 0..columns.len() {
            let name = &columns[changed].0;
            if name == "key.segment_context_name" || name.contains("return2") {
                continue;
            }
            let folder = segment();
            let mut columns = self::columns(component);
            let Cells { kind, rows, .. } = columns[changed].1;
            columns[changed].1 = match kind {
                Kind::BYTE_ARRAY => lists::<DoubleType>(vec![vec![1.5, 2.5]; rows]),
                _ => flat::<ByteArrayType>(vec!["text"; rows]),
            };
            write(folder.path(), component, &columns, PLAIN);
            let said = said(folder.path());
            // The bounds of angles are not looked at where the angles are given, and the second laser has none then.
            assert!(said.contains("expected"), "{component}, {name}: {said}");
        }
    }
}

/// A segment with other cells in a column.
fn changed(component: &str, name: &str, cells: Cells) -> tempfile::TempDir {
    let folder = segment();
    let mut columns = columns(component);
    columns.iter_mut().find(|(column, _)| column.ends_with(name)).expect("a column").1 = cells;
    write(folder.path(), component, &columns, PLAIN);
    folder
}

#[test]
fn values_without_meaning() {
    let count = FRAMES * lasers().len();
    let shaped = |sides: [i32; 3]| lists::<Int32Type>(vec![sides.to_vec(); count]);
    let shape = "expected rows, columns and channels of an image";
    for (component, name, cells, parts) in [
        ("lidar", "return1.shape", shaped([i32::MAX; 3]), &[shape][..]),
        ("lidar", "return1.shape", shaped([-1, -1, 4]), &[shape]),
        ("lidar", "return1.shape", shaped([0, 0, 0]), &[shape]),
        ("lidar", "return1.shape", shaped([12, 90, 5]), &[shape]),
        ("lidar", "return1.values", lists::<FloatType>(vec![Vec::new(); count]), &["on 0 values"]),
        ("lidar_pose", "return1.values", lists::<FloatType>(vec![vec![0.0; 7]; FRAMES]), &["on 7 values"]),
        (
            "lidar_calibration",
            "beam_inclination.values",
            lists::<DoubleType>(vec![vec![0.1; 3]; 2]),
            &["3 angles of beams for 12 rows"],
        ),
        (
            "vehicle_pose",
            "transform",
            lists::<DoubleType>(vec![vec![1.0; 16]; FRAMES]),
            &["row 0 of group 0: expected sound values"],
        ),
        ("vehicle_pose", "frame_timestamp_micros", flat::<Int64Type>([5; FRAMES]), &["expected one row, found two"]),
        ("camera_calibration", "width", flat::<Int32Type>([i32::MAX; 2]), &["expected a lens"]),
        ("camera_calibration", "k1", flat::<DoubleType>([50.0; 2]), &["expected a lens", "50.0"]),
        (
            "camera_calibration",
            "height",
            flat::<Int32Type>([HEIGHT as i32 + 1; 2]),
            &["60 x 41 pixels, as the calibration says, found 60 x 40"],
        ),
        (
            "camera_image",
            "image",
            flat::<ByteArrayType>(["no image"; FRAMES * 2]),
            &["expected a readable PNG or JPEG"],
        ),
        ("lidar", "key.laser_name", flat::<Int32Type>(vec![9; count]), &["the number or name of a sensor"]),
    ] {
        let said = said(changed(component, name, cells).path());
        assert!(parts.iter().all(|part| said.contains(part)), "{component}, {name}: {said}");
    }
}

/// Points that are not finite or far away are counted and left out; without poses of pixels the sweep is refused.
#[test]
fn ranges_without_meaning() {
    let mut images: Vec<Vec<f32>> =
        (0..FRAMES).flat_map(|frame| lasers().map(|laser| range_image(&laser, frame))).collect();
    (images[0][0], images[0][4], images[0][8]) = (f32::NAN, f32::INFINITY, 1e9);
    let folder = changed("lidar", "return1.values", lists::<FloatType>(images));
    let sweep =
        DrivingLog::open(folder.path(), &LogOptions::default()).expect("opened").labelled_sweep(0).expect("a sweep");
    assert_eq!(sweep.left_out, 3);
    let folder = changed("lidar_pose", "frame_timestamp_micros", flat::<Int64Type>(0..FRAMES as i64));
    let said = said(folder.path());
    assert!(said.contains("no poses of the pixels"), "{said}");
}

#[test]
fn every_cut_of_a_footer_and_many_of_the_rest() {
    let folder = segment();
    let path = folder.path().join("lidar").join(format!("{NAME}.parquet"));
    let whole = fs::read(&path).expect("read");
    for cut in (0..whole.len()).filter(|cut| *cut + 3000 > whole.len() || cut % 997 == 0) {
        fs::write(&path, &whole[..cut]).expect("written");
        let error = DrivingLog::open(folder.path(), &LogOptions::default()).expect_err("cut").to_string();
        assert!(error.contains(".parquet: the footer: expected a whole Parquet file"), "{cut}: {error}");
    }
}

fn of_records(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.tfrecord");
    fs::write(&path, bytes).expect("written");
    said(&path)
}

#[test]
fn records_with_mistakes() {
    let whole = framed(&record::frame(0));
    assert_eq!(of_records(&whole), "");
    assert!(of_records(&[]).contains("found no frame"));
    for cut in (1..whole.len()).filter(|cut| *cut < 40 || *cut + 40 > whole.len() || cut % 499 == 0) {
        assert!(of_records(&whole[..cut]).contains("expected a whole record"), "{cut}");
    }
    let mut other = whole.clone();
    other[3] ^= 1;
    assert!(of_records(&other).contains("a length that does not agree with its checksum"));
    // A bit of the content, which is noticed when the sweep is read.
    let mut other = whole.clone();
    let place = other.len() - 20;
    other[place] ^= 1;
    assert!(of_records(&other).contains("a content that agrees with its checksum"), "{}", of_records(&other));
    // A length of 2^62 bytes with the right checksum.
    let length = (1_u64 << 62).to_le_bytes();
    let giant = [&length[..], &record::masked(&length).to_le_bytes(), &[0; 64]].concat();
    assert!(of_records(&giant).contains("a length of 4611686018427387904 bytes"));
    assert!(of_records(&framed(&Message::default().integer(2, 7).0)).contains("no pose of the vehicle"));
    assert!(of_records(&[whole.clone(), whole].concat()).contains("expected one frame, found two"));
}

#[test]
fn matrices_with_mistakes() {
    let laser = |image: &[u8]| {
        let image = Message::default().bytes(2, image);
        let laser = Message::default().integer(1, 2).bytes(2, &image.0);
        of_records(&framed(&Message(record::frame(0)).bytes(5, &laser.0).0))
    };
    assert!(laser(b"no zlib").contains("cannot be inflated"));
    assert!(laser(&record::matrix([1 << 31, 1 << 31, 4], &[1.0; 8])).contains("on 8 values"));
    assert!(laser(&record::matrix([8, 40, 3], &[1.0; 960])).contains("3 channels"));
    assert!(laser(&record::matrix([2, 40, 4], &[1.0; 320])).is_empty(), "evenly spaced rows may be any number");
}

/// A small stream whose content would fill the memory is given up at the limit. Those of pages are tested beside the
/// codecs.
#[test]
fn a_matrix_that_swells() {
    // 65 MiB of zeros in 65 KB.
    let image = Message::default().bytes(2, &record::deflated(&vec![0; 65 << 20]));
    let laser = Message::default().integer(1, 2).bytes(2, &image.0);
    let said = of_records(&framed(&Message(record::frame(0)).bytes(5, &laser.0).0));
    assert!(said.contains("more than 64 MiB"), "{said}");
}
