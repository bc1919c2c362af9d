//! Random lights that a path tracer finds in their scene.

use super::assets;
use super::builder::{Builder, Pose};
use super::draw::{Draw, colour, number, table};
use super::material::Lobes;
use glam::DVec3;
use toml::{Table, Value};

/// Far from the seeds of other scenes.
const STREAM: u64 = 0x736f_6674_6e65_7373;

/// Approximate distance of lamps from what they light.
const DISTANCE: f64 = 1.5;

impl Builder {
    /// A name for a light, and so for its layer.
    fn light_name(&self) -> Value {
        let emits = |shape: &&Table| shape.contains_key("emission");
        let count = self.lights.len() + self.shapes.iter().filter(emits).count();
        format!("light{count}").into()
    }

    fn tint(&mut self, strength: f64) -> Value {
        colour(self.draw.channels(0.2, 1.0).map(|c| c * strength))
    }
}

/// Adds a lamp: a shape that emits and stays within the ball.
pub fn lamp(b: &mut Builder, center: DVec3, radius: f64) {
    let kinds: &[&str] = match b.lobes {
        // A path tracer hardly finds one-sided lamps in glass.
        Lobes::Any => &["sphere", "sphere", "mesh"],
        Lobes::Wide => &["sphere", "sphere", "disc", "rectangle", "mesh"],
    };
    let kind = b.draw.pick(kinds);
    let turn = (b.draw.direction(), b.draw.between(0.0, 180.0));
    let pose = Pose {
        half: DVec3::splat(radius),
        turn,
        center,
    };
    hang(b, kind, pose);
}

/// Adds a lamp of this kind of shape.
pub fn hang(b: &mut Builder, kind: &str, mut pose: Pose) {
    let name = b.light_name();
    if kind == "sphere" {
        pose.turn.1 = 0.0;
    }
    let radius = pose.half.x;
    let strength = (DISTANCE / radius) * (DISTANCE / radius);
    let radiance = b.tint(strength.max(0.3));
    let mut shape = table([
        ("name", name),
        ("type", kind.into()),
        ("emission", table([("radiance", radiance)]).into()),
    ]);
    if kind == "mesh" {
        let bytes = assets::closed_mesh(&mut b.draw, false);
        shape.insert("file".into(), b.asset("ply", bytes).into());
    }
    shape.insert("transform".into(), b.steps(&pose));
    b.shapes.push(shape);
}

/// Where lamps may hang.
#[derive(Clone, Copy, Debug)]
pub struct Air {
    /// A corner of the box.
    pub low: DVec3,
    /// The opposite one.
    pub high: DVec3,
    /// Whether a scattering medium may be there.
    pub is_foggy: bool,
}

/// Adds a lamp or another light that has a position.
pub fn local(b: &mut Builder, air: &Air) {
    let is_wide = b.lobes == Lobes::Wide;
    let radius = match (is_wide, air.is_foggy) {
        (true, false) if b.draw.chance(0.5) => b.draw.log_between(0.003, 0.1),
        // A point light in fog has infinite variance.
        (true, _) => b.draw.log_between(0.08, 0.3),
        // Lamps seen only in mirrors and through glass are found by chance.
        (false, _) => b.draw.between(0.2, 0.4),
    };
    let Some(center) = b.place(air.low, air.high, radius.max(0.1)) else {
        return;
    };
    if is_wide && !air.is_foggy && b.draw.chance(0.4) {
        return point(b, center);
    }
    match b.draw.chance(0.6) {
        true => lamp(b, center, radius),
        false => {
            // It hangs there and shines downwards.
            let kind = b.draw.pick(&["rectangle", "disc"]);
            let pose = Pose {
                half: DVec3::splat(radius),
                turn: (DVec3::X, 90.0),
                center,
            };
            hang(b, kind, pose);
        }
    }
}

fn point(b: &mut Builder, center: DVec3) {
    let name = b.light_name();
    let strength = DISTANCE * DISTANCE * b.scale * b.scale;
    let position = b.position(center);
    let mut light = table([("name", name), ("position", position)]);
    if b.draw.chance(0.5) {
        light.insert("type".into(), "point".into());
        light.insert("intensity".into(), b.tint(strength));
    } else {
        let target = b.draw.point(DVec3::new(-0.5, 0.0, -0.5), DVec3::new(0.5, 0.3, 0.5));
        light.insert("type".into(), "spot".into());
        light.insert("target".into(), b.position(target));
        light.insert("cutoff_angle".into(), number(b.draw.between(15.0, 60.0)));
        light.insert("intensity".into(), b.tint(2.0 * strength));
    }
    b.lights.push(light);
}

/// Adds a light at infinity, or nearly so.
pub fn distant(b: &mut Builder) {
    let choices: &[&str] = match b.lobes {
        Lobes::Any => &["environment", "environment", "dome", "far"],
        Lobes::Wide => &["environment", "directional", "directional", "dome", "far"],
    };
    let has_sky = b
        .lights
        .iter()
        .any(|light| light["type"].as_str() == Some("environment"));
    match b.draw.pick(choices) {
        "environment" if !has_sky => environment(b),
        "directional" => {
            let mut towards = b.draw.direction();
            towards.y = -towards.y.abs() - 0.2;
            let light = table([
                ("name", b.light_name()),
                ("type", "directional".into()),
                ("direction", super::draw::vector(towards)),
                ("irradiance", b.tint(2.0)),
            ]);
            b.lights.push(light);
        }
        "dome" => {
            let radius = b.draw.log_between(20.0, 3000.0);
            let light = table([
                ("name", b.light_name()),
                ("type", "sphere".into()),
                ("flip_normals", true.into()),
                ("radius", b.length(radius)),
                ("emission", table([("radiance", b.tint(0.5))]).into()),
            ]);
            b.shapes.push(light);
        }
        _ => {
            // A huge ball far away, with about the angular size of a lamp here.
            let distance = b.draw.log_between(10.0, 300.0);
            let mut towards = b.draw.direction();
            towards.y = towards.y.abs() + 0.3;
            let radius = distance * b.draw.between(0.1, 0.3);
            let center = towards.normalize() * distance;
            let radiance = b.tint(30.0);
            let light = table([
                ("name", b.light_name()),
                ("type", "sphere".into()),
                ("center", b.position(center)),
                ("radius", b.length(radius)),
                ("emission", table([("radiance", radiance)]).into()),
            ]);
            b.shapes.push(light);
        }
    }
}

fn environment(b: &mut Builder) {
    let name = b.light_name();
    let mut light = table([("name", name), ("type", "environment".into())]);
    if b.draw.chance(0.5) {
        light.insert("radiance".into(), b.tint(0.7));
    } else {
        let sun = match b.lobes {
            Lobes::Any => 5.0,
            Lobes::Wide => b.draw.log_between(5.0, 300.0),
        };
        let sky = assets::sky(&mut b.draw, sun);
        light.insert("image".into(), b.asset("hdr", sky).into());
        light.insert("rotate_y".into(), number(b.draw.between(0.0, 360.0)));
    }
    b.lights.push(light);
}

/// In half of the scenes, gives half of the lamps that can have it soft falloff, using its own random numbers.
pub fn soften(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM);
    if draw.chance(0.5) {
        return;
    }
    for light in &mut b.lights {
        if light.contains_key("radius") && light["type"].as_str() == Some("spot") && draw.chance(0.5) {
            light.insert("soft_falloff".into(), true.into());
        }
    }
    for shape in &mut b.shapes {
        let is_plain = !shape.contains_key("flip_normals") && !shape.contains_key("interior");
        let passes = shape.get("material").and_then(Value::as_str) == Some("null");
        let is_ball = shape["type"].as_str() == Some("sphere") && is_plain && passes;
        let Some(Value::Table(emission)) = shape.get_mut("emission").filter(|_| is_ball) else {
            continue;
        };
        let is_even = !["two_sided", "spread", "scale"]
            .iter()
            .any(|key| emission.contains_key(*key));
        if is_even && draw.chance(0.5) {
            emission.insert("soft_falloff".into(), true.into());
        }
    }
}
