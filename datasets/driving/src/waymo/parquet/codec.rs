//! Unpacking of pages: never more than the page's header says, and never more than the codec can make of the bytes.

use std::io::Read;

use flate2::read::MultiGzDecoder;
use parquet::basic::Compression;

use crate::feather::lz4;

/// The content of a packed page, which has `size` bytes. Memory is taken as it is filled.
///
/// # Errors
/// A piece of a sentence: what is found where a page of `size` bytes is expected.
pub(crate) fn unpack(codec: Compression, packed: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let mut content = Vec::new();
    let wrong = |name: &str| format!("a broken {name} stream");
    let mut read = |reader: &mut dyn Read, name: &str| {
        // One byte more shows a stream that is longer than it should be.
        reader.take(size as u64 + 1).read_to_end(&mut content).map_err(|_| wrong(name))
    };
    match codec {
        Compression::UNCOMPRESSED => content = packed.to_vec(),
        Compression::SNAPPY => {
            let length = snap::raw::decompress_len(packed).map_err(|_| wrong("Snappy"))?;
            // A copy of 64 bytes takes two.
            if length != size || length / 64 > packed.len() {
                return Err(wrong("Snappy"));
            }
            content = snap::raw::Decoder::new().decompress_vec(packed).map_err(|_| wrong("Snappy"))?;
        }
        Compression::GZIP(_) => drop(read(&mut MultiGzDecoder::new(packed), "gzip")?),
        Compression::BROTLI(_) => drop(read(&mut brotli_decompressor::Decompressor::new(packed, BUFFER), "Brotli")?),
        Compression::ZSTD(_) => {
            let mut decoder = zstd::stream::read::Decoder::with_buffer(packed).map_err(|_| wrong("Zstandard"))?;
            decoder.window_log_max(WINDOW_LOG).map_err(|_| wrong("Zstandard"))?;
            read(&mut decoder, "Zstandard")?;
        }
        Compression::LZ4_RAW => lz4::block(packed, &mut content, size).ok_or_else(|| wrong("LZ4"))?,
        other => return Err(format!("the codec {other}, which is not read")),
    }
    match content.len() == size {
        true => Ok(content),
        false => Err(format!("a page whose content has not the {size} bytes that its header says")),
    }
}

/// Bytes that the Brotli decoder takes in at a time.
const BUFFER: usize = 4096;

/// Largest window of a Zstandard stream, as a power of two: 8 MiB, as the format asks every reader to have.
const WINDOW_LOG: u32 = 23;

#[cfg(test)]
mod tests {
    use std::io::Write;

    use parquet::basic::{BrotliLevel, GzipLevel, ZstdLevel};

    use super::*;

    /// A Brotli stream without compression (RFC 7932, section 9.2): a window of 16 bits, one stored block, and an empty
    /// last one.
    fn stored(content: &[u8]) -> Vec<u8> {
        // 0: the window; 0: not the last block; 00: four digits of the length; 16 bits of length - 1; 1: stored.
        let head = (content.len() as u32 - 1) << 4 | 1 << 20;
        [&head.to_le_bytes()[..3], content, &[3]].concat()
    }

    fn packed() -> Vec<(Compression, Vec<u8>, Vec<u8>)> {
        let content: Vec<u8> = (0..2000_u32).map(|i| (i / 7 % 50) as u8).collect();
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(&content).expect("packed");
        let snappy = snap::raw::Encoder::new().compress_vec(&content).expect("packed");
        let zstd = zstd::stream::encode_all(&content[..], 3).expect("packed");
        // One run of literals: 15 in the token, and 1985 = 7 * 255 + 200 behind it.
        let lz4 = [&[0xf0, 255, 255, 255, 255, 255, 255, 255, 200][..], &content].concat();
        vec![
            (Compression::GZIP(GzipLevel::default()), gzip.finish().expect("packed"), content.clone()),
            (Compression::SNAPPY, snappy, content.clone()),
            (Compression::ZSTD(ZstdLevel::default()), zstd, content.clone()),
            (Compression::LZ4_RAW, lz4, content.clone()),
            (Compression::BROTLI(BrotliLevel::default()), stored(&content), content),
        ]
    }

    #[test]
    fn every_codec_gives_the_content_and_no_other_size() {
        for (codec, bytes, content) in packed() {
            assert_eq!(unpack(codec, &bytes, content.len()).as_ref(), Ok(&content), "{codec}");
            for size in [0, content.len() - 1, content.len() + 1, usize::MAX >> 1] {
                assert!(unpack(codec, &bytes, size).is_err(), "{codec}: {size}");
            }
            for cut in 0..bytes.len() {
                // Brotli's last byte is the empty block, and gzip's trailer is checked by the decoder.
                assert!(
                    unpack(codec, &bytes[..cut], content.len()).is_err() || cut + 1 == bytes.len(),
                    "{codec}: cut to {cut} of {}",
                    bytes.len()
                );
            }
        }
        assert!(unpack(Compression::LZO, &[1, 2, 3], 3).is_err());
    }
}
