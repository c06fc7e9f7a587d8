//! Writing images.

use exr::prelude::{ReadChannels, ReadLayers, read};
use gs_datasets::image_io::{write_exr, write_png};

use crate::fixtures::Folder;

#[test]
fn png_round_trip_and_overwrite() {
    let folder = Folder::new();
    let path = folder.file("new/folder/image.png");
    for channels in [1, 3, 4] {
        let data: Vec<u8> = (0..7 * 5 * channels).map(|i| (i * 7) as u8).collect();
        write_png(&path, 7, 5, &data).expect("written");
        let image = image::open(&path).expect("read");
        assert_eq!((image.width(), image.height(), image.into_bytes()), (7, 5, data));
    }
    let left: Vec<_> = std::fs::read_dir(folder.file("new/folder")).expect("listed").collect();
    assert_eq!(left.len(), 1, "no temporary file stays: {left:?}");
}

#[test]
fn exr_round_trip_is_exact() {
    let folder = Folder::new();
    let path = folder.file("image.exr");
    let depth: Vec<f32> = (0..6).map(|i| 1e-3 + 1e6 * i as f32).collect();
    let alpha: Vec<f32> = (0..6).map(|i| i as f32 / 5.0).collect();
    write_exr(&path, 3, 2, &[("Z", &depth), ("A", &alpha), ("R", &alpha)]).expect("written");
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = image.from_file(&path).expect("read");
    let layer = image.layer_data;
    assert_eq!((layer.size.x(), layer.size.y()), (3, 2));
    let values = |name: &str| -> Vec<f32> {
        let channel =
            layer.channel_data.list.iter().find(|channel| channel.name.eq_case_insensitive(name)).expect(name);
        channel.sample_data.values_as_f32().collect()
    };
    assert_eq!(values("Z"), depth);
    assert_eq!(values("A"), alpha);
}

#[test]
fn what_cannot_be_written_leaves_the_old_file() {
    let folder = Folder::new();
    let path = folder.file("image.png");
    write_png(&path, 1, 1, &[1, 2, 3]).expect("written");
    let before = std::fs::read(&path).expect("read");
    assert!(write_png(&path, 2, 2, &[0; 5]).is_err());
    assert!(write_png(&path, 0, 0, &[]).is_err());
    assert!(write_png(&path, usize::MAX, 2, &[0; 5]).is_err());
    assert!(write_exr(&path, 2, 2, &[("R", &[0.0; 3])]).is_err());
    assert!(write_exr(&path, 2, 2, &[]).is_err());
    assert_eq!(std::fs::read(&path).expect("read"), before);
    // A folder is in the way.
    std::fs::create_dir(folder.file("taken.png")).expect("made");
    let error = write_png(&folder.file("taken.png"), 1, 1, &[0]).expect_err("a folder").to_string();
    assert!(error.contains("taken.png") && error.contains("write"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("listed").count(), 2, "no temporary file stays");
}
