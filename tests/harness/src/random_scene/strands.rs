//! Curves and points in random scenes, from separate random numbers.

use super::builder::Builder;
use super::draw::{Draw, colour, number, table};
use super::material;
use glam::DVec3;
use toml::{Table, Value};

/// Far from the seeds of other scenes.
const STREAM: u64 = 0x6861_6972_7374_7261;

/// Adds strands or balls where some shape is, in that shape's surroundings. Most scenes are left as they are.
pub fn grow(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM);
    if !draw.chance(0.2) {
        return;
    }
    let places: Vec<Value> = (b.shapes.iter())
        .filter(|shape| !shape.contains_key("emission"))
        .filter_map(|shape| shape.get("transform").cloned())
        .collect();
    if places.is_empty() {
        return;
    }
    let place = places[(draw.unit() * places.len() as f64) as usize % places.len()].clone();
    let of_hair = draw.chance(0.6);
    let material = match of_hair {
        true => hair(&mut draw),
        false => material::opaque(&mut draw, b.lobes, 0.8),
    };
    let name = b.material(material);
    let is_points = draw.chance(0.25);
    let strands = if is_points { 1 } else { 6 };
    for _ in 0..strands {
        let mut shape = table([("material", name.clone().into()), ("transform", place.clone())]);
        if is_points {
            shape.insert("type".into(), "points".into());
        } else {
            shape.insert("type".into(), "curves".into());
            shape.insert("basis".into(), draw.pick(&["linear", "b_spline", "catmull_rom"]).into());
        }
        // The hair model lets light leave where it enters, which holds for hairs that are thin compared with their
        // surroundings.
        let widest = if of_hair { 0.012 } else { 0.12 };
        shape.insert("points".into(), points(&mut draw, widest).into());
        b.shapes.push(shape);
    }
}

fn hair(draw: &mut Draw) -> Table {
    let mut hair = table([("type", "hair".into())]);
    match draw.pick(&[0, 1, 2]) {
        0 => hair.insert("color".into(), colour(draw.channels(0.1, 0.9))),
        1 => hair.insert("absorption".into(), colour(draw.channels(0.0, 1.0))),
        _ => hair.insert("eumelanin".into(), number(draw.between(0.1, 2.0))),
    };
    hair.insert("beta_m".into(), number(draw.between(0.3, 1.0)));
    hair.insert("beta_n".into(), number(draw.between(0.3, 1.0)));
    hair
}

/// Rows of positions around the unit ball, and radii.
fn points(draw: &mut Draw, widest: f64) -> Vec<Value> {
    let mut at = draw.direction() * draw.between(0.3, 1.1);
    let mut points = Vec::new();
    for _ in 0..5 {
        let radius = draw.between(0.25, 1.0) * widest;
        points.push(Value::from([at.x, at.y, at.z, radius].map(number).to_vec()));
        at += draw.direction() * 0.4 + DVec3::Y * 0.1;
    }
    points
}
