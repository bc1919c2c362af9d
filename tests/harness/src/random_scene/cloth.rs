//! Rough diffuse surfaces and sheen of fibres.

use super::builder::Builder;
use super::draw::{Draw, colour, number};
use toml::{Table, Value};

/// Far from the seeds of other scenes.
const STREAM: u64 = 0x636c_6f74_685f_7379;

/// In one of six scenes: turns diffuse materials into rough ones or layers of fibres, and gives principled ones a rough
/// base with fibres over it.
pub fn weave(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM);
    if !draw.chance(1.0 / 6.0) {
        return;
    }
    for (_, material) in b.materials.iter_mut() {
        let Value::Table(material) = material else { continue };
        match material.get("type").and_then(Value::as_str) {
            Some("diffuse") if draw.chance(0.3) => {
                material.insert("type".into(), "sheen".into());
                material.insert("roughness".into(), number(draw.between(0.2, 1.0)));
            }
            Some("diffuse") => {
                material.insert("roughness".into(), number(draw.unit()));
            }
            Some("principled") => cover(&mut draw, material),
            _ => {}
        }
    }
}

fn cover(draw: &mut Draw, material: &mut Table) {
    if draw.chance(0.7) {
        for burley in ["sheen", "sheen_tint"] {
            material.remove(burley);
        }
        material.insert("sheen_weight".into(), number(draw.unit()));
        material.insert("sheen_roughness".into(), number(draw.between(0.2, 1.0)));
        material.insert("sheen_color".into(), colour(draw.channels(0.2, 1.0)));
    }
    if draw.chance(0.7) {
        material.remove("flatness");
        material.insert("diffuse_roughness".into(), number(draw.unit()));
    }
}
