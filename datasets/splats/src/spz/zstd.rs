//! Version 4: each array is a zstd stream, after a header of 32 bytes and a table of the streams' lengths.

use std::io::Read;

use ruzstd::decoding::StreamingDecoder;

use super::HEADER;
use crate::bounded::Bytes;

/// Bytes of the longer header after those that all versions share: the table's place, and room.
const MORE: usize = 16;

/// No zstd block holds more than 128 KiB, and one of equal bytes takes four.
const ZSTD_MOST: usize = 32 << 10;

/// The arrays of `lengths` bytes, one after another, from the bytes of a whole file.
pub(super) fn arrays(file: &[u8], lengths: &[usize]) -> Result<Vec<u8>, String> {
    let mut header = Bytes(file);
    let streams = usize::from(header.take(HEADER)?[HEADER - 1]);
    let table = Bytes(header.take(MORE)?).u32()? as usize;
    let lengths: Vec<usize> = lengths.iter().copied().filter(|length| *length > 0).collect();
    if streams < lengths.len() {
        return Err(format!("expected {} streams, found {streams}", lengths.len()));
    }
    let mut rest = Bytes(file.get(table..).ok_or("the table of streams lies outside the file; it is cut short")?);
    let mut table = Bytes(rest.take(16 * streams)?);
    let mut arrays = Vec::new();
    for expected in lengths {
        let [packed, unpacked] = [long(&mut table)?, long(&mut table)?];
        let stream = rest.take(usize::try_from(packed).map_err(|_| "a stream is longer than any file")?)?;
        if unpacked != expected as u64 || expected / ZSTD_MOST > stream.len() {
            return Err(format!("expected a stream that unpacks to {expected} bytes, found {packed} for {unpacked}"));
        }
        let before = arrays.len();
        let decoder = StreamingDecoder::new(stream).map_err(|error| format!("cannot unpack: {error}"))?;
        decoder
            .take(expected as u64 + 1)
            .read_to_end(&mut arrays)
            .map_err(|error| format!("cannot unpack: {error}"))?;
        let found = arrays.len() - before;
        if found != expected {
            return Err(format!("expected a stream that unpacks to {expected} bytes, found another length"));
        }
    }
    Ok(arrays)
}

fn long(bytes: &mut Bytes) -> Result<u64, String> {
    Ok(u64::from(bytes.u32()?) | u64::from(bytes.u32()?) << 32)
}
