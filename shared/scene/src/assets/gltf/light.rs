//! Lights of KHR_lights_punctual.

use super::node::Placed;
use super::write::{number, quoted, vector};
use glam::DVec3;
use gltf::khr_lights_punctual::{Kind, Light};
use std::fmt::Write;

/// The unit of a light's intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LightUnit {
    /// W/sr and W/m^2.
    Watt,
    /// Candela and lux, 683 lm to the watt.
    Lumen,
}

/// Lumens per watt of green light, which exporters use for all light.
const LUMENS_PER_WATT: f64 = 683.0;

impl LightUnit {
    /// The unit a program writes: candela and lux for Blender's exporter at its defaults. Most others write watts.
    pub fn of_generator(generator: &str) -> Self {
        match generator.starts_with("Khronos glTF Blender I/O") {
            true => Self::Lumen,
            false => Self::Watt,
        }
    }

    fn watts(self) -> f64 {
        match self {
            Self::Watt => 1.0,
            Self::Lumen => 1.0 / LUMENS_PER_WATT,
        }
    }
}

/// Append a light at its node's place, as TOML.
pub fn add_light(light: &Light<'_>, node: &Placed<'_>, unit: LightUnit, text: &mut String) {
    let place = &node.world_from_node;
    let towards = place.transform_vector3(DVec3::NEG_Z).normalize_or_zero();
    let [r, g, b] = light
        .color()
        .map(|c| number(f64::from(c) * f64::from(light.intensity()) * unit.watts()));
    let strength = format!("[{r}, {g}, {b}]");
    let _ = writeln!(text, "[[lights]]\nname = {}", quoted(&node.name));
    let position = vector(place.translation);
    let _ = match light.kind() {
        Kind::Point => writeln!(text, "type = \"point\"\nposition = {position}\nintensity = {strength}"),
        Kind::Directional => writeln!(
            text,
            "type = \"directional\"\ndirection = {}\nirradiance = {strength}",
            vector(towards)
        ),
        Kind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } => {
            let [inner, outer] = [inner_cone_angle, outer_cone_angle].map(|a| f64::from(a).to_degrees());
            // A spot's edge must have some width.
            let inner = inner.min(0.999 * outer);
            writeln!(
                text,
                "type = \"spot\"\nposition = {position}\ntarget = {}\nintensity = {strength}\ncutoff_angle = {}\n\
                 beam_width = {}",
                vector(place.translation + towards),
                number(outer),
                number(inner)
            )
        }
    };
}
