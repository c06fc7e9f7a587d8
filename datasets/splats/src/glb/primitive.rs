//! The Gaussians of one primitive, in its own axes.

use gs_base::local::is_offset;
use serde_json::Value;

use super::arrays::Accessors;
use super::{OPACITY_LEAST, SPLATS, harmonic_name};
use crate::Splats;
use crate::json::{at, index};
use crate::splats::logit;

/// A size nearer to 0 than this, scene units, has no use for a finite logarithm: flat Gaussians have sizes of 0 in
/// files of others.
pub(super) const SIZE_LEAST: f32 = 1e-12;

/// The kernel of 3D Gaussians.
const KERNEL: &str = "ellipse";

/// The extension of a primitive of Gaussians; `None` for another primitive.
pub(super) fn extension(primitive: &Value) -> Option<&Value> {
    primitive.get("extensions")?.get(SPLATS)
}

/// How many Gaussians a primitive promises.
pub(super) fn promised(primitive: &Value, accessors: &Accessors) -> Result<usize, String> {
    accessors.count(index(primitive, "/attributes/POSITION")?)
}

/// Reads a primitive.
pub(super) fn read(primitive: &Value, accessors: &Accessors) -> Result<Splats, String> {
    let extension = at(primitive, &format!("/extensions/{SPLATS}"))?;
    if let Some(name) = extension.get("extensions").and_then(Value::as_object).and_then(|more| more.keys().next()) {
        return Err(format!("expected plain accessors of {SPLATS}, found another form of it ({name:?})"));
    }
    let kernel = extension.get("kernel").and_then(Value::as_str).unwrap_or(KERNEL);
    if kernel != KERNEL {
        return Err(format!("expected the kernel {KERNEL:?} of {SPLATS}, found {kernel:?}"));
    }
    let named = |name: &str| primitive.get("attributes").and_then(|attributes| attributes.get(name)?.as_u64());
    let count = promised(primitive, accessors)?;
    // Held against each other before any is read: a short file may name a long array again and again.
    let wanted = |name: &str| {
        let accessor = named(name).ok_or_else(|| format!("expected the attribute {name}, found none"))? as usize;
        match accessors.count(accessor)? {
            found if found == count => Ok(accessor),
            found => Err(format!("expected {count} values of {name}, found {found}")),
        }
    };
    let means = accessors.floats::<3>(wanted("POSITION")?)?;
    let quats = accessors.floats::<4>(wanted(&format!("{SPLATS}:ROTATION"))?)?;
    let scales = accessors.floats::<3>(wanted(&format!("{SPLATS}:SCALE"))?)?;
    let opacities = accessors.floats::<1>(wanted(&format!("{SPLATS}:OPACITY"))?)?;
    let degree = (0..=3).rev().find(|degree: &usize| named(&harmonic_name(degree * degree)).is_some()).unwrap_or(0);
    let s = (degree + 1) * (degree + 1);
    let mut sh = vec![[0.0; 3]; means.len() * s];
    for i in 0..s {
        let values = accessors.floats::<3>(wanted(&harmonic_name(i))?)?;
        sh.iter_mut().skip(i).step_by(s).zip(values).for_each(|(to, from)| *to = from);
    }
    // A negative size stays: its logarithm is no number, which is found below.
    let log = |size: f32| if (0.0..SIZE_LEAST).contains(&size) { SIZE_LEAST.ln() } else { size.ln() };
    let splats = Splats {
        means,
        offset: offset(primitive)?,
        quats: quats.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect(),
        log_scales: scales.into_iter().map(|s| s.map(log)).collect(),
        opacity_logits: opacities.into_iter().map(|[p]| logit(f64::from(p), OPACITY_LEAST)).collect(),
        degree,
        sh,
        antialiased: primitive.pointer("/extras/antialiased").and_then(Value::as_bool),
    };
    splats.check()?;
    Ok(splats)
}

/// The offset that we write where a scene is far from its world's origin.
fn offset(primitive: &Value) -> Result<[f64; 3], String> {
    let Some(value) = primitive.pointer("/extras/offset") else { return Ok([0.0; 3]) };
    let numbers: Option<Vec<f64>> = value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
    let offset = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()).filter(|offset| is_offset(*offset));
    offset.ok_or_else(|| "expected an offset of three numbers in the extras, found another value".to_owned())
}
