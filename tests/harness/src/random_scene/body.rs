//! Random objects: their materials and their interiors.

use super::assets;
use super::builder::{Builder, Pose};
use super::draw::{number, table};
use super::light;
use super::material;
use glam::DVec3;
use toml::{Table, Value};

/// Where an object goes, and what is around it.
#[derive(Clone, Debug)]
pub struct Spot {
    /// Its centre.
    pub center: DVec3,
    /// It stays within a ball of this radius.
    pub radius: f64,
    /// It stands on the plane y = 0, whatever the height of its centre.
    pub stands: bool,
    /// Name of the medium around it, if it is not the world's.
    pub medium: Option<String>,
    /// How many objects it is inside.
    pub depth: u32,
}

/// Adds an object.
pub fn body(b: &mut Builder, spot: &Spot) {
    match b.draw.unit() {
        x if x < 0.38 => opaque(b, spot),
        x if x < 0.45 => sheet(b, spot),
        x if x < 0.68 => glass(b, spot),
        x if x < 0.95 => cloud(b, spot),
        _ if spot.stands && spot.depth == 0 => pair(b, spot),
        _ => instances(b, spot),
    }
}

/// A closed ball, cube or mesh in its own space, without material.
fn closed(b: &mut Builder, spot: &Spot) -> (Table, Pose) {
    let kind = b.draw.pick(&["sphere", "sphere", "cube", "cube", "cube", "mesh"]);
    let turn = match spot.stands {
        true => (DVec3::Y, b.draw.between(0.0, 90.0)),
        false => (b.draw.direction(), b.draw.between(0.0, 90.0)),
    };
    let mut pose = Pose {
        half: DVec3::splat(spot.radius),
        turn,
        center: spot.center,
    };
    let mut shape = table([("type", kind.into())]);
    match kind {
        "sphere" => pose.turn.1 = 0.0,
        "cube" => {
            // Now and then a sheet, down to a hundredth of its sides.
            let thin = if b.draw.chance(0.3) {
                b.draw.log_between(0.01, 0.2)
            } else {
                1.0
            };
            let mut half = DVec3::new(1.0, b.draw.between(0.4, 1.0), b.draw.between(0.4, 1.0));
            half[b.draw.pick(&[0, 1, 2])] *= thin;
            pose.half = half * (spot.radius / half.length());
        }
        _ => {
            let with_normals = b.draw.chance(0.3);
            let bytes = assets::closed_mesh(&mut b.draw, with_normals);
            shape.insert("file".into(), b.asset("ply", bytes).into());
            if with_normals && b.draw.chance(0.3) {
                shape.insert("face_normals".into(), true.into());
            }
        }
    }
    if spot.stands {
        pose.center.y = pose.half.y;
        if kind != "cube" || b.draw.chance(0.5) {
            pose.center.y += b.draw.between(0.01, 0.3);
        }
    }
    shape.insert("transform".into(), b.steps(&pose));
    (shape, pose)
}

/// Opaque objects: closed, open, dented, with holes.
fn opaque(b: &mut Builder, spot: &Spot) {
    let (mut shape, pose) = match b.draw.chance(0.7) {
        true => closed(b, spot),
        false => open(b, spot),
    };
    let name = b.opaque(0.9);
    if b.draw.chance(0.2) {
        let relief = assets::relief(&mut b.draw);
        let image = Value::from(b.asset("hdr", relief));
        let scale = b.length(0.1 * pose.half.min_element());
        let bump = table([("image", image), ("scale", scale), ("raw", true.into())]);
        set(&mut b.materials, &name, "bump", bump.into());
    }
    if b.draw.chance(0.15) {
        let opacity = opacity(b);
        set(&mut b.materials, &name, "opacity", opacity);
    }
    shape.insert("material".into(), name.into());
    b.shapes.push(shape);
}

fn set(materials: &mut Table, name: &str, key: &str, value: Value) {
    if let Some(Value::Table(material)) = materials.get_mut(name) {
        material.insert(key.into(), value);
    }
}

fn opacity(b: &mut Builder) -> Value {
    match b.draw.pick(&[0, 1, 2]) {
        0 => number(b.draw.between(0.2, 0.9)),
        1 => {
            let squares = vec![number(1.0), number(b.draw.between(0.0, 0.5))];
            let steps = table([("scale", number(b.draw.between(2.0, 8.0)))]);
            let texture = [
                ("checkerboard", squares.into()),
                ("uv", vec![Value::from(steps)].into()),
            ];
            table(texture).into()
        }
        _ => {
            let holes = assets::relief(&mut b.draw);
            let image = b.asset("hdr", holes);
            table([("image", image.into())]).into()
        }
    }
}

/// An open shape, without material.
fn open(b: &mut Builder, spot: &Spot) -> (Table, Pose) {
    let kind = b.draw.pick(&["rectangle", "disc", "cylinder", "mesh"]);
    let turn = (b.draw.direction(), b.draw.between(0.0, 180.0));
    let mut pose = Pose {
        half: DVec3::splat(0.7 * spot.radius),
        turn,
        center: spot.center,
    };
    let mut shape = table([("type", kind.into())]);
    match kind {
        "disc" => pose.half = DVec3::splat(spot.radius),
        "mesh" => {
            let with_normals = b.draw.chance(0.5);
            let bytes = assets::waves(&mut b.draw, with_normals);
            shape.insert("file".into(), b.asset("ply", bytes).into());
        }
        _ => {}
    }
    if spot.stands {
        pose.center.y = spot.radius + 0.02;
    }
    shape.insert("transform".into(), b.steps(&pose));
    (shape, pose)
}

/// A thin sheet: a pane, or one with holes.
fn sheet(b: &mut Builder, spot: &Spot) {
    let (mut shape, _) = open(b, spot);
    let material = match b.lobes {
        material::Lobes::Any => {
            let ior = number(b.draw.between(1.1, 1.9));
            table([("type", "thin_dielectric".into()), ("ior", ior)])
        }
        material::Lobes::Wide => {
            let mut material = material::opaque(&mut b.draw, b.lobes, 0.9);
            material.insert("opacity".into(), opacity(b));
            material
        }
    };
    let name = b.material(material);
    shape.insert("material".into(), name.into());
    b.shapes.push(shape);
}

/// Gives the interior a boundary material, if there is an interior.
fn bound(shape: &mut Table, material: String, interior: Option<&str>, spot: &Spot) {
    shape.insert("material".into(), material.into());
    if let Some(interior) = interior {
        shape.insert("interior".into(), interior.into());
    }
    if let Some(exterior) = &spot.medium {
        shape.insert("exterior".into(), exterior.clone().into());
    }
}

/// Glass: empty, full, or with an object in it.
fn glass(b: &mut Builder, spot: &Spot) {
    let (mut shape, pose) = closed(b, spot);
    let material = material::glass(&mut b.draw, b.lobes);
    let material = b.material(material);
    let medium = b.draw.chance(0.35).then(|| {
        let steps = b.steps(&pose);
        b.medium(2.0 * pose.half.min_element(), 30.0, Some(steps))
    });
    bound(&mut shape, material, medium.as_deref(), spot);
    let is_mesh = shape.contains_key("file");
    b.shapes.push(shape);
    // In the world's medium, glass without a medium of its own is full of that medium: it never contains nothing.
    inside(b, spot, &pose, is_mesh, medium.or(Some("none".into())));
}

/// A medium without a surface.
fn cloud(b: &mut Builder, spot: &Spot) {
    let (mut shape, pose) = closed(b, spot);
    let steps = b.steps(&pose);
    let medium = b.medium(2.0 * pose.half.min_element(), 100.0, Some(steps));
    let null = b.null();
    bound(&mut shape, null, Some(&medium), spot);
    let is_mesh = shape.contains_key("file");
    b.shapes.push(shape);
    inside(b, spot, &pose, is_mesh, Some(medium));
}

/// Something in the middle of an object, now and then.
fn inside(b: &mut Builder, spot: &Spot, pose: &Pose, is_mesh: bool, medium: Option<String>) {
    let room = pose.half.min_element();
    if spot.depth >= 2 || room < 0.12 || !b.draw.chance(0.35) {
        return;
    }
    let inner = Spot {
        center: pose.center,
        radius: room * b.draw.between(0.45, 0.6),
        stands: false,
        medium,
        depth: spot.depth + 1,
    };
    match b.draw.chance(0.4) {
        // It may stick out of a dented mesh, as lamps may.
        true => light::lamp(b, inner.center, inner.radius),
        false if is_mesh => {
            let radius = 0.45 * inner.radius;
            body(b, &Spot { radius, ..inner });
        }
        false => body(b, &inner),
    }
}

/// Two cubes on the ground that share a face: two media, or a medium and glass.
fn pair(b: &mut Builder, spot: &Spot) {
    let half = 0.5 * spot.radius;
    let mut is_glass = false;
    for side in [-1.0, 1.0] {
        let center = DVec3::new(spot.center.x + side * half, half, spot.center.z);
        let pose = Pose {
            half: DVec3::splat(half),
            turn: (DVec3::Y, 0.0),
            center,
        };
        let steps = b.steps(&pose);
        let mut shape = table([("type", "cube".into()), ("transform", steps.clone())]);
        let medium = b.medium(2.0 * half, 10.0, Some(steps));
        // A ray would meet only one of two interfaces at the same place.
        is_glass = !is_glass && b.draw.chance(0.3);
        let material = match is_glass {
            true => {
                let glass = material::glass(&mut b.draw, b.lobes);
                b.material(glass)
            }
            false => b.null(),
        };
        bound(&mut shape, material, Some(&medium), spot);
        b.shapes.push(shape);
    }
}

/// Copies of one shape.
fn instances(b: &mut Builder, spot: &Spot) {
    let kind = b.draw.pick(&["sphere", "cube", "mesh"]);
    let material = match b.draw.chance(0.3) && spot.medium.is_none() {
        true => {
            let glass = material::glass(&mut b.draw, b.lobes);
            b.material(glass)
        }
        false => b.opaque(0.9),
    };
    let mut shape = table([("type", kind.into()), ("material", material.into())]);
    if kind == "mesh" {
        let bytes = assets::closed_mesh(&mut b.draw, false);
        shape.insert("file".into(), b.asset("ply", bytes).into());
    }
    let count = b.draw.pick(&[2, 3, 5]);
    let each = spot.radius / f64::from(count);
    let lift = if spot.stands {
        spot.radius + 0.02 - spot.center.y
    } else {
        0.0
    };
    let along = b.draw.direction();
    let transforms = (0..count).map(|i| {
        let offset = f64::from(2 * i + 1 - count) * each;
        let pose = Pose {
            half: DVec3::splat(0.55 * each),
            turn: (b.draw.direction(), b.draw.between(0.0, 90.0)),
            center: spot.center + along * offset + DVec3::Y * lift,
        };
        b.steps(&pose)
    });
    let transforms: Vec<Value> = transforms.collect();
    b.shapes.push(table([
        ("type", "instances".into()),
        ("shape", shape.into()),
        ("transforms", transforms.into()),
    ]));
}
