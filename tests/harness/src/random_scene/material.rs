//! Random materials.

use super::draw::{Draw, colour, number, table};
use toml::{Table, Value};

/// From this roughness on, a path tracer finds point lights by way of a surface.
pub const WIDE: f64 = 0.15;

/// Which lobes a scene's surfaces may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobes {
    /// Mirrors, glass, and every roughness. Lights must have some size.
    Any,
    /// None narrower than that of [`WIDE`]. Lights may be points.
    Wide,
}

impl Lobes {
    fn alpha(self, draw: &mut Draw) -> f64 {
        match self {
            Self::Any => draw.log_between(0.001, 1.0),
            Self::Wide => draw.log_between(WIDE, 1.0),
        }
    }
}

/// An opaque material. `bright`: its largest reflectance, if it has one.
pub fn opaque(draw: &mut Draw, lobes: Lobes, bright: f64) -> Table {
    let kinds: &[&str] = match lobes {
        Lobes::Any => &[
            "diffuse",
            "diffuse",
            "mirror",
            "conductor",
            "rough_conductor",
            "rough_conductor",
            "plastic",
            "rough_plastic",
            "principled",
        ],
        Lobes::Wide => &["diffuse", "diffuse", "rough_conductor", "rough_plastic", "principled"],
    };
    let kind = draw.pick(kinds);
    let mut material = table([("type", kind.into())]);
    let mut set = |key: &str, value: Value| material.insert(key.into(), value);
    match kind {
        "principled" => {
            set("base_color", reflectance(draw, bright));
            set("metallic", number(draw.pick(&[0.0, 0.3, 1.0])));
            let least = match lobes {
                Lobes::Any => 0.04,
                Lobes::Wide => WIDE.sqrt(),
            };
            set("roughness", number(draw.between(least, 1.0)));
            set("specular", number(draw.pick(&[0.0, 0.5, 1.0])));
        }
        "conductor" | "rough_conductor" => {
            set("preset", draw.pick(&["copper", "silver", "chromium", "gold"]).into());
        }
        "mirror" => {
            set(
                "reflectance",
                colour(draw.channels(0.3, 1.0).map(|c| c.min(bright + 0.1))),
            );
        }
        _ => {
            set("reflectance", reflectance(draw, bright));
        }
    }
    if let "plastic" | "rough_plastic" = kind {
        set("nonlinear", draw.chance(0.5).into());
        set("ior", number(draw.between(1.2, 2.0)));
    }
    if let "rough_conductor" | "rough_plastic" = kind {
        set("alpha", number(lobes.alpha(draw)));
        set("distribution", draw.pick(&["ggx", "beckmann"]).into());
    }
    if !matches!(kind, "mirror" | "conductor" | "rough_conductor") {
        set("two_sided", true.into());
    }
    material
}

/// A reflectance, or a checkerboard of two.
fn reflectance(draw: &mut Draw, bright: f64) -> Value {
    let one = colour(draw.channels(0.0, bright));
    match draw.chance(0.15) {
        true => {
            let squares = vec![one, colour(draw.channels(0.0, bright))];
            let mut texture = table([("checkerboard", Value::Array(squares))]);
            let steps = table([("scale", number(draw.between(1.0, 6.0)))]);
            texture.insert("uv".into(), Value::Array(vec![steps.into()]));
            texture.into()
        }
        false => one,
    }
}

/// Glass that may bound media.
pub fn glass(draw: &mut Draw, lobes: Lobes) -> Table {
    let smooth = lobes == Lobes::Any && draw.chance(0.5);
    let kind = if smooth { "dielectric" } else { "rough_dielectric" };
    let mut material = table([("type", kind.into()), ("ior", number(draw.between(1.1, 2.0)))]);
    if !smooth {
        material.insert("alpha".into(), number(lobes.alpha(draw)));
        material.insert("distribution".into(), draw.pick(&["ggx", "beckmann"]).into());
    }
    material
}
