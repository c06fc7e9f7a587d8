//! COLMAP models and tables of RealityScan as other programs write them.

use glam::DVec3;
use gs_datasets::{Scene, SceneFormat, check, load, load_cameras};

use crate::colmap::{ENCODINGS, example};
use crate::fixtures::{Folder, all, cloud, names, warned};

fn load_all(folder: &Folder) -> Scene {
    folder.load(&all())
}

fn moved(folder: &Folder, from: &str, to: &str) {
    let to = folder.file(to);
    std::fs::create_dir_all(to.parent().expect("a parent")).expect("a folder");
    std::fs::rename(folder.file(from), to).expect("moved");
}

/// As undistorters and converters leave them: another extension, the folder in the name, no folder, another case.
#[test]
fn renamed_photos_are_found_if_only_one_can_be_meant() {
    let folder = Folder::new();
    let model = example(&folder);
    model.write_binary(&folder, "sparse/0");
    moved(&folder, "images/b.png", "images/b.JPG");
    moved(&folder, "images/left/a.png", "images/left_a.png");
    moved(&folder, "images/z.png", "images/deep/down/Z.png");
    let scene = load_all(&folder);
    assert_eq!(names(&scene.train), ["a photo", "b", "left/a", "z"]);
    let told = scene.warnings.join(" ");
    assert!(told.contains("3 photos were found under another name") && told.contains("b.png as b.JPG"), "{told}");
    // Two photos of one name: neither is taken, and the missing one is named.
    moved(&folder, "images/left_a.png", "images/one/a.png");
    folder.photo("images/two/a.png", 40, 30);
    let scene = load_all(&folder);
    assert_eq!(names(&scene.train), ["a photo", "b", "z"]);
    let told = scene.warnings.join(" ");
    assert!(told.contains("1 of 4 photos does not exist") && told.contains("left/a.png"), "{told}");
}

/// Metashape and RealityCapture write a camera a photo; photos may be half as large as the cameras say; newer COLMAP
/// writes rigs and frames beside; VGGT writes no points.
#[test]
fn models_of_other_programs_load() {
    let folder = Folder::new();
    let mut model = example(&folder);
    let lens = model.cameras.remove(1);
    model.cameras.clear();
    for (i, image) in model.images.iter_mut().enumerate() {
        image.camera_id = 100 + i as u32;
        let params = lens.params.iter().map(|x| 2.0 * x).collect();
        model.cameras.push(crate::colmap::Camera { id: 100 + i as u32, model: 1, width: 80, height: 60, params });
    }
    model.points.clear();
    for (write, rigs) in ENCODINGS {
        write(&model, &folder, "sparse/0");
        folder.write(&format!("sparse/0/rigs.{rigs}"), "1 1 CAMERA 100\n");
        folder.write(&format!("sparse/0/frames.{rigs}"), "1 1 1 0 0 0 0 0 0 1 CAMERA 100 90\n");
        let scene = load_all(&folder);
        assert_eq!((scene.train.len(), scene.points.map_or(0, |points| points.len())), (4, 0));
        assert!((scene.train[0].intrinsics.fx - 40.0).abs() < 1e-9, "rescaled to the photo");
        warned(&scene.warnings, &["rescaled"]);
    }
    std::fs::remove_file(folder.file("sparse/0/points3D.bin")).expect("removed");
    assert!(load_all(&folder).warnings.iter().any(|text| text.contains("no points")));
}

#[test]
fn cameras_of_a_model_need_no_photos() {
    let folder = Folder::new();
    let model = example(&folder);
    model.write_text(&folder, "sparse/0");
    let scene = load_all(&folder);
    std::fs::remove_dir_all(folder.file("images")).expect("removed");
    let cameras = load_cameras(folder.path()).expect("cameras");
    assert_eq!(cameras.iter().map(|camera| camera.name.as_str()).collect::<Vec<_>>(), ["a photo", "b", "left/a", "z"]);
    for (camera, view) in cameras.iter().zip(&scene.train) {
        assert_eq!((camera.c2w, camera.intrinsics, camera.width, camera.height), (view.c2w, view.intrinsics, 40, 30));
    }
    for path in ["sparse", "sparse/0"] {
        assert_eq!(load_cameras(&folder.file(path)).expect("cameras"), cameras, "{path}");
    }
    let error = load_cameras(Folder::new().path()).expect_err("nothing is there").to_string();
    assert!(error.contains("COLMAP model"), "{error}");
}

/// A camera at (1, 2, 3) that looks north, level: heading 0, pitch 90 and roll 0 turn OpenGL's axes so that -z is north
/// and up is up.
#[test]
fn tables_of_realityscan_load() {
    let folder = Folder::new();
    folder.photo("images/a.png", 40, 30);
    folder.photo("images/b.png", 30, 40);
    folder.write(
        "cameras.csv",
        "#cameras 3\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n\
         a.png,1,2,3,0,90,0,36,0.05,-0.025,0,0,0,0,0,0\r\nb.jpg,0,0,0,90,90,0,18,0,0,0,0,0,0,0,0\n\
         gone.png,0,0,0,0,0,0,18,0,0,0,0,0,0,0,0\n",
    );
    folder.write("cameras.ply", cloud("float", &[[1.0, 9.0, 3.0], [2.0, 9.0, 3.0]]));
    for path in [folder.path().to_path_buf(), folder.file("cameras.csv")] {
        let scene = load(&path, &all()).expect("loaded");
        assert_eq!((scene.format, names(&scene.train)), (SceneFormat::RealityScan, vec!["a", "b"]));
        let [a, b] = &scene.train[..] else { panic!("two views") };
        assert!((a.c2w.w_axis.truncate() - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        assert!((a.c2w.z_axis.truncate() - DVec3::Y).length() < 1e-9, "looks north: {}", a.c2w.z_axis);
        assert!((a.c2w.y_axis.truncate() - DVec3::NEG_Z).length() < 1e-9, "is upright");
        assert!(
            (b.c2w.z_axis.truncate() - DVec3::X).length() < 1e-9,
            "a heading of 90 degrees is east: {}",
            b.c2w.z_axis
        );
        let k = a.intrinsics;
        assert_eq!((k.fx, k.cx, k.cy), (40.0, 22.0, 14.0), "36 mm is one longer side");
        assert_eq!((b.intrinsics.fx, b.width), (20.0, 30));
        assert_eq!(scene.points.as_ref().map(|points| points.len()), Some(2));
        let told = scene.warnings.join(" ");
        assert!(told.contains("1 of 3 photos does not exist") && told.contains("gone.png"), "{told}");
    }
    assert!(check(folder.path(), &all()).to_string().contains("RealityScan"));
    for (row, word) in [
        ("a.png,1,2,3,0,90,0,x", "column f"),
        ("a.png,1,2,3,0,inf,0,36", "column pitch"),
        ("a.png,1", "column heading"),
    ] {
        folder.write("cameras.csv", format!("#name,x,y,alt,heading,pitch,roll,f\n{row}\n"));
        folder.refused(&all(), &[word, "line 2"]);
    }
}

/// One photo in each container, and one turned by EXIF.
#[test]
fn other_containers_are_read() {
    use image::{DynamicImage, ImageFormat, RgbImage};
    let photo = RgbImage::from_fn(40, 30, |x, y| image::Rgb([(6 * x) as u8, (8 * y) as u8, 90]));
    let deep = DynamicImage::ImageRgb8(photo.clone()).into_rgb16();
    for (extension, image, format) in [
        ("webp", DynamicImage::ImageRgb8(photo.clone()), ImageFormat::WebP),
        ("tif", DynamicImage::ImageRgb8(photo.clone()), ImageFormat::Tiff),
        ("tiff", DynamicImage::ImageRgb16(deep.clone()), ImageFormat::Tiff),
        ("png", DynamicImage::ImageRgb16(deep), ImageFormat::Png),
    ] {
        let folder = Folder::new();
        let mut model = example(&folder);
        std::fs::remove_file(folder.file("images/b.png")).expect("removed");
        let mut bytes = Vec::new();
        image.write_to(&mut std::io::Cursor::new(&mut bytes), format).expect("encoded");
        folder.write(&format!("images/b.{extension}"), &bytes);
        model.images[0].name = format!("b.{extension}");
        model.write_text(&folder, "sparse/0");
        let scene = load_all(&folder);
        let view = scene.train.iter().find(|view| view.name == "b").expect("the photo");
        // Lossless, and 16 bits of an 8-bit value are that value again.
        assert_eq!(view.image.data, photo.as_raw().as_slice(), "{extension}");
        for length in [bytes.len() / 2, 20] {
            folder.write(&format!("images/b.{extension}"), &bytes[..length]);
            assert!(load(folder.path(), &all()).is_err(), "{extension} of {length} bytes");
        }
    }
}

/// EXIF orientation 6 in a JPEG: said by `check`, and the pixels are as stored.
#[test]
fn a_turned_photo_is_told() {
    let folder = Folder::new();
    let mut model = example(&folder);
    let photo = image::RgbImage::from_pixel(40, 30, image::Rgb([9, 90, 190]));
    let mut jpeg = Vec::new();
    photo.write_to(&mut std::io::Cursor::new(&mut jpeg), image::ImageFormat::Jpeg).expect("encoded");
    // A TIFF header, one entry: tag 0x112 (orientation), a short, 6.
    let exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let segment = [&[0xff, 0xe1][..], &(exif.len() as u16 + 2).to_be_bytes(), exif].concat();
    jpeg.splice(2..2, segment);
    folder.write("images/z.jpg", jpeg);
    model.images[3].name = "z.jpg".into();
    model.write_text(&folder, "sparse/0");
    let report = check(folder.path(), &all());
    assert!(
        report.is_ok() && report.to_string().contains("1 image has an EXIF orientation, which is not applied"),
        "{report}"
    );
    assert_eq!(load_all(&folder).train[3].width, 40);
}
