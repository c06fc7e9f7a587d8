//! The motion as an extension: time functions as JSON, vectors as accessors.

use serde_json::{Value, json};

use super::arrays::{Accessors, Arrays};
use super::json::{at, index, list, number};
use super::{MOTION, MOTION_VERSION};
use crate::splats::unit_xyzw;
use crate::{Beyond, Keys, Law, Motion, Series, SeriesLaw, Shape, TimeFunction};

/// Most time functions of a series: a polynomial of order 8, 40 kinks and a remainder are far below.
const FUNCTIONS_MAX: usize = 256;

pub(super) fn to_json(motion: &Motion, arrays: &mut Arrays) -> Value {
    let mut value = json!({
        "version": MOTION_VERSION,
        "span": motion.span,
        "middle": motion.middle,
        "rows": arrays.indices(&motion.rows),
    });
    let series = |series: &Series, arrays: &mut Arrays| -> Value {
        let functions: Vec<Value> = series.functions.iter().map(function).collect();
        json!({"functions": functions, "vectors": arrays.floats(series.vectors.iter().copied())})
    };
    match &motion.law {
        Law::Series(law) => {
            value["window"] = json!({"t0": law.t0, "half": law.half});
            // glTF knows no accessor without values.
            for (name, part) in [("position", &law.position), ("rotation", &law.rotation)] {
                if !part.vectors.is_empty() {
                    value[name] = series(part, arrays);
                }
            }
        }
        Law::Keys(keys) => {
            value["keys"] = json!({
                "times": keys.times,
                "positions": arrays.floats(keys.means.iter().copied()),
                "rotations": arrays.floats(keys.quats.iter().map(|q| unit_xyzw(*q))),
            });
            if !keys.log_scales.is_empty() {
                value["keys"]["scales"] = arrays.floats(keys.log_scales.iter().map(|s| s.map(f32::exp))).into();
            }
        }
    }
    value
}

fn function(function: &TimeFunction) -> Value {
    let mut value = match function.shape {
        Shape::Power(k) => json!({"power": k}),
        Shape::Ramp { near, far } => json!({"ramp": [near, far]}),
        Shape::Wave { power, n, sine } => {
            json!({"power": power, "wave": n, "of": if sine { "sine" } else { "cosine" }})
        }
    };
    if let Some(Beyond { line, edges, fade }) = function.beyond {
        value["beyond"] = json!({"line": line, "edges": edges, "fade": fade});
    }
    value
}

/// Reads what [`to_json`] wrote, or anybody else.
pub(super) fn of_json(value: &Value, accessors: &Accessors) -> Result<Motion, String> {
    let version = index(value, "/version")?;
    if version as u64 != MOTION_VERSION {
        return Err(format!("expected version {MOTION_VERSION} of {MOTION}, found {version}"));
    }
    let rows = accessors.indices(index(value, "/rows")?)?;
    let law = match value.get("keys") {
        Some(keys) => Law::Keys(self::keys(keys, accessors)?),
        None => Law::Series(SeriesLaw {
            t0: number(value, "/window/t0")?,
            half: number(value, "/window/half")?,
            position: series(value.get("position"), accessors)?,
            rotation: series(value.get("rotation"), accessors)?,
        }),
    };
    let span = [number(value, "/span/0")?, number(value, "/span/1")?];
    Ok(Motion { span, middle: number(value, "/middle")?, rows, law })
}

fn keys(value: &Value, accessors: &Accessors) -> Result<Keys, String> {
    let time = |t: &Value| t.as_f64().ok_or_else(|| "expected times of key frames that are numbers".to_owned());
    let quats = accessors.floats::<4>(index(value, "/rotations")?)?;
    let scales = match value.get("scales") {
        Some(_) => accessors.floats::<3>(index(value, "/scales")?)?,
        None => Vec::new(),
    };
    Ok(Keys {
        times: list(value, "/times")?.iter().map(time).collect::<Result<_, _>>()?,
        means: accessors.floats::<3>(index(value, "/positions")?)?,
        quats: quats.into_iter().map(|[x, y, z, w]| [w, x, y, z]).collect(),
        log_scales: scales.into_iter().map(|s| s.map(f32::ln)).collect(),
    })
}

fn series(value: Option<&Value>, accessors: &Accessors) -> Result<Series, String> {
    let Some(value) = value else { return Ok(Series::default()) };
    let functions = list(value, "/functions")?;
    if functions.len() > FUNCTIONS_MAX {
        return Err(format!("expected at most {FUNCTIONS_MAX} time functions, found {}", functions.len()));
    }
    let functions = functions.iter().map(time_function).collect::<Result<_, _>>()?;
    Ok(Series { functions, vectors: accessors.floats::<3>(index(value, "/vectors")?)? })
}

fn time_function(value: &Value) -> Result<TimeFunction, String> {
    let whole = |pointer: &str| {
        let number = u32::try_from(index(value, pointer)?).ok().filter(|number| *number <= 1000);
        number.ok_or_else(|| format!("expected a number up to 1000 at {pointer} of a time function"))
    };
    let shape = if value.get("ramp").is_some() {
        let (near, far) = (number(value, "/ramp/0")?, number(value, "/ramp/1")?);
        if near == far || near * far < 0.0 {
            return Err(format!("expected two ends of a ramp on one side of 0, found {near} and {far}"));
        }
        Shape::Ramp { near, far }
    } else if value.get("wave").is_some() {
        let sine = at(value, "/of")?.as_str() == Some("sine");
        Shape::Wave { power: whole("/power")?, n: whole("/wave")?, sine }
    } else {
        Shape::Power(whole("/power")?)
    };
    let pair = |p: &str| Ok::<_, String>([number(value, &format!("{p}/0"))?, number(value, &format!("{p}/1"))?]);
    let beyond = match value.get("beyond") {
        None => None,
        Some(_) => {
            let fade = number(value, "/beyond/fade")?;
            if fade.is_nan() || fade <= 0.0 {
                return Err(format!("expected a positive fade of a time function, found {fade}"));
            }
            let edges = [pair("/beyond/edges/0")?, pair("/beyond/edges/1")?];
            Some(Beyond { line: pair("/beyond/line")?, edges, fade })
        }
    };
    Ok(TimeFunction { shape, beyond })
}
