//! How large the image of a JPEG file is, and whether the file ends where it says: its segments are walked, nothing is
//! decoded (ITU T.81, annex B).

use std::io::{Read, Seek};

/// The first byte of every marker.
const MARKER: u8 = 0xFF;
/// Start of image.
const START: u8 = 0xD8;
/// End of image, start of scan.
const END: u8 = 0xD9;
const SCAN: u8 = 0xDA;

/// Width and height as the first frame header says, read from the start of a file: segments before it are skipped, and
/// nothing behind it is read. `None` where there is no such header.
pub(crate) fn size(file: &mut (impl Read + Seek)) -> Option<(u32, u32)> {
    let mut start = [0; 2];
    file.read_exact(&mut start).ok()?;
    if start != [MARKER, START] {
        return None;
    }
    let mut byte = [0];
    loop {
        file.read_exact(&mut byte).ok()?;
        if byte[0] != MARKER {
            continue;
        }
        while byte[0] == MARKER {
            file.read_exact(&mut byte).ok()?;
        }
        match byte[0] {
            END | SCAN => return None,
            0x00 | 0x01 | 0xD0..=0xD7 => {}
            // Start of frame, of any coding; C4, C8 and CC are tables.
            0xC0..=0xC3 | 0xC5..=0xC7 | 0xC9..=0xCB | 0xCD..=0xCF => {
                let mut header = [0; 7];
                file.read_exact(&mut header).ok()?;
                let [_, _, _, high, low, left, right] = header;
                let side = |high, low| u32::from(u16::from_be_bytes([high, low]));
                return Some((side(left, right), side(high, low))).filter(|(width, height)| *width > 0 && *height > 0);
            }
            _ => {
                let mut length = [0; 2];
                file.read_exact(&mut length).ok()?;
                file.seek_relative(i64::from(u16::from_be_bytes(length)).checked_sub(2).filter(|rest| *rest >= 0)?)
                    .ok()?;
            }
        }
    }
}

/// Whether the end marker follows the last scan.
pub(crate) fn is_whole(bytes: &[u8]) -> bool {
    // Behind the start marker.
    let mut at = 2;
    while let Some(code) = marker(bytes, &mut at) {
        match code {
            END => return true,
            // Markers without a segment: TEM and restarts.
            0x01 | 0xD0..=0xD7 => {}
            _ => {
                let Some([high, low]) = bytes.get(at..at + 2) else { return false };
                at += usize::from(u16::from_be_bytes([*high, *low]));
                if code == SCAN {
                    at = end_of_scan(bytes, at);
                }
            }
        }
    }
    false
}

/// The code of the marker at or behind `at`, which moves behind it.
fn marker(bytes: &[u8], at: &mut usize) -> Option<u8> {
    let begin = *at + bytes.get(*at..)?.iter().position(|byte| *byte == MARKER)?;
    let code = begin + bytes[begin..].iter().position(|byte| *byte != MARKER)?;
    *at = code + 1;
    Some(bytes[code])
}

/// Offset of the first marker behind coded data, in which 0xFF is followed by 0 or belongs to a restart.
fn end_of_scan(bytes: &[u8], begin: usize) -> usize {
    let pairs = bytes.get(begin..).unwrap_or_default().windows(2);
    let is_data = |code: u8| matches!(code, 0x00 | 0xD0..=0xD7 | MARKER);
    let found = pairs.enumerate().find(|(_, pair)| pair[0] == MARKER && !is_data(pair[1]));
    found.map_or(bytes.len(), |(offset, _)| begin + offset)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use image::{DynamicImage, ImageFormat, RgbImage};

    use super::*;

    #[test]
    fn a_cut_file_is_not_whole() {
        let image = RgbImage::from_fn(40, 30, |x, y| image::Rgb([(x * 6) as u8, (y * 8) as u8, (x * y) as u8]));
        let mut bytes = Vec::new();
        DynamicImage::from(image).write_to(&mut Cursor::new(&mut bytes), ImageFormat::Jpeg).expect("encoded");
        assert!(is_whole(&bytes));
        assert_eq!(size(&mut Cursor::new(&bytes)), Some((40, 30)));
        for cut in 0..bytes.len() {
            assert!(!is_whole(&bytes[..cut]), "cut to {cut} of {} bytes", bytes.len());
        }
        // Cameras append previews; what ends inside a segment (a thumbnail) is not the end.
        assert!(is_whole(&[&bytes[..], &[0; 9]].concat()));
        assert_eq!(size(&mut Cursor::new(&bytes[..20])), None);
        let with_thumbnail = [&bytes[..2], &[MARKER, 0xE1, 0, 4, MARKER, END], &bytes[2..bytes.len() - 2]].concat();
        assert!(!is_whole(&with_thumbnail));
        assert_eq!(size(&mut Cursor::new(&with_thumbnail)), Some((40, 30)), "a thumbnail in a segment is skipped");
        for no_jpeg in
            [&b"\x89PNG"[..], &[], &[MARKER, START], &[MARKER, START, MARKER, 0xE1, 0, 0, 0, 0], &[MARKER; 64]]
        {
            assert_eq!(size(&mut Cursor::new(no_jpeg)), None, "{no_jpeg:?}");
        }
    }
}
