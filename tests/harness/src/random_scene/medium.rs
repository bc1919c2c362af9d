//! Random media.

use super::assets::{self, Asset};
use super::draw::{Draw, colour, number, table};
use toml::{Table, Value};

/// The extent that a medium is made for.
#[derive(Clone, Debug)]
pub struct Extent {
    /// Width, scene units.
    pub across: f64,
    /// Largest optical depth across it.
    pub max_depth: f64,
    /// For varying densities, the steps that place the box [-1, 1]^3; without them the medium is homogeneous.
    pub steps: Option<Value>,
}

/// A medium of this extent, and its files. `name`: of the medium, used for the names of files.
pub fn medium(draw: &mut Draw, name: &str, extent: &Extent) -> (Table, Vec<Asset>) {
    let depth = draw.log_between(0.01, extent.max_depth);
    let spread = draw.pick(&[1.0, 1.0, 1.0, 3.0, 10.0]);
    let sigma_t = match spread {
        1.0 => [depth; 3],
        _ => std::array::from_fn(|_| (depth * draw.log_between(1.0 / spread, spread)).min(extent.max_depth)),
    }
    .map(|depth| depth / extent.across);
    // Paths in dense media that absorb little hardly end: allow up to some hundred scatterings.
    let most = if depth > 10.0 { 0.99 } else { 1.0 };
    let one = |draw: &mut Draw| match draw.chance(0.5) {
        true => draw.between(0.0, 1.0),
        false => (1.0 - draw.log_between(1e-3, 1.0)).min(most),
    };
    let albedo: [f64; 3] = match draw.chance(0.5) {
        true => [one(draw); 3],
        false => std::array::from_fn(|_| one(draw)),
    };
    let mut medium = table([("type", "homogeneous".into()), ("phase", phase(draw))]);
    let mut files = Vec::new();
    match &extent.steps {
        Some(steps) if draw.chance(0.35) => {
            medium.insert("type".into(), "heterogeneous".into());
            medium.insert("transform".into(), steps.clone());
            let (density, file) = density(draw, name);
            if let Value::Table(density) = &density
                && density.contains_key("file")
            {
                // Files fill the unit cube.
                let mut all = vec![
                    table([("scale", number(2.0))]).into(),
                    table([("translate", vec![number(-1.0); 3].into())]).into(),
                ];
                all.extend(steps.as_array().into_iter().flatten().cloned());
                medium.insert("transform".into(), Value::Array(all));
            }
            medium.insert("density".into(), density);
            files.extend(file);
            let tracking = draw.pick(&["ratio_tracking", "residual_ratio_tracking"]);
            medium.insert("transmittance".into(), tracking.into());
        }
        _ => {}
    }
    if draw.chance(0.3) {
        let product = |i: usize| sigma_t[i] * albedo[i];
        let rest = |i: usize| sigma_t[i] * (1.0 - albedo[i]);
        medium.insert("sigma_s".into(), colour(std::array::from_fn(product)));
        medium.insert("sigma_a".into(), colour(std::array::from_fn(rest)));
    } else {
        medium.insert("sigma_t".into(), colour(sigma_t));
        medium.insert("albedo".into(), colour(albedo));
    }
    (medium, files)
}

fn density(draw: &mut Draw, name: &str) -> (Value, Option<Asset>) {
    if draw.chance(0.3) {
        let name = format!("{name}.vol");
        let bytes = assets::grid(draw, 1, 0.0, 1.0);
        let density = table([("file", name.clone().into())]);
        return (density.into(), Some(Asset { name, bytes }));
    }
    let corner = |x: f64| Value::Array(vec![number(x); 3]);
    let mut density = table([("min", corner(-1.0)), ("max", corner(1.0)), ("voxel", number(0.15))]);
    match draw.pick(&[0, 1, 2]) {
        0 => {
            let noise = table([
                ("size", number(draw.between(0.4, 1.5))),
                ("contrast", number(draw.between(1.0, 4.0))),
                ("seed", Value::Integer(draw.pick(&[1, 2, 3]))),
            ]);
            density.insert("noise".into(), noise.into());
        }
        1 => {
            let height = table([("base", number(-1.0)), ("scale", number(draw.between(0.2, 2.0)))]);
            density.insert("height".into(), height.into());
        }
        _ => {
            let blob = table([
                (
                    "center",
                    Value::Array((0..3).map(|_| number(draw.between(-0.5, 0.5))).collect()),
                ),
                ("radius", number(draw.between(0.2, 0.8))),
            ]);
            density.insert("blobs".into(), Value::Array(vec![blob.into()]));
        }
    }
    (density.into(), None)
}

fn phase(draw: &mut Draw) -> Value {
    let hg = |draw: &mut Draw| {
        let g = number(draw.between(-0.9, 0.9));
        Value::from(table([("type", "hg".into()), ("g", g)]))
    };
    match draw.pick(&[0, 1, 1, 2]) {
        0 => "isotropic".into(),
        1 => hg(draw),
        _ => {
            let phases = vec![hg(draw), hg(draw)];
            let weight = number(draw.between(0.1, 0.9));
            table([("type", "blend".into()), ("weight", weight), ("phases", phases.into())]).into()
        }
    }
}
