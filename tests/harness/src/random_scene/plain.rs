//! Scenes of what kernels of devices have: the rest of a random scene becomes the plainest thing of its kind.

use super::RandomScene;
use toml::{Table, Value};

/// Fields of materials that no kernel knows.
const OF_MATERIALS: [&str; 10] = [
    "bump",
    "normal_map",
    "opacity",
    "alpha",
    "distribution",
    "roughness",
    "metallic",
    "specular",
    "nonlinear",
    "base_color",
];

/// The same scene without what devices have no kernels for. It may be one that they cannot render for other reasons.
pub fn plain(scene: &RandomScene) -> RandomScene {
    let mut scene = scene.clone();
    let blends = scene.table.get("materials").and_then(Value::as_table).cloned();
    each(&mut scene.table, "materials", |material| {
        *material = first_part(blends.as_ref(), material);
        let kind = kind(material);
        let smooth = match kind.as_str() {
            "null" | "mirror" | "conductor" | "dielectric" | "thin_dielectric" | "diffuse" => &kind,
            "rough_conductor" => "conductor",
            "rough_dielectric" => "dielectric",
            _ => "diffuse",
        };
        if smooth == "diffuse" {
            let colour = material.get("base_color").cloned();
            let reflectance = ["reflectance", "two_sided"].map(|key| (key, material.get(key).cloned()));
            material.clear();
            for (key, value) in reflectance.into_iter().chain([("reflectance", colour)]) {
                material.extend(value.map(|value| (key.to_owned(), value)));
            }
        }
        material.insert("type".into(), smooth.into());
        for key in OF_MATERIALS {
            material.remove(key);
        }
        if let Some(index) = material.get("ior").and_then(|ior| ior.get("nd")).cloned() {
            material.insert("ior".into(), index);
        }
    });
    each(&mut scene.table, "media", |medium| {
        for key in ["density", "transform", "transmittance"] {
            medium.remove(key);
        }
        medium.insert("type".into(), "homogeneous".into());
        let phases = medium.get("phase").and_then(|phase| phase.get("phases"));
        if let Some(phase) = phases.and_then(|phases| phases.get(0)).cloned() {
            medium.insert("phase".into(), phase);
        }
    });
    scene
}

fn kind(table: &Table) -> String {
    table.get("type").and_then(Value::as_str).unwrap_or_default().to_owned()
}

/// Of a blend, its first material, which may be one as well.
fn first_part(all: Option<&Table>, material: &Table) -> Table {
    let parts = material.get("materials").and_then(Value::as_array);
    let first = parts.and_then(|parts| parts.first()).and_then(Value::as_str);
    match first.and_then(|name| all?.get(name)?.as_table()) {
        Some(first) => first_part(all, first),
        None => material.clone(),
    }
}

/// All tables of a section, by name or in a list.
fn each(scene: &mut Table, section: &str, mut of: impl FnMut(&mut Table)) {
    match scene.get_mut(section) {
        Some(Value::Table(named)) => named.iter_mut().filter_map(|(_, v)| v.as_table_mut()).for_each(&mut of),
        Some(Value::Array(listed)) => listed.iter_mut().filter_map(Value::as_table_mut).for_each(&mut of),
        _ => {}
    }
}
