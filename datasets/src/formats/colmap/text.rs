//! COLMAP text files.

use std::path::Path;
use std::str::{FromStr, SplitAsciiWhitespace};

use glam::DVec3;
use gs_base::guarded;

use super::model::{Camera, Image, Listed, Point, model_by_name};
use crate::error::DatasetError;

/// The words of one line.
struct Line<'a> {
    file: &'a Path,
    number: usize,
    words: SplitAsciiWhitespace<'a>,
}

impl<'a> Line<'a> {
    fn new(file: &'a Path, number: usize, text: &'a str) -> Self {
        Self { file, number, words: text.split_ascii_whitespace() }
    }

    fn wrong(&self, expected: &str, found: &str) -> DatasetError {
        let found = if found.is_empty() { "the end of the line".to_string() } else { format!("{found:?}") };
        DatasetError::malformed(self.file, format!("line {}", self.number), expected, found)
    }

    fn next<T: FromStr>(&mut self, expected: &str) -> Result<T, DatasetError> {
        let word = self.words.next().unwrap_or("");
        word.parse().map_err(|_| self.wrong(expected, word))
    }

    /// A number, which may be none by IEEE 754: one broken camera or pose is no reason to refuse the file.
    fn float(&mut self, expected: &str) -> Result<f64, DatasetError> {
        let word = self.words.next().unwrap_or("");
        word.parse().ok().or_else(|| is_nan(word).then_some(f64::NAN)).ok_or_else(|| self.wrong(expected, word))
    }

    fn array<const N: usize>(&mut self, expected: &str) -> Result<[f64; N], DatasetError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.float(expected)?;
        }
        Ok(out)
    }
}

/// Whether a word is what C libraries print for "not a number": `-nan(ind)`, `nan(snan)`, `1.#QNAN`, `-1.#IND`.
fn is_nan(word: &str) -> bool {
    let word = word.trim_start_matches(['-', '+']).to_ascii_lowercase();
    word.starts_with("nan") || word.starts_with("1.#")
}

/// Lines with their numbers, comments left out and blank lines kept.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().map(|(i, line)| (i + 1, line)).filter(|(_, line)| !line.trim_start().starts_with('#'))
}

/// Reads each line with text of a file.
fn each_line<T>(path: &Path, read: impl Fn(Line) -> Result<T, DatasetError>) -> Result<Vec<T>, DatasetError> {
    let text = guarded::read_to_string(path, guarded::MODEL_MAX)?;
    let lines = lines(&text).filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(number, text)| read(Line::new(path, number, text))).collect()
}

/// cameras.txt: `ID MODEL WIDTH HEIGHT PARAMS...`
pub(super) fn cameras(path: &Path) -> Result<Vec<Listed>, DatasetError> {
    each_line(path, |mut line| Ok((line.next("a camera id")?, camera(line))))
}

/// The rest of a camera's line.
fn camera(mut line: Line) -> Result<Camera, DatasetError> {
    let name: String = line.next("a camera model")?;
    let (model, count) = model_by_name(&name).ok_or_else(|| line.wrong("a COLMAP camera model", &name))?;
    let (width, height) = (line.next("a width")?, line.next("a height")?);
    let expected = format!("{count} parameters for {model}");
    let params = (0..count).map(|_| line.float(&expected)).collect::<Result<Vec<f64>, _>>()?;
    match line.words.next() {
        Some(extra) => Err(line.wrong(&expected, &format!("one more: {extra}"))),
        None => Ok(Camera { model, width, height, params }),
    }
}

/// images.txt: two lines an image, `ID QW QX QY QZ TX TY TZ CAMERA_ID NAME` and `(X Y POINT3D_ID)...`, of which the
/// second may be empty. Where a tool dropped empty lines, the next image stands in its place.
pub(super) fn images(path: &Path, keep_observations: bool) -> Result<Vec<Image>, DatasetError> {
    let text = guarded::read_to_string(path, guarded::MODEL_MAX)?;
    let mut images = Vec::new();
    let mut lines = lines(&text).peekable();
    while let Some((number, header)) = lines.next() {
        if header.trim().is_empty() {
            continue;
        }
        let mut line = Line::new(path, number, header);
        let _: u32 = line.next("an image id")?;
        let q = line.array("a quaternion of 4 numbers")?;
        let t = line.array("a translation of 3 numbers")?;
        let camera_id = line.next("a camera id")?;
        let name = after_words(header, 9).to_string();
        if name.is_empty() {
            return Err(line.wrong("an image name", ""));
        }
        let observations = match lines.next_if(|(_, text)| !is_image(text)) {
            Some((number, text)) => observations(Line::new(path, number, text), keep_observations)?,
            None => Vec::new(),
        };
        images.push(Image { q, t, camera_id, name, observations });
    }
    Ok(images)
}

/// Whether a line is an image's own: observations come in threes, and ten words (an id, seven numbers, a camera and a
/// name) do not. Of a name with spaces the words tell: the tenth is no number, or the twelfth is no point.
fn is_image(line: &str) -> bool {
    let words: Vec<&str> = line.split_ascii_whitespace().take(12).collect();
    let is_float = |word: &&str| word.parse::<f64>().is_ok() || is_nan(word);
    let begins = words.len() >= 10
        && words[0].parse::<u32>().is_ok()
        && words[1..8].iter().all(is_float)
        && words[8].parse::<u32>().is_ok();
    let is_observations = || words.chunks(3).all(|three| three.len() == 3 && three[2].parse::<i64>().is_ok());
    begins && (!is_observations() || !is_float(&words[9]))
}

/// The line is parsed in full even when it is not kept, so that a file cut short is noticed.
fn observations(mut line: Line, keep: bool) -> Result<Vec<(f64, f64, u64)>, DatasetError> {
    const EXPECTED: &str = "observations (X Y POINT3D_ID)";
    let mut observations = Vec::new();
    while let Some(word) = line.words.next() {
        let x: f64 = word.parse().map_err(|_| line.wrong(EXPECTED, word))?;
        let y = line.float(EXPECTED)?;
        let point: i64 = line.next(EXPECTED)?;
        if let (true, Ok(point)) = (keep, u64::try_from(point)) {
            observations.push((x, y, point));
        }
    }
    Ok(observations)
}

/// The text behind the first `count` words: names may contain spaces.
fn after_words(line: &str, count: usize) -> &str {
    let mut rest = line.trim();
    for _ in 0..count {
        rest = rest.find(|c: char| c.is_ascii_whitespace()).map_or("", |end| rest[end..].trim_start());
    }
    rest
}

/// points3D.txt: `ID X Y Z R G B ERROR (IMAGE_ID POINT2D_IDX)...`
pub(super) fn points(path: &Path) -> Result<Vec<(u64, Point)>, DatasetError> {
    each_line(path, |mut line| {
        let id = line.next("a point id")?;
        let position = DVec3::from_array(line.array("a position of 3 numbers")?);
        let color = [line.next("a red value")?, line.next("a green value")?, line.next("a blue value")?];
        Ok((id, Point { position, color, error: line.float("a reprojection error")? }))
    })
}
