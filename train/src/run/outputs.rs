//! Files that a command writes where users keep files of their own: never over one that a data set names or that this
//! program did not make. A file of ours is known by a mark in its first bytes.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use gs_base::atomic::temporary_begin;
use gs_base::write_atomic;
use gs_datasets::image_io::encode_png;
use serde::Serialize;

/// The mark: a text chunk of a PNG, a comment of PLY, SPZ, GIF, SVG, HTML and Markdown, the generator of glTF, the last
/// box of an MP4, an attribute of EXR, a field of JSON.
pub const MARK: &str = "written by gsburn";

/// The begin and some columns of the first line of our CSV tables: a table has no place for a comment, and these
/// columns are in each.
const CSV: (&str, [&str; 2]) = ("run,", [",step,", ",PSNR dB,"]);

/// Bytes in which the mark is looked for: a header with all its properties takes some 2 kB.
const LOOKED_AT: u64 = 8192;

/// Longest name of a file, bytes, on the usual file systems, less what a temporary name beside it adds.
const NAME_MAX: usize = 255 - 32;

/// Checks that all of `paths` can be written: none is a file of somebody else, or of the data set, whose files are
/// `named`.
///
/// # Errors
/// A sentence with the first that cannot. Nothing was written.
pub fn check(paths: &[PathBuf], named: &[PathBuf]) -> Result<()> {
    let named: Vec<PathBuf> = named.iter().filter_map(|path| path.canonicalize().ok()).collect();
    for path in paths {
        let name = path.file_name().map_or(0, |name| name.as_encoded_bytes().len());
        if name > NAME_MAX {
            bail!("{}: expected a name of at most {NAME_MAX} bytes, found one of {name}", path.display());
        }
        let Ok(existing) = path.canonicalize() else { continue };
        if named.contains(&existing) {
            bail!("{}: the data set names this file; choose another folder with --out", path.display());
        }
        if !is_ours(&existing) {
            bail!(
                "{}: expected no file, or one that gsburn wrote, found another; choose another place",
                path.display()
            );
        }
    }
    remove_left_over(paths);
    Ok(())
}

/// Removes half files beside `paths` that killed processes left there: those that an atomic write of one of them makes
/// first.
pub fn remove_left_over(paths: &[PathBuf]) {
    let begin = |path: &PathBuf| {
        temporary_begin(path).map(|begin| (path.parent().unwrap_or(Path::new("")).to_path_buf(), begin))
    };
    let begins: BTreeSet<(PathBuf, String)> = paths.iter().filter_map(begin).collect();
    let folders: BTreeSet<&PathBuf> = begins.iter().map(|(folder, _)| folder).collect();
    for folder in folders {
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        for entry in fs::read_dir(here).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let Some((begin, process)) = name.to_str().and_then(temporary) else { continue };
            let is_one = begins.contains(&(folder.clone(), begin.to_string())) && !is_alive(process, &entry.path());
            if is_one && let Err(error) = fs::remove_file(entry.path()) {
                tracing::warn!("{}: cannot remove: {error}", entry.path().display());
            }
        }
    }
}

/// `.NAME.PROCESS.NUMBER.tmp`: the name's begin with its dots, and the process.
fn temporary(name: &str) -> Option<(&str, u32)> {
    let (rest, number) = name.strip_suffix(".tmp")?.rsplit_once('.')?;
    let (begin, process) = rest.rsplit_once('.')?;
    number.parse::<u64>().ok()?;
    Some((begin.strip_prefix('.')?, process.parse().ok()?))
}

/// Longest time that a file is being written where the system does not say which processes live, seconds.
const WRITING_MAX: u64 = 3600;

fn is_alive(process: u32, path: &Path) -> bool {
    let processes = Path::new("/proc/self");
    if processes.exists() {
        return processes.with_file_name(process.to_string()).exists();
    }
    let age = fs::metadata(path).and_then(|data| data.modified()).ok().and_then(|changed| changed.elapsed().ok());
    age.is_none_or(|age| age.as_secs() < WRITING_MAX)
}

/// [`check`] of one file.
///
/// # Errors
/// As [`check`].
pub fn check_one(path: &Path) -> Result<()> {
    check(&[path.to_path_buf()], &[])
}

fn is_ours(path: &Path) -> bool {
    let (mut begin, mut end) = (Vec::new(), Vec::new());
    // What cannot be read is not ours; a pipe or a device is not opened.
    let is_read =
        path.is_file() && File::open(path).and_then(|file| file.take(LOOKED_AT).read_to_end(&mut begin)).is_ok();
    let is_csv = path.extension().is_some_and(|extension| extension == "csv") && is_our_table(&begin);
    // A film has its mark behind everything else.
    let is_end_read = is_read && read_end(path, &mut end).is_ok();
    let has_mark = |bytes: &[u8]| bytes.windows(MARK.len()).any(|bytes| bytes == MARK.as_bytes());
    is_read && (is_csv || has_mark(&begin) || is_end_read && has_mark(&end))
}

fn read_end(path: &Path, end: &mut Vec<u8>) -> std::io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len().min(MARK.len() as u64);
    file.seek(SeekFrom::End(-(length as i64)))?;
    file.take(length).read_to_end(end).map(drop)
}

fn is_our_table(begin: &[u8]) -> bool {
    let first = begin.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let first = String::from_utf8_lossy(first);
    first.starts_with(CSV.0) && CSV.1.iter().all(|column| first.contains(column))
}

/// Writes an image of 8 bits, `[height, width, channels]`, with the mark.
///
/// # Errors
/// When it cannot be encoded or written; then no partial file is left.
pub fn write_png(path: &Path, [width, height]: [usize; 2], pixels: &[u8]) -> Result<()> {
    Ok(write_atomic(path, &marked_png(&encode_png(path, width, height, pixels)?))?)
}

/// Writes figures as JSON for readers.
///
/// # Errors
/// When they cannot be written; then no partial file is left.
pub fn write_json(path: &Path, figures: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(figures).expect("figures are JSON") + "\n";
    Ok(write_atomic(path, text.as_bytes())?)
}

/// An SVG with the mark in a comment.
pub fn marked_svg(svg: &str) -> String {
    format!("<!-- {MARK} -->\n{svg}")
}

/// A Markdown table that a later one may be written over.
pub fn marked_markdown(markdown: &str) -> String {
    format!("<!-- {MARK} -->\n\n{markdown}")
}

/// A PNG with the mark in a text chunk behind its header.
pub fn marked_png(png: &[u8]) -> Vec<u8> {
    // Eight bytes of signature and the 25 of IHDR, which is always first.
    let (header, rest) = png.split_at(33.min(png.len()));
    let chunk = [b"tEXtSoftware\0", MARK.as_bytes()].concat();
    let length = (chunk.len() - 4) as u32;
    let crc = crc32fast::hash(&chunk);
    [header, &length.to_be_bytes(), &chunk, &crc.to_be_bytes(), rest].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_ours_are_written_over() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let refused = |name: &str| check_one(&at(name)).expect_err("refused").to_string();
        check_one(&at("new.png")).expect("nothing is there");
        fs::write(at("photo.png"), "a photo").expect("written");
        assert!(refused("photo.png").contains("found another"));
        fs::write(at("scene.ply"), format!("ply\ncomment {MARK}\n")).expect("written");
        check_one(&at("scene.ply")).expect("ours");
        let named = check(&[at("scene.ply")], &[at("scene.ply")]).expect_err("of the data set").to_string();
        assert!(named.contains("data set names"), "{named}");
        fs::write(at("t.csv"), "run,cap,step,PSNR dB,SSIM\na,10,3,20.00,0.9\n").expect("written");
        check_one(&at("t.csv")).expect("ours");
        fs::write(at("mine.csv"), "run,date\n1,today\n").expect("written");
        assert!(refused("mine.csv").contains("found another"));
        fs::write(at("chart.svg"), marked_svg("<svg/>")).expect("written");
        check_one(&at("chart.svg")).expect("ours");
        assert!(refused(&"x".repeat(250)).contains("at most"));
    }

    #[test]
    fn half_files_of_killed_processes_go() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let long = format!("{}.png", "x".repeat(40));
        // No process has the number 4294967295; this one lives.
        let dead = [".r_000.png.4294967295.0.tmp".to_string(), format!(".{}.4294967295.7.tmp", "x".repeat(32))];
        let kept = [
            format!(".r_000.png.{}.0.tmp", std::process::id()),
            ".other.png.4294967295.0.tmp".into(),
            ".r_000.png.mine.tmp".into(),
        ];
        dead.iter().chain(&kept).for_each(|name| fs::write(at(name), "half").expect("written"));
        check(&[at("r_000.png"), at(&long)], &[]).expect("nothing in the way");
        assert!(dead.iter().all(|name| !at(name).exists()) && kept.iter().all(|name| at(name).exists()));
    }

    #[test]
    fn a_marked_image_is_still_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let mut png = Vec::new();
        image::RgbImage::from_pixel(3, 2, image::Rgb([1, 2, 3]))
            .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
            .expect("encoded");
        fs::write(&path, marked_png(&png)).expect("written");
        check_one(&path).expect("ours");
        let read = image::open(&path).expect("an image").to_rgb8();
        assert_eq!((read.dimensions(), read.get_pixel(2, 1).0), ((3, 2), [1, 2, 3]));
    }
}
