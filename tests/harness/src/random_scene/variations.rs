//! Variations of a finished scene, from separate random numbers: lamps that rays pass, blends, lobes, textured numbers,
//! graphs, leaves, skin, textured and two-sided emitters, parallel rays, dispersive glass, spots and suns with a size.
//! Each leaves many scenes as they are.

use super::builder::Builder;
use super::draw::{Draw, colour, number, table};
use super::material::{self, Lobes, WIDE};
use glam::DVec3;
use toml::{Table, Value};

/// Far from the seeds of other scenes.
const STREAM: u64 = 0x7661_7269_6174_696f;

/// Fields of a material that a blend takes over for all its parts.
const AROUND: [&str; 3] = ["bump", "normal_map", "opacity"];

/// Varies the scene.
pub fn vary(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM);
    if draw.chance(0.5) {
        return;
    }
    let clear = b.media.is_empty();
    for i in 0..b.shapes.len() {
        let shape = &b.shapes[i];
        if shape.contains_key("emission") && !shape.contains_key("material") && draw.chance(0.4) {
            let null = b.null();
            b.shapes[i].insert("material".into(), null.into());
            b.shapes[i].insert("boundary".into(), false.into());
        }
    }
    let names: Vec<String> = b.materials.keys().cloned().collect();
    for name in names {
        let Some(Value::Table(material)) = b.materials.get(&name).cloned() else {
            continue;
        };
        let kind = material.get("type").and_then(Value::as_str).unwrap_or_default();
        if kind == "null" || kind.ends_with("dielectric") {
            continue;
        }
        let mut material = material.clone();
        if kind == "principled" {
            add_lobes(&mut draw, b.lobes, clear, &mut material);
        }
        if let Some(alpha) = ["alpha", "roughness"]
            .into_iter()
            .find(|key| material.contains_key(*key))
            && kind != "rough_plastic"
            && draw.chance(0.3)
        {
            let least = match (b.lobes, alpha) {
                (Lobes::Any, _) => 0.02,
                (Lobes::Wide, "alpha") => WIDE,
                (Lobes::Wide, _) => WIDE.sqrt(),
            };
            let mut roughness = || number(draw.between(least, 1.0));
            let squares = vec![roughness(), roughness()];
            material.insert(alpha.into(), table([("checkerboard", Value::Array(squares))]).into());
        }
        if draw.chance(0.4) {
            blend(&mut draw, b, &name, material, clear);
        } else {
            b.materials.insert(name, material.into());
        }
    }
}

/// A pattern over position: a node with values from 0 to 1.
fn pattern(draw: &mut Draw, scale: f64) -> Table {
    let of = draw.pick(&["object", "generated", "world"]);
    let size = if of == "generated" { 1.0 } else { scale };
    let coordinates = table([("node", "coordinates".into()), ("of", of.into())]);
    let fineness = number(draw.log_between(0.7, 4.0) / size);
    let kind = draw.pick(&["noise", "voronoi", "wave", "checker", "magic", "white_noise"]);
    let mut node = table([("node", kind.into()), ("vector", coordinates.into())]);
    match kind {
        "noise" => node.insert("detail".into(), number(draw.between(0.0, 3.0))),
        "voronoi" => node.insert("normalize".into(), true.into()),
        "wave" => node.insert("distortion".into(), number(draw.between(0.0, 3.0))),
        _ => None,
    };
    if kind == "white_noise" {
        // Constant within cells, or different at every point.
        let mut cells = table([("node", "vector_math".into()), ("operation", "snap".into())]);
        let Some(inner) = node.remove("vector") else {
            return node;
        };
        cells.insert("a".into(), inner);
        cells.insert("b".into(), number(0.3 * size));
        node.insert("vector".into(), cells.into());
    } else {
        node.insert("scale".into(), fineness);
    }
    if let "wave" | "checker" | "magic" = kind {
        node.insert("output".into(), "value".into());
    }
    node
}

/// Turns colours, roughness, opacity and emission into graphs, in one of three scenes.
pub fn grow_graphs(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(8));
    if !draw.chance(1.0 / 3.0) {
        return;
    }
    let scale = b.scale;
    let mix = |draw: &mut Draw, one: Value, other: Value| {
        let factor = pattern(draw, scale);
        let mut node = table([("node", "mix".into()), ("factor", factor.into())]);
        node.insert("a".into(), one);
        node.insert("b".into(), other);
        Value::from(node)
    };
    let materials: Vec<&mut Value> = b.materials.iter_mut().map(|(_, material)| material).collect();
    for material in materials {
        let Value::Table(material) = material else { continue };
        if material.get("type").and_then(Value::as_str) == Some("diffuse") && draw.chance(0.3) {
            // A leaf.
            material.insert("type".into(), "translucent".into());
            material.remove("two_sided");
            material.insert("transmittance".into(), colour(draw.channels(0.0, 0.5)));
        }
        for key in ["reflectance", "base_color"] {
            if material.get(key).is_some_and(|value| !value.is_table()) && draw.chance(0.6) {
                let one = material.get(key).cloned().unwrap_or(number(0.5));
                let other = colour(draw.channels(0.0, 0.8));
                let node = mix(&mut draw, one, other);
                material.insert(key.into(), node);
            }
        }
        if let Some(least) = material.get("roughness").and_then(Value::as_float)
            && draw.chance(0.4)
        {
            // At least as rough as before.
            let rougher = number(draw.between(least, 1.0));
            let node = mix(&mut draw, number(least), rougher);
            material.insert("roughness".into(), node);
        }
        if let Some(opacity) = material.get("opacity").and_then(Value::as_float)
            && draw.chance(0.5)
        {
            let node = mix(&mut draw, number(opacity), number(1.0));
            material.insert("opacity".into(), node);
        }
    }
    for shape in &mut b.shapes {
        let Some(Value::Table(emission)) = shape.get_mut("emission") else {
            continue;
        };
        if draw.chance(0.4)
            && emission.get("scale").is_none()
            && let Some(radiance) = emission.remove("radiance")
        {
            let node = mix(&mut draw, number(1.0), number(0.1));
            emission.insert("radiance".into(), node);
            emission.insert("scale".into(), radiance);
        }
    }
}

/// Adds subsurface scattering to closed objects, in one of three scenes without a medium.
pub fn sink_in(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(4));
    if !draw.chance(1.0 / 3.0) || !b.media.is_empty() {
        return;
    }
    for (i, shape) in b.shapes.iter_mut().enumerate() {
        let is_closed = matches!(shape.get("type").and_then(Value::as_str), Some("sphere" | "cube"));
        let taken = ["emission", "interior", "exterior", "boundary", "flip_normals"];
        if !is_closed || taken.iter().any(|key| shape.contains_key(*key)) || !draw.chance(0.5) {
            continue;
        }
        let name = shape.get("material").and_then(Value::as_str).unwrap_or_default();
        let Some(Value::Table(material)) = b.materials.get(name) else {
            continue;
        };
        let kind = material.get("type").and_then(Value::as_str);
        if !matches!(kind, Some("diffuse" | "principled")) || material.contains_key("spec_trans") {
            continue;
        }
        let mut skin = material.clone();
        skin.insert("type".into(), "principled".into());
        skin.remove("two_sided");
        if let Some(reflectance) = skin.remove("reflectance") {
            skin.insert("base_color".into(), reflectance);
            skin.insert("roughness".into(), number(draw.between(WIDE.sqrt(), 1.0)));
        }
        skin.insert("subsurface".into(), number(draw.between(0.3, 1.0)));
        let radii = [0; 3].map(|_| draw.log_between(0.03, 0.5) * b.scale);
        skin.insert("subsurface_radius".into(), radii.map(number).to_vec().into());
        if draw.chance(0.3) {
            skin.insert("subsurface_anisotropy".into(), number(draw.between(-0.5, 0.8)));
        }
        let name = format!("skin_{i}");
        shape.insert("material".into(), name.clone().into());
        b.materials.insert(name, skin.into());
    }
}

/// Makes rough materials anisotropic, in one of four scenes: facets are rougher along a tangent or across it, and
/// nowhere smoother.
pub fn brush(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(44));
    if !draw.chance(0.25) {
        return;
    }
    for (_, material) in b.materials.iter_mut() {
        let Value::Table(material) = material else { continue };
        let kind = material.get("type").and_then(Value::as_str).unwrap_or_default();
        let of = |name: &str| material.get(name).and_then(Value::as_float);
        let fields = match (kind, of("alpha"), of("roughness")) {
            ("rough_conductor" | "rough_dielectric", Some(alpha), _) => {
                material.remove("alpha");
                let wider = (alpha * draw.between(1.5, 6.0)).min(1.5);
                let [u, v] = draw.pick(&[[alpha, wider], [wider, alpha]]);
                vec![("alpha_u", u), ("alpha_v", v)]
            }
            ("principled", _, Some(roughness)) if draw.chance(0.7) => {
                let anisotropic = draw.between(0.3, 1.0);
                let aspect = (1.0 - 0.9 * anisotropic).sqrt();
                let wider = (roughness * roughness / aspect).min(1.0).sqrt();
                vec![("anisotropic", anisotropic), ("roughness", wider)]
            }
            ("principled", _, Some(_)) => vec![("anisotropy_strength", draw.between(0.2, 1.0))],
            _ => continue,
        };
        for (name, value) in fields {
            material.insert(name.into(), number(value));
        }
        if draw.chance(0.5) {
            material.insert("anisotropic_rotation".into(), number(draw.between(0.0, 1.0)));
        }
        if draw.chance(0.5) {
            let tangent = draw.pick(&["u", "around_x", "around_y", "around_z"]);
            material.insert("tangent".into(), tangent.into());
        }
    }
}

/// Turns a diffuse material into velvet, in one of eight scenes.
pub fn pile(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(52));
    if !draw.chance(0.125) {
        return;
    }
    let is_diffuse = |material: &&mut Table| material.get("type").and_then(Value::as_str) == Some("diffuse");
    let mut diffuse = b
        .materials
        .iter_mut()
        .filter_map(|(_, material)| material.as_table_mut());
    if let Some(material) = diffuse.find(is_diffuse) {
        material.insert("type".into(), "velvet".into());
        material.insert("roughness".into(), number(draw.between(0.2, 1.0)));
    }
}

/// Gives a transmissive principled material a thin film, in one of three scenes.
pub fn glaze(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(56));
    if !draw.chance(1.0 / 3.0) {
        return;
    }
    let lets_through = |material: &&mut Table| material.contains_key("spec_trans");
    let mut tables = b
        .materials
        .iter_mut()
        .filter_map(|(_, material)| material.as_table_mut());
    if let Some(material) = tables.find(lets_through) {
        material.insert("thin_film_thickness".into(), number(draw.between(0.05, 0.8)));
        material.insert("thin_film_ior".into(), number(draw.between(1.1, 1.8)));
    }
}

/// Makes glass dispersive, in one of four scenes.
pub fn split_light(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(16));
    if !draw.chance(0.25) {
        return;
    }
    for (_, material) in b.materials.iter_mut() {
        let Value::Table(material) = material else { continue };
        let Some(ior) = material.get("ior").and_then(Value::as_float) else {
            continue;
        };
        // Strong enough to be seen, but never crossing the index of the surroundings.
        let is_denser = ior > 1.1;
        if is_denser {
            let abbe = number(draw.between(8.0, 60.0));
            material.insert("ior".into(), table([("nd", number(ior)), ("abbe", abbe)]).into());
        }
    }
}

/// Varies the lights, and the camera.
pub fn vary_light_and_view(b: &mut Builder, camera: &mut Table, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(32));
    if draw.chance(0.5) {
        return;
    }
    for shape in &mut b.shapes {
        let Some(Value::Table(emission)) = shape.get_mut("emission") else {
            continue;
        };
        if draw.chance(0.4) {
            emission.insert("two_sided".into(), true.into());
        }
        if draw.chance(0.4)
            && let Some(radiance) = emission.remove("radiance")
        {
            let dim = number(draw.between(0.0, 0.3));
            let squares = Value::Array(vec![number(1.0), dim]);
            emission.insert("radiance".into(), table([("checkerboard", squares)]).into());
            emission.insert("scale".into(), radiance);
        }
    }
    if draw.chance(0.25)
        && let Some(width) = width_at_target(camera)
    {
        camera.remove("fov");
        camera.insert("projection".into(), "orthographic".into());
        camera.insert("view_width".into(), number(width));
    }
}

/// Gives spots and suns a size, in half of the scenes.
pub fn size_lights(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(48));
    if draw.chance(0.5) {
        return;
    }
    let scale = b.scale;
    for light in &mut b.lights {
        let kind = light.get("type").and_then(Value::as_str);
        if kind == Some("spot") {
            let radius = number(draw.log_between(0.01, 0.2) * scale);
            light.insert("radius".into(), radius);
            let falloff = draw.pick(&["linear", "smooth"]);
            light.insert("falloff".into(), falloff.into());
        } else if kind == Some("directional") {
            let angle = number(draw.log_between(0.3, 60.0));
            light.insert("angle".into(), angle);
        }
    }
}

/// Turns spots into lasers, lets lamps shine into cones, and makes cameras panoramic, in one of four scenes each.
pub fn narrow_and_widen(b: &mut Builder, camera: &mut Table, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(24));
    let scale = b.scale;
    if draw.chance(0.25) {
        for light in &mut b.lights {
            if light.get("type").and_then(Value::as_str) != Some("spot") {
                continue;
            }
            let bright = light.remove("power").or_else(|| light.remove("intensity"));
            let place = ["position", "target"].map(|name| light.remove(name));
            let [Some(position), Some(target)] = place else {
                continue;
            };
            let mut laser = table([("type", "laser".into()), ("position", position), ("target", target)]);
            laser.insert("radius".into(), number(draw.log_between(0.05, 0.6) * scale));
            laser.insert("profile".into(), draw.pick(&["flat", "gaussian"]).into());
            laser.insert("power".into(), bright.unwrap_or(number(1.0)));
            for kept in ["name", "group", "visible"] {
                if let Some(value) = light.remove(kept) {
                    laser.insert(kept.into(), value);
                }
            }
            *light = laser;
        }
    }
    if draw.chance(0.25) {
        for shape in &mut b.shapes {
            if let Some(Value::Table(emission)) = shape.get_mut("emission") {
                emission.insert("spread".into(), number(draw.between(20.0, 170.0)));
            }
        }
    }
    let is_plain = !camera.contains_key("aperture") && camera.contains_key("fov");
    if draw.chance(0.25) && is_plain {
        let kind = draw.pick(&["equirectangular", "cylindrical", "fisheye"]);
        camera.insert("projection".into(), kind.into());
        let widest = if kind == "cylindrical" { 300.0 } else { 360.0 };
        camera.insert("fov".into(), number(draw.between(60.0, widest)));
        camera.remove("fov_axis");
    }
}

/// The width of the image at the camera's target, scene units.
fn width_at_target(camera: &Table) -> Option<f64> {
    let point = |name: &str| {
        let numbers = camera.get(name)?.as_array()?.iter().map(Value::as_float);
        let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
        Some(DVec3::from_slice(&numbers))
    };
    let half = 0.5 * camera.get("fov")?.as_float()?.to_radians();
    Some(2.0 * libm::tan(half) * point("origin")?.distance(point("target")?))
}

fn add_lobes(draw: &mut Draw, lobes: Lobes, clear: bool, material: &mut Table) {
    let lets_through = clear && draw.chance(0.3);
    if lets_through {
        // The other side is the inside.
        material.remove("two_sided");
    }
    let mut set = |key: &str, value: f64| material.insert(key.into(), number(value));
    for key in ["sheen", "sheen_tint", "spec_tint", "flatness"] {
        if draw.chance(0.5) {
            set(key, draw.unit());
        }
    }
    // The coat is narrower than the lobes by which a path tracer finds points.
    let has_narrow_coat = lobes == Lobes::Any && draw.chance(0.5);
    if has_narrow_coat {
        set("clearcoat", draw.unit());
        set("clearcoat_gloss", draw.unit());
    }
    // As wide as the lobe below it, for the same reason.
    if !lets_through && !has_narrow_coat && draw.chance(0.3) {
        set("coat_weight", draw.unit());
        set("coat_roughness", draw.between(0.4, 0.8));
        set("coat_ior", draw.between(1.2, 1.9));
    }
    if !lets_through && draw.chance(0.2) {
        set("thin_film_thickness", draw.between(0.05, 0.8));
        set("thin_film_ior", draw.between(1.1, 1.8));
    }
    if lets_through {
        set("spec_trans", draw.between(0.2, 1.0));
        set("specular", 0.5);
    }
}

/// The material, blended with another.
fn blend(draw: &mut Draw, b: &mut Builder, name: &str, mut material: Table, clear: bool) {
    let mut blend = table([("type", "blend".into())]);
    for key in AROUND {
        if let Some(value) = material.remove(key) {
            blend.insert(key.into(), value);
        }
    }
    let other = match clear && draw.chance(0.3) {
        true => material::glass(draw, b.lobes),
        false => material::opaque(draw, b.lobes, 0.8),
    };
    let parts = [format!("{name}-one"), format!("{name}-other")];
    let weight = match draw.chance(0.3) {
        true => {
            let squares = vec![colour([draw.unit(); 3]), colour([draw.unit(); 3])];
            table([("checkerboard", Value::Array(squares))]).into()
        }
        false => number(draw.unit()),
    };
    blend.insert("weight".into(), weight);
    blend.insert(
        "materials".into(),
        Value::Array(parts.clone().map(Value::from).to_vec()),
    );
    for (part, material) in parts.into_iter().zip([material, other]) {
        b.materials.insert(part, material.into());
    }
    b.materials.insert(name.into(), blend.into());
}

/// Makes some media emit: evenly, by their density or another, or as black bodies.
pub fn kindle(b: &mut Builder, seed: u64) {
    let mut draw = Draw::new(seed ^ STREAM.rotate_left(32));
    if draw.chance(0.65) {
        return;
    }
    // Surroundings have no end.
    let mut open: Vec<String> = b.world.iter().cloned().collect();
    for shape in &b.shapes {
        let inner = shape.get("shape").and_then(Value::as_table).unwrap_or(shape);
        if let (Some(Value::String(name)), true) = (inner.get("interior"), inner.contains_key("flip_normals")) {
            open.push(name.clone());
        }
    }
    let scale = b.scale;
    let media = b.media.iter_mut().filter(|(name, _)| !open.contains(*name));
    for (_, medium) in media {
        let Some(medium) = medium.as_table_mut().filter(|_| draw.chance(0.7)) else {
            continue;
        };
        let strength = draw.log_between(0.2, 3.0) / scale;
        let shade: [f64; 3] = std::array::from_fn(|_| strength * draw.between(0.2, 1.0));
        let varies = medium.contains_key("density");
        let emission = match (draw.pick(&[0, 1, 2]), varies) {
            (0, _) => colour(shade),
            (1, true) => table([("color", colour(shade)), ("field", "density".into())]).into(),
            (_, true) => {
                // A black body of 3000 K emits 1.46e6.
                let kelvin = draw.between(1500.0, 2500.0);
                let fields = [
                    ("color", colour(shade)),
                    ("scale", number(1.0 / 1.46e6)),
                    ("temperature", "density".into()),
                    ("kelvin", number(kelvin)),
                ];
                table(fields).into()
            }
            (_, false) => {
                let fields = [
                    ("color", colour(shade)),
                    ("scale", number(1.0 / 1.46e6)),
                    ("temperature", number(draw.between(2000.0, 4000.0))),
                ];
                table(fields).into()
            }
        };
        medium.insert("emission".into(), emission);
    }
}
