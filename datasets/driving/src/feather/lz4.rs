//! LZ4 frames (the LZ4 frame format 1.6 and block format), without checks of their checksums.

use super::flat::array;

/// The first bytes of a frame.
const MAGIC: u32 = 0x184d_2204;

/// Most bytes that LZ4 makes of one.
const RATIO_MAX: usize = 255;

/// The content of a frame, which must have `expected` bytes; `None` for anything else. No more is allocated than the
/// frame could hold.
pub(crate) fn frame(bytes: &[u8], expected: usize) -> Option<Vec<u8>> {
    if expected > bytes.len().checked_mul(RATIO_MAX)? || u32::from_le_bytes(array(bytes, 0)?) != MAGIC {
        return None;
    }
    let flags = *bytes.get(4)?;
    let has = |bit: u8| flags >> bit & 1 == 1;
    if flags >> 6 != 1 || has(0) {
        return None;
    }
    // Flags, block size, the content's size where it is given, and a check byte.
    let mut at = 4 + 2 + if has(3) { 8 } else { 0 } + 1;
    let mut content = Vec::with_capacity(expected);
    loop {
        let size = u32::from_le_bytes(array(bytes, at)?);
        at += 4;
        if size == 0 {
            return (content.len() == expected).then_some(content);
        }
        let end = at.checked_add((size & 0x7fff_ffff) as usize)?;
        let block_bytes = bytes.get(at..end)?;
        if size >> 31 == 1 {
            if content.len() + block_bytes.len() > expected {
                return None;
            }
            content.extend_from_slice(block_bytes);
        } else {
            block(block_bytes, &mut content, expected)?;
        }
        at = end + if has(4) { 4 } else { 0 };
    }
}

/// Appends the content of a block; what was written before serves as its dictionary.
pub(crate) fn block(bytes: &[u8], content: &mut Vec<u8>, most: usize) -> Option<()> {
    let mut at = 0;
    loop {
        let token = *bytes.get(at)?;
        at += 1;
        let literals = length(bytes, &mut at, token >> 4)?;
        let run = bytes.get(at..at.checked_add(literals)?)?;
        at += literals;
        if content.len() + run.len() > most {
            return None;
        }
        content.extend_from_slice(run);
        if at == bytes.len() {
            return Some(());
        }
        let back = usize::from(u16::from_le_bytes(array(bytes, at)?));
        at += 2;
        let count = length(bytes, &mut at, token & 15)?.checked_add(4)?;
        if back == 0 || back > content.len() || content.len().checked_add(count)? > most {
            return None;
        }
        // Byte by byte, because a run may repeat bytes that it has just written.
        let start = content.len() - back;
        for i in start..start + count {
            content.push(content[i]);
        }
    }
}

/// A length of which four bits are in a token; further bytes follow while they are 255.
fn length(bytes: &[u8], at: &mut usize, nibble: u8) -> Option<usize> {
    let mut sum = usize::from(nibble);
    if nibble == 15 {
        loop {
            let byte = *bytes.get(*at)?;
            *at += 1;
            sum = sum.checked_add(usize::from(byte))?;
            if byte != 255 {
                break;
            }
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame with independent blocks and no sizes or checksums.
    fn framed(blocks: &[(bool, &[u8])]) -> Vec<u8> {
        let mut bytes = [&MAGIC.to_le_bytes()[..], &[0x60, 0x40, 0]].concat();
        for (is_plain, block) in blocks {
            let size = block.len() as u32 | if *is_plain { 1 << 31 } else { 0 };
            bytes.extend(size.to_le_bytes());
            bytes.extend(*block);
        }
        bytes.extend([0; 4]);
        bytes
    }

    #[test]
    fn runs_and_repetitions() {
        // "ab", then 10 bytes from 2 back, then the literal "c"; and a plain block.
        let packed = [0x26, b'a', b'b', 2, 0, 0x10, b'c'];
        let bytes = framed(&[(false, &packed), (true, b"xyz")]);
        assert_eq!(
            frame(&bytes, 16).as_deref(),
            Some(&b"abababababab"[..].iter().chain(b"cxyz").copied().collect::<Vec<u8>>()[..])
        );
        for wrong in [0, 15, 17, usize::MAX, 1 << 40] {
            assert_eq!(frame(&bytes, wrong), None, "{wrong} bytes");
        }
        for cut in 0..bytes.len() {
            assert_eq!(frame(&bytes[..cut], 16), None, "cut to {cut}");
        }
        // Back beyond the beginning.
        assert_eq!(frame(&framed(&[(false, &[0x16, b'a', 9, 0, 0x10, b'c'])]), 12), None);
    }
}
