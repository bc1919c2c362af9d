//! Which estimator counts which light path is free to choose: every choice gives the same light. Rooms with every class
//! of paths, by beams and photons, by camera paths, and by the path tracer.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks_of, blur, is_long, reference_images, scene};
use beamfarm_image::job::{JobSettings, ReferenceSettings, Technique, Techniques};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::estimators::{Caustics, PathEnds, SurfaceLight};
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::LightSelector;

const ROOM: &str = r#"
[image]
width = 24
height = 24
[render]
passes = PASSES
paths = 4000
radius = 0.03
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, 0.0, 0.0]
fov = 80.0
WORLD
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.2, 0.3]
sigma_s = [0.9, 0.7, 0.5]
phase = { type = "hg", g = 0.4 }
[media.milk]
type = "homogeneous"
sigma_t = [3.0, 2.0, 4.0]
albedo = [0.9, 0.8, 0.7]
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
[materials.red]
type = "diffuse"
reflectance = [0.7, 0.2, 0.1]
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.frosted]
type = "rough_dielectric"
alpha = 0.05
ior = 1.5
[materials.steel]
type = "rough_conductor"
alpha = 0.05
preset = "chromium"
[materials.lacquer]
type = "rough_plastic"
alpha = 0.06
reflectance = [0.2, 0.3, 0.5]
[materials.coat]
type = "plastic"
reflectance = [0.2, 0.5, 0.3]
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.45, -0.6, -0.3]
radius = 0.38
BALL
[[shapes]]
type = "sphere"
center = [0.5, -0.65, -0.2]
radius = 0.33
OTHER
[[shapes]]
type = "sphere"
center = [0.1, 0.55, -0.1]
radius = 0.25
emission = { radiance = [3.0, 2.5, 2.0] }
"#;

fn room(world: &str, ball: &str, other: &str, passes: u64) -> Scene {
    let text = ROOM.replace("WORLD", world).replace("BALL", ball);
    let text = text.replace("OTHER", other);
    scene(&text.replace("PASSES", &passes.to_string()))
}

const PHOTONS: Option<Technique> = Some(Technique::Photons);
const PATHS: Option<Technique> = Some(Technique::Paths);

/// All ways to share the light, from as much as possible by photons to none.
const ALL: [Techniques; 6] = [
    techniques(PHOTONS, PHOTONS, PHOTONS),
    techniques(PHOTONS, PATHS, PHOTONS),
    techniques(PATHS, PHOTONS, PHOTONS),
    techniques(PATHS, PATHS, PHOTONS),
    techniques(PATHS, PATHS, PATHS),
    // Caustics by both, weighted by MIS.
    techniques(PATHS, PATHS, None),
];

const fn techniques(media: Option<Technique>, surfaces: Option<Technique>, caustics: Option<Technique>) -> Techniques {
    Techniques {
        media,
        surfaces,
        caustics,
        aimed: None,
    }
}

/// Images of the scene, its light found by these techniques.
fn by(scene: &Scene, techniques: Techniques, seed: u64) -> Blocks {
    let settings = JobSettings {
        seed,
        techniques,
        ..scene.description().defaults.job_settings()
    };
    let plan = RenderPlan::new(scene, settings);
    let estimators = &plan.estimators;
    assert_eq!(estimators.any_beams(), techniques.media == PHOTONS);
    assert_eq!(estimators.ends() == PathEnds::FarEnough, techniques.surfaces == PHOTONS);
    let caustics = match techniques.caustics {
        Some(Technique::Photons) => Caustics::Photons,
        Some(Technique::Paths) => Caustics::Paths,
        None => Caustics::Shared,
    };
    assert_eq!(estimators.caustics_of(0), caustics);
    blocks_of(scene, &plan, 8)
}

/// Two pictures are the same, with little enough noise to tell.
fn same_means(name: &str, a: &Blocks, b: &Blocks, suite: &mut Suite) {
    // Kernels blur what photons bring.
    suite.same_blocks(name, a, b, 5e-3);
    assert!(a.noise(b) < 0.02 * blur(), "{name}: {}", a.noise(b));
}

const FOG: &str = "[world]\nmedium = \"fog\"";

/// Significance 1e-2 for all blocks of all rooms together.
#[test]
fn beams_and_camera_paths_find_the_same_light() {
    let mut suite = Suite::new(1e-2);
    for (name, world, ball, other) in [
        ("fog", FOG, "material = \"red\"", "material = \"red\""),
        ("fog and glass", FOG, "material = \"glass\"", "material = \"lacquer\""),
        (
            "fog and rough glass",
            FOG,
            "material = \"frosted\"",
            "material = \"steel\"",
        ),
        (
            "milk",
            "",
            "material = \"frosted\"\ninterior = \"milk\"",
            "material = \"coat\"",
        ),
        (
            "milk in fog",
            FOG,
            "material = \"glass\"\ninterior = \"milk\"",
            "material = \"red\"",
        ),
    ] {
        // Other rooms and random scenes cover what is in these rooms.
        if ["fog", "fog and rough glass", "milk"].contains(&name) && !is_long() {
            continue;
        }
        let scene = room(world, ball, other, 300);
        let settings = ReferenceSettings {
            seed: 5,
            max_depth: None,
        };
        let samples = if is_long() { 100 } else { 36 };
        let truth = Blocks::new(reference_images(&scene, settings, samples, 8), 8);
        for (seed, techniques) in (0..).zip(ALL) {
            let name = format!("{name}, {techniques}");
            same_means(&name, &by(&scene, techniques, seed), &truth, &mut suite);
        }
    }
    suite.finish();
}

/// An even sky whose caustics come by camera paths behind glass, by photons, or by both. Significance 1e-2 for all
/// blocks.
#[test]
fn a_sky_is_met_behind_glass_or_brings_photons() {
    let text = r#"
[image]
width = 24
height = 24
[render]
passes = PASSES
paths = 20000
radius = 0.02
[camera]
origin = [0.0, 1.2, 3.0]
target = [0.0, 0.3, 0.0]
fov = 50.0
[materials.floor]
type = "diffuse"
reflectance = 0.5
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.frosted]
type = "rough_dielectric"
alpha = 0.04
ior = 1.5
[[shapes]]
type = "disc"
material = "floor"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 2.0 }]
[[shapes]]
type = "sphere"
center = [-0.6, 0.5, 0.0]
radius = 0.5
material = "glass"
[[shapes]]
type = "sphere"
center = [0.6, 0.5, 0.0]
radius = 0.5
material = "frosted"
[[lights]]
type = "environment"
radiance = [0.5, 0.7, 1.0]
"#;
    let scene = scene(&text.replace("PASSES", "400"));
    let mut suite = Suite::new(1e-2);
    let ways = [(0, Caustics::Paths), (1, Caustics::Photons), (2, Caustics::Shared)];
    let [met, brought, shared] = ways.map(|(seed, caustics)| {
        let mut settings = scene.description().defaults.job_settings();
        settings.seed = seed;
        let mut plan = RenderPlan::new(&scene, settings);
        assert!(plan.estimators.caustics_of(0) == Caustics::Paths && !plan.surface_photons);
        if caustics != Caustics::Paths {
            plan.estimators.surfaces = SurfaceLight::Paths(vec![caustics]);
            plan.surface_photons = true;
            let description = scene.description();
            plan.emitters = LightSelector::new(&description.lights, &description.objects, &description.bounds);
        }
        blocks_of(&scene, &plan, 8)
    });
    same_means("photons of the sky", &met, &brought, &mut suite);
    same_means("photons of the sky, and paths", &met, &shared, &mut suite);
    suite.finish();
}
