//! The program's defaults, on scenes where the other choice is far worse: tens of times the variance for the same time
//! (`beamfarm bench --regret`).

use beamfarm_harness::random_scene::RandomScene;
use beamfarm_harness::render::scene;
use beamfarm_image::job::Technique;
use beamfarm_render::cpu::pass::Cpu;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::estimators::PathEnds;
use beamfarm_render::plan::pilot::{Candidate, Choice, Question};
use beamfarm_render::world::Scene;
use std::time::Duration;

fn chosen(scene: &Scene) -> (Candidate, RenderPlan) {
    let description = scene.description();
    let settings = description.defaults.job_settings();
    let choice = Choice::new(&Cpu, description, Question::new(settings, None)).expect("there is something to choose");
    let best = choice.candidates[choice.best];
    (best, RenderPlan::new(scene, best.settings))
}

/// The sun through a slab of glass in the roof, over an endless floor. Without aiming, one photon in a thousand comes
/// through and a small picture may see none: that is not a noise-free picture.
#[test]
fn the_sun_is_aimed_at_a_pane() {
    let roof = |side: [f32; 3], at: [f32; 3]| {
        format!(
            "[[shapes]]\ntype = \"cube\"\nmaterial = \"floor\"\ntransform = [{{ scale = {side:?} }}, {{ translate = {at:?} }}]\n"
        )
    };
    let text = format!(
        r#"
[image]
width = 480
height = 320
[camera]
origin = [0, 1.5, 0]
target = [0, 0, 0]
up = [0, 0, -1]
fov = 40
[materials.floor]
type = "diffuse"
reflectance = 0.5
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "rectangle"
material = "floor"
transform = [{{ scale = 20 }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
[[shapes]]
type = "cube"
material = "glass"
transform = [{{ scale = [1, 0.05, 1] }}, {{ translate = [0, 2, 0] }}]
{}{}{}{}
[[lights]]
type = "directional"
direction = [0, -1, 0]
irradiance = 3
"#,
        roof([5.0, 0.1, 10.0], [-6.0, 2.0, 0.0]),
        roof([5.0, 0.1, 10.0], [6.0, 2.0, 0.0]),
        roof([1.0, 0.1, 5.0], [0.0, 2.0, 6.0]),
        roof([1.0, 0.1, 5.0], [0.0, 2.0, -6.0]),
    );
    let (candidate, plan) = chosen(&scene(&text));
    assert!(plan.targets.is_some(), "{:?}", candidate.settings);
    assert!(candidate.settings.paths_per_pass > 2000, "{:?}", candidate.settings);
}

/// A distant ball gives nearly all the light, over a mirror. Photons that start all over it hardly ever arrive, and
/// pictures made with them have no noise because they lack its caustics.
#[test]
fn a_plan_that_lacks_the_light_of_others_is_not_taken() {
    for (radius, radiance) in [(5000, 265), (2000, 1600)] {
        let text = format!(
            r#"
[image]
width = 32
height = 32
[camera]
origin = [-808.9, 244.9, 79.15]
target = [0, 96.95, 0]
fov = 31
[materials.gold]
type = "rough_conductor"
preset = "gold"
alpha = 0.004
[materials.paint]
type = "diffuse"
reflectance = [0.22, 0.5, 0.26]
two_sided = true
[render]
passes = 1000
[[shapes]]
type = "rectangle"
material = "gold"
transform = [{{ scale = 5000 }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
[[shapes]]
type = "sphere"
material = "paint"
center = [0, 150, 0]
radius = 100
[[shapes]]
type = "sphere"
center = [-51710, 82240, -45490]
radius = {radius}
emission = {{ radiance = {radiance} }}
[[shapes]]
type = "rectangle"
material = "paint"
emission = {{ radiance = 10 }}
transform = [{{ scale = 100 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [-125, 800, -100] }}]
"#
        );
        let (candidate, plan) = chosen(&scene(&text));
        assert!(
            plan.targets.is_some() || candidate.settings.techniques.caustics == Some(Technique::Paths),
            "{:?}",
            candidate.settings
        );
    }
}

/// A distant lamp over an endless mirror, next to fog and frosted glass: an aimed photon is worth hundreds. Small
/// pictures with plain photons see almost none of the caustics and seem noise-free.
#[test]
fn plain_photons_that_are_rare_are_not_taken_for_few() {
    let (candidate, plan) = chosen(&RandomScene::new(1274).load().unwrap());
    let by_paths = !plan.has_photons();
    assert!(plan.targets.is_some() || by_paths, "{:?}", candidate.settings);
}

/// Fog in a cube of this height around a spot and a lens. A polished corner in a hall of some kilometres, under an open
/// sky. The sky's photons start over the whole hall, a millionth of them near what is seen; a plan that leaves the
/// light of mirrors to them has a picture that is too dark and has little noise. An explicit setting is obeyed.
#[test]
fn light_of_the_sky_is_not_left_to_photons_in_a_huge_hall() {
    let text = r#"
[image]
width = 48
height = 48
[camera]
origin = [6, 6, 2]
target = [0, 0, 0.5]
up = [0, 0, 1]
fov = 30
[materials.polished]
type = "principled"
base_color = 0.1
roughness = 0.1
two_sided = true
[[shapes]]
type = "rectangle"
material = "polished"
transform = [{ scale = [10, 3000, 1] }, { translate = [0, 2900, 0] }]
[[shapes]]
type = "rectangle"
material = "polished"
transform = [{ scale = [3000, 10, 1] }, { rotate = { axis = [1, 0, 0], angle = 90 } }, { translate = [2900, -2, 0] }]
[[shapes]]
type = "sphere"
material = "polished"
center = [0, 0, 0.6]
radius = 0.6
[[lights]]
type = "environment"
radiance = 0.2
[[lights]]
type = "point"
position = [2, 2, 2]
intensity = 5
"#;
    let scene = scene(text);
    let (_, plan) = chosen(&scene);
    assert!(format!("{plan}").contains("by the part that the camera sees"), "{plan}");
    assert_eq!(plan.estimators.ends(), PathEnds::Never, "{plan}");
    let mut settings = scene.description().defaults.job_settings();
    settings.techniques.surfaces = Some(Technique::Photons);
    let choice = Choice::new(&Cpu, scene.description(), Question::new(settings, None)).expect("a choice");
    assert_eq!(choice.settings().techniques.surfaces, Some(Technique::Photons));
}

/// Nor is the light of a dome, two in a hundred thousand of whose photons reach a ball of rough glass in thin fog.
#[test]
fn light_of_a_dome_is_not_left_to_photons() {
    let text = r#"
[image]
width = 32
height = 32
[camera]
origin = [-0.5, 1.4, 2.6]
target = [0, 0, 0]
fov = 56
[materials.bounds]
type = "null"
[materials.frosted]
type = "rough_dielectric"
alpha = 0.16
ior = 1.3
[media.fog]
type = "homogeneous"
sigma_t = [0.07, 0.02, 0.09]
albedo = 0.99
[[shapes]]
type = "sphere"
radius = 5
material = "bounds"
interior = "fog"
[[shapes]]
type = "sphere"
radius = 65
flip_normals = true
emission = { radiance = [0.2, 0.5, 0.3] }
[[shapes]]
type = "sphere"
center = [0, 0.3, -0.2]
radius = 0.27
material = "frosted"
exterior = "fog"
interior = "none"
"#;
    let (_, plan) = chosen(&scene(text));
    assert_eq!(plan.estimators.ends(), PathEnds::Never, "{plan}");
    assert!(!plan.estimators.any_beams(), "{plan}");
}

/// Nor is what fog scatters of it, in a scene a thousand times smaller than the dome.
#[test]
fn light_of_a_dome_in_fog_is_not_left_to_beams() {
    let (_, plan) = chosen(&RandomScene::new(1605).load().unwrap());
    assert!(!plan.estimators.any_beams(), "{plan}");
}

/// The beam of a laser in smoke is not left to paths that scatter inside it by chance, though the lamp that lights the
/// rest is cheaper by paths.
#[test]
fn the_beam_of_a_laser_is_not_left_to_paths() {
    let text = |light: &str| {
        format!(
            r#"
[image]
width = 96
height = 64
[camera]
origin = [0, 1.5, 6]
target = [0, 0.5, 0]
fov = 45
[materials.wall]
type = "diffuse"
reflectance = 0.05
two_sided = true
[media.smoke]
type = "homogeneous"
sigma_a = 0.004
sigma_s = 0.05
[world]
medium = "smoke"
[[shapes]]
type = "cube"
material = "wall"
transform = [{{ scale = [6, 2.5, 7] }}, {{ translate = [0, 2.4, 0] }}]
[[shapes]]
type = "rectangle"
emission = {{ radiance = 0.3 }}
transform = [{{ scale = [1.6, 0.9, 1] }}, {{ look_at = {{ origin = [-2, 3.6, -3], target = [0.3, 0, 0] }} }}]
{light}
"#
        )
    };
    let laser =
        "[[lights]]\ntype = \"laser\"\nposition = [-3, 0.6, 0]\ndirection = [1, 0, 0]\nradius = 0.02\npower = 1";
    let slit = "[[lights]]\ntype = \"spot\"\nposition = [-3, 0.6, 0]\ntarget = [0, 0.6, 0]\ncutoff_angle = 0.3\n\
                intensity = 1000";
    for light in [laser, slit] {
        let (_, plan) = chosen(&scene(&text(light)));
        assert!(plan.beams, "{light}: {plan}");
        assert_ne!(
            plan.settings.techniques.media,
            Some(Technique::Paths),
            "{light}: {plan}"
        );
    }
}

fn fog_box(height: f32) -> String {
    format!(
        r#"
[image]
width = 480
height = 320
[camera]
origin = [0, 2.3, 7.5]
target = [0, 2, 0]
fov = 48
[media.fog]
type = "homogeneous"
sigma_a = 0.04
sigma_s = 0.04
phase = {{ type = "hg", g = 0.4 }}
[materials.grey]
type = "diffuse"
reflectance = 0.7
two_sided = true
[materials.air]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "rectangle"
material = "grey"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = 10 }}]
[[shapes]]
type = "rectangle"
material = "grey"
transform = [{{ scale = 10 }}, {{ translate = [0, 5, -5] }}]
[[shapes]]
type = "cube"
material = "air"
interior = "fog"
transform = [{{ scale = [4.5, {half}, 4.5] }}, {{ translate = [0, {middle}, 0] }}]
[[shapes]]
type = "sphere"
material = "glass"
boundary = false
transform = [{{ scale = [0.35, 1, 1] }}, {{ translate = [-0.6, 2.2, 0] }}]
[[lights]]
type = "spot"
visible = ["reflected", "refracted", "shadow", "photon"]
position = [-3.9, 3.1, 0]
target = [-2.9, 2.84, 0]
intensity = 2000
cutoff_angle = 14.5
"#,
        half = height / 2.0,
        middle = height / 2.0 + 0.05,
    )
}

/// No box is too low for beams to be tried, and rules that hide a lamp from the camera change nothing else.
#[test]
fn fog_around_a_spot_has_beams_in_boxes_of_all_heights() {
    for height in [5.0, 5.7, 8.0, 16.0] {
        let scene = scene(&fog_box(height));
        let (candidate, plan) = chosen(&scene);
        assert!(plan.estimators.any_beams(), "{height}: {:?}", candidate.settings);
        assert_ne!(candidate.settings.techniques.media, Some(Technique::Paths), "{height}");
    }
}

/// A five-second job does not wait for a pilot of four seconds. The limit is counted in work, so that it is the same
/// everywhere.
#[test]
fn short_jobs_have_short_pilots() {
    let scene = scene(&fog_box(8.0));
    let description = scene.description();
    let work = |seconds: u64| {
        let question = Question {
            time: Some(Duration::from_secs(seconds)),
            ..Question::new(description.defaults.job_settings(), None)
        };
        let choice = Choice::new(&Cpu, description, question).expect("there is something to choose");
        choice.work * 1e-9
    };
    let works = [1, 5, 20].map(|seconds| (seconds, work(seconds)));
    for (seconds, work) in works {
        // A fifth of it, and the first pictures of a plan that were begun before the limit.
        assert!(work < 0.2 * seconds as f64 + 0.2, "{seconds} s: {work}");
    }
    assert!(works[2].1 > 2.0 * works[0].1, "{works:?}");
}

/// Nothing is seen: there is nothing to choose by, but every number is set.
#[test]
fn a_dark_picture_has_a_plan() {
    let text = fog_box(5.7).replace("intensity = 2000", "intensity = 1e-30");
    let scene = scene(&text);
    let description = scene.description();
    let question = Question::new(description.defaults.job_settings(), None);
    let choice = Choice::new(&Cpu, description, question);
    let candidates = choice.iter().flat_map(|choice| &choice.candidates);
    for candidate in candidates {
        assert!(candidate.cost().is_finite(), "{candidate:?}");
    }
}
