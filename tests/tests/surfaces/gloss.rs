//! Several gather rays and surface photons seen on gloss: the same mean light as one gather ray finds alone, with less
//! noise.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, blocks, blur, images, plan_of, scene, truth, with_threads};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// A closed room whose walls are lit by a spot and a small lamp, and a ball.
const ROOM: &str = r#"
[image]
width = 24
height = 24
[render]
passes = PASSES
paths = 3000
radius = 0.03
seed = 11
[camera]
origin = [0.0, 0.0, 0.95]
target = [0.0, -0.2, -1.0]
fov = 60.0
[materials.wall]
type = "diffuse"
reflectance = [0.6, 0.5, 0.4]
two_sided = true
[materials.plain]
type = "diffuse"
reflectance = [0.3, 0.3, 0.4]
[materials.steel]
type = "rough_conductor"
alpha = 0.1
preset = "iridium"
[materials.frosted]
type = "rough_dielectric"
alpha = 0.3
ior = 1.5
[materials.varnish]
type = "rough_plastic"
alpha = 0.15
reflectance = [0.2, 0.4, 0.6]
[materials.disney]
type = "principled"
base_color = [0.7, 0.4, 0.2]
metallic = 0.5
roughness = 0.4
[[shapes]]
name = "room"
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
name = "ball"
type = "sphere"
center = [-0.3, -0.5, -0.4]
radius = 0.4
material = "GLOSS"
[[shapes]]
name = "other"
type = "sphere"
center = [0.6, -0.6, -0.3]
radius = 0.25
material = "OTHER"
[[lights]]
name = "lamp"
type = "point"
position = [0.7, 0.7, 0.5]
intensity = 0.1
[[lights]]
name = "spot"
type = "spot"
position = [0.0, 0.8, 0.0]
target = [0.6, 0.0, -1.0]
cutoff_angle = 20
intensity = 3
[[shapes]]
name = "lantern"
type = "sphere"
center = [-0.6, 0.8, -0.7]
radius = 0.08
emission = { radiance = 8.0 }
"#;

fn room(gloss: &str, other: &str, passes: u64) -> String {
    let room = ROOM.replace("GLOSS", gloss).replace("OTHER", other);
    room.replace("PASSES", &passes.to_string())
}

/// One gather ray, or four, whatever the plan chooses.
fn gather_rays(plan: &mut RenderPlan, all: bool) {
    plan.gloss_rays_side = if all { 2 } else { 1 };
}

/// Blocks of the room with one gather ray, and with four.
fn both(text: &str) -> [Blocks; 2] {
    let scene = scene(text);
    [false, true].map(|all| {
        let mut settings = scene.description().defaults.job_settings();
        settings.seed += u64::from(all);
        let mut plan = RenderPlan::new(&scene, settings);
        gather_rays(&mut plan, all);
        let passes = 0..images(scene.description().defaults.passes);
        Blocks::new(passes.map(|i| render_pass(&scene, &plan, i).expect("a pass").film), 6)
    })
}

/// Two pictures are the same, with little enough noise to tell.
fn same_means(name: &str, [alone, together]: &[Blocks; 2], suite: &mut Suite) {
    // Kernels blur what photons bring.
    suite.same_blocks(name, together, alone, 3e-3);
    let noise = together.noise(alone);
    assert!(noise < 0.03 * blur(), "{name}: {noise}");
}

/// A scene is what the path tracer shows in so many images. `[most, slack]`: the most noise
/// that is little enough to tell, and what blocks may differ by on top.
fn is_as_traced(name: &str, scene: &Scene, images: u64, [most, slack]: [f64; 2], suite: &mut Suite) {
    let (passes, truth) = (blocks(scene, 8), truth(scene, images, 8, 8));
    let noise = passes.noise(&truth);
    assert!(noise < most * blur(), "{name}: {noise}");
    suite.same_blocks(name, &passes, &truth, slack);
}

/// Metal, frosted glass with transmission, a rough coat, and the principled BSDF. Significance 1e-2 for all blocks of
/// all rooms together.
#[test]
fn gloss_changes_noise_and_not_light() {
    let mut suite = Suite::new(1e-2);
    for gloss in ["steel", "frosted", "varnish", "disney"] {
        same_means(gloss, &both(&room(gloss, "plain", 1000)), &mut suite);
    }
    suite.finish();
}

/// Gloss with its own rule finds the same light with one gather ray and with several. Significance 1e-2 for all blocks.
#[test]
fn gloss_obeys_its_rules() {
    let mut suite = Suite::new(1e-2);
    let rule = "[[rules]]\non = [\"ball\"]\nrays = [\"reflected\"]\nexclude = [\"other\"]\n";
    let text = format!("{}\n{rule}", room("steel", "plain", 800));
    same_means("ruled", &both(&text), &mut suite);
    suite.finish();
}

/// More lights than gloss chooses from at a time, and a room without gloss, against the path tracer: points of all
/// powers around the room, and the lantern. Significance 1e-2 for all blocks of all rooms together.
#[test]
fn surfaces_among_many_lights_are_what_the_path_tracer_shows() {
    let mut suite = Suite::new(1e-2);
    for gloss in ["steel", "varnish", "plain"] {
        let mut text = room(gloss, "plain", 800);
        for i in 0..12 {
            let (x, z) = (0.1 * f64::from(i) - 0.6, 0.6 - 0.1 * f64::from(i));
            let intensity = 0.01 * f64::from(1 + i * i);
            text += &format!("[[lights]]\ntype = \"point\"\nposition = [{x}, 0.85, {z}]\nintensity = {intensity}\n");
        }
        let scene = scene(&text);
        let reference = truth(&scene, 64, 32, 6);
        same_means(gloss, &[reference, blocks(&scene, 6)], &mut suite);
    }
    suite.finish();
}

/// Variance of passes in the middle of a metal ball that shows a wall lit by the spot, over that of one gather ray.
#[test]
fn gloss_lowers_the_noise() {
    for (paths, first, bound) in [(3000, 100, 0.5), (40_000, 0, 0.35)] {
        let text = room("steel", "plain", 1).replace("radius = 0.03\n", "");
        let text = text.replace("alpha = 0.1", "alpha = 0.2");
        let text = text.replace("paths = 3000", &format!("paths = {paths}"));
        let scene = scene(&text);
        let [alone, together] = [false, true].map(|all| {
            let mut plan = plan_of(&scene);
            gather_rays(&mut plan, all);
            let film = |i| render_pass(&scene, &plan, i).expect("a pass").film;
            let blocks = Blocks::new((first..first + 60).map(film), 1);
            let pixels = blocks.blocks.iter().enumerate();
            let on_ball = |i: usize| (13..17).contains(&(i / 24)) && (6..10).contains(&(i % 24));
            let variances = pixels.filter(|(i, _)| on_ball(*i)).map(|(_, b)| b[0].variance());
            variances.sum::<f64>()
        });
        assert!(
            together < bound * alone,
            "{paths} paths: {together}, by one gather ray {alone}"
        );
    }
}

#[test]
fn bits_do_not_depend_on_threads() {
    let scene = scene(&room("steel", "plain", 1));
    let plan = plan_of(&scene);
    let images = [1, 3].map(|threads| with_threads(threads, || render_pass(&scene, &plan, 3).expect("a pass").film));
    assert_eq!(images[0], images[1]);
}

/// Polished objects that show each other's images of a lamp without size.
const POLISHED: &str = r#"
[image]
width = 24
height = 24
[render]
passes = PASSES
paths = 3000
radius = 0.03
[camera]
origin = [0.0, 1.0, 4.0]
target = [0.0, 0.5, 0.0]
fov = 40.0
[materials.steel]
type = "rough_conductor"
alpha = 0.07
preset = "chromium"
[materials.other]
MATERIAL
[[shapes]]
type = "rectangle"
material = "steel"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 1.5 }]
[[shapes]]
type = "sphere"
center = [-0.5, 0.5, 0.0]
radius = 0.5
material = "steel"
[[shapes]]
type = "sphere"
center = [0.6, 0.5, 0.3]
radius = 0.5
material = "other"
[[lights]]
LIGHT
"#;

/// Lights without size that one polished surface shows by way of another: each is found once, as by the path tracer.
/// Significance 1e-2 for all blocks of all scenes.
#[test]
fn lights_of_no_size_are_seen_once_in_polish() {
    let mut suite = Suite::new(1e-2);
    let point = "type = \"point\"\nposition = [0.0, 3.0, 1.5]\nintensity = 10.0";
    let parallel = "type = \"directional\"\ndirection = [0.3, -1.0, -0.4]\nirradiance = 2.0";
    let steel = "type = \"rough_conductor\"\nalpha = 0.07\npreset = \"gold\"";
    let lacquer = "type = \"rough_plastic\"\nalpha = 0.07\nreflectance = [0.2, 0.3, 0.5]";
    let frosted = "type = \"rough_dielectric\"\nalpha = 0.07\nior = 1.5";
    for (light, material) in [(point, steel), (parallel, lacquer), (point, frosted)] {
        let scene = scene(
            &POLISHED
                .replace("LIGHT", light)
                .replace("MATERIAL", material)
                .replace("PASSES", "1600"),
        );
        is_as_traced(material, &scene, 800, [0.05, 5e-3], &mut suite);
    }
    suite.finish();
}

/// A lamp that rays pass, over a ball of polished metal: light sampling alone would hardly ever hit the lobe.
#[test]
fn lamps_that_rays_pass_are_seen_in_polish() {
    const LAMP: &str = r#"
[image]
width = 24
height = 24
[render]
passes = 256
paths = 2000
radius = 0.02
[camera]
origin = [0, 0, 4]
target = [0, 0, 0]
fov = 24
[materials.MATERIAL]
SURFACE
[materials.polish]
type = "rough_conductor"
alpha = 0.01
preset = "gold"
[materials.floor]
type = "diffuse"
[[shapes]]
type = "sphere"
radius = 0.8
material = "polish"
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{ scale = 3.0 }, { rotate = { axis = [1, 0, 0], angle = -90 } }, { translate = [0, -0.8, 0] }]
[[shapes]]
type = "rectangle"
material = "MATERIAL"
emission = { radiance = 5.0 }
transform = [{ scale = 0.5 }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [0, 2.5, 0.8] }]
"#;
    let mut suite = Suite::new(1e-2);
    let lace = "type = \"diffuse\"\nreflectance = 0.0\nopacity = 0.3";
    for (name, surface) in [
        ("null", "type = \"null\""),
        ("lace", lace),
        ("black", "type = \"diffuse\"\nreflectance = 0.0"),
    ] {
        let scene = scene(&LAMP.replace("MATERIAL", name).replace("SURFACE", surface));
        is_as_traced(name, &scene, 512, [0.05, 1e-2], &mut suite);
    }
    suite.finish();
}

/// Blends of materials of all kinds, lit by a lamp with its caustics: as the path tracer finds them, which follows no
/// photon.
#[test]
fn blends_are_what_the_path_tracer_shows() {
    const BLENDS: &str = r#"
[image]
width = 24
height = 24
[render]
passes = PASSES
paths = 4000
radius = 0.03
[camera]
origin = [0, 0.6, 3.4]
target = [0, 0.1, 0]
fov = 40
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.frosted]
type = "rough_dielectric"
alpha = 0.3
ior = 1.5
[materials.steel]
type = "rough_conductor"
alpha = 0.05
preset = "iridium"
[materials.lacquer]
type = "plastic"
reflectance = [0.2, 0.4, 0.6]
[materials.clay]
type = "diffuse"
reflectance = [0.7, 0.4, 0.3]
[materials.mixed]
type = "blend"
materials = MATERIALS
weight = WEIGHT
[materials.wall]
type = "diffuse"
reflectance = 0.6
[[shapes]]
type = "sphere"
center = [0, 0.1, 0]
radius = 0.6
material = "mixed"
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
transform = [{ scale = [2, 2, 4] }, { translate = [0, 1.5, 0] }]
[[shapes]]
type = "sphere"
center = [0.8, 2.2, 0.7]
radius = 0.3
emission = { radiance = 8.0 }
"#;
    let mut suite = Suite::new(1e-2);
    let cases = [
        ("[\"glass\", \"clay\"]", "0.4"),
        ("[\"frosted\", \"steel\"]", "0.5"),
        (
            "[\"clay\", \"lacquer\"]",
            "{ checkerboard = [0.2, 0.9], uv = [{ scale = [8, 4, 1] }] }",
        ),
        ("[\"steel\", \"glass\"]", "0.5"),
    ];
    for (materials, weight) in cases {
        let scene = scene(
            &BLENDS
                .replace("MATERIALS", materials)
                .replace("WEIGHT", weight)
                .replace("PASSES", "400"),
        );
        is_as_traced(materials, &scene, 800, [0.08, 1e-2], &mut suite);
    }
    suite.finish();
}
