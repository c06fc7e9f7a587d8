//! The lens keys of transforms.json, per frame or shared.
//!
//! nerfstudio names lenses by `camera_model`. instant-ngp has a key for each projection: `is_fisheye` is OpenCV's
//! fisheye, `latlong` what all others call equirectangular, and `equirectangular` a projection of equal areas, which is
//! refused: whoever writes it may mean either.

use gs_base::sentence::number;

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::formats::json::Keys;
use crate::lens::{Focal, Lens};
use crate::projection::Projection;

/// Largest declared image side, pixels; beyond it a number is not a size.
const SIDE_MAX: f64 = 1e6;

/// Most pixels of a declared image: the largest cameras have 1.5e8, and a rendering needs some 25 bytes for each.
const PIXELS_MAX: f64 = 2e8;

/// Names of camera models, as COLMAP and nerfstudio have them, and their projections.
const MODELS: [(&str, Projection); 8] = [
    ("OPENCV", Projection::Pinhole),
    ("PINHOLE", Projection::Pinhole),
    ("SIMPLE_PINHOLE", Projection::Pinhole),
    ("SIMPLE_RADIAL", Projection::Pinhole),
    ("RADIAL", Projection::Pinhole),
    ("PERSPECTIVE", Projection::Pinhole),
    ("OPENCV_FISHEYE", Projection::Fisheye),
    ("EQUIRECTANGULAR", Projection::Equirectangular),
];

/// Keys of instant-ngp that ask for a projection; `None` of those that are not read.
const KEYS: [(&str, Option<Projection>); 4] = [
    ("is_fisheye", Some(Projection::Fisheye)),
    ("latlong", Some(Projection::Equirectangular)),
    ("equirectangular", None),
    ("ftheta_p0", None),
];

/// Reads the lens of one frame. `scopes` are the frame's own keys and then the file's: a focal length given as an angle
/// in the frame wins over one given in pixels for the whole file.
pub(super) fn read(keys: &Keys) -> Result<Lens, DatasetError> {
    let projection = projection(keys)?;
    let (focal_x, focal_y) = focal(keys)?;
    if projection != Projection::Equirectangular && focal_x.is_none() && focal_y.is_none() {
        return Err(keys.wrong("fl_x", "a focal length (fl_x or camera_angle_x)", "neither".to_string()));
    }
    let (width, height) = (size(keys, "w")?, size(keys, "h")?);
    if let (Some(width), Some(height)) = (width, height)
        && width * height > PIXELS_MAX
    {
        return Err(keys.wrong("w", "an image of at most 200 megapixels", format!("{width} x {height}")));
    }
    Ok(Lens {
        focal_x,
        focal_y,
        cx: keys.number("cx")?,
        cy: keys.number("cy")?,
        width,
        height,
        projection,
        // A panorama is put together by a program, and has none.
        distortion: if projection == Projection::Equirectangular { Distortion::default() } else { distortion(keys)? },
    })
}

fn focal(keys: &Keys) -> Result<(Option<Focal>, Option<Focal>), DatasetError> {
    for object in &keys.objects {
        let own = Keys { file: keys.file, location: keys.location.clone(), objects: vec![object] };
        let axis = |pixels: &str, angle: &str| -> Result<Option<Focal>, DatasetError> {
            if let Some(value) = own.number(pixels)? {
                return if value > 0.0 {
                    Ok(Some(Focal::Pixels(value)))
                } else {
                    Err(own.wrong(pixels, "a focal length above 0", number(value)))
                };
            }
            match own.number(angle)? {
                Some(value) if value > 0.0 && value < std::f64::consts::PI => Ok(Some(Focal::Angle(value))),
                Some(value) => Err(own.wrong(angle, "an angle between 0 and pi (radians)", number(value))),
                None => Ok(None),
            }
        };
        let found = (axis("fl_x", "camera_angle_x")?, axis("fl_y", "camera_angle_y")?);
        if found.0.is_some() || found.1.is_some() {
            return Ok(found);
        }
    }
    Ok((None, None))
}

fn size(keys: &Keys, key: &str) -> Result<Option<f64>, DatasetError> {
    match keys.number(key)? {
        Some(value) if !(1.0..=SIDE_MAX).contains(&value) => {
            Err(keys.wrong(key, "an image side of 1 to 1000000 pixels", number(value)))
        }
        other => Ok(other),
    }
}

fn distortion(keys: &Keys) -> Result<Distortion, DatasetError> {
    let value = |key: &str| keys.number(key).map(|value| value.unwrap_or(0.0));
    Ok(Distortion {
        k: [value("k1")?, value("k2")?, value("k3")?, value("k4")?],
        p: [value("p1")?, value("p2")?],
        ..Distortion::default()
    })
}

fn projection(keys: &Keys) -> Result<Projection, DatasetError> {
    let refuse = |what: String| DatasetError::Unsupported {
        path: keys.file.to_path_buf(),
        what: format!("{what} ({})", keys.location),
        expected:
            "a camera model OPENCV (k1, k2, k3, k4, p1, p2), OPENCV_FISHEYE (k1, k2, k3, k4), EQUIRECTANGULAR or \
                   a pinhole"
                .to_string(),
    };
    let mut found = Projection::Pinhole;
    if let Some(model) = keys.text("camera_model")? {
        let known = MODELS.iter().find(|(name, _)| model.eq_ignore_ascii_case(name));
        found = known.ok_or_else(|| refuse(format!("camera model {model:?}")))?.1;
    }
    for (key, projection) in KEYS {
        let asked = match keys.get(key) {
            Some(serde_json::Value::Bool(on)) => *on,
            Some(_) => true,
            None => false,
        };
        if asked {
            found = projection.ok_or_else(|| refuse(format!("the projection of key `{key}`")))?;
        }
    }
    Ok(found)
}
