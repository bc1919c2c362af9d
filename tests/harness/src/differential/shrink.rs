//! Reduces a scene with a fault: removes and simplifies things as long as the fault stays.

use super::many::examine_alone;
use super::{Effort, Verdict};
use crate::random_scene::RandomScene;
use crate::random_scene::draw::{number, table};
use toml::{Table, Value};

/// The kind of a fault; `None` if there is none.
fn fault(verdict: &Result<Verdict, String>) -> Option<&str> {
    match verdict {
        Ok(verdict) => verdict.is_fault().then(|| verdict.word()),
        Err(_) => Some("panic"),
    }
}

/// Removes from the scene what its fault does not need, as long as it stays a fault of its kind. `step` is called with
/// every scene that still has it.
pub fn shrink(
    scene: &RandomScene,
    effort: &Effort,
    mut step: impl FnMut(&RandomScene, &Result<Verdict, String>),
) -> RandomScene {
    let mut best = scene.clone();
    let verdict = examine_alone(scene, effort);
    let kind = fault(&verdict);
    if kind.is_none() {
        return best;
    }
    loop {
        let smaller = candidates(&best.table).into_iter().find_map(|table| {
            let candidate = RandomScene {
                table: without_unused(table),
                ..best.clone()
            };
            if candidate == best || candidate.description().is_err() {
                return None;
            }
            let verdict = examine_alone(&candidate, effort);
            (fault(&verdict) == kind).then(|| {
                step(&candidate, &verdict);
                candidate
            })
        });
        match smaller {
            Some(smaller) => best = smaller,
            None => return best,
        }
    }
}

/// Scenes with one thing removed, the largest savings first.
fn candidates(scene: &Table) -> Vec<Table> {
    let mut all = Vec::new();
    for key in ["rules", "lights", "shapes"] {
        let count = scene.get(key).and_then(Value::as_array).map_or(0, Vec::len);
        for index in (0..count).rev() {
            let mut less = scene.clone();
            if let Some(Value::Array(list)) = less.get_mut(key) {
                list.remove(index);
                if list.is_empty() {
                    less.remove(key);
                }
                all.push(less);
            }
        }
    }
    if scene.contains_key("world") {
        all.push(without(scene, &["world".into()]));
    }
    if let Some(Value::Table(materials)) = scene.get("materials") {
        for (name, material) in materials {
            let diffuse = table([("type", "diffuse".into()), ("two_sided", true.into())]);
            if !matches!(material, Value::Table(own) if *own == diffuse) {
                all.push(with(scene, &["materials".into(), name.clone()], diffuse.into()));
            }
        }
    }
    let mut paths = Vec::new();
    visit(scene, &mut Vec::new(), &mut paths);
    for (path, value) in paths {
        let Some(key) = path.last() else { continue };
        match key.as_str() {
            "bump" | "opacity" | "visible" | "aperture" | "phase" | "interior" | "exterior" | "flip_normals"
            | "distribution" | "nonlinear" | "specular" | "metallic" | "transmittance" | "noise" | "blobs"
            | "height" | "face_normals" | "rotate_y" => all.push(without(scene, &path)),
            "type" if value.as_str() == Some("heterogeneous") => {
                let mut less = with(scene, &path, "homogeneous".into());
                for key in ["density", "transform", "transmittance"] {
                    let mut other = path.clone();
                    other.pop();
                    other.push(key.into());
                    less = without(&less, &other);
                }
                all.push(less);
            }
            "sigma_t" | "sigma_s" | "sigma_a" | "albedo" | "reflectance" | "base_color" | "radiance" | "intensity"
            | "irradiance" => {
                if let Value::Array(channels) = value {
                    let sum: f64 = channels.iter().filter_map(Value::as_float).sum();
                    all.push(with(scene, &path, number(sum / 3.0)));
                }
            }
            "transform" => {
                let steps = value.as_array().cloned().unwrap_or_default();
                let is_turn = |step: &Value| step.get("rotate").is_some();
                if let Some(turn) = steps.iter().position(is_turn) {
                    let mut less = steps;
                    less.remove(turn);
                    all.push(with(scene, &path, less.into()));
                }
            }
            _ => {}
        }
    }
    all
}

/// All entries of tables, with their paths; numbers are positions in lists.
fn visit(table: &Table, way: &mut Vec<String>, out: &mut Vec<(Vec<String>, Value)>) {
    for (key, value) in table {
        way.push(key.clone());
        out.push((way.clone(), value.clone()));
        visit_value(value, way, out);
        way.pop();
    }
}

fn visit_value(value: &Value, way: &mut Vec<String>, out: &mut Vec<(Vec<String>, Value)>) {
    match value {
        Value::Table(table) => visit(table, way, out),
        Value::Array(list) => {
            for (i, value) in list.iter().enumerate() {
                way.push(i.to_string());
                visit_value(value, way, out);
                way.pop();
            }
        }
        _ => {}
    }
}

fn parent<'a>(scene: &'a mut Table, path: &[String]) -> Option<&'a mut Table> {
    let (first, rest) = path.split_first()?;
    if rest.is_empty() {
        return Some(scene);
    }
    let mut value = scene.get_mut(first)?;
    for key in &rest[..rest.len() - 1] {
        value = match value {
            Value::Table(table) => table.get_mut(key)?,
            Value::Array(list) => list.get_mut(key.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    value.as_table_mut()
}

fn with(scene: &Table, path: &[String], value: Value) -> Table {
    let mut scene = scene.clone();
    if let (Some(table), Some(key)) = (parent(&mut scene, path), path.last()) {
        table.insert(key.clone(), value);
    }
    scene
}

fn without(scene: &Table, path: &[String]) -> Table {
    let mut scene = scene.clone();
    if let (Some(table), Some(key)) = (parent(&mut scene, path), path.last()) {
        table.remove(key);
    }
    scene
}

/// Without materials and media that nothing refers to.
fn without_unused(mut scene: Table) -> Table {
    let mut names = Vec::new();
    let mut entries = Vec::new();
    visit(&scene, &mut Vec::new(), &mut entries);
    for (path, value) in entries {
        let key = path.last().map(String::as_str);
        if let (Some("material" | "interior" | "exterior" | "medium"), Value::String(name)) = (key, value) {
            names.push(name);
        }
    }
    for key in ["materials", "media"] {
        if let Some(Value::Table(table)) = scene.get_mut(key) {
            table.retain(|name, _| names.iter().any(|used| used == name));
            if table.is_empty() {
                scene.remove(key);
            }
        }
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidates_differ_and_most_are_valid() {
        let (mut valid, mut all) = (0, 0);
        for seed in 0..8 {
            let scene = RandomScene::new(seed);
            for table in candidates(&scene.table) {
                let candidate = RandomScene {
                    table: without_unused(table),
                    ..scene.clone()
                };
                assert_ne!(candidate.toml(), scene.toml());
                all += 1;
                valid += u32::from(candidate.description().is_ok());
            }
        }
        assert!(2 * valid > all, "{valid} of {all}");
    }
}
