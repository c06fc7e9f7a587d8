//! Arrays of text in NumPy files: `U` (four bytes a character) and `S` (one byte).

use gs_base::npy;

/// Longest file of texts, bytes: 10 000 paths of 400 characters at four bytes each.
pub(super) const BYTES_MAX: u64 = 16 << 20;

/// The type of an array's values as its header writes it, from the first bytes of the file.
pub(super) fn descr(bytes: &[u8]) -> Option<String> {
    header(bytes).map(|(descr, _)| descr)
}

/// The header's type and the bytes after the header.
fn header(bytes: &[u8]) -> Option<(String, &[u8])> {
    let (version, rest) = bytes.strip_prefix(npy::MAGIC)?.split_first_chunk::<2>()?;
    let (length, rest) = if version[0] == 1 {
        let (length, rest) = rest.split_first_chunk::<2>()?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk::<4>()?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    let (header, data) = rest.split_at_checked(length)?;
    let header = String::from_utf8_lossy(header);
    let after = header.split_once("'descr':").or_else(|| header.split_once("\"descr\":"))?.1.trim_start();
    let quote = after.chars().next().filter(|c| "'\"".contains(*c))?;
    Some((after[1..].split(quote).next()?.to_string(), data))
}

/// The texts of a file, in the order of its values; `None` where it holds something else.
pub(super) fn parse(bytes: &[u8]) -> Option<Vec<String>> {
    let (descr, data) = header(bytes)?;
    let (order, kind) = (descr.chars().next()?, descr.trim_start_matches(['<', '>', '|', '=']));
    let length: usize = kind.get(1..)?.parse().ok().filter(|length| *length > 0)?;
    let text = |chars: &mut dyn Iterator<Item = char>| chars.take_while(|c| *c != '\0').collect::<String>();
    match kind.chars().next()? {
        'S' => Some(data.chunks_exact(length).map(|word| text(&mut word.iter().map(|b| char::from(*b)))).collect()),
        'U' => {
            let read = |unit: &[u8; 4]| match order {
                '>' => u32::from_be_bytes(*unit),
                _ => u32::from_le_bytes(*unit),
            };
            let character = |unit: &[u8; 4]| char::from_u32(read(unit)).unwrap_or(char::REPLACEMENT_CHARACTER);
            let words = data.chunks_exact(length.checked_mul(4)?);
            Some(words.map(|word| text(&mut word.as_chunks::<4>().0.iter().map(character))).collect())
        }
        _ => None,
    }
}
