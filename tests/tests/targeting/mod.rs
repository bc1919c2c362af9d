//! Photon targeting changes the noise of the picture and nothing else.

mod lamps;
mod starts;

use beamfarm_harness::Suite;
use beamfarm_harness::render::{Blocks, images, is_long, plan_of, scene};
use beamfarm_harness::z_test::two_sided;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

/// A room with a window on the right of the wall ahead, and perhaps one on the left, in a much larger world. Radii are
/// given, so the bias of a pass does not depend on how its photons are aimed.
struct Room<'a> {
    targeting: &'a str,
    left_window: bool,
    more: &'a str,
}

impl Room<'_> {
    fn scene(&self) -> Scene {
        let left = match self.left_window {
            true => {
                r#"
    [{ scale = [0.1, 1.2, 0.4] }, { translate = [-1.1, 0, -0.8] }],
    [{ scale = [0.1, 1.2, 0.7] }, { translate = [-1.1, 0, 0.5] }],
    [{ scale = [0.1, 0.4, 0.2] }, { translate = [-1.1, -0.8, -0.3] }],
    [{ scale = [0.1, 0.5, 0.2] }, { translate = [-1.1, 0.7, -0.3] }],
"#
            }
            false => "    [{ scale = [0.1, 1.2, 1.2] }, { translate = [-1.1, 0, 0] }],",
        };
        scene(&format!(
            r#"
[image]
width = 16
height = 16
[render]
passes = 64
paths = 20000
radius = 0.25
targeting = "{}"
[camera]
origin = [0.0, 0.2, 0.9]
target = [0.1, -0.1, 0.0]
fov = 90.0
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
[materials.pane]
type = "thin_dielectric"
ior = 1.5
[materials.air]
type = "null"
[[shapes]]
type = "instances"
name = "walls"
shape = {{ type = "cube", material = "wall" }}
transforms = [
    [{{ scale = [1.2, 0.1, 1.2] }}, {{ translate = [0, -1.1, 0] }}],
    [{{ scale = [1.2, 0.1, 1.2] }}, {{ translate = [0, 1.1, 0] }}],
    [{{ scale = [1.2, 1.2, 0.1] }}, {{ translate = [0, 0, 1.1] }}],
    [{{ scale = [1.2, 1.2, 0.1] }}, {{ translate = [0, 0, -1.1] }}],
    [{{ scale = [0.1, 1.2, 0.4] }}, {{ translate = [1.1, 0, -0.8] }}],
    [{{ scale = [0.1, 1.2, 0.5] }}, {{ translate = [1.1, 0, 0.7] }}],
    [{{ scale = [0.1, 0.5, 0.3] }}, {{ translate = [1.1, -0.7, -0.1] }}],
    [{{ scale = [0.1, 0.3, 0.3] }}, {{ translate = [1.1, 0.9, -0.1] }}],
{}
]
[[shapes]]
name = "right pane"
type = "rectangle"
material = "pane"
transform = [{{ scale = [0.3, 0.4, 1] }}, {{ rotate = {{ axis = [0, 1, 0], angle = 90 }} }}, {{ translate = [1.1, 0.2, -0.1] }}]
[[shapes]]
name = "left pane"
type = "rectangle"
material = "pane"
transform = [{{ scale = [0.2, 0.3, 1] }}, {{ rotate = {{ axis = [0, 1, 0], angle = 90 }} }}, {{ translate = [-1.1, -0.1, -0.3] }}]
[[shapes]]
name = "far away"
type = "sphere"
center = [5, 0, 0]
radius = 0.4
material = "wall"
{}
"#,
            self.targeting, left, self.more
        ))
    }
}

const SKY: &str = r#"
[[lights]]
name = "light"
type = "environment"
radiance = [1.0, 1.5, 2.0]
"#;
const SUN: &str = r#"
[[lights]]
name = "light"
type = "directional"
direction = [-1.0, -0.4, 0.2]
irradiance = [3.0, 2.5, 2.0]
"#;
const SPOT: &str = r#"
[[lights]]
name = "light"
type = "spot"
position = [5.0, 1.5, -1.0]
target = [0.0, 0.0, 0.0]
cutoff_angle = 70.0
beam_width = 10.0
intensity = 60.0
"#;
/// A sun with an angular size, and a spot that is a ball.
const WIDE_SUN: &str = r#"
[[lights]]
name = "light"
type = "directional"
direction = [-1.0, -0.4, 0.2]
irradiance = [3.0, 2.5, 2.0]
angle = 15.0
"#;
const BALL: &str = r#"
[[lights]]
name = "light"
type = "spot"
position = [5.0, 1.5, -1.0]
target = [0.0, 0.0, 0.0]
cutoff_angle = 70.0
beam_width = 10.0
intensity = 60.0
radius = 0.5
falloff = "smooth"
"#;
const POINT: &str = r#"
[[lights]]
name = "light"
type = "point"
position = [4.0, 1.5, -1.0]
intensity = 40.0
"#;
const LAMP: &str = r#"
[[shapes]]
name = "light"
type = "sphere"
center = [4.0, 1.0, -0.5]
radius = 0.4
emission = { radiance = 20.0 }
"#;
/// A dome that emits inwards, all around.
const DOME: &str = r#"
[[shapes]]
name = "light"
type = "sphere"
center = [4.0, 0.0, 0.0]
radius = 12.0
flip_normals = true
emission = { radiance = 2.0 }
"#;
const LAMP_AND_FOG: &str = r#"
[[shapes]]
name = "light"
type = "disc"
emission = { radiance = 40.0 }
transform = [{ scale = 0.5 }, { rotate = { axis = [0, 1, 0], angle = -90 } }, { translate = [4.0, 0.6, -0.5] }]
[[shapes]]
type = "cube"
material = "air"
interior = "fog"
transform = [{ scale = [0.9, 0.9, 0.7] }, { translate = [0, 0, -0.15] }]
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = 0.6
phase = { type = "hg", g = 0.5 }
"#;
const SUN_AND_SMOKE: &str = r#"
[[lights]]
name = "light"
type = "directional"
direction = [-1.0, -0.4, 0.2]
irradiance = 4.0
[[shapes]]
type = "cube"
material = "air"
interior = "smoke"
transform = [{ scale = [0.9, 0.9, 0.7] }, { translate = [0, 0, -0.15] }]
[media.smoke]
type = "heterogeneous"
sigma_t = 1.5
albedo = 0.9
[media.smoke.density]
min = [-0.9, -0.9, -0.9]
max = [0.9, 0.9, 0.6]
voxel = 0.2
noise = { size = 0.8 }
"#;
const RULES: &str = r#"
[[shapes]]
name = "board"
type = "rectangle"
material = "wall"
transform = [{ scale = 0.5 }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [1.5, 0.2, -0.1] }]
[[rules]]
on = ["light"]
rays = ["photon"]
exclude = ["board"]
[[rules]]
on = ["walls"]
rays = ["photon"]
exclude = ["right pane"]
"#;

/// Means over blocks of 4 x 4 pixels of the passes.
fn passes(scene: &Scene, plan: &RenderPlan) -> Blocks {
    let passes = 0..images(scene.description().defaults.passes);
    Blocks::new(passes.map(|i| render_pass(scene, plan, i).expect("a pass").film), 4)
}

/// All means are the same at a significance of 1e-3 for all of them together.
#[track_caller]
fn same(what: &str, a: &Blocks, b: &Blocks) {
    let mut suite = Suite::new(1e-3);
    suite.same_blocks(what, a, b, 0.0);
    suite.finish();
}

/// Ratio of the variances of two pictures' blocks.
fn noise(a: &Blocks, b: &Blocks) -> f64 {
    let sum = |of: &Blocks| -> f64 { of.blocks.iter().flatten().map(|m| m.variance()).sum() };
    sum(a) / sum(b)
}

/// The same picture with targets and without, with less noise. Returns the room.
fn targets_lower_the_noise(what: &str, more: &str) -> Scene {
    let [(off, _), (on, scene)] = ["off", "on"].map(|targeting| {
        let left_window = false;
        let scene = Room {
            targeting,
            left_window,
            more,
        }
        .scene();
        let plan = plan_of(&scene);
        assert_eq!(plan.targets.is_some(), targeting == "on", "{what}");
        (passes(&scene, &plan), scene)
    });
    same(what, &on, &off);
    let noise = noise(&on, &off);
    println!("{what}: {noise:.3} times the variance");
    assert!(noise < 0.9, "{what}: {noise} times the variance");
    scene
}

/// Every kind of light, and media, through one window: the same picture with less noise.
#[test]
fn pictures_are_the_same_with_less_noise() {
    let lights = [
        ("sky", SKY),
        ("sun", SUN),
        ("spot", SPOT),
        ("wide sun", WIDE_SUN),
        ("spot of a ball", BALL),
        ("point", POINT),
        ("lamp", LAMP),
        ("lamp and fog", LAMP_AND_FOG),
        ("sun and smoke", SUN_AND_SMOKE),
    ];
    for (what, more) in lights {
        // The other cases cover what these lights have in common with them.
        if ["sun", "spot", "wide sun", "lamp"].contains(&what) && !is_long() {
            continue;
        }
        targets_lower_the_noise(what, more);
    }
}

/// Targets found with one of the windows walled up know nothing of the light through it.
#[test]
fn light_that_the_targets_do_not_know_of_is_not_lost() {
    for (what, more) in [("sky", SKY), ("dome", DOME)] {
        let room = |targeting, left_window: bool| {
            Room {
                targeting,
                left_window,
                more,
            }
            .scene()
        };
        let (off, on, walled_up) = (room("off", true), room("on", true), room("on", false));
        let mut ignorant = plan_of(&on);
        ignorant.targets = plan_of(&walled_up).targets;
        assert!(ignorant.targets.is_some());
        same(what, &passes(&on, &ignorant), &passes(&off, &plan_of(&off)));
    }
}

/// The lamp's photons pass a board in front of the window; the walls' photons pass the pane.
#[test]
fn targeted_photons_obey_visibility_rules() {
    for (what, light) in [("sun", SUN), ("lamp", LAMP)] {
        let scene = targets_lower_the_noise(what, &format!("{light}{RULES}"));
        assert!(scene.description().rules.as_ref().unwrap().touches_photons);
    }
}

/// Kernels fit the room that the camera sees, however large the world around it is. Where the room is most of the
/// world, the world decides.
#[test]
fn kernels_fit_what_the_camera_sees() {
    let radii = |distance: f32| {
        let more = &format!(
            r#"{SUN}
[[shapes]]
type = "sphere"
center = [{distance}, 0, 0]
radius = 0.4
material = "wall"
"#
        );
        let room = Room {
            targeting: "auto",
            left_window: false,
            more,
        };
        let mut description = room.scene().description().clone();
        description.defaults.radius = None;
        let world = description.bounds.radius;
        let scene = Scene::new(description);
        (plan_of(&scene).radii, world)
    };
    let (near, small) = radii(5.0);
    assert_eq!(near.smooth_ceiling, 0.04 * small);
    let (far, world) = radii(40.0);
    let (farther, _) = radii(80.0);
    // The camera sees the room's inside, 2 x 2 x 2, whose box has a half diagonal of 1.73.
    let seen = far.smooth_ceiling / 0.08;
    assert!(seen > 1.0 && seen < 1.74, "{seen} of {world}");
    for (a, b) in [
        (far.floor, farther.floor),
        (far.ceiling, farther.ceiling),
        (far.smooth_ceiling, farther.smooth_ceiling),
    ] {
        assert!((a / b - 1.0).abs() < 1e-4, "{a} and {b}");
    }
}

#[test]
fn any_number_of_threads_makes_the_same_targets_and_bits() {
    let room = Room {
        targeting: "on",
        left_window: true,
        more: LAMP_AND_FOG,
    };
    let films = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let scene = room.scene();
            render_pass(&scene, &plan_of(&scene), 3).expect("a pass").film.pixels
        })
    });
    assert!(films[0] == films[1]);
}

/// Where photons already land where they are useful, nothing changes; where they do not, they are aimed by default.
#[test]
fn it_is_off_by_itself_where_nothing_is_gained() {
    let open = |targeting: &str| {
        scene(&format!(
            r#"
[image]
width = 16
height = 12
[render]
paths = 2000
targeting = "{targeting}"
[world]
medium = "haze"
[media.haze]
type = "homogeneous"
sigma_t = 0.05
albedo = 0.9
[camera]
origin = [0.0, 0.5, 4.0]
target = [0.0, 0.0, 0.0]
fov = 45.0
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "sphere"
radius = 0.7
material = "glass"
[[shapes]]
type = "cube"
flip_normals = true
transform = [{{ scale = 4.5 }}]
[[lights]]
name = "bulb"
type = "point"
position = [2, 2, 1]
power = 100
"#
        ))
    };
    let (auto, off) = (open("auto"), open("off"));
    let (auto_plan, off_plan) = (plan_of(&auto), plan_of(&off));
    let told = auto_plan.to_string();
    assert!(told.contains("\"bulb\" gains too little by aiming"), "{told}");
    assert!(off_plan.targets.is_none());
    assert!(
        render_pass(&auto, &auto_plan, 0).expect("a pass").film.pixels
            == render_pass(&off, &off_plan, 0).expect("a pass").film.pixels
    );

    let room = Room {
        targeting: "auto",
        left_window: false,
        more: SKY,
    }
    .scene();
    let plan = plan_of(&room);
    let told = plan.to_string();
    assert!(plan.targets.is_some() && told.contains("photon targeting"), "{told}");
}

/// Photons that miss are dropped. Here the targets know of nearly all light, so little is lost.
#[test]
fn rejection_is_biased_and_says_so() {
    let room = |targeting| {
        let left_window = false;
        Room {
            targeting,
            left_window,
            more: SKY,
        }
        .scene()
    };
    let (off, reject) = (room("off"), room("reject"));
    let (off_plan, reject_plan) = (plan_of(&off), plan_of(&reject));
    let told = reject_plan.to_string();
    assert!(told.contains("BIASED"), "{told}");
    assert!(reject_plan.targets.as_ref().is_some_and(|targets| targets.rejects()));
    let (all, kept) = (passes(&off, &off_plan), passes(&reject, &reject_plan));
    for (all, kept) in all.whole.iter().zip(&kept.whole) {
        let z = (kept.mean() - all.mean()) / kept.std_error().hypot(all.std_error());
        assert!(two_sided(z) > 1e-4 || z < 0.0, "{} of {}", kept.mean(), all.mean());
        assert!(kept.mean() > 0.8 * all.mean(), "{} of {}", kept.mean(), all.mean());
    }
}
