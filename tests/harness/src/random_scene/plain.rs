//! Scenes of what kernels of devices have: the rest of a random scene becomes the plainest thing of its kind.

use super::RandomScene;
use toml::{Table, Value};

/// The same scene without what devices have no kernels for. It may be one that they cannot render for other reasons.
pub fn plain(scene: &RandomScene) -> RandomScene {
    let mut scene = scene.clone();
    each(&mut scene.table, "media", |medium| {
        let phases = medium.get("phase").and_then(|phase| phase.get("phases"));
        if let Some(phase) = phases.and_then(|phases| phases.get(0)).cloned() {
            medium.insert("phase".into(), phase);
        }
    });
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
