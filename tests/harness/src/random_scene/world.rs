//! Random places: rooms, planes, and open space, with a camera that looks at the objects.

use super::body::{Spot, body};
use super::builder::{Builder, Pose};
use super::draw::{number, table};
use super::light::{self, Air};
use super::material::Lobes;
use glam::DVec3;
use toml::{Table, Value};

/// Width and height of the picture.
pub const SIDE: i64 = 32;

/// Fills a scene; returns its camera.
pub fn fill(b: &mut Builder) -> Table {
    let mut camera = match b.draw.pick(&[0, 0, 1, 2, 2, 2, 3]) {
        0 => closed_room(b),
        1 => open_room(b),
        2 => plane(b),
        _ => space(b),
    };
    if b.draw.chance(0.2) {
        let aperture = b.draw.between(0.01, 0.1);
        camera.insert("aperture".into(), b.length(aperture));
    }
    if b.draw.chance(0.15) {
        rules(b);
    }
    camera
}

fn camera(b: &mut Builder, origin: DVec3, target: DVec3, fov: f64) -> Table {
    table([
        ("origin", b.position(origin)),
        ("target", b.position(target)),
        ("fov", number(fov)),
    ])
}

/// Fog everywhere, now and then. `max_depth`: over two units.
fn fog(b: &mut Builder, max_depth: f64) {
    if b.draw.chance(0.25) {
        b.world = Some(b.medium(2.0, max_depth, None));
    }
}

fn bodies(b: &mut Builder, low: DVec3, high: DVec3, stands: bool) {
    for _ in 0..b.draw.pick(&[1, 1, 2, 3, 4]) {
        let radius = b.draw.log_between(0.08, 0.6);
        let fits = |low: f64, high: f64| low + radius < high - radius;
        if !(fits(low.x, high.x) && fits(low.y, high.y) && fits(low.z, high.z)) {
            continue;
        }
        let (mut low, mut high) = (low + radius, high - radius);
        if stands {
            // Its height follows from its shape.
            (low.y, high.y) = (radius, radius + 1e-3);
        }
        if let Some(center) = b.place(low, high, 1.1 * radius) {
            let spot = Spot {
                center,
                radius,
                stands,
                medium: None,
                depth: 0,
            };
            body(b, &spot);
        }
    }
}

/// Walls of a room with these half sides; `open`: without the wall at +z.
fn walls(b: &mut Builder, half: DVec3, open: bool) {
    let bright = 0.8;
    if !open && b.draw.chance(0.5) {
        let material = b.opaque(bright);
        let pose = Pose {
            half,
            turn: (DVec3::Y, 0.0),
            center: DVec3::ZERO,
        };
        b.shapes.push(table([
            ("name", "room".into()),
            ("type", "cube".into()),
            ("flip_normals", true.into()),
            ("material", material.into()),
            ("transform", b.steps(&pose)),
        ]));
        return;
    }
    let alike = b.draw.chance(0.5).then(|| b.opaque(bright));
    // Walls extend beyond each other, so that no ray finds a gap.
    let (x, y, z) = (1.02 * half.x, 1.02 * half.y, 1.02 * half.z);
    let walls = [
        ("floor", [x, z], (DVec3::X, -90.0), DVec3::NEG_Y * half.y),
        ("ceiling", [x, z], (DVec3::X, 90.0), DVec3::Y * half.y),
        ("left", [z, y], (DVec3::Y, 90.0), DVec3::NEG_X * half.x),
        ("right", [z, y], (DVec3::Y, -90.0), DVec3::X * half.x),
        ("back", [x, y], (DVec3::Y, 0.0), DVec3::NEG_Z * half.z),
        ("front", [x, y], (DVec3::Y, 180.0), DVec3::Z * half.z),
    ];
    for (name, [width, height], turn, center) in walls {
        if open && name == "front" {
            continue;
        }
        let material = match &alike {
            Some(material) => material.clone(),
            None => b.opaque(bright),
        };
        let pose = Pose {
            half: DVec3::new(width, height, 1.0),
            turn,
            center,
        };
        b.shapes.push(table([
            ("name", name.into()),
            ("type", "rectangle".into()),
            ("material", material.into()),
            ("transform", b.steps(&pose)),
        ]));
    }
}

/// A medium that fills a room up to its walls, or nearly so.
fn fill_with_fog(b: &mut Builder, half: DVec3) -> String {
    let half = half * b.draw.pick(&[1.0, 0.999, 0.8]);
    let pose = Pose {
        half,
        turn: (DVec3::Y, 0.0),
        center: DVec3::ZERO,
    };
    let steps = b.steps(&pose);
    let medium = b.medium(2.0, 3.0, Some(steps.clone()));
    let null = b.null();
    b.shapes.push(table([
        ("name", "fog".into()),
        ("type", "cube".into()),
        ("material", null.into()),
        ("interior", medium.clone().into()),
        ("transform", steps),
    ]));
    medium
}

fn room_size(b: &mut Builder) -> DVec3 {
    b.draw.point(DVec3::new(1.2, 1.0, 1.2), DVec3::new(2.0, 1.5, 2.0))
}

fn closed_room(b: &mut Builder) -> Table {
    let half = room_size(b);
    walls(b, half, false);
    fog(b, 3.0);
    let eye = DVec3::new(0.3 * half.x, b.draw.between(-0.3, 0.5), 0.85 * half.z);
    b.taken.push((eye, 0.15));
    let inner = half - 0.05;
    if b.draw.chance(0.7) {
        // Under the ceiling.
        let radius = b.draw.between(0.2, 0.5);
        let center = DVec3::new(0.0, half.y - 0.05, 0.0);
        b.taken.push((center, radius));
        let pose = Pose {
            half: DVec3::splat(radius),
            turn: (DVec3::X, 90.0),
            center,
        };
        let lamp = b.draw.pick(&["rectangle", "disc"]);
        light::hang(b, lamp, pose);
    } else {
        let air = Air {
            low: -0.7 * inner,
            high: 0.7 * inner,
            is_foggy: b.world.is_some(),
        };
        light::local(b, &air);
    }
    if b.draw.chance(0.3) {
        let air = Air {
            low: -0.7 * inner,
            high: 0.7 * inner,
            is_foggy: b.world.is_some(),
        };
        light::local(b, &air);
    }
    bodies(b, -inner, inner, false);
    let fov = b.draw.between(50.0, 90.0);
    camera(b, eye, DVec3::ZERO, fov)
}

fn open_room(b: &mut Builder) -> Table {
    let half = room_size(b);
    walls(b, half, true);
    let foggy = b.draw.chance(0.5);
    let fog = foggy.then(|| fill_with_fog(b, half));
    let eye = DVec3::new(0.2, b.draw.between(-0.2, 0.3), half.z + b.draw.between(1.0, 3.0));
    b.taken.push((eye, 0.2));
    if b.draw.chance(0.5) {
        light::distant(b);
    }
    if b.shapes.iter().all(|shape| !shape.contains_key("emission")) && b.lights.is_empty() || b.draw.chance(0.5) {
        let inner = 0.6 * half;
        light::local(
            b,
            &Air {
                low: -inner,
                high: inner,
                is_foggy: foggy,
            },
        );
    }
    let count = b.shapes.len();
    let inner = 0.75 * half;
    bodies(b, -inner, inner, false);
    if let Some(fog) = fog {
        around(&mut b.shapes[count..], &fog);
    }
    let fov = b.draw.between(40.0, 60.0);
    camera(b, eye, DVec3::ZERO, fov)
}

/// Names the surroundings of shapes that bound media or glass.
fn around(shapes: &mut [Table], medium: &str) {
    for shape in shapes {
        let bounds =
            shape.contains_key("interior") || shape.get("material").and_then(Value::as_str).is_some_and(is_glass);
        if bounds && !shape.contains_key("exterior") {
            shape.insert("exterior".into(), medium.into());
            if !shape.contains_key("interior") {
                shape.insert("interior".into(), "none".into());
            }
        }
        if let Some(Value::Table(copied)) = shape.get_mut("shape") {
            around(std::slice::from_mut(copied), medium);
        }
    }
}

fn is_glass(material: &str) -> bool {
    material.starts_with("dielectric") || material.starts_with("rough_dielectric")
}

fn plane(b: &mut Builder) -> Table {
    let half = match b.draw.chance(0.4) {
        true => b.draw.between(2.0, 4.0),
        false => b.draw.log_between(4.0, 1000.0),
    };
    let ground = b.opaque(0.8);
    let pose = Pose {
        half: DVec3::new(half, half, 1.0),
        turn: (DVec3::X, -90.0),
        center: DVec3::ZERO,
    };
    b.shapes.push(table([
        ("name", "ground".into()),
        ("type", "rectangle".into()),
        ("material", ground.into()),
        ("transform", b.steps(&pose)),
    ]));
    fog(b, 1.0);
    let angle = b.draw.between(0.0, 360.0).to_radians();
    let (sin, cos) = libm::sincos(angle);
    let distance = b.draw.between(2.0, 4.0);
    let eye = DVec3::new(distance * cos, b.draw.between(0.3, 2.5), distance * sin);
    b.taken.push((eye, 0.2));
    let air = Air {
        low: DVec3::new(-1.0, 1.3, -1.0),
        high: DVec3::new(1.0, 2.5, 1.0),
        is_foggy: b.world.is_some(),
    };
    lights(b, &air);
    let (low, high) = (DVec3::new(-1.2, 0.0, -1.2), DVec3::new(1.2, 1.3, 1.2));
    bodies(b, low, high, true);
    let fov = b.draw.between(25.0, 60.0);
    camera(b, eye, DVec3::new(0.0, 0.25, 0.0), fov)
}

fn space(b: &mut Builder) -> Table {
    fog(b, 1.0);
    let eye = b.draw.direction() * b.draw.between(2.5, 4.0);
    b.taken.push((eye, 0.2));
    let air = Air {
        low: DVec3::splat(-1.5),
        high: DVec3::splat(1.5),
        is_foggy: b.world.is_some(),
    };
    // A medium around the camera as well, now and then.
    let cloud = (b.world.is_none() && b.draw.chance(0.2)).then(|| {
        let medium = b.medium(6.0, 5.0, None);
        let null = b.null();
        let radius = b.draw.between(4.5, 8.0);
        b.shapes.push(table([
            ("name", "cloud".into()),
            ("type", "sphere".into()),
            ("radius", b.length(radius)),
            ("material", null.into()),
            ("interior", medium.clone().into()),
        ]));
        medium
    });
    lights(
        b,
        &Air {
            is_foggy: air.is_foggy || cloud.is_some(),
            ..air
        },
    );
    let count = b.shapes.len();
    bodies(b, DVec3::splat(-1.0), DVec3::splat(1.0), false);
    if let Some(cloud) = cloud {
        around(&mut b.shapes[count..], &cloud);
    }
    let fov = b.draw.between(25.0, 60.0);
    camera(b, eye, DVec3::ZERO, fov)
}

/// Lights under the open sky; with endless fog, none from beyond it.
fn lights(b: &mut Builder, air: &Air) {
    let is_far = b.world.is_none() && b.draw.chance(0.7);
    if is_far {
        light::distant(b);
        if b.draw.chance(0.3) {
            light::distant(b);
        }
    }
    if !is_far || b.draw.chance(0.4) {
        light::local(b, air);
    }
}

/// Some visibility rules, but none for photons.
fn rules(b: &mut Builder) {
    let mut rays = vec!["camera", "reflected", "refracted"];
    if b.lobes == Lobes::Wide {
        // Light that obeys rules is found by light sampling alone, which narrow lobes make noisy.
        rays.push("shadow");
    }
    let dropped = b.draw.pick(&rays);
    let all = ["camera", "reflected", "refracted", "shadow", "photon"];
    let visible: Vec<Value> = all.into_iter().filter(|r| *r != dropped).map(Value::from).collect();
    let index = b.draw.pick(&(0..b.shapes.len()).collect::<Vec<_>>());
    if b.draw.chance(0.6) {
        b.shapes[index].insert("visible".into(), visible.into());
        return;
    }
    let name = b.shapes[index].entry("name").or_insert("named".into()).clone();
    b.rules.push(table([
        ("on", vec![Value::from("all")].into()),
        ("rays", vec![Value::from(dropped)].into()),
        ("exclude", vec![name].into()),
    ]));
}
