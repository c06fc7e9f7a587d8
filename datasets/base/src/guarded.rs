//! Reading files that somebody else wrote: regular files only, and never more than a limit.
//!
//! A name in a data set, or on a command line, may lead to a device that never ends (`/dev/zero`), to a pipe that
//! nobody writes to, or to a file of terabytes that takes no room on its disk. All of them are refused before anything
//! is read.
//!
//! # Limits
//!
//! | limit | bytes | reason |
//! |---|---|---|
//! | [`DESCRIPTION_MAX`] | 256 MiB | in memory up to 16 times as much; a frame takes 1 KB, so that 250 000 fit |
//! | [`MODEL_MAX`] | 8 GiB | a COLMAP model of 10 000 photos with 10 000 observations each has 3 GB |
//! | [`POINTS_MAX`] | 2 GiB | 100 million points of a scanner, each a line of text |
//! | [`IMAGE_MAX`] | 1 GiB | no more than decoding one photo may take; 250 megapixels without compression |
//!
//! Counts inside a file are held against the bytes that follow them by each reader.

use std::fs::{File, FileType};
use std::io::Read;
use std::path::Path;

use crate::error::FileError;

/// Largest JSON file, bytes.
pub const DESCRIPTION_MAX: u64 = 256 << 20;

/// Largest file of a COLMAP model, bytes.
pub const MODEL_MAX: u64 = 8 << 30;

/// Largest PLY file of points, bytes.
pub const POINTS_MAX: u64 = 2 << 30;

/// Largest photo, mask, depth map or array, bytes.
pub const IMAGE_MAX: u64 = 1 << 30;

/// Opens a file for reading, if it is a regular file (or a link to one) of at most `limit` bytes.
///
/// # Errors
/// When it is a folder, a device, a pipe or a socket, is longer than `limit`, or cannot be opened. A pipe is not
/// opened, because that waits for a writer.
pub fn open_regular(path: &Path, limit: u64) -> Result<File, FileError> {
    let unreadable = |error| FileError::read(path, error);
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(FileError::NotAFile { path: path.to_path_buf(), found: name_of(metadata.file_type()) });
    }
    if metadata.len() > limit {
        let found = size(metadata.len());
        return Err(FileError::TooLarge { path: path.to_path_buf(), limit: size(limit), found });
    }
    File::open(path).map_err(unreadable)
}

/// The bytes of a regular file of at most `limit` bytes.
///
/// # Errors
/// As [`open_regular`], when reading fails, and when the file grows beyond `limit` meanwhile or there is no memory for
/// it.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>, FileError> {
    let unreadable = |error| FileError::read(path, error);
    let file = open_regular(path, limit)?;
    let length = file.metadata().map_err(unreadable)?.len().min(limit);
    let mut bytes = Vec::new();
    let reserved = bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX));
    reserved.map_err(|error| unreadable(std::io::Error::other(format!("no memory for {}: {error}", size(length)))))?;
    // Files of the kernel (/proc) say that they are empty and are not.
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit {
        let found = format!("more than {}", size(limit));
        return Err(FileError::TooLarge { path: path.to_path_buf(), limit: size(limit), found });
    }
    Ok(bytes)
}

/// The text of a regular file of at most `limit` bytes, without the byte order mark that editors of Windows put before
/// it.
///
/// # Errors
/// As [`read`], and when the file is not in UTF-8.
pub fn read_to_string(path: &Path, limit: u64) -> Result<String, FileError> {
    let mut text = String::from_utf8(read(path, limit)?).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        FileError::malformed(path, format!("byte {offset}"), "text in UTF-8", "bytes that are not UTF-8")
    })?;
    if text.starts_with('\u{feff}') {
        text.drain(..'\u{feff}'.len_utf8());
    }
    Ok(text)
}

/// Whether something that could be read is there: anything but a folder. A device or a pipe is refused when it is read,
/// and not passed over as if it did not exist.
pub fn is_there(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_dir())
}

fn name_of(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if kind.is_dir() { "a folder" } else { "something else" }
}

/// "17 bytes", "1.5 GiB".
fn size(bytes: u64) -> String {
    const UNITS: [(u64, &str); 4] = [(1 << 40, "TiB"), (1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
    match UNITS.into_iter().find(|(unit, _)| bytes >= *unit) {
        Some((unit, name)) => format!("{:.1} {name}", bytes as f64 / unit as f64),
        None if bytes == 1 => "1 byte".to_string(),
        None => format!("{bytes} bytes"),
    }
}
