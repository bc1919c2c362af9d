//! Overlapping media without surfaces add up.

use beamfarm_harness::differential::{Effort, examine};
use beamfarm_harness::render::{average, blocks, is_long, reference_images, scene};
use beamfarm_harness::suite::Suite;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::nested::{Outcome, Reason};

/// Boxes of depth 1 in front of a lamp, seen by parallel rays: a row of three pixels.
const VIEW: &str = r#"
image = { width = 6, height = 2 }
render = { passes = 4, paths = 100 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], projection = "orthographic", view_width = 1.5 }
[materials]
edge = { type = "null" }
[[shapes]]
type = "rectangle"
emission = { radiance = 1.0 }
transform = [{ scale = 20 }, { translate = [0, 0, -3] }]
"#;

fn absorbs(name: &str, sigma_a: f64) -> String {
    format!("[media.{name}]\ntype = \"homogeneous\"\nsigma_a = {sigma_a}\nsigma_s = 0.0\n")
}

fn cube(name: &str, medium: &str, at: [f64; 2], more: &str) -> String {
    format!(
        "[[shapes]]\nname = \"{name}\"\ntype = \"cube\"\nmaterial = \"edge\"\ninterior = \"{medium}\"\n{more}\n\
         transform = [{{ scale = 0.5 }}, {{ translate = [{}, 0.0, {}] }}]\n",
        at[0], at[1]
    )
}

/// Pixels of a row at x = -0.625, -0.375, ..., 0.625, by passes and by the path tracer.
fn rows(text: &str) -> [Vec<f64>; 2] {
    let scene = scene(text);
    assert_eq!(scene.misplaced(), [""; 0]);
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    let film = reference_images(&scene, settings, 1, 4).next().unwrap();
    let row = |pixels: &[[f32; 3]]| pixels[..6].iter().map(|p| f64::from(p[1])).collect();
    [row(&average(&scene).beauty.pixels), row(&film.pixels)]
}

fn are_seen(text: &str, depths: [f64; 6]) {
    for row in rows(text) {
        for (seen, depth) in row.iter().zip(depths) {
            let expected = libm::exp(-depth);
            assert!((seen - expected).abs() < 1e-4, "{row:?}, expected {depths:?} in depth");
        }
    }
}

#[test]
fn absorption_adds_up() {
    let media = absorbs("a", 1.0) + &absorbs("b", 0.5);
    for (other, far) in [([0.25, 0.02], 0.5), ([0.25, 0.0], 0.5)] {
        let shapes = cube("a", "a", [-0.25, 0.0], "") + &cube("b", "b", other, "");
        let met = scene(&format!("{VIEW}{media}{shapes}")).meeting_solids().to_vec();
        assert_eq!(met[0].outcome, Outcome::AddUp { is_exact: true });
        are_seen(&format!("{VIEW}{media}{shapes}"), [1.0, 1.0, 1.5, 1.5, far, far]);
    }
    // Overlapping along part of the ray.
    let shapes = cube("a", "a", [-0.25, 0.0], "") + &cube("b", "b", [0.25, 0.4], "");
    are_seen(&format!("{VIEW}{media}{shapes}"), [1.0, 1.0, 1.5, 1.5, 0.5, 0.5]);
    // The one that has a priority displaces the other.
    let shapes = cube("a", "a", [-0.25, 0.0], "") + &cube("b", "b", [0.25, 0.4], "priority = 1");
    let met = scene(&format!("{VIEW}{media}{shapes}")).meeting_solids().to_vec();
    assert_eq!(
        met[0].outcome,
        Outcome::GivesWay {
            to: 2,
            reason: Reason::Priority
        }
    );
    are_seen(&format!("{VIEW}{media}{shapes}"), [1.0, 1.0, 0.9, 0.9, 0.5, 0.5]);
    // All in one place, or one within the other.
    let shapes = cube("a", "a", [0.0, 0.0], "") + &cube("b", "b", [0.0, 0.0], "");
    are_seen(&format!("{VIEW}{media}{shapes}"), [0.0, 1.5, 1.5, 1.5, 1.5, 0.0]);
    let small = cube("b", "b", [0.0, 0.0], "").replace("scale = 0.5", "scale = 0.25");
    are_seen(
        &format!("{VIEW}{media}{}{small}", cube("a", "a", [0.0, 0.0], "")),
        [0.0, 1.0, 1.25, 1.25, 1.0, 0.0],
    );
    // A box that names its exterior displaces that, as always.
    let named = small.replace("material", "exterior = \"a\"\nmaterial");
    are_seen(
        &format!("{VIEW}{media}{}{named}", cube("a", "a", [0.0, 0.0], "")),
        [0.0, 1.0, 0.75, 0.75, 1.0, 0.0],
    );
}

#[test]
fn four_add_up() {
    let media = ["a", "b", "c", "d"].map(|name| absorbs(name, 0.25)).concat();
    let shapes = ["a", "b", "c", "d"].iter().zip([-0.5, -0.25, 0.0, 0.25]);
    let shapes: String = shapes.map(|(name, x)| cube(name, name, [x, 0.1 * x], "")).collect();
    // From -1 to 0, -0.75 to 0.25, -0.5 to 0.5, -0.25 to 0.75.
    are_seen(&format!("{VIEW}{media}{shapes}"), [0.5, 0.75, 1.0, 0.75, 0.5, 0.25]);
}

const LIT: &str = r#"
image = { width = 16, height = 16 }
render = { passes = 128, paths = 3000, radius = 0.08 }
camera = { origin = [0.2, 0.8, 3.5], target = [0, 0, 0], fov = 40 }
[materials]
edge = { type = "null" }
[[lights]]
type = "point"
position = [0, 1.2, 0.3]
power = 40
[[shapes]]
type = "rectangle"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 3 }, { translate = [0, -0.8, 0] }]
[media]
a = { type = "homogeneous", sigma_a = 0.2, sigma_s = [0.8, 0.4, 0.2], phase = { type = "hg", g = 0.5 } }
b = { type = "homogeneous", sigma_a = [0.1, 0.3, 0.3], sigma_s = [0.4, 0.2, 0.1], phase = { type = "hg", g = -0.4 } }
twice = { type = "homogeneous", sigma_a = 0.4, sigma_s = [1.6, 0.8, 0.4], phase = { type = "hg", g = 0.5 } }
"#;

fn fog(medium: &str, x: [f64; 2]) -> String {
    let (middle, half) = (0.5 * (x[0] + x[1]), 0.5 * (x[1] - x[0]));
    format!(
        "[[shapes]]\ntype = \"cube\"\nmaterial = \"edge\"\ninterior = \"{medium}\"\n\
         transform = [{{ scale = [{half}, 0.6, 0.6] }}, {{ translate = [{middle}, 0.0, 0.0] }}]\n"
    )
}

/// Two volumes of the same fog make one of twice the density, where they overlap in part or everywhere.
#[test]
fn fog_twice_is_fog_of_twice_the_density() {
    let mut suite = Suite::new(1e-3);
    for (what, two, one) in [
        (
            "all",
            fog("a", [-0.7, 0.7]) + &fog("a", [-0.7, 0.7]),
            fog("twice", [-0.7, 0.7]),
        ),
        (
            "the middle",
            fog("a", [-0.9, 0.3]) + &fog("a", [-0.3, 0.9]),
            fog("a", [-0.9, -0.3]) + &fog("twice", [-0.3, 0.3]) + &fog("a", [0.3, 0.9]),
        ),
    ] {
        let [two, one] = [two, one].map(|shapes| blocks(&scene(&format!("{LIT}{shapes}")), 8));
        suite.same_blocks(what, &two, &one, 0.02);
    }
    suite.finish();
}

/// With two phase functions as well: for every class of light path, and against a medium declared as the sum.
#[test]
fn phase_functions_are_mixed() {
    let overlap = scene(&format!("{LIT}{}{}", fog("a", [-0.9, 0.3]), fog("b", [-0.3, 0.9])));
    assert_eq!(overlap.meeting_solids()[0].outcome, Outcome::AddUp { is_exact: true });
    let media = &overlap.description().media;
    let (Medium::Homogeneous(sum), 4) = (&media[3], media.len()) else {
        panic!("{media:?}")
    };
    let [a, b] = [&media[0], &media[1]];
    for cos in [-0.9, 0.0, 0.7] {
        let expected = a.phase().eval(cos) * 2.0 / 3.0 + b.phase().eval(cos) / 3.0;
        assert!((sum.phase.eval(cos) / expected - 1.0).abs() < 1e-4);
    }
    assert!((sum.sigma_s - a.sigma_s() - b.sigma_s()).length() < 1e-6);
    let effort = Effort {
        images: if is_long() { 48 } else { 12 },
        samples: 16,
        significance: 1e-4,
        seconds: f64::INFINITY,
    };
    let verdict = examine(&overlap, &effort);
    assert!(!verdict.is_fault(), "{verdict}");
}
