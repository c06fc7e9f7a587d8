//! Files that may be compressed: gzip is told by its first bytes and not by the name.

use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use gs_base::guarded;
use gs_datasets::DatasetError;

/// Longest file and longest content, bytes. A sweep of both LiDARs of PandaSet has 8 MB; this has room for 5 million
/// points. Deflate makes at most 1032 bytes of one, so a small file stays far below.
const CONTENT_MAX: u64 = 256 << 20;

/// The first bytes of a gzip stream (RFC 1952).
const MAGIC: [u8; 2] = [0x1f, 0x8b];

/// The content of a file, inflated if it is a gzip stream.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let bytes = guarded::read(path, CONTENT_MAX)?;
    if !bytes.starts_with(&MAGIC) {
        return Ok(bytes);
    }
    let mut content = Vec::new();
    let inflated = GzDecoder::new(&bytes[..]).take(CONTENT_MAX + 1).read_to_end(&mut content);
    let wrong =
        |found: String| DatasetError::malformed(path, "the gzip stream", "a whole stream of at most 256 MiB", found);
    inflated.map_err(|error| wrong(format!("{error} after {} bytes", content.len())))?;
    if content.len() as u64 > CONTENT_MAX {
        return Err(wrong("more".to_string()));
    }
    Ok(content)
}

/// A gzip stream with this content and no time in its header, so that equal contents are equal files.
pub fn compress(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    // Writing to memory does not fail.
    let written = encoder.write_all(content).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}
