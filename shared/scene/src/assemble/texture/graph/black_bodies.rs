//! Black body colours.

use crate::cie;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::texture::graph::table::{Between, Entry, Table};

/// Black body colours of luminance 1, 800 to 12000 K, as in Blender.
pub(super) fn black_bodies() -> Option<Table> {
    let entries = black_body_list().map(|(kelvin, color)| Entry {
        at: kelvin as f32,
        color,
        alpha: 1.0,
    });
    Table::ramp(entries.collect(), Between::Linear)
}

/// The same colours, and their temperature range. Steps are even in one over the temperature.
pub fn black_body_colors() -> ([f32; 2], Vec<Rgb>) {
    let range = BLACK_BODIES.map(|kelvin| kelvin as f32);
    (range, black_body_list().map(|(_, color)| color).collect())
}

/// The range of temperatures, kelvin.
const BLACK_BODIES: [f64; 2] = [800.0, 12_000.0];

fn black_body_list() -> impl Iterator<Item = (f64, Rgb)> {
    const STEPS: u32 = 512;
    (0..=STEPS).map(|i| {
        // Even in 1/T, on which the spectrum depends.
        let part = f64::from(i) / f64::from(STEPS);
        let [low, high] = BLACK_BODIES;
        let kelvin = 1.0 / (1.0 / low + (1.0 / high - 1.0 / low) * part);
        (kelvin, cie::black_body(kelvin).as_vec3())
    })
}
