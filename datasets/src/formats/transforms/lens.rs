//! The lens keys of transforms.json, per frame or shared.

use gs_base::sentence::number;

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::formats::json::Keys;
use crate::lens::{Focal, Lens};

/// Largest declared image side, pixels; beyond it a number is not a size.
const SIDE_MAX: f64 = 1e6;

/// Most pixels of a declared image: the largest cameras have 1.5e8, and a rendering needs some 25 bytes for each.
const PIXELS_MAX: f64 = 2e8;

/// Keys of instant-ngp that ask for a projection other than the pinhole.
const OTHER_PROJECTIONS: [&str; 4] = ["is_fisheye", "latlong", "equirectangular", "ftheta_p0"];

/// Reads the lens of one frame. `scopes` are the frame's own keys and then the file's: a focal length given as an angle
/// in the frame wins over one given in pixels for the whole file.
pub(super) fn read(keys: &Keys) -> Result<Lens, DatasetError> {
    refuse_other_projections(keys)?;
    let (focal_x, focal_y) = focal(keys)?;
    if focal_x.is_none() && focal_y.is_none() {
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
        distortion: distortion(keys)?,
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
        d: [0.0; 3],
        p: [value("p1")?, value("p2")?],
    })
}

fn refuse_other_projections(keys: &Keys) -> Result<(), DatasetError> {
    let refuse = |what: String| DatasetError::Unsupported {
        path: keys.file.to_path_buf(),
        what: format!("{what} ({})", keys.location),
        expected: "a pinhole camera, with or without the distortion k1, k2, k3, k4, p1, p2 of OPENCV".to_string(),
    };
    if let Some(model) = keys.text("camera_model")? {
        let known = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE"];
        if !known.contains(&model.to_ascii_uppercase().as_str()) {
            return Err(refuse(format!("camera model {model:?}")));
        }
    }
    for key in OTHER_PROJECTIONS {
        let asked = match keys.get(key) {
            Some(serde_json::Value::Bool(on)) => *on,
            Some(_) => true,
            None => false,
        };
        if asked {
            return Err(refuse(format!("the projection of key `{key}`")));
        }
    }
    Ok(())
}
