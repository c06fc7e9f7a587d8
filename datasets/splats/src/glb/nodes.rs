//! The nodes of a document: which meshes are shown, and where.

use glam::{DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;

use crate::json::{index, list};

/// A mesh, and its place in the world.
pub(super) struct Shown {
    pub mesh: usize,
    pub to_world: DMat4,
}

/// The meshes of the document's scene. Of a document without scenes all nodes are shown, of one without nodes all
/// meshes.
pub(super) fn shown(document: &Value) -> Result<Vec<Shown>, String> {
    let Some(nodes) = document.get("nodes").and_then(Value::as_array).filter(|nodes| !nodes.is_empty()) else {
        let meshes = list(document, "/meshes")?.len();
        return Ok((0..meshes).map(|mesh| Shown { mesh, to_world: DMat4::IDENTITY }).collect());
    };
    let mut found = Vec::new();
    // Nodes are trees: none is met twice, so circles end and no node is multiplied.
    let mut met = vec![false; nodes.len()];
    let mut open: Vec<(usize, DMat4)> =
        roots(document, nodes)?.into_iter().map(|root| (root, DMat4::IDENTITY)).collect();
    open.reverse();
    while let Some((number, parent)) = open.pop() {
        let node = nodes.get(number).ok_or_else(|| format!("expected a node below {}, found {number}", nodes.len()))?;
        if std::mem::replace(&mut met[number], true) {
            return Err(format!("node {number}: expected one parent, found it again below another or itself"));
        }
        let to_world = parent * own_transform(node).map_err(|message| format!("node {number}: {message}"))?;
        if !to_world.is_finite() {
            return Err(format!("node {number}: expected a transform of finite numbers, found another"));
        }
        if node.get("mesh").is_some() {
            found.push(Shown { mesh: index(node, "/mesh")?, to_world });
        }
        open.extend(numbers(node, "children")?.into_iter().rev().map(|child| (child, to_world)));
    }
    Ok(found)
}

fn roots(document: &Value, nodes: &[Value]) -> Result<Vec<usize>, String> {
    if document.get("scenes").is_some() {
        let scene = if document.get("scene").is_some() { index(document, "/scene")? } else { 0 };
        let scenes = list(document, "/scenes")?;
        let scene =
            scenes.get(scene).ok_or_else(|| format!("expected a scene below {}, found {scene}", scenes.len()))?;
        return numbers(scene, "nodes");
    }
    let mut is_child = vec![false; nodes.len()];
    for node in nodes {
        for child in numbers(node, "children")? {
            is_child.get_mut(child).into_iter().for_each(|is_child| *is_child = true);
        }
    }
    Ok((0..nodes.len()).filter(|number| !is_child[*number]).collect())
}

fn numbers(value: &Value, key: &str) -> Result<Vec<usize>, String> {
    let Some(list) = value.get(key) else { return Ok(Vec::new()) };
    let number = |value: &Value| value.as_u64().and_then(|number| usize::try_from(number).ok());
    let numbers = list.as_array().and_then(|list| list.iter().map(number).collect());
    numbers.ok_or_else(|| format!("expected whole numbers in `{key}`, found another value"))
}

/// A matrix in the order of columns, or a translation, a rotation and a scale.
fn own_transform(node: &Value) -> Result<DMat4, String> {
    if let Some(matrix) = floats::<16>(node, "matrix")? {
        let matrix = DMat4::from_cols_array(&matrix);
        let last = matrix.row(3);
        return if last == DVec4::W {
            Ok(matrix)
        } else {
            Err(format!("expected a last row of 0 0 0 1, found {last}"))
        };
    }
    let translation = floats::<3>(node, "translation")?.map_or(DVec3::ZERO, DVec3::from_array);
    let scale = floats::<3>(node, "scale")?.map_or(DVec3::ONE, DVec3::from_array);
    let rotation = floats::<4>(node, "rotation")?.map_or(DQuat::IDENTITY, DQuat::from_array);
    if !(rotation.length() > 0.0 && rotation.length().is_finite()) {
        return Err("expected a rotation of norm 1, found zeros".into());
    }
    Ok(DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation))
}

fn floats<const N: usize>(node: &Value, key: &str) -> Result<Option<[f64; N]>, String> {
    let Some(value) = node.get(key) else { return Ok(None) };
    let values: Option<Vec<f64>> = value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
    let values = values.and_then(|values| <[f64; N]>::try_from(values).ok());
    values.map(Some).ok_or_else(|| format!("expected {N} numbers in `{key}`, found another value"))
}
