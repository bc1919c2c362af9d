//! Glass, liquids and ice that overlap or touch, against the formulas of plane layers, against the path tracer, and
//! against the same thing in one piece.

use beamfarm_harness::differential::{Effort, examine};
use beamfarm_harness::render::{average, blocks, is_long, reference_images, scene};
use beamfarm_harness::suite::Suite;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::world::Scene;
use beamfarm_render::world::nested::{Meeting, Outcome, Reason};
use beamfarm_scene::{ImportOptions, import};

/// Parallel rays along z through the middle of the objects, in front of a lamp of radiance 1.
const VIEW: &str = r#"
image = { width = 8, height = 8 }
render = { passes = 64, paths = 1000 }
camera = { origin = [0.013, 0.017, 9], target = [0.013, 0.017, 0], projection = "orthographic", view_width = 0.4 }
[materials]
glass = { type = "dielectric", ior = 1.5 }
water = { type = "dielectric", ior = 1.33 }
ice = { type = "dielectric", ior = 1.31 }
ice_in_water = { type = "dielectric", ior = 1.31, exterior_ior = 1.33 }
[media.juice]
type = "homogeneous"
sigma_a = [0.1, 0.6, 1.2]
sigma_s = 0.0
[[shapes]]
type = "rectangle"
emission = { radiance = 1.0 }
transform = [{ scale = 50 }, { translate = [0, 0, -5] }]
"#;

const ABSORBED: [f64; 3] = [0.1, 0.6, 1.2];

/// A box from `z[0]` to `z[1]`, of the given width.
fn slab(name: &str, z: [f64; 2], half: f64, more: &str) -> String {
    let (middle, thick) = (0.5 * (z[0] + z[1]), 0.5 * (z[1] - z[0]));
    format!(
        "[[shapes]]\nname = \"{name}\"\ntype = \"cube\"\n{more}\n\
         transform = [{{ scale = [{half}, {half}, {thick}] }}, {{ translate = [0, 0, {middle}] }}]\n"
    )
}

fn walls() -> String {
    slab("front", [1.0, 1.3], 1.5, "material = \"glass\"") + &slab("back", [-1.3, -1.0], 1.5, "material = \"glass\"")
}

fn juice(z: f64, more: &str) -> String {
    slab(
        "juice",
        [-z, z],
        1.2,
        &format!("material = \"water\"\ninterior = \"juice\"\n{more}"),
    )
}

/// What passes plane layers, each with an index, absorption and thickness, including all internal reflections.
fn through(layers: &[(f64, f64, f64)]) -> f64 {
    let (mut index, mut back, mut sum) = (1.0, 0.0, 1.0);
    let ends = [(1.0, 0.0, 0.0)];
    for &(next, absorption, thickness) in layers.iter().chain(&ends) {
        let r = ((next - index) / (next + index)) * ((next - index) / (next + index));
        let left = 1.0 - back * r;
        (sum, back) = (sum * (1.0 - r) / left, r + (1.0 - r) * (1.0 - r) * back / left);
        let once = libm::exp(-absorption * thickness);
        (sum, back) = (sum * once, back * once * once);
        index = next;
    }
    sum
}

fn seen(scene: &Scene) -> [Rgb; 2] {
    let settings = ReferenceSettings {
        seed: 1,
        max_depth: None,
    };
    let mean = |pixels: &[[f32; 3]]| {
        let sum: Rgb = pixels.iter().map(|p| Rgb::from_array(*p)).sum();
        sum / pixels.len() as f32
    };
    let mut by_paths = Rgb::ZERO;
    for film in reference_images(scene, settings, 8, 16) {
        by_paths += mean(&film.pixels) / 8.0;
    }
    [by_paths, mean(&average(scene).beauty.pixels)]
}

/// Layers, with absorption as a share of the juice's.
fn is_seen(what: &str, shapes: &str, layers: &[(f64, f64, f64)]) {
    let scene = scene(&format!("{VIEW}{shapes}"));
    for (by, seen) in ["the path tracer", "passes"].into_iter().zip(seen(&scene)) {
        for (channel, absorption) in ABSORBED.into_iter().enumerate() {
            let layers: Vec<_> = layers
                .iter()
                .map(|(index, share, thick)| (*index, share * absorption, *thick))
                .collect();
            let expected = through(&layers);
            assert!(
                (f64::from(seen[channel]) - expected).abs() < 0.02,
                "{what}, by {by}: {seen}, expected {expected} in channel {channel}"
            );
        }
    }
}

const GLASS: (f64, f64, f64) = (1.5, 0.0, 0.3);

#[test]
fn liquids_end_at_their_glass() {
    let between = [GLASS, (1.33, 1.0, 2.0), GLASS];
    is_seen("overlap", &(walls() + &juice(1.15, "")), &between);
    is_seen("first the juice", &(juice(1.15, "") + &walls()), &between);
    is_seen("touch", &(walls() + &juice(1.0, "")), &between);
    let all = slab(
        "in all of it",
        [-1.3, 1.3],
        1.2,
        "material = \"water\"\ninterior = \"juice\"",
    );
    is_seen("as thick as the walls", &(walls() + &all), &between);
    let air = (1.0, 0.0, 0.01);
    let apart = [GLASS, air, (1.33, 1.0, 1.98), air, GLASS];
    is_seen("gap", &(walls() + &juice(0.99, "")), &apart);
    // The walls cut it.
    let cut = (1.5, 0.0, 0.15);
    is_seen(
        "priority",
        &(walls() + &juice(1.15, "priority = 1")),
        &[cut, (1.33, 1.0, 2.3), cut],
    );
    let lower = walls().replace("material", "priority = -1\nmaterial");
    is_seen("lower", &(lower + &juice(1.15, "")), &[cut, (1.33, 1.0, 2.3), cut]);
    let keeps = walls().replace("material", "boundary = false\nmaterial");
    is_seen("no boundary", &(keeps.clone() + &juice(1.15, "")), &between);
    is_seen("no boundary, touch", &(keeps + &juice(1.0, "")), &between);
    // Placed by other transforms.
    let mirrored = juice(1.15, "").replace("transform = [", "transform = [{ scale = [1, 1, -1] }, ");
    is_seen("mirrored", &(walls() + &mirrored), &between);
    let copied = walls()
        .replace(
            "type = \"cube\"\nmaterial = \"glass\"\ntransform = [",
            "type = \"instances\"\n\
         shape = { type = \"cube\", material = \"glass\" }\ntransforms = [[",
        )
        .replace("]}]\n", "]}]]\n");
    assert!(copied.contains("instances"));
    let copied = copied.replace(" }]\n", " }]]\n");
    is_seen("instances", &(copied + &juice(1.15, "")), &between);
}

#[test]
fn what_is_of_one_index_has_no_surface_within() {
    let oil = juice(1.15, "").replace("\"water\"", "\"glass\"");
    is_seen("oil in glass", &(walls() + &oil), &[GLASS, (1.5, 1.0, 2.0), GLASS]);
    let block =
        slab("a", [-1.0, 0.3], 1.0, "material = \"glass\"") + &slab("b", [-0.2, 1.0], 1.1, "material = \"glass\"");
    is_seen("two blocks", &block, &[(1.5, 0.0, 2.0)]);
}

/// Floating ice, in the middle or at the wall.
#[test]
fn three_solids_meet() {
    for (z, layers) in [
        (
            [-0.5, 0.4],
            &[GLASS, (1.33, 1.0, 0.6), (1.31, 0.0, 0.9), (1.33, 1.0, 0.5), GLASS][..],
        ),
        ([-0.5, 1.0], &[GLASS, (1.31, 0.0, 1.5), (1.33, 1.0, 0.5), GLASS]),
        ([-0.5, 1.1], &[GLASS, (1.31, 0.0, 1.5), (1.33, 1.0, 0.5), GLASS]),
    ] {
        for overlap in [1.0, 1.15] {
            let shapes = [slab("ice", z, 1.4, "material = \"ice\""), walls(), juice(overlap, "")];
            is_seen(&format!("{z:?} {overlap}"), &shapes.concat(), layers);
        }
    }
    // Submerged ice, its index given relative to the water or not; its priority says that it is there.
    for ice in ["ice", "ice_in_water"] {
        let ice = slab("ice", [-0.5, 0.4], 0.9, &format!("material = \"{ice}\"\npriority = 1"));
        let layers = [GLASS, (1.33, 1.0, 0.6), (1.31, 0.0, 0.9), (1.33, 1.0, 0.5), GLASS];
        is_seen("submerged", &(walls() + &juice(1.15, "") + &ice), &layers);
    }
}

/// A bubble is not lost in an object that has a priority for other reasons.
#[test]
fn bubbles_are_what_they_say() {
    let bubble = slab("bubble", [-0.5, 0.5], 0.9, "material = \"bubble\"");
    let bubble = format!("[materials.bubble]\ntype = \"dielectric\"\nior = 1\nexterior_ior = 1.5\n{bubble}");
    let layers = [(1.5, 0.0, 0.5), (1.0, 0.0, 1.0), (1.5, 0.0, 0.5)];
    for more in ["", "priority = 1"] {
        let block = slab("block", [-1.0, 1.0], 1.5, &format!("material = \"glass\"\n{more}"));
        is_seen(&format!("bubble {more}"), &(block + &bubble), &layers);
    }
}

#[test]
fn who_gives_way_is_known() {
    let outcome = |shapes: &str| {
        let scene = scene(&format!("{VIEW}{shapes}"));
        let met: Vec<_> = scene.meeting_solids().to_vec();
        let name = |object: u32| scene.description().objects[object as usize].name.clone();
        let outcomes = met.iter().map(|met| match met.outcome {
            Outcome::GivesWay { to, reason } => (met.meeting, name(to), reason),
            other => panic!("{other:?}"),
        });
        outcomes.collect::<Vec<_>>()
    };
    let front = |meeting, reason| {
        [
            (meeting, "front".to_owned(), reason),
            (meeting, "back".to_owned(), reason),
        ]
    };
    assert_eq!(
        outcome(&(walls() + &juice(1.1, ""))),
        front(Meeting::Crossing, Reason::Medium)
    );
    assert_eq!(
        outcome(&(walls() + &juice(1.0, ""))),
        front(Meeting::Touching, Reason::Medium)
    );
    let clear = juice(1.1, "").replace("interior = \"juice\"", "");
    assert_eq!(outcome(&(walls() + &clear)), front(Meeting::Crossing, Reason::Index));
    let cubes = slab("a", [0.0, 1.0], 1.0, "material = \"ice\"") + &slab("b", [0.5, 1.5], 1.1, "material = \"ice\"");
    assert_eq!(outcome(&cubes), [(Meeting::Crossing, "a".to_owned(), Reason::Order)]);
    let upper = cubes.replacen("name = \"b\"", "name = \"b\"\npriority = 3", 1);
    assert_eq!(outcome(&upper), [(Meeting::Crossing, "b".to_owned(), Reason::Priority)]);
}

/// Also for paths that start in there.
#[test]
fn the_medium_is_that_of_what_is_there() {
    for more in ["", "boundary = false\n"] {
        let walls = walls().replace("material", &format!("{more}material"));
        let scene = scene(&format!("{VIEW}{walls}{}", juice(1.15, "")));
        let camera = scene.description().camera.position;
        for (z, expected) in [
            (0.0, Some(0)),
            (0.98, Some(0)),
            (1.05, None),
            (1.2, None),
            (1.35, None),
            (-1.1, None),
        ] {
            // Render space begins at the camera.
            let at = camera + Vec3::new(0.1, 0.2, z - 9.0);
            assert_eq!(scene.medium_at(at), expected, "{z}");
        }
        assert_eq!(scene.misplaced(), [""; 0]);
    }
}

/// A lamp and a ball in water modelled as two boxes, and as one: shadow rays pass boundaries that do not count.
#[test]
fn two_waters_are_one() {
    let scene_of = |water: String| {
        scene(&format!(
            r#"
image = {{ width = 16, height = 16 }}
render = {{ passes = 200, paths = 2000, radius = 0.1 }}
camera = {{ origin = [0, 0, 6], target = [0.6, 0, 0], fov = 8 }}
[materials]
water = {{ type = "dielectric", ior = 1.33 }}
[media.ink]
type = "homogeneous"
sigma_a = [0.1, 0.3, 0.5]
sigma_s = 0.0
[[shapes]]
type = "sphere"
center = [0.6, 0, 0]
radius = 0.4
[[lights]]
type = "point"
position = [-0.6, 0.3, 0.4]
power = 50
{water}"#
        ))
    };
    let water = |x: [f64; 2]| {
        let (middle, half) = (0.5 * (x[0] + x[1]), 0.5 * (x[1] - x[0]));
        format!(
            "[[shapes]]\ntype = \"cube\"\nmaterial = \"water\"\ninterior = \"ink\"\n\
             transform = [{{ scale = [{half}, 1, 1] }}, {{ translate = [{middle}, 0, 0] }}]\n"
        )
    };
    let one = blocks(&scene_of(water([-1.5, 1.5])), 8);
    let two = blocks(&scene_of(water([-1.5, 0.2]) + &water([-0.1, 1.5])), 8);
    assert!(one.whole[0].mean() > 0.01, "{:?}", one.whole);
    let mut suite = Suite::new(1e-3);
    suite.same_blocks("two waters", &one, &two, 0.02);
    suite.finish();
}

/// Light through a ball of glass that reaches into coloured water, on what stands in it and below it: photons and
/// camera paths, for every class of light path.
#[test]
fn photons_agree_with_paths() {
    for (what, ball) in [
        ("clear", "material = \"glass\""),
        ("frosted", "material = \"frosted\""),
        ("lower", "material = \"glass\"\npriority = -1"),
    ] {
        let scene = scene(&format!(
            r#"
image = {{ width = 16, height = 16 }}
render = {{ paths = 4000, radius = 0.05 }}
camera = {{ origin = [0.3, 2.5, 5], target = [0, 0, 0], fov = 45 }}
[materials]
glass = {{ type = "dielectric", ior = 1.6 }}
frosted = {{ type = "rough_dielectric", ior = 1.6, alpha = 0.3 }}
water = {{ type = "dielectric", ior = 1.33 }}
[media.ink]
type = "homogeneous"
sigma_a = [0.1, 0.3, 0.5]
sigma_s = [0.3, 0.2, 0.1]
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = 4 }}, {{ translate = [0, -1.2, 0] }}]
[[shapes]]
type = "cube"
material = "water"
interior = "ink"
transform = [{{ scale = [1.2, 0.6, 1] }}, {{ translate = [0, -0.5, 0] }}]
[[shapes]]
type = "sphere"
center = [0.1, 0.2, 0]
radius = 0.6
{ball}
[[shapes]]
type = "sphere"
center = [-0.7, -0.6, 0.4]
radius = 0.25
[[shapes]]
type = "rectangle"
emission = {{ radiance = 30.0 }}
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ scale = 0.4 }}, {{ translate = [0, 3, 0] }}]
"#
        ));
        let effort = Effort {
            images: if is_long() { 48 } else { 12 },
            samples: 16,
            significance: 1e-4,
            seconds: f64::INFINITY,
        };
        let verdict = examine(&scene, &effort);
        assert!(!verdict.is_fault(), "{what}: {verdict}");
    }
}

/// The same from a Mitsuba file.
#[test]
fn files_of_others_mean_the_same() {
    let cube = |z: [f64; 2], half: f64, index: f64, more: &str| {
        let (middle, thick) = (0.5 * (z[0] + z[1]), 0.5 * (z[1] - z[0]));
        format!(
            r#"<shape type="cube"><transform name="to_world"><scale x="{half}" y="{half}" z="{thick}"/>
            <translate z="{middle}"/></transform>
            <bsdf type="dielectric"><float name="int_ior" value="{index}"/></bsdf>{more}</shape>"#
        )
    };
    let juice = r#"<medium type="homogeneous" name="interior"><rgb name="sigma_t" value="0.05 0.3 0.6"/><float name="scale" value="2"/>
        <float name="albedo" value="0"/></medium>"#;
    let xml = format!(
        r#"<scene version="3.0.0"><integrator type="volpath"/>
        <sensor type="orthographic"><transform name="to_world"><scale x="0.2" y="0.2"/>
            <lookat origin="0.013, 0.017, 9" target="0.013, 0.017, 0" up="0, 1, 0"/></transform>
            <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
        <shape type="rectangle"><transform name="to_world"><scale value="50"/><translate z="-5"/></transform>
            <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>
        {}{}{}</scene>"#,
        cube([1.0, 1.3], 1.5, 1.5, ""),
        cube([-1.3, -1.0], 1.5, 1.5, ""),
        cube([-1.15, 1.15], 1.2, 1.33, juice),
    );
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.xml");
    std::fs::write(&file, xml).unwrap();
    let imported = import(&file, folder.path(), &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let scene = scene(&imported.text);
    for seen in seen(&scene) {
        for (channel, absorption) in ABSORBED.into_iter().enumerate() {
            let expected = through(&[GLASS, (1.33, absorption, 2.0), GLASS]);
            assert!((f64::from(seen[channel]) - expected).abs() < 0.02, "{seen}, {expected}");
        }
    }
}
