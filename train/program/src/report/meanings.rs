//! The meanings of the figures of a report, for readers who do not know their names.

/// Beginnings of names, and their meaning in a sentence.
const MEANINGS: [(&str, &str); 25] = [
    (
        "PSNR",
        "peak signal-to-noise ratio, decibels: how little the renderings differ from photos that training has not seen; higher is better. At 20 dB \
              shapes are right and details are missing, at 30 dB differences are small, at 40 dB they are hard to see.",
    ),
    ("SSIM", "structural similarity in windows of 11 pixels, -1 to 1: 1 for equal images."),
    ("MS-SSIM", "SSIM over five scales, 0 to 1: 1 for equal images."),
    (
        "LPIPS",
        "distance between two images as a network sees them that was trained on people's judgements: 0 for equal images, lower is better.",
    ),
    (
        "Moving parts",
        "PSNR and SSIM over those pixels alone in which something moves: most of a photo rests, and hides errors of motion.",
    ),
    ("Gaussians", "the soft coloured ellipsoids that make up the scene."),
    (
        "Moving Gaussians",
        "Gaussians that have a path of their own. Order: the highest power of time in the path; 0 rests.",
    ),
    ("Blurry photo", "PSNR of the blur that the scene forms over an exposure, against the photo as it was taken."),
    ("Velocity off by", "angle between a surface's velocity in the scene and its true one."),
    ("Speed off by", "difference between a surface's speed in the scene and its true one, as a share of the true one."),
    ("Exposure", "time over which the shutter was open, in the data set's unit of time."),
    ("Gain over the lifted points", "PSNR that the network adds to the coloured LiDAR points as they were measured."),
    ("Gain of the velocities", "PSNR in moving parts, less that of the same scene with everything at rest."),
    (
        "EPE",
        "end point error, metres: mean distance between a point's predicted and its true place a tenth of a second later; lower is better.",
    ),
    (
        "Bucketed",
        "by class of object, and by whether a point moves. Errors of moving points are divided by their speed: at 1 the motion is as wrong as none.",
    ),
    ("Wheeled VRU", "vulnerable road users on wheels: people on bicycles, motorcycles and scooters."),
    ("Peak memory", "the most that the program has held, beside the prediction made before it began."),
    (
        "SH degree",
        "degree of the spherical harmonics by which a colour depends on the direction of view: 0 is the same from all sides.",
    ),
    ("Numbers of motion", "values that describe paths, in the whole scene."),
    ("Kinks", "times at which all paths may change their velocity at once."),
    ("Remainder", "a small network's correction of the paths."),
    ("Tile intersections", "pairs of a Gaussian and a square of 16 pixels that it touches: the work of drawing."),
    ("Voxels", "cells of space that hold a Gaussian, for the network."),
    ("Loss", "what training makes small: errors of the photo of a step, and the penalties of the method."),
    ("Schedule", "the steps at which training changes what it does."),
];

/// The meaning of a name: of the longest beginning that is listed.
pub fn meaning(name: &str) -> Option<&'static str> {
    let listed = MEANINGS.iter().filter(|(listed, _)| begins_with(name, listed));
    listed.max_by_key(|(listed, _)| listed.len()).map(|(_, meaning)| *meaning)
}

/// The list of those names that are in one of the texts of a page, folded.
pub fn list<'a>(texts: impl Iterator<Item = &'a str> + Clone) -> String {
    let is_used = |listed: &str| texts.clone().any(|text| contains(text, listed));
    let used = MEANINGS.iter().filter(|(listed, _)| is_used(listed));
    let rows: String = used.map(|(name, meaning)| format!("<dt>{name}</dt><dd>{meaning}</dd>\n")).collect();
    match rows.is_empty() {
        true => rows,
        false => format!(
            "<details class=\"meanings\"><summary>What the figures mean</summary>\n<dl>\n{rows}</dl></details>\n"
        ),
    }
}

fn begins_with(text: &str, listed: &str) -> bool {
    text.get(..listed.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(listed))
}

/// Whether a listed name stands in a text as a word.
fn contains(text: &str, listed: &str) -> bool {
    let is_begin = |at: usize| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '-');
    text.char_indices().any(|(at, _)| is_begin(at) && begins_with(&text[at..], listed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_their_own_meaning() {
        assert!(meaning("EPE3D, moving").is_some_and(|text| text.starts_with("end point error")));
        assert!(meaning("moving Gaussians").is_some_and(|text| text.contains("path")));
        assert!(meaning("MS-SSIM").is_some_and(|text| text.contains("five scales")));
        assert_eq!(meaning("Ünknown"), None);
    }

    #[test]
    fn a_page_explains_what_is_on_it() {
        let list = list(["MS-SSIM", "Scene flow, bucketed", "wheeled VRU"].into_iter());
        for name in ["MS-SSIM", "Bucketed", "Wheeled VRU"] {
            assert!(list.contains(&format!("<dt>{name}</dt>")), "{name} in {list}");
        }
        assert!(!list.contains("<dt>SSIM</dt>") && !list.contains("<dt>Exposure</dt>"), "{list}");
        assert_eq!(super::list(["nothing known"].into_iter()), "");
    }
}
