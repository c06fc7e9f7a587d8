//! Photos in other containers, videos, and photos without poses: a sentence that says what to do.

use gs_datasets::load;
use serde_json::json;

use crate::fixtures::{Folder, all, ring_scene};

/// First bytes of files in other containers.
const FOREIGN: [(&str, &str, &[u8]); 4] = [
    ("heic", "HEIC", b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"),
    ("avif", "AVIF", b"\0\0\0\x18ftypavif\0\0\0\0mif1avif"),
    ("gif", "GIF", b"GIF89a\x08\0\x06\0"),
    ("bmp", "BMP", b"BM\x8a\0\0\0\0\0\0\0\x8a\0\0\0"),
];

const VIDEOS: [(&str, &[u8]); 4] = [
    ("mp4", b"\0\0\0\x18ftypisom\0\0\x02\0isomiso2"),
    ("mov", b"\0\0\0\x14ftypqt  \0\0\0\0qt  "),
    ("mkv", b"\x1a\x45\xdf\xa3\x01\0\0\0\0\0\0\x23"),
    ("avi", b"RIFF\x24\0\0\0AVI LIST"),
];

#[test]
fn a_photo_in_another_container_says_how_to_convert_it() {
    for (extension, name, bytes) in FOREIGN {
        // By its own extension, and by the extension it should have.
        for file in [format!("images/01.{extension}"), "images/01.png".to_string()] {
            let (folder, mut top) = ring_scene(3);
            folder.write(&file, bytes);
            top["frames"][1]["file_path"] = json!(file);
            folder.write_json("transforms.json", &top);
            folder.refused_by_both(&all(), &[&file, name, "convert", "PNG or JPEG"]);
        }
    }
    for (extension, bytes) in VIDEOS {
        let (folder, mut top) = ring_scene(3);
        let file = format!("clip.{extension}");
        folder.write(&file, bytes);
        top["frames"][1]["file_path"] = json!(file);
        folder.write_json("transforms.json", &top);
        folder.refused_by_both(&all(), &[&file, "a video", "ffmpeg"]);
    }
}

#[test]
fn photos_without_poses_say_which_tool_makes_them() {
    for below in ["", "images/", "left/"] {
        let folder = Folder::new();
        folder.photo(&format!("{below}a.png"), 8, 6);
        folder.refused_by_both(&all(), &["1 photo ", "no camera poses", "COLMAP"]);
        folder.photo(&format!("{below}b.JPG"), 8, 6);
        folder.refused_by_both(&all(), &["2 photos ", "no camera poses", "COLMAP"]);
    }
    for (extension, _, bytes) in FOREIGN {
        let folder = Folder::new();
        folder.write(&format!("a.{extension}"), bytes);
        folder.write(&format!("b.{}", extension.to_uppercase()), bytes);
        folder.refused_by_both(&all(), &["2 photos", "convert", "PNG or JPEG", "COLMAP"]);
    }
    for (extension, bytes) in VIDEOS {
        let folder = Folder::new();
        folder.write(&format!("clip.{extension}"), bytes);
        folder.refused_by_both(&all(), &["1 video ", "ffmpeg", "COLMAP"]);
        let error = load(&folder.file(&format!("clip.{extension}")), &all()).expect_err("a video").to_string();
        assert!(error.contains("a video") && error.contains("ffmpeg"), "{error}");
    }
    let folder = Folder::new();
    folder.photo("a.png", 8, 6);
    let error = load(&folder.file("a.png"), &all()).expect_err("one photo").to_string();
    assert!(error.contains("a single photo") && error.contains("folder"), "{error}");
}

#[test]
fn cameras_with_videos_are_told_the_command() {
    let folder = Folder::new();
    let row: Vec<u8> = [0.0; 17].iter().flat_map(|value: &f64| value.to_le_bytes()).collect();
    folder.write("poses_bounds.npy", crate::fixtures::npy(1, "<f8", false, "(1, 17)", &row));
    folder.write("cam00.mp4", VIDEOS[0].1);
    folder.refused_by_both(&all(), &["videos", "ffmpeg", "cam00/%04d.png"]);
}
