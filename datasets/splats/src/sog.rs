//! SOG 2 of PlayCanvas: a description, `meta.json`, and WebP textures with one pixel a Gaussian, in a folder or in a
//! zip archive (`.sog`). It is read, not written.
//!
//! | texture | a pixel |
//! |---|---|
//! | `means` (low and high byte) | `n` from `mins` to `maxs` in steps of `1 / 65535`; the mean is `sign(n) (exp abs n - 1)` |
//! | `quats` | alpha less 252: the largest of w x y z; colours: the others in order, `(2 c / 255 - 1) / sqrt 2` |
//! | `scales` | places in a codebook of logarithms |
//! | `sh0` | places in a codebook of harmonics of degree 0; alpha: the opacity, a share of 255 |
//! | `shN` labels | low and high byte of a row of the palette; no texture where the degree is 0 |
//! | `shN` centroids | the palette, 64 rows beside each other: places in a codebook, one pixel a harmonic |

use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

use gs_base::{FileError, guarded};
use image::{ImageFormat, ImageReader, Limits};
use serde_json::Value;

use crate::json::{at, index, list, number};
use crate::splats::{ALPHA_LEAST, logit};
use crate::{COUNT_MAX, FILE_MAX, Splats};

/// The file that describes the others.
pub const DESCRIPTION: &str = "meta.json";

/// Rows of the palette beside each other in its texture.
const PALETTE_COLUMNS: usize = 64;

/// Alpha of a rotation whose largest number is w.
const LARGEST_IS_W: u8 = 252;

/// Reads a folder of SOG by its `meta.json`, or a `.sog` archive; values may be not finite.
///
/// # Errors
/// When a file cannot be read, is of another version, or has fewer pixels than Gaussians.
pub fn read(path: &Path) -> Result<Splats, FileError> {
    let wrong = |message| FileError::wrong(path, message);
    if path.ends_with(DESCRIPTION) {
        let folder = path.parent().unwrap_or(Path::new("."));
        let file = |name: &str| guarded::read(&folder.join(name), FILE_MAX).map_err(|error| error.to_string());
        return decode(file).map_err(wrong);
    }
    let archive = guarded::open_regular(path, FILE_MAX)?;
    let mut archive = zip::ZipArchive::new(archive).map_err(|error| wrong(format!("no zip archive: {error}")))?;
    decode(|name| entry(&mut archive, name)).map_err(wrong)
}

/// The bytes of a file of an archive, which may lie in a folder of it.
fn entry(archive: &mut zip::ZipArchive<File>, name: &str) -> Result<Vec<u8>, String> {
    let is_it = |path: &String| path.rsplit('/').next() == Some(name);
    let path = archive.file_names().flatten().map(|path| path.into_owned()).find(is_it);
    let path = path.ok_or_else(|| format!("expected {name} in the archive, found none"))?;
    let wrong = |error: &dyn std::fmt::Display| format!("{name}: {error}");
    let entry = archive.by_name(&path).map_err(|error| wrong(&error))?;
    let mut bytes = Vec::new();
    entry.take(guarded::IMAGE_MAX).read_to_end(&mut bytes).map_err(|error| wrong(&error))?;
    Ok(bytes)
}

/// The scene of files by their names.
fn decode(mut file: impl FnMut(&str) -> Result<Vec<u8>, String>) -> Result<Splats, String> {
    let meta: Value = serde_json::from_slice(&file(DESCRIPTION)?).map_err(|error| format!("{DESCRIPTION}: {error}"))?;
    let version = meta.get("version").and_then(Value::as_u64);
    if version != Some(2) {
        let found = version.map_or("none".into(), |version| version.to_string());
        return Err(format!("expected SOG of version 2, found version {found}"));
    }
    let count = index(&meta, "/count")?;
    if count > COUNT_MAX {
        return Err(format!("expected at most {COUNT_MAX} Gaussians, found {count}"));
    }
    let mut texture = |part: &str, which: usize, pixels: usize| -> Result<Texture, String> {
        let name = at(&meta, &format!("/{part}/files/{which}"))?.as_str().unwrap_or_default();
        // A name that leads out of the folder is none of a SOG file.
        if name.is_empty() || name.contains(['/', '\\']) {
            return Err(format!("expected the name of a file at /{part}/files/{which}, found {name:?}"));
        }
        Texture::parse(name, &file(name)?, pixels)
    };
    let means = [texture("means", 0, count)?, texture("means", 1, count)?];
    let [quats, scales, sh0] = [texture("quats", 0, count)?, texture("scales", 0, count)?, texture("sh0", 0, count)?];
    let [mins, maxs] = [numbers::<3>(&meta, "/means/mins")?, numbers::<3>(&meta, "/means/maxs")?];
    let [of_scales, of_colors] = ["/scales/codebook", "/sh0/codebook"].map(|pointer| numbers::<256>(&meta, pointer));
    let (of_scales, of_colors) = (of_scales?, of_colors?);
    let palette = match meta.get("shN").filter(|part| !part.is_null()) {
        Some(_) => Some((texture("shN", 1, count)?, Palette::parse(&meta, texture("shN", 0, 0)?)?)),
        None => None,
    };
    let degree = palette.as_ref().map_or(0, |(_, palette)| palette.degree);
    let antialiased = meta.get("antialias").and_then(Value::as_bool);
    let mut splats = Splats { degree, antialiased, ..Splats::default() };
    for row in 0..count {
        let [low, high] = [means[0].at(row), means[1].at(row)];
        splats.means.push(std::array::from_fn(|i| {
            let share = f32::from(u16::from_le_bytes([low[i], high[i]])) / f32::from(u16::MAX);
            let n = mins[i] + share * (maxs[i] - mins[i]);
            n.signum() * n.abs().exp_m1()
        }));
        splats.quats.push(rotation(quats.at(row)));
        let [x, y, z, _] = scales.at(row);
        splats.log_scales.push([x, y, z].map(|place| of_scales[usize::from(place)]));
        let [red, green, blue, alpha] = sh0.at(row);
        splats.sh.push([red, green, blue].map(|place| of_colors[usize::from(place)]));
        splats.opacity_logits.push(logit(f64::from(alpha) / 255.0, ALPHA_LEAST));
        if let Some((labels, palette)) = &palette {
            let [low, high, ..] = labels.at(row);
            palette.push(usize::from(u16::from_le_bytes([low, high])), row, &mut splats.sh)?;
        }
    }
    Ok(splats)
}

/// `N` finite numbers of a list.
fn numbers<const N: usize>(meta: &Value, pointer: &str) -> Result<[f32; N], String> {
    let found = list(meta, pointer)?.len();
    if found < N {
        return Err(format!("expected {N} numbers at {pointer}, found {found}"));
    }
    let mut numbers = [0.0; N];
    for (i, value) in numbers.iter_mut().enumerate() {
        *value = number(meta, &format!("{pointer}/{i}"))? as f32;
    }
    Ok(numbers)
}

/// The rotation of a pixel, w x y z.
fn rotation([a, b, c, tag]: [u8; 4]) -> [f32; 4] {
    let others = [a, b, c].map(|byte| (f32::from(byte) / 255.0 * 2.0 - 1.0) * std::f32::consts::FRAC_1_SQRT_2);
    let largest = (1.0 - others.iter().map(|x| x * x).sum::<f32>()).max(0.0).sqrt();
    let place = usize::from(tag.saturating_sub(LARGEST_IS_W));
    let mut others = others.into_iter();
    std::array::from_fn(|i| if i == place { largest } else { others.next().unwrap_or_default() })
}

/// An image of 8 bits a channel.
struct Texture {
    width: usize,
    /// Red, green, blue and alpha, row by row.
    data: Vec<u8>,
}

impl Texture {
    /// Decodes a WebP file of at least `pixels` pixels.
    fn parse(name: &str, file: &[u8], pixels: usize) -> Result<Self, String> {
        let mut reader = ImageReader::with_format(Cursor::new(file), ImageFormat::WebP);
        let mut limits = Limits::default();
        limits.max_alloc = Some(guarded::IMAGE_MAX);
        reader.limits(limits);
        let image = reader.decode().map_err(|error| format!("{name}: {error}"))?.into_rgba8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        if width * height < pixels {
            return Err(format!("{name}: expected {pixels} pixels or more, found {width} x {height}"));
        }
        Ok(Self { width, data: image.into_raw() })
    }

    fn at(&self, pixel: usize) -> [u8; 4] {
        std::array::from_fn(|i| self.data[4 * pixel + i])
    }
}

/// The harmonics above degree 0 that Gaussians share.
struct Palette {
    degree: usize,
    /// Harmonics above degree 0.
    harmonics: usize,
    /// Whole rows in the texture.
    rows: usize,
    codebook: [f32; 256],
    centroids: Texture,
}

impl Palette {
    fn parse(meta: &Value, centroids: Texture) -> Result<Self, String> {
        let degree = index(meta, "/shN/bands")?;
        if !(1..=3).contains(&degree) {
            return Err(format!("expected harmonics of 1 to 3 bands, found {degree}"));
        }
        let harmonics = (degree + 1).pow(2) - 1;
        if centroids.width != PALETTE_COLUMNS * harmonics {
            return Err(format!(
                "expected a texture of centroids of {} columns, found {}",
                PALETTE_COLUMNS * harmonics,
                centroids.width
            ));
        }
        let rows = centroids.data.len() / (4 * harmonics);
        Ok(Self { degree, harmonics, rows, codebook: numbers(meta, "/shN/codebook")?, centroids })
    }

    /// Adds the harmonics of a row of the palette.
    fn push(&self, label: usize, gaussian: usize, sh: &mut Vec<[f32; 3]>) -> Result<(), String> {
        if label >= self.rows {
            return Err(format!("Gaussian {gaussian}: expected a label below {}, found {label}", self.rows));
        }
        // Rows of the palette fill the rows of the texture.
        sh.extend((0..self.harmonics).map(|i| {
            let [red, green, blue, _] = self.centroids.at(label * self.harmonics + i);
            [red, green, blue].map(|place| self.codebook[usize::from(place)])
        }));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    fn webp(width: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let height = pixels.len() as u32 / width;
        let image = image::RgbaImage::from_raw(width, height, pixels.as_flattened().to_vec()).expect("all pixels");
        image.write_to(&mut file, ImageFormat::WebP).expect("encoded");
        file.into_inner()
    }

    /// Two Gaussians of degree 1; entry `i` of each codebook is `i / 8`.
    fn files() -> HashMap<String, Vec<u8>> {
        let codebook: Vec<f32> = (0..256).map(|i| i as f32 / 8.0).collect();
        let meta = serde_json::json!({
            "version": 2, "count": 2, "antialias": true,
            "means": {"mins": [-1.0, 0.0, 0.0], "maxs": [1.0, 2.0, 0.0], "files": ["l", "u"]},
            "quats": {"files": ["q"]}, "scales": {"codebook": codebook, "files": ["s"]},
            "sh0": {"codebook": codebook, "files": ["c"]},
            "shN": {"codebook": codebook, "bands": 1, "files": ["p", "n"]},
        });
        let mut palette = vec![[0; 4]; 64 * 3 * 2];
        palette[64 * 3..][..3].copy_from_slice(&[[1, 2, 3, 255], [4, 5, 6, 255], [7, 8, 9, 255]]);
        let files = [
            (DESCRIPTION, meta.to_string().into_bytes()),
            ("l", webp(2, &[[0, 0, 0, 255], [255, 255, 7, 255]])),
            ("u", webp(2, &[[0, 0, 0, 255], [255, 255, 7, 255]])),
            // The largest number is w, then y; the others are nearly 0, or nearly sqrt 1/2.
            ("q", webp(2, &[[128, 128, 128, 252], [255, 128, 128, 254]])),
            ("s", webp(2, &[[8, 16, 0, 255], [0, 0, 0, 255]])),
            ("c", webp(2, &[[8, 16, 24, 51], [0, 0, 0, 255]])),
            ("p", webp(64 * 3, &palette)),
            ("n", webp(2, &[[64, 0, 0, 255], [0, 0, 0, 255]])),
        ];
        files.into_iter().map(|(name, bytes)| (name.to_string(), bytes)).collect()
    }

    fn decoded(files: &HashMap<String, Vec<u8>>) -> Result<Splats, String> {
        decode(|name| files.get(name).cloned().ok_or_else(|| format!("{name} is missing")))
    }

    #[test]
    fn textures_are_read_as_they_are_laid_out() {
        let splats = decoded(&files()).expect("two Gaussians");
        splats.check().expect("finite");
        let e = 1.0_f32.exp_m1();
        assert_eq!(splats.means, [[-e, 0.0, 0.0], [e, 2.0_f32.exp_m1(), 0.0]]);
        assert_eq!((splats.log_scales[0], splats.sh[0]), ([1.0, 2.0, 0.0], [1.0, 2.0, 3.0]));
        assert!((splats.opacity_logits[0] + 4.0_f32.ln()).abs() < 1e-5, "a fifth");
        assert_eq!(splats.sh[1..4], [[0.125, 0.25, 0.375], [0.5, 0.625, 0.75], [0.875, 1.0, 1.125]]);
        assert_eq!((splats.sh[5], splats.antialiased), ([0.0; 3], Some(true)));
        let near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.005);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert!(near(splats.quats[0], [1.0, 0.0, 0.0, 0.0]), "{:?}", splats.quats);
        assert!(near(splats.quats[1], [half, 0.0, half, 0.0]), "{:?}", splats.quats);
    }

    #[test]
    fn what_is_cut_short_or_another_is_refused() {
        let whole = files();
        for (name, bytes) in &whole {
            for length in [0, bytes.len() / 2] {
                let mut cut = whole.clone();
                cut.insert(name.clone(), bytes[..length].to_vec());
                assert!(decoded(&cut).is_err(), "{name} of {length} bytes");
            }
        }
        let meta = String::from_utf8(whole[DESCRIPTION].clone()).expect("text");
        for (from, to) in [
            (r#""version":2"#, r#""version":1"#),
            (r#""count":2"#, r#""count":3"#),
            (r#""count":2"#, r#""count":99999999999"#),
            (r#""bands":1"#, r#""bands":2"#),
            (r#"["q"]"#, r#"["../q"]"#),
            (r#""mins":[-1.0,"#, r#""mins":["#),
        ] {
            let mut changed = whole.clone();
            assert!(meta.contains(from), "{meta}");
            changed.insert(DESCRIPTION.into(), meta.replace(from, to).into_bytes());
            assert!(decoded(&changed).is_err(), "{to}");
        }
        let mut label = whole.clone();
        label.insert("n".into(), webp(2, &[[128, 0, 0, 255], [0, 0, 0, 255]]));
        assert!(decoded(&label).unwrap_err().contains("below 128"));
    }
}
