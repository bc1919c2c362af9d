//! What no pixel depends on: how the picture is displayed, and how many passes it gets. A change of them makes no new
//! revision.

use beamfarm_image::view::{View, ViewTransform};
use beamfarm_render::world::RenderDefaults;
use beamfarm_scene::Files;

/// Settings that no pixel depends on and that are not part of the scene's meaning.
#[derive(Clone, Copy)]
pub(super) struct Looks {
    pub view: View,
    pub passes: u64,
}

impl Looks {
    pub fn of(files: &Files) -> Self {
        let table = files.files.get(&files.scene).and_then(|file| {
            let text = std::str::from_utf8(file.bytes()).ok()?;
            toml::from_str::<toml::Table>(text).ok()
        });
        let render = table.as_ref().and_then(|table| table.get("render"));
        let field = |name: &str| render.and_then(|render| render.get(name));
        let number = |name: &str| match field(name) {
            Some(toml::Value::Float(number)) => Some(*number as f32),
            Some(toml::Value::Integer(number)) => Some(*number as f32),
            _ => None,
        };
        let transform = field("view").and_then(|name| ViewTransform::named(name.as_str()?));
        let passes = field("passes").and_then(toml::Value::as_integer);
        let defaults = RenderDefaults::default();
        Self {
            view: View {
                transform: transform.unwrap_or(defaults.view.transform),
                exposure: number("exposure").unwrap_or(defaults.view.exposure),
                white_balance: number("white_balance").unwrap_or(defaults.view.white_balance),
            },
            passes: passes
                .and_then(|passes| u64::try_from(passes).ok())
                .unwrap_or(defaults.passes),
        }
    }
}
