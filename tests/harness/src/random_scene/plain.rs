//! Scenes of what kernels of devices have: the rest of a random scene becomes the plainest thing of its kind.

use super::RandomScene;
use super::draw::number;
use toml::{Table, Value};

/// The same scene without what devices have no kernels for. It may be one that they cannot render for other reasons.
pub fn plain(scene: &RandomScene) -> RandomScene {
    let mut scene = scene.clone();
    scene.table.remove("rules");
    each(&mut scene.table, "materials", |material| {
        if let Some(index) = material.get("ior").and_then(|ior| ior.get("nd")).cloned() {
            material.insert("ior".into(), index);
        }
    });
    each(&mut scene.table, "media", |medium| {
        let phases = medium.get("phase").and_then(|phase| phase.get("phases"));
        if let Some(phase) = phases.and_then(|phases| phases.get(0)).cloned() {
            medium.insert("phase".into(), phase);
        }
    });
    each(&mut scene.table, "shapes", |shape| {
        if let Some(Value::Table(emission)) = shape.get_mut("emission")
            && emission.get("radiance").is_some_and(Value::is_table)
        {
            let scale = emission.remove("scale").unwrap_or_else(|| number(1.0));
            emission.insert("radiance".into(), scale);
        }
        shape.remove("visible");
    });
    each(&mut scene.table, "lights", |light| {
        for key in ["radius", "angle", "falloff", "rotate_y"] {
            light.remove(key);
        }
        if light.remove("image").is_some() {
            light.insert("radiance".into(), number(0.5));
        }
    });
    if let Some(Value::Table(camera)) = scene.table.get_mut("camera")
        && camera.remove("projection").is_some()
    {
        camera.remove("view_width");
        camera.insert("fov".into(), number(40.0));
    }
    scene
}

/// All tables of a section, by name or in a list.
fn each(scene: &mut Table, section: &str, mut of: impl FnMut(&mut Table)) {
    match scene.get_mut(section) {
        Some(Value::Table(named)) => named.iter_mut().filter_map(|(_, v)| v.as_table_mut()).for_each(&mut of),
        Some(Value::Array(listed)) => listed.iter_mut().filter_map(Value::as_table_mut).for_each(&mut of),
        _ => {}
    }
}
