//! Writers of NumPy files.

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A NumPy file of version 1 with any type and bytes, padded as NumPy does.
pub(super) fn npy(descr: &str, fortran: bool, shape: &[usize], data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': ({sides}), }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

/// `<f4` in C order.
pub(super) fn floats(shape: &[usize], values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    npy("<f4", false, shape, &values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

/// `<U` texts, as `numpy.array(["a", "b"])` saves them.
pub(super) fn texts(words: &[&str]) -> Vec<u8> {
    let longest = words.iter().map(|word| word.chars().count()).max().unwrap_or(1).max(1);
    let padded = |word: &&str| {
        let units: Vec<u32> = word.chars().map(u32::from).collect();
        (0..longest).flat_map(|i| units.get(i).copied().unwrap_or(0).to_le_bytes()).collect::<Vec<u8>>()
    };
    npy(&format!("<U{longest}"), false, &[words.len()], &words.iter().flat_map(padded).collect::<Vec<u8>>())
}

/// An archive as `numpy.savez` (stored) or `numpy.savez_compressed` writes it.
pub(super) fn npz(entries: &[(&str, Vec<u8>)], deflated: bool) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let method = if deflated { CompressionMethod::Deflated } else { CompressionMethod::Stored };
    // NumPy asks for 64-bit sizes in every entry.
    let options = SimpleFileOptions::default().compression_method(method).large_file(true);
    for (name, bytes) in entries {
        archive.start_file(format!("{name}.npy"), options).expect("an entry");
        archive.write_all(bytes).expect("its bytes");
    }
    archive.finish().expect("an archive").into_inner()
}
