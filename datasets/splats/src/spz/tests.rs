use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::*;
use crate::Splats;
use crate::splats::testing::random;
use crate::splats::{sigmoid, unit};

/// Largest difference, component by component.
fn apart<const D: usize>(a: &[[f32; D]], b: &[[f32; D]]) -> f32 {
    a.iter().flatten().zip(b.iter().flatten()).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

fn packed(raw: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(raw).and_then(|()| gzip.finish()).expect("memory")
}

fn header(version: u32, count: u32, degree: u8, bits: u8) -> Vec<u8> {
    [&MAGIC.to_le_bytes()[..], &version.to_le_bytes(), &count.to_le_bytes(), &[degree, bits, 0, 0]].concat()
}

/// Half a step of each quantisation: positions 1/4096, alphas and colours 1/255, log scales 1/16, harmonics buckets of
/// 8 and 16 of 1/128 (and half a step before that). A component of a rotation is off by half of 1/(511 sqrt 2) or, the
/// largest one, by at most three times that; 1e-5 is for rounding.
#[test]
fn what_is_written_is_read_to_half_a_step() {
    for degree in 0..=3 {
        let splats = random(500, degree, 7 + degree as u64);
        let back = decode(&encode(&splats).expect("encoded")).expect("decoded");
        assert_eq!((back.len(), back.degree, back.antialiased), (500, degree, Some(false)));
        assert!(apart(&back.means, &splats.means) <= 0.5 / 4096.0 + 1e-6);
        assert!(apart(&back.log_scales, &splats.log_scales) <= 0.5 / 16.0 + 1e-5);
        for (a, b) in back.opacity_logits.iter().zip(&splats.opacity_logits) {
            assert!((sigmoid(*a) - sigmoid(*b)).abs() <= 0.5 / 255.0 + 1e-6);
        }
        for (a, b) in back.quats.iter().zip(&splats.quats) {
            let (a, b) = (unit(*a), unit(*b));
            let sign = if a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
            let most = a.iter().zip(&b).map(|(a, b)| (a - sign * b).abs()).fold(0.0, f64::max);
            assert!(most <= 3.0 * 0.5 / 511.0 / 2_f64.sqrt() + 1e-5, "{most}");
        }
        let s = splats.coefficients();
        for (i, (a, b)) in back.sh.iter().zip(&splats.sh).enumerate() {
            // The clamp at the byte 255 takes one step more.
            let bound = match i % s {
                0 => 0.5 / 255.0 / 0.15 + 1e-5,
                1..4 => 4.5 / 128.0 + 1e-5,
                _ => 8.5 / 128.0 + 1e-5,
            };
            // A colour beyond the range of its byte is clamped.
            let clamped = if i % s == 0 { b.map(|x| x.clamp(-0.5 / 0.15, 0.5 / 0.15)) } else { *b };
            assert!(apart(&[*a], &[clamped]) <= bound, "coefficient {}: {a:?} {b:?}", i % s);
        }
    }
}

/// A scene that was read once is written again to the same bytes: every quantised value is its own nearest step. Ties
/// of the largest component of a rotation may fall to another component, so rotations are compared by their turn.
#[test]
fn a_second_trip_changes_nothing() {
    let once = decode(&encode(&random(300, 3, 5)).expect("encoded")).expect("decoded");
    let twice = decode(&encode(&once).expect("encoded")).expect("decoded");
    assert_eq!((&once.means, &once.log_scales, &once.sh), (&twice.means, &twice.log_scales, &twice.sh));
    assert_eq!(once.opacity_logits, twice.opacity_logits);
    assert!(apart(&once.quats, &twice.quats) < 0.003);
}

#[test]
fn opaque_and_clear_gaussians_stay_finite() {
    let mut splats = random(2, 0, 1);
    splats.opacity_logits = vec![40.0, -40.0];
    splats.log_scales = vec![[9.0; 3], [-30.0; 3]];
    let back = decode(&encode(&splats).expect("encoded")).expect("decoded");
    assert!(back.opacity_logits.iter().all(|x| x.is_finite() && x.abs() > 6.0), "{:?}", back.opacity_logits);
    assert_eq!(back.log_scales, [[255.0 / 16.0 - 10.0; 3], [-10.0; 3]]);
}

/// A scene of 500 km takes its bits, and half a step is then larger. Positions that no bits hold are named.
#[test]
fn wide_scenes_keep_their_positions() {
    let mut splats = random(50, 0, 2);
    splats
        .means
        .iter_mut()
        .enumerate()
        .for_each(|(i, mean)| mean[0] += if i % 2 == 0 { 500_000.0 } else { -500_000.0 });
    splats.means[0][0] = 0.0;
    assert_eq!((fractional_bits(&splats), far(&splats)), (Some(4), None));
    let back = decode(&encode(&splats).expect("encoded")).expect("decoded");
    let apart =
        back.means.iter().zip(&splats.means).map(|(a, b)| {
            (0..3).map(|i| (f64::from(a[i]) + back.offset[i] - f64::from(b[i])).abs()).fold(0.0, f64::max)
        });
    assert!(apart.fold(0.0, f64::max) <= 0.5 / 16.0 + 1e-6);
    splats.means[7][1] = 1e9;
    splats.means[9][2] = -2e9;
    let error = encode(&splats).expect_err("no bits");
    assert!(error.contains("Gaussian 7") && error.contains("1e9") && error.contains("2 of 50"), "{error}");
    assert!(error.contains(".ply and .glb hold them"), "{error}");
}

/// One Gaussian far from all others would coarsen the positions of all to 1/64 unit. It is named, with the others'
/// reach.
#[test]
fn far_gaussians_are_named() {
    let mut splats = random(400, 0, 3);
    assert_eq!(far(&splats), None);
    for (row, place) in [(17, [1e5, 0.0, 0.0]), (200, [0.0, -5e8, 3e38])] {
        splats.means[row] = place;
        let found = far(&splats).expect("far ones");
        assert_eq!(found.rows, if row == 17 { vec![17] } else { vec![17, 200] });
        assert!((99_000.0..101_000.0).contains(&found.distance) && (3.0..7.0).contains(&found.reach), "{found:?}");
        let kept: Vec<u32> = (0..400).filter(|row| !found.rows.contains(row)).collect();
        assert_eq!((fractional_bits(&splats.select(&kept)), far(&splats.select(&kept))), (Some(12), None));
    }
    // Those that the finer step holds stay, however far from the others they are.
    let mut layered = random(400, 0, 3);
    (0..10).for_each(|row| layered.means[row] = [900.0 + row as f32, 0.0, 0.0]);
    layered.means[300] = [1e5, 0.0, 0.0];
    assert_eq!(far(&layered).map(|far| far.rows), Some(vec![300]));
    // Large Gaussians do not see the coarser step.
    let mut sky = random(400, 0, 3);
    sky.log_scales = vec![[0.0; 3]; 400];
    sky.means[17] = [1e4, 0.0, 0.0];
    assert_eq!(far(&sky), None);
    // A wide scene has no Gaussian apart from the others.
    let mut wide = random(400, 0, 3);
    wide.means.iter_mut().flatten().for_each(|x| *x *= 5000.0);
    assert_eq!((far(&wide), oversized(&wide)), (None, 0));
    wide.log_scales[3][1] = 7.0;
    assert_eq!((oversized(&wide), far(&Splats::default())), (1, None));
}

/// An offset stands in the comment of the gzip stream to the last digit, and the rest of the file is that of the local
/// scene.
#[test]
fn an_offset_comes_back() {
    let local = random(20, 1, 4);
    let offset = [450_123.123_456_789, -5_200_456.1, 1.0 / 3.0];
    let back = decode(&encode(&Splats { offset, ..local.clone() }).expect("encoded")).expect("decoded");
    let near = decode(&encode(&local).expect("encoded")).expect("decoded");
    assert_eq!((back.offset, near.offset), (offset, [0.0; 3]));
    assert_eq!((back.means, back.sh, back.quats), (near.means, near.sh, near.quats));
    let comment = |text: &str| {
        let mut gzip = flate2::GzBuilder::new().comment(text).write(Vec::new(), Compression::default());
        gzip.write_all(&header(3, 0, 0, 12)).and_then(|()| gzip.finish()).expect("memory")
    };
    for wrong in ["1 2", "1 2 3 4", "1 2 nan", "1 2 1e300", "a b c"] {
        let error = decode(&comment(&format!("written by gsburn; offset {wrong}"))).expect_err(wrong);
        assert!(error.contains("an offset of three numbers"), "{error}");
        decode(&comment(&format!("made elsewhere; offset {wrong}"))).expect("a comment of another program");
    }
}

/// A stream whose gzip was undone is read, unless it is cut short; other versions are named by their header.
#[test]
fn a_stream_without_gzip_is_read() {
    let packed = encode(&random(20, 1, 3)).expect("encoded");
    let mut raw = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::MultiGzDecoder::new(&packed[..]), &mut raw).expect("unpacked");
    assert_eq!(decode(&raw).expect("read"), decode(&packed).expect("read"));
    for length in (0..raw.len()).step_by(7) {
        assert!(decode(&raw[..length]).is_err(), "{length} bytes");
    }
    raw[4] = 5;
    assert!(decode(&raw).expect_err("newer").contains("found SPZ 5"));
    raw[4] = 1;
    assert!(decode(&raw).expect_err("older").contains("found SPZ 1"));
}

/// A file of version 2 by hand: one Gaussian.
#[test]
fn version_2_is_read() {
    let position = |x: f32| ((x * 4096.0) as i32).to_le_bytes()[..3].to_vec();
    let mut raw = header(2, 1, 1, 12);
    [1.5, -2.0, 0.25].map(position).iter().for_each(|bytes| raw.extend(bytes));
    // Half opaque, colours, scales, a rotation of 90 degrees about x, harmonics of which the first is 0.5.
    raw.extend([128, 255, 128, 0, 160, 96, 0, 218, 128, 128]);
    raw.extend([192, 128, 128, 128, 128, 128, 128, 128, 128]);
    let splats = decode(&packed(&raw)).expect("decoded");
    assert_eq!(splats.means, [[1.5, 2.0, -0.25]]);
    assert_eq!(splats.log_scales, [[0.0, -4.0, -10.0]]);
    assert!((splats.quats[0][0] - 0.7045).abs() < 0.003 && (splats.quats[0][1] - 0.7098).abs() < 0.003);
    assert_eq!(splats.sh[1], [-0.5, 0.0, 0.0], "the first harmonic is of y, which is reversed");
    assert!((splats.sh[0][0] - 3.3333).abs() < 1e-3 && (splats.sh[0][2] + 3.3333).abs() < 1e-3);
}

/// Every length of the file is refused, and so are headers that promise what no file holds.
#[test]
fn broken_files_are_refused() {
    let bytes = encode(&random(20, 1, 3)).expect("encoded");
    for length in 0..bytes.len() {
        assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
    let wrong = |raw: &[u8]| decode(&packed(raw)).expect_err("broken");
    assert!(wrong(&header(3, 67_000_000, 3, 12)).contains("no "));
    assert!(wrong(&header(3, u32::MAX, 0, 12)).contains("at most"));
    assert!(wrong(&header(1, 1, 0, 12)).contains("SPZ 1"));
    assert!(wrong(&header(3, 1, 9, 12)).contains("degree"));
    assert!(wrong(&header(3, 1, 0, 60)).contains("fractional"));
    assert!(wrong(b"a text of more than sixteen bytes").contains("NGSP"));
    assert!(decode(b"plain bytes, no gzip").is_err());
    assert!(decode(&header(5, 1, 0, 12)).expect_err("newer").contains("SPZ 5"));
}

/// A bomb: 64 MB of zeros in 64 kB. Only what the header asks for is unpacked.
#[test]
fn a_bomb_is_not_unpacked() {
    let mut raw = header(3, 1, 0, 12);
    raw.resize(64 << 20, 0);
    assert!(decode(&packed(&raw)).expect_err("too long").contains("found more"));
}

#[test]
fn an_empty_scene_comes_back() {
    let back = decode(&encode(&Splats::default()).expect("encoded")).expect("decoded");
    assert!(back.is_empty());
}

/// A zstd frame of one raw block of fewer than 256 bytes (RFC 8878): its size in one byte, then the block.
fn frame(bytes: &[u8]) -> Vec<u8> {
    let block = (bytes.len() as u32) << 3 | 1;
    [&[0x28, 0xb5, 0x2f, 0xfd, 0x20, bytes.len() as u8][..], &block.to_le_bytes()[..3], bytes].concat()
}

/// The arrays of version 3 as a file of version 4.
fn version_4(splats: &Splats) -> Vec<u8> {
    let mut raw = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&encode(splats).expect("encoded")[..]), &mut raw)
        .expect("gzip");
    let (header, mut arrays) = raw.split_at(HEADER);
    let (n, rest) = (splats.len(), splats.coefficients() - 1);
    let lengths: Vec<usize> = [9, 1, 3, 3, 4, 3 * rest].into_iter().map(|bytes| bytes * n).filter(|n| *n > 0).collect();
    let mut file = header.to_vec();
    file[4] = 4;
    file[15] = lengths.len() as u8;
    file.extend(32_u32.to_le_bytes());
    file.extend([0; 12]);
    let (mut table, mut streams) = (Vec::new(), Vec::new());
    for length in lengths {
        let (array, after) = arrays.split_at(length);
        arrays = after;
        let stream = frame(array);
        [stream.len() as u64, length as u64].iter().for_each(|length| table.extend(length.to_le_bytes()));
        streams.extend(stream);
    }
    [file, table, streams].concat()
}

#[test]
fn version_4_has_the_same_arrays() {
    for degree in [0, 1] {
        let splats = random(20, degree, 3);
        let back = decode(&version_4(&splats)).expect("decoded");
        assert_eq!(back, decode(&encode(&splats).expect("encoded")).expect("decoded"), "degree {degree}");
    }
}

#[test]
fn a_damaged_version_4_is_refused() {
    let whole = version_4(&random(20, 0, 3));
    for length in 0..whole.len() {
        assert!(decode(&whole[..length]).is_err(), "{length} bytes");
    }
    // The table far outside, no streams, a stream of another length, no zstd.
    for (at, byte) in [(19, 255), (15, 0), (40, 7), (39, 255), (112, 0)] {
        let mut file = whole.clone();
        file[at] = byte;
        assert!(decode(&file).is_err(), "byte {at}");
    }
}
