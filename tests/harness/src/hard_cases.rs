//! Scenes at the limits of number ranges with known radiance: variations of one furnace, a closed box in which every
//! point sees radiance 1 (n^2 within glass of index n), whatever scatters in it without absorbing.

use crate::MeanEstimate;
use crate::path_tracer::Grid;
use crate::render::{plan_of, scene_with};
use beamfarm_image::job::PassStats;
use beamfarm_render::cpu::pass::render_pass;
use glam::{DAffine3, DVec3};

/// A scene and its expected picture.
#[derive(Clone, Debug)]
pub struct Case {
    /// A short name.
    pub name: &'static str,
    /// The scene file.
    pub toml: String,
    /// Files that the scene names.
    pub assets: Vec<(&'static str, Vec<u8>)>,
    /// Radiance of every pixel and channel.
    pub truth: f64,
    /// Share of the truth by which kernels of this size may change it where they reach beyond walls.
    pub allowance: f64,
    /// First pass that is rendered.
    pub first_pass: u64,
    /// Passes.
    pub passes: u64,
    /// Nearly all light comes from beams that hardly any ray finds: a few passes show at most the truth.
    pub rarely_seen: bool,
    /// How many times the ordinary case's beams and evaluations the case inherently needs: the work is compared per
    /// unit of this.
    pub work: f64,
}

/// The result of a case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Mean of the picture over truth, by channel; one value per pass.
    pub ratio: [MeanEstimate; 3],
    /// Sums over the passes.
    pub stats: PassStats,
}

impl Case {
    /// Renders it.
    pub fn render(&self) -> Outcome {
        let assets: Vec<(&str, &[u8])> = self.assets.iter().map(|(n, b)| (*n, &b[..])).collect();
        let scene = scene_with(&self.toml, &assets);
        let plan = plan_of(&scene);
        let mut outcome = Outcome {
            ratio: [MeanEstimate::new(); 3],
            stats: PassStats::default(),
        };
        for pass_index in self.first_pass..self.first_pass + self.passes {
            let image = render_pass(&scene, &plan, pass_index).expect("a pass");
            let count = image.film.pixels.len() as f64;
            for (c, ratio) in outcome.ratio.iter_mut().enumerate() {
                let sum: f64 = image.film.pixels.iter().map(|p| f64::from(p[c])).sum();
                ratio.add(sum / count / self.truth);
            }
            outcome.stats += image.stats;
        }
        outcome
    }
}

/// The box, of half a side `scale`, with fog in it. `medium`: its coefficients, for a box of half a side 1.
fn furnace(scale: f64, medium: &str, rest: &str) -> Case {
    let walls = 0.5;
    let toml = format!(
        r#"
[image]
width = 16
height = 16
[render]
passes = 32
paths = 1000
alpha = 0.5
radius = {radius}
seed = 17
[world]
medium = "fog"
[camera]
origin = [{x}, {y}, {z}]
target = [0.0, {t}, 0.0]
fov = 60.0
[media.fog]
type = "homogeneous"
{medium}
[materials.wall]
type = "diffuse"
reflectance = {walls}
[materials.white]
type = "diffuse"
reflectance = 1.0
two_sided = true
[materials.boundary]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
emission = {{ radiance = {emission} }}
transform = [{{ scale = {scale} }}]
{rest}
"#,
        radius = 0.01 * scale,
        x = 0.1 * scale,
        y = 0.2 * scale,
        z = 0.9 * scale,
        t = 0.1 * scale,
        emission = 1.0 - walls,
    );
    Case {
        name: "",
        toml,
        assets: Vec::new(),
        truth: 1.0,
        allowance: 0.01,
        first_pass: 0,
        passes: 32,
        rarely_seen: false,
        work: 1.0,
    }
}

const FOG: &str = "sigma_a = 0.0\nsigma_s = 0.5";

fn in_fog(name: &'static str, rest: &str) -> Case {
    Case {
        name,
        ..furnace(1.0, FOG, rest)
    }
}

fn of_medium(name: &'static str, medium: &str) -> Case {
    Case {
        name,
        ..furnace(1.0, medium, "")
    }
}

/// The furnace with nothing hard in it, with which the others are compared.
pub fn ordinary() -> Case {
    in_fog("ordinary fog", "")
}

/// All of them.
pub fn cases() -> Vec<Case> {
    let mut cases = vec![
        of_medium("sigma_t = 0", "sigma_a = 0\nsigma_s = 0"),
        of_medium("sigma_t = 0 in one channel", "sigma_a = 0\nsigma_s = [0.5, 0.0, 0.2]"),
        of_medium("sigma_t = 1e-12", "sigma_a = 0\nsigma_s = 1e-12"),
        in_fog(
            "index-matched glass",
            r#"
[materials.matched]
type = "dielectric"
ior = 1.0
[[shapes]]
type = "sphere"
center = [0, 0, -0.2]
radius = 0.5
material = "matched"
interior = "fog"
"#,
        ),
        in_fog(
            "grazing glass",
            // The camera is just above a pane that fills the lower half of its view.
            r#"
[[shapes]]
type = "cube"
material = "glass"
transform = [{ scale = [0.8, 0.05, 0.8] }, { translate = [0.0, 0.1, 0.0] }]
"#,
        ),
        in_fog(
            "coincident boundaries",
            r#"
[[shapes]]
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = 0.5 }]
[[shapes]]
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = 0.5 }]
"#,
        ),
        in_fog(
            "nested media",
            r#"
[media.thick]
type = "homogeneous"
sigma_a = 0
sigma_s = [2.0, 1.0, 0.0]
phase = { type = "hg", g = 0.5 }
[media.thin]
type = "homogeneous"
sigma_a = 0
sigma_s = 0.1
[[shapes]]
type = "sphere"
center = [0, 0, -0.2]
radius = 0.5
material = "boundary"
interior = "thick"
[[shapes]]
type = "sphere"
center = [0, 0, -0.2]
radius = 0.25
material = "boundary"
interior = "thin"
exterior = "thick"
"#,
        ),
        in_fog(
            "light inside of glass",
            // Within glass of index n all radiance is n^2 as large.
            r#"
[[shapes]]
type = "sphere"
center = [0, 0, -0.2]
radius = 0.5
material = "glass"
interior = "none"
[[shapes]]
type = "sphere"
center = [0, 0, -0.2]
radius = 0.2
emission = { radiance = 2.25 }
"#,
        ),
        in_fog(
            "light that touches a boundary",
            r#"
[media.thick]
type = "homogeneous"
sigma_a = 0
sigma_s = 1.0
[[shapes]]
type = "sphere"
center = [0, 0, -0.2]
radius = 0.4
material = "boundary"
interior = "thick"
[[shapes]]
type = "sphere"
center = [0.6, 0, -0.2]
radius = 0.2
emission = { radiance = 1.0 }
[[shapes]]
type = "sphere"
center = [-0.2, 0, -0.2]
radius = 0.2
emission = { radiance = 1.0 }
"#,
        ),
    ];
    for (name, g) in [
        ("HG, g = 0.9", 0.9),
        ("HG, g = -0.9", -0.9),
        ("HG, g = 0.999", 0.999),
        ("HG, g = -0.999", -0.999),
    ] {
        let medium = format!("{FOG}\nphase = {{ type = \"hg\", g = {g} }}");
        cases.push(Case {
            passes: 200,
            rarely_seen: f64::abs(g) > 0.99,
            ..of_medium(name, &medium)
        });
    }
    for (name, scale) in [("scaled by 1e-3", 1e-3), ("scaled by 1e4", 1e4)] {
        let medium = format!("sigma_a = 0.0\nsigma_s = {}", 0.5 / scale);
        cases.push(Case {
            name,
            ..furnace(scale, &medium, "")
        });
    }
    let inside = r#"
[[shapes]]
type = "sphere"
center = [0.1, 0.2, 0.85]
radius = 0.12
material = "glass"
interior = INTERIOR
"#;
    for (name, interior) in [
        ("camera inside of glass", "\"none\""),
        ("camera inside of glass full of fog", "\"fog\""),
    ] {
        cases.push(Case {
            truth: 2.25,
            ..in_fog(name, &inside.replace("INTERIOR", interior))
        });
    }
    cases.push({
        let mut case = in_fog("camera inside of beams", "");
        case.toml = case.toml.replace("radius = 0.01\n", "radius = 0.2\n");
        // As wide as the camera's distance to the walls.
        case.allowance = 0.1;
        case.work = 20.0;
        case
    });
    cases.push(Case {
        first_pass: 1_000_000,
        passes: 400,
        // Base radii so wide that the photons of some passes are found.
        toml: ordinary().toml.replace("radius = 0.01", "radius = 0.2"),
        ..in_fog("a million passes later", "")
    });
    cases.push(Case {
        assets: vec![("spike.vol", spike())],
        allowance: 0.02,
        work: 4.0,
        ..in_fog(
            "spike in a grid",
            r#"
[media.smoke]
type = "heterogeneous"
sigma_a = 0.0
sigma_s = [0.01, 0.02, 0.005]
density = { file = "spike.vol" }
transform = [{ translate = [-0.5, -0.5, -0.5] }]
[[shapes]]
type = "cube"
material = "boundary"
interior = "smoke"
transform = [{ scale = 0.5 }]
"#,
        )
    });
    cases.push(Case {
        assets: vec![("bad.obj", degenerate())],
        ..in_fog(
            "coincident and degenerate triangles",
            r#"
[[shapes]]
type = "mesh"
file = "bad.obj"
material = "white"
"#,
        )
    });
    cases
}

/// A density of 1 around a single sample of 1000: the density reaches its majorant in one point.
fn spike() -> Vec<u8> {
    let mut samples = vec![1.0; 8 * 8 * 8];
    samples[4 + 8 * (4 + 8 * 4)] = 1000.0;
    Grid::new([8; 3], samples, DAffine3::from_translation(DVec3::splat(-0.5))).vol()
}

/// A square, the same square again, slivers along its diagonal, and triangles without an area.
fn degenerate() -> Vec<u8> {
    b"v -0.5 -0.3 -0.5\nv 0.5 -0.3 -0.5\nv 0.5 0.4 -0.4\nv -0.5 0.4 -0.4\nv 0 0.05 -0.45\n\
      v 0.0001 0.05007 -0.45\nv 0.5 0.4 -0.4\n\
      f 1 2 3\nf 1 3 4\nf 1 2 3\nf 1 3 4\nf 1 5 3\nf 1 6 3\nf 3 6 1\nf 2 2 2\nf 1 1 3\nf 3 7 3\n"
        .to_vec()
}
