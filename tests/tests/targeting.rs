//! Photon targeting: it changes the noise of the picture and nothing else.

#![allow(clippy::unwrap_used)]

use beamfarm_shared::light::{EmissionSample, EmissionUniforms};
use beamfarm_shared::math::{Frame, Vec2, Vec3};
use beamfarm_shared::pass::render_pass;
use beamfarm_shared::plan::{RenderPlan, Scene};
use beamfarm_shared::sampler::{Purpose, Sampler};
use beamfarm_shared::warp;
use beamfarm_tests::quadrature::Rect;
use beamfarm_tests::render::{Blocks, scene};
use beamfarm_tests::z_test::two_sided;
use beamfarm_tests::{Chi2, MeanEstimate};

/// A room with a window on the right of the wall ahead, and perhaps one on the left, in a world that is much larger. Radii are
/// given: the bias of a pass is the same however its photons are aimed.
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
passes = 24
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
/// Emits inwards, all around.
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

fn plan(scene: &Scene) -> RenderPlan {
    RenderPlan::new(scene, scene.description().defaults.job_settings())
}

/// Means over blocks of 4 x 4 pixels of the passes.
fn passes(scene: &Scene, plan: &RenderPlan) -> Blocks {
    let passes = 0..scene.description().defaults.passes;
    Blocks::new(passes.map(|i| render_pass(scene, plan, i).film), 4)
}

/// All means are the same at a significance of 1e-3 for all of them together (Šidák).
#[track_caller]
fn same(what: &str, a: &Blocks, b: &Blocks) {
    let pairs: Vec<_> = (a.blocks.iter().zip(&b.blocks))
        .flat_map(|(a, b)| a.iter().zip(b))
        .chain(a.whole.iter().zip(&b.whole))
        .collect();
    let threshold = 1.0 - libm::pow(1.0 - 1e-3, 1.0 / pairs.len() as f64);
    assert!(pairs.iter().any(|(a, _)| a.mean() > 0.0), "{what}: black");
    for (i, (a, b)) in pairs.iter().enumerate() {
        assert!(
            a.p_value_same(b) > threshold,
            "{what}, value {i}: {:.5} ± {:.5} and {:.5} ± {:.5}",
            a.mean(),
            a.std_error(),
            b.mean(),
            b.std_error()
        );
    }
}

/// Variance of the picture's blocks over that of another's.
fn noise(a: &Blocks, b: &Blocks) -> f64 {
    let sum = |of: &Blocks| -> f64 { of.blocks.iter().flatten().map(|m| m.variance()).sum() };
    sum(a) / sum(b)
}

/// Every kind of light, and media, by one window: the same picture, with less noise.
#[test]
fn pictures_are_the_same_with_less_noise() {
    let lights = [
        ("sky", SKY),
        ("sun", SUN),
        ("spot", SPOT),
        ("point", POINT),
        ("lamp", LAMP),
        ("lamp and fog", LAMP_AND_FOG),
        ("sun and smoke", SUN_AND_SMOKE),
    ];
    for (what, more) in lights {
        let [off, on] = ["off", "on"].map(|targeting| {
            let left_window = false;
            let scene = Room {
                targeting,
                left_window,
                more,
            }
            .scene();
            let plan = plan(&scene);
            assert_eq!(plan.targets.is_some(), targeting == "on", "{what}");
            passes(&scene, &plan)
        });
        same(what, &on, &off);
        let noise = noise(&on, &off);
        println!("{what}: {noise:.3} times the variance");
        assert!(noise < 0.9, "{what}: {noise} times the variance");
    }
}

/// Targets of the same room with one of its windows walled up know nothing of the light that comes through that.
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
        let mut ignorant = plan(&on);
        ignorant.targets = plan(&walled_up).targets;
        assert!(ignorant.targets.is_some());
        same(what, &passes(&on, &ignorant), &passes(&off, &plan(&off)));
    }
}

/// The lamp's photons pass a board before the window, those of walls pass the pane.
#[test]
fn targeted_photons_obey_visibility_rules() {
    for (what, light) in [("sun", SUN), ("lamp", LAMP)] {
        let more = &format!("{light}{RULES}");
        let [off, on] = ["off", "on"].map(|targeting| {
            let left_window = false;
            let scene = Room {
                targeting,
                left_window,
                more,
            }
            .scene();
            assert!(scene.description().rules.as_ref().unwrap().touches_photons);
            let plan = plan(&scene);
            assert_eq!(plan.targets.is_some(), targeting == "on", "{what}");
            passes(&scene, &plan)
        });
        same(what, &on, &off);
        let noise = noise(&on, &off);
        println!("{what}, ruled: {noise:.3} times the variance");
        assert!(noise < 0.9, "{what}: {noise} times the variance");
    }
}

/// Flux by where the photons start and where they go is that of plain emission, at a significance of 1e-3 for all together
/// (Šidák).
#[test]
fn flux_is_that_of_the_light() {
    for (what, more) in [
        ("sky", SKY),
        ("sun", SUN),
        ("spot", SPOT),
        ("point", POINT),
        ("lamp", LAMP),
    ] {
        let room = Room {
            targeting: "on",
            left_window: true,
            more,
        };
        let scene = room.scene();
        let plan = plan(&scene);
        let description = scene.description();
        let (objects, bounds) = (&description.objects, &description.bounds);
        let light = &description.lights[0];
        let aim = plan.targets.as_ref().unwrap().of(0).unwrap();
        const BINS: usize = 65;
        let bin = |start: &EmissionSample| {
            let side = |x: f32, bit: usize| usize::from(x > 0.0) << bit;
            let line = start.origin + start.dir * bounds.radius - bounds.center;
            let d = start.dir;
            side(d.x, 0)
                + side(d.y, 1)
                + side(d.z, 2)
                + side(line.x, 3)
                + side(line.y, 4)
                + side(line.z, 5)
        };
        let mut means = [[MeanEstimate::new(); BINS]; 2];
        let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
        for _ in 0..200_000 {
            let plain =
                light.sample_emission(objects, bounds, EmissionUniforms::draw(&mut sampler));
            let u = EmissionUniforms::draw(&mut sampler);
            let mixed = light.sample_mixture(objects, bounds, aim, u, sampler.next_1d());
            for (means, start) in means.iter_mut().zip([Some(plain), mixed]) {
                let at = start.map(|start| (bin(&start), f64::from(start.power.x)));
                for (i, mean) in means.iter_mut().enumerate() {
                    mean.add(match at {
                        Some((_, power)) if i == BINS - 1 => power,
                        Some((bin, power)) if i == bin => power,
                        _ => 0.0,
                    });
                }
            }
        }
        let threshold = 1.0 - libm::pow(1.0 - 1e-3, 1.0 / BINS as f64);
        let [plain, mixed] = &means;
        for (i, (a, b)) in plain.iter().zip(mixed).enumerate() {
            assert!(
                a.p_value_same(b) > threshold,
                "{what}, bin {i}: {:.5} ± {:.5} and {:.5} ± {:.5}",
                a.mean(),
                a.std_error(),
                b.mean(),
                b.std_error()
            );
        }
        let power = f64::from(light.power(objects, bounds).x);
        let total = &mixed[BINS - 1];
        assert!(
            total.p_value(power) > 1e-4,
            "{what}: {} of {power}",
            total.mean()
        );
    }
}

/// How many of a sampler's directions lie in caps around some of them, against the density integrated by even directions there:
/// discs seen from the side make densities too narrow for a quadrature over the sphere. Significance 1e-3.
fn caps_hold_what_their_density_says(
    what: &str,
    draw: impl Fn(&mut Sampler) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) {
    const CAPS: usize = 200;
    let mut sampler = Sampler::new(7, 1, Purpose::Test, 0);
    let caps: Vec<Vec3> = (0..)
        .find_map(|_| {
            let drawn: Vec<Vec3> = (0..CAPS * 4).filter_map(|_| draw(&mut sampler)).collect();
            (drawn.len() >= CAPS).then(|| drawn[..CAPS].to_vec())
        })
        .unwrap();
    let drawn: Vec<Option<Vec3>> = (0..200_000).map(|_| draw(&mut sampler)).collect();
    let threshold = 1.0 - libm::pow(1.0 - 1e-3, 1.0 / CAPS as f64);
    let least = libm::cosf(0.05);
    let size = 2.0 * std::f64::consts::PI * (1.0 - f64::from(least));
    for cap in caps {
        let inside =
            |dir: &Option<Vec3>| f64::from(u8::from(dir.is_some_and(|d| d.dot(cap) >= least)));
        let counted: MeanEstimate = drawn.iter().map(inside).collect();
        let frame = Frame::from_normal(cap);
        let even = |_| frame.to_world(warp::uniform_cone(sampler.next_2d(), least));
        let integral: MeanEstimate = (0..20_000)
            .map(even)
            .map(|dir| size * f64::from(pdf(dir)))
            .collect();
        assert!(
            counted.p_value_same(&integral) > threshold,
            "{what}, around {cap}: {:e} +- {:e} and {:e} +- {:e}",
            counted.mean(),
            counted.std_error(),
            integral.mean(),
            integral.std_error()
        );
    }
}

/// Directions from lights that are somewhere, and points across the sun's rays, follow the density that weighs them. Each test
/// at a significance of 1e-3.
#[test]
fn starts_follow_their_density() {
    for (what, more) in [("spot", SPOT), ("point", POINT), ("lamp", LAMP)] {
        let scene = Room {
            targeting: "on",
            left_window: true,
            more,
        }
        .scene();
        let plan = plan(&scene);
        let description = scene.description();
        let (objects, bounds) = (&description.objects, &description.bounds);
        let light = &description.lights[0];
        let aim = plan.targets.as_ref().unwrap().of(0).unwrap();
        // One point of the lamp.
        let draw = |sampler: &mut Sampler| {
            let u = EmissionUniforms {
                position: Vec2::new(0.7, 0.53),
                primitive: 0.5,
                direction: sampler.next_2d(),
            };
            light.sample_mixture(objects, bounds, aim, u, sampler.next_1d())
        };
        let one = (0..)
            .find_map(|i| draw(&mut Sampler::new(1, 1, Purpose::Test, i)))
            .unwrap();
        let pdf = |dir: Vec3| light.mixture_pdf(bounds, aim, &EmissionSample { dir, ..one });
        caps_hold_what_their_density_says(what, |s| draw(s).map(|start| start.dir), pdf);
    }
    let scene = Room {
        targeting: "on",
        left_window: true,
        more: SUN,
    }
    .scene();
    let plan = plan(&scene);
    let description = scene.description();
    let (objects, bounds) = (&description.objects, &description.bounds);
    let light = &description.lights[0];
    let aim = plan.targets.as_ref().unwrap().of(0).unwrap();
    let draw = |sampler: &mut Sampler| {
        let u = EmissionUniforms::draw(sampler);
        light.sample_mixture(objects, bounds, aim, u, sampler.next_1d())
    };
    let one = draw(&mut Sampler::new(1, 1, Purpose::Test, 0)).unwrap();
    let frame = beamfarm_shared::math::Frame::from_normal(one.dir);
    let middle = bounds.center - one.dir * bounds.radius;
    let to_plane = |start: EmissionSample| frame.to_local(start.origin - middle).truncate();
    let pdf = |p: Vec2| {
        if p.length() > bounds.radius {
            return 0.0;
        }
        let origin = middle + frame.to_world(p.extend(0.0));
        light.mixture_pdf(bounds, aim, &EmissionSample { origin, ..one })
    };
    let side = (-f64::from(bounds.radius), f64::from(bounds.radius));
    let domain = Rect { x: side, y: side };
    let result = Chi2::default().plane(domain, |s| draw(s).map(to_plane), pdf);
    assert!(result.p_value > 1e-3, "sun: {result:?}");
}

/// A room with a lamp in a globe of glass over the camera's head, all of whose light comes by photons, and seven rooms like it
/// that the camera does not see, where lamps are as strong.
fn rooms(targeting: &str) -> Scene {
    let room = |i: usize| {
        let x = 3.0 * i as f32;
        format!(
            r#"
[[shapes]]
type = "cube"
material = "wall"
flip_normals = true
transform = [{{ translate = [{x}, 0, 0] }}]
[[shapes]]
type = "sphere"
center = [{x}, 0.4, -0.2]
radius = 0.2
material = "glass"
[[shapes]]
name = "lamp {i}"
type = "sphere"
center = [{x}, 0.4, -0.2]
radius = 0.1
material = "wall"
emission = {{ radiance = [8.0, 6.0, 4.0] }}
"#
        )
    };
    let rooms: String = (0..8).map(room).collect();
    scene(&format!(
        r#"
[image]
width = 16
height = 16
[render]
passes = 24
paths = 4000
radius = 0.25
targeting = "{targeting}"
[camera]
origin = [0.0, -0.3, 0.9]
target = [0.0, -0.7, 0.0]
fov = 80.0
[materials.wall]
type = "diffuse"
reflectance = [0.6, 0.5, 0.4]
[materials.glass]
type = "dielectric"
ior = 1.5
{rooms}
"#
    ))
}

/// Photons start at the lamp that is seen; the picture is that of lamps chosen by their power, with less noise.
#[test]
fn lamps_that_are_seen_get_more_photons() {
    let (off, auto) = (rooms("off"), rooms("auto"));
    let chosen = plan(&auto);
    let told = chosen.to_string();
    let emitters = chosen.targets.as_ref().and_then(|t| t.emitters()).unwrap();
    assert!(told.contains("\"lamp 0\" gets"), "{told}");
    let total: f32 = (0..8).map(|light| emitters.pmf(light)).sum();
    assert!((total - 1.0).abs() < 1e-6, "{total}");
    assert!(emitters.pmf(0) > 0.5, "{}", emitters.pmf(0));
    for hidden in 1..8 {
        let by_power = 1.0 / 8.0;
        let pmf = emitters.pmf(hidden);
        assert!(pmf > 0.49 * by_power && pmf < 0.51 * by_power, "{pmf}");
    }
    let (before, after) = (passes(&off, &plan(&off)), passes(&auto, &chosen));
    same("lamps", &after, &before);
    let noise = noise(&after, &before);
    println!("lamps: {noise:.3} times the variance");
    assert!(noise < 0.5, "{noise} times the variance");
}

/// A choice made where the camera saw another lamp than it does: the picture stays.
#[test]
fn a_wrong_choice_of_lamps_loses_no_light() {
    let looks_away = |targeting: &str, room: f32| {
        let mut description = rooms(targeting).description().clone();
        description.camera.position.x += 3.0 * room;
        Scene::new(description)
    };
    let (off, elsewhere) = (looks_away("off", 0.0), looks_away("on", 3.0));
    let mut ignorant = plan(&off);
    ignorant.targets = plan(&elsewhere).targets;
    let emitters = ignorant
        .targets
        .as_ref()
        .and_then(|t| t.emitters())
        .unwrap();
    assert!(emitters.pmf(0) < 0.1 && emitters.pmf(3) > 0.4);
    same(
        "lamps",
        &passes(&off, &ignorant),
        &passes(&off, &plan(&off)),
    );
}

/// Kernels are as wide as fits the room that the camera sees, however large the world is around it; where the room is most of the
/// world, by the world.
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
        (plan(&scene).radii, world)
    };
    let (near, small) = radii(5.0);
    assert_eq!(near.smooth_ceiling, 0.04 * small);
    let (far, world) = radii(40.0);
    let (farther, _) = radii(80.0);
    // The camera sees the room's inside, 2 x 2 x 2, whose box has half a diagonal of 1.73.
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
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let scene = room.scene();
            render_pass(&scene, &plan(&scene), 3).film.pixels
        })
    });
    assert!(films[0] == films[1]);
}

/// Where photons land where they are of use, nothing changes; where they do not, they are aimed unasked.
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
    let (auto_plan, off_plan) = (plan(&auto), plan(&off));
    let told = auto_plan.to_string();
    assert!(told.contains("\"bulb\" lands where it matters"), "{told}");
    assert!(off_plan.to_string().contains("off, says the scene"));
    assert!(
        render_pass(&auto, &auto_plan, 0).film.pixels
            == render_pass(&off, &off_plan, 0).film.pixels
    );

    let room = Room {
        targeting: "auto",
        left_window: false,
        more: SKY,
    }
    .scene();
    let plan = plan(&room);
    let told = plan.to_string();
    assert!(
        plan.targets.is_some() && told.contains("photon targeting"),
        "{told}"
    );
}

/// Photons that miss are dropped: here the targets know of nearly all light, so that little is missing.
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
    let (off_plan, reject_plan) = (plan(&off), plan(&reject));
    let told = reject_plan.to_string();
    assert!(told.contains("BIASED"), "{told}");
    assert!(
        reject_plan
            .targets
            .as_ref()
            .is_some_and(|targets| targets.rejects())
    );
    let (all, kept) = (passes(&off, &off_plan), passes(&reject, &reject_plan));
    for (all, kept) in all.whole.iter().zip(&kept.whole) {
        let z = (kept.mean() - all.mean()) / kept.std_error().hypot(all.std_error());
        assert!(
            two_sided(z) > 1e-4 || z < 0.0,
            "{} of {}",
            kept.mean(),
            all.mean()
        );
        assert!(
            kept.mean() > 0.8 * all.mean(),
            "{} of {}",
            kept.mean(),
            all.mean()
        );
    }
}
