//! A scene's heterogeneous media follow the format: densities in their places, and defaults.

use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_image::bundle::Bundle;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::Rgb;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::medium::transmittance::Estimator;
use beamfarm_render::world::medium::{Heterogeneous, Medium};
use beamfarm_render::world::phase::Phase;
use beamfarm_scene::read_bundle;
use glam::DVec3;

/// The camera stands at (0, 0, 5).
const VIEW: &str = "image = { width = 8, height = 4 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 90 }
";

fn volume(name: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/data/volumes");
    std::fs::read(format!("{folder}/{name}")).expect("a volume")
}

fn load(text: &str, volumes: &[&str]) -> SceneDescription {
    let text = format!("{VIEW}{text}");
    let assets = volumes
        .iter()
        .map(|name| (name.to_string(), volume(name)))
        .chain([("scene.toml".to_string(), text.clone().into_bytes())]);
    let bundle = Bundle {
        scene: "scene.toml".to_string(),
        files: assets.collect(),
    };
    beamfarm_scene::load(&bundle).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn heterogeneous(scene: &SceneDescription) -> Vec<&Heterogeneous> {
    let media = scene.media.iter();
    media
        .map(|medium| match medium {
            Medium::Heterogeneous(medium) => medium,
            other => panic!("{other:?}"),
        })
        .collect()
}

/// The medium with this density and these further fields.
fn medium(density: &str, fields: &str, volumes: &[&str]) -> Heterogeneous {
    let text = format!(
        "[media.cloud]\ntype = \"heterogeneous\"\nsigma_a = 0.5\nsigma_s = [1, 2, 3]\ndensity = {{ {density} }}\n{fields}"
    );
    heterogeneous(&load(&text, volumes))[0].clone()
}

/// Density at a point in world space.
fn at(medium: &Heterogeneous, point: DVec3) -> f32 {
    medium.density((point - DVec3::new(0.0, 0.0, 5.0)).as_vec3())
}

#[test]
fn openvdb_densities_are_at_their_places() {
    let expected = String::from_utf8(volume("expected.txt")).unwrap();
    let section = expected
        .split("grid ")
        .find(|section| section.starts_with("uncompressed density\n"))
        .unwrap();
    let alone = medium(r#"file = "uncompressed.vdb""#, "", &["uncompressed.vdb"]);
    let placed = medium(
        r#"file = "uncompressed.vdb", grid = "density""#,
        "transform = [{ scale = [2, 1, 2] }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [1, -2, 3] }]",
        &["uncompressed.vdb"],
    );
    let mut count = 0;
    for line in section.lines().filter(|line| line.starts_with("value")) {
        let numbers: Vec<f64> = line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect();
        let world = DVec3::from_slice(&numbers) * 0.1 + DVec3::new(10.0, 20.5, -30.0);
        let moved = DVec3::new(2.0 * world.z, world.y, -2.0 * world.x);
        for (medium, point) in [(&alone, world), (&placed, moved + DVec3::new(1.0, -2.0, 3.0))] {
            // Single precision at 1000 samples from the origin.
            let error = f64::from(at(medium, point)) - numbers[3];
            assert!(error.abs() < 2e-3, "{line}: off by {error}");
        }
        count += 1;
    }
    assert_eq!(count, 24);
    assert_eq!(at(&alone, DVec3::ZERO), 0.0);
}

#[test]
fn mitsuba_densities_fill_the_unit_cube() {
    let expected = String::from_utf8(volume("expected_vol.txt")).unwrap();
    let alone = medium(r#"file = "grid.vol""#, "", &["grid.vol"]);
    let placed = medium(
        r#"file = "grid.vol""#,
        "transform = [{ scale = 3 }, { translate = [-1, 0, 4] }]",
        &["grid.vol"],
    );
    for line in expected.lines() {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        let point = DVec3::from_slice(&numbers);
        for (medium, point) in [(&alone, point), (&placed, 3.0 * point + DVec3::new(-1.0, 0.0, 4.0))] {
            let error = f64::from(at(medium, point)) - numbers[3];
            assert!(error.abs() < 2e-5, "{line}: off by {error}");
        }
    }
    for outside in [
        DVec3::new(-0.01, 0.5, 0.5),
        DVec3::new(0.5, 1.01, 0.5),
        DVec3::new(0.5, 0.5, 1.01),
    ] {
        assert_eq!(at(&alone, outside), 0.0);
    }
}

#[test]
fn fields_arrive() {
    let file = r#"file = "several.vdb", grid = "heat[1]""#;
    let estimators = [
        ("\"ratio_tracking\"", Estimator::RatioTracking),
        ("\"residual_ratio_tracking\"", Estimator::ResidualRatioTracking),
        ("{ free_flights = 12 }", Estimator::FreeFlight { distances: 12 }),
    ];
    for (written, estimator) in estimators {
        let fields = format!("scale = 4\nphase = {{ type = \"hg\", g = 0.7 }}\ntransmittance = {written}");
        let cloud = medium(file, &fields, &["several.vdb"]);
        assert_eq!(cloud.estimator, estimator);
        assert_eq!(cloud.sigma_a, Rgb::splat(2.0));
        assert_eq!(cloud.sigma_s, Rgb::new(4.0, 8.0, 12.0));
        assert_eq!(cloud.phase, Phase::HenyeyGreenstein { g: 0.7 });
    }
    let plain = medium(file, "", &["several.vdb"]);
    assert_eq!(plain.estimator, Estimator::DEFAULT);
    assert_eq!(plain.sigma_a, Rgb::splat(0.5));
    assert_eq!(plain.sigma_s, Rgb::new(1.0, 2.0, 3.0));
    assert_eq!(plain.phase, Phase::Isotropic);
}

#[test]
fn media_of_one_grid_share_its_samples() {
    let cloud = |name: &str, grid: &str, scale: f64| {
        format!(
            "[media.{name}]\ntype = \"heterogeneous\"\nsigma_t = 1\nalbedo = 1\nscale = {scale}
            density = {{ file = \"several.vdb\", grid = \"{grid}\" }}\ntransform = [{{ scale = {scale} }}]\n"
        )
    };
    let text = cloud("a", "heat[0]", 1.0) + &cloud("b", "heat[0]", 2.0) + &cloud("c", "heat[1]", 1.0);
    let scene = load(&text, &["several.vdb"]);
    let media = heterogeneous(&scene);
    assert!(std::ptr::eq(media[0].bricks(), media[1].bricks()));
    assert!(!std::ptr::eq(media[0].bricks(), media[2].bricks()));
    let point = DVec3::splat(6.0);
    assert!(at(media[0], point) > 0.5);
    assert_eq!(at(media[1], 2.0 * point), at(media[0], point));
}

#[test]
fn bundles_hold_volume_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.toml");
    std::fs::create_dir(folder.path().join("volumes")).unwrap();
    std::fs::write(folder.path().join("volumes/a.vol"), volume("grid.vol")).unwrap();
    let text = format!(
        "{VIEW}[media.cloud]\ntype = \"heterogeneous\"\nsigma_t = 1\nalbedo = 1\ndensity = {{ file = \"volumes/a.vol\" }}"
    );
    std::fs::write(&path, text).unwrap();
    let bundle = read_bundle(&path).unwrap();
    let names: Vec<&String> = bundle.files.keys().collect();
    assert_eq!(names, ["cloud.toml", "volumes/a.vol"]);
    assert_eq!(beamfarm_scene::load(&bundle).unwrap().media.len(), 1);
}

/// A box of 16 x 24 x 8 samples, half a unit apart.
const BOX: &str = "min = [-3, 1, 2], max = [5, 13, 6], voxel = 0.5";
const HEIGHT: &str = "height = { base = 4.5, scale = 2.5 }";
const BLOBS: &str = "blobs = [{ center = [0, 5, 3], radius = 2 }, { center = [6, 10, 4], radius = 1.5, density = 3 }]";
const NOISE: &str = "noise = { size = 3, octaves = 2, gain = 0.25, contrast = 1.5, seed = 9 }";

/// Positions of the samples of `BOX`.
fn places() -> impl Iterator<Item = DVec3> {
    let place = |i: u32| DVec3::new((i % 16) as f64, (i / 16 % 24) as f64, (i / 384) as f64);
    (0..16 * 24 * 8).map(move |i| DVec3::new(-2.75, 1.25, 2.25) + 0.5 * place(i))
}

fn recipe(factors: &[&str]) -> Heterogeneous {
    let fields: Vec<&str> = [BOX].iter().chain(factors).copied().collect();
    medium(&fields.join(", "), "", &[])
}

fn is_near(got: f32, expected: f64) -> bool {
    (f64::from(got) - expected).abs() <= 1e-5 * (1.0 + expected)
}

#[test]
fn recipes_follow_their_formulas() {
    let constant = recipe(&[]);
    let (height, blobs, noise) = (recipe(&[HEIGHT]), recipe(&[BLOBS]), recipe(&[NOISE]));
    let product = recipe(&[NOISE, BLOBS, HEIGHT]);
    assert_eq!(constant.bricks().samples().to_array(), [16, 24, 8]);
    for p in places() {
        assert_eq!(at(&constant, p), 1.0);
        let by_height = libm::exp(-((p.y - 4.5) / 2.5).max(0.0));
        assert!(is_near(at(&height, p), by_height), "{p}");
        let ball = |x, y, z, radius: f64| {
            let d2 = (p - DVec3::new(x, y, z)).length_squared();
            libm::exp(-d2 / (2.0 * radius * radius))
        };
        let by_blobs = ball(0.0, 5.0, 3.0, 2.0) + 3.0 * ball(6.0, 10.0, 4.0, 1.5);
        assert!(is_near(at(&blobs, p), by_blobs), "{p}");
        let expected = by_height * by_blobs * f64::from(at(&noise, p));
        assert!(is_near(at(&product, p), expected), "{p}");
    }
    // The outermost samples extend to the sides of the box; beyond it there is nothing.
    for (inside, outside) in [
        (DVec3::new(-2.999, 2.0, 3.0), DVec3::new(-3.001, 2.0, 3.0)),
        (DVec3::new(0.0, 12.999, 3.0), DVec3::new(0.0, 13.001, 3.0)),
        (DVec3::new(0.0, 2.0, 5.999), DVec3::new(0.0, 2.0, 6.001)),
    ] {
        assert_eq!((at(&constant, inside), at(&constant, outside)), (1.0, 0.0));
    }
}

#[test]
fn recipes_have_their_defaults() {
    let same = |short: &str, long: &str| {
        let [short, long] =
            [short, long].map(|fields| medium(&format!("min = [0, -1, 0], max = [2, 0.5, 1], {fields}"), "", &[]));
        assert_eq!(short.bricks().samples(), long.bricks().samples());
        for i in 0..1000 {
            let p = DVec3::new(
                (i % 10) as f64 * 0.2,
                (i / 10 % 10) as f64 * 0.15 - 1.0,
                (i / 100) as f64 * 0.1,
            );
            assert_eq!(at(&short, p).to_bits(), at(&long, p).to_bits());
        }
    };
    same("blobs = []", "voxel = 0.03125");
    same("height = { scale = 0.5 }", "height = { base = 0, scale = 0.5 }");
    same(
        "height = { scale = 0.5 }, voxel = 0.1",
        "height = { base = 0.0, scale = 0.5 }, voxel = 0.1",
    );
    same(
        "blobs = [{ center = [1, 0, 0], radius = 1 }]",
        "blobs = [{ center = [1, 0, 0], radius = 1, density = 1 }]",
    );
    same(
        "noise = { size = 0.3 }",
        "noise = { size = 0.3, octaves = 4, gain = 0.5, contrast = 1, seed = 0 }",
    );
}

/// 64^3 samples of noise.
fn noise(fields: &str, size: f64) -> Vec<f32> {
    let n = 16.0 * size;
    let cloud = medium(
        &format!("min = [0, 0, 0], max = [{n}, {n}, {n}], noise = {{ size = {size}, {fields} }}"),
        "",
        &[],
    );
    let place = |i: u32| DVec3::new((i % 64) as f64, (i / 64 % 64) as f64, (i / 4096) as f64);
    (0..64 * 64 * 64)
        .map(|i| at(&cloud, (place(i) + 0.5) * (size / 4.0)))
        .collect()
}

#[test]
fn noise_is_what_the_format_says() {
    let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|v| v.to_bits()).collect() };
    let one = noise("seed = 5", 1.0);
    assert_eq!(bits(&one), bits(&noise("seed = 5", 1.0)));
    let other = noise("seed = 6", 1.0);
    let differ = one.iter().zip(&other).filter(|(a, b)| a != b).count();
    assert!(differ > 250_000, "{differ}");

    for seed in 0..4 {
        let values = noise(&format!("seed = {seed}"), 1.0);
        assert!(values.iter().all(|v| (0.0..=2.0).contains(v)));
        let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
        let spread = values.iter().map(|v| (f64::from(*v) - mean) * (f64::from(*v) - mean));
        let deviation = libm::sqrt(spread.sum::<f64>() / values.len() as f64);
        // Five standard errors, as if its 16^3 cells with a deviation of about 0.2 were independent.
        assert!((mean - 1.0).abs() < 0.015, "{mean}");
        assert!((0.1..0.3).contains(&deviation), "{deviation}");
    }

    let strong = noise("contrast = 3", 1.0);
    let mean = strong.iter().map(|v| f64::from(*v)).sum::<f64>() / strong.len() as f64;
    assert!((mean - 1.0).abs() < 0.03, "{mean}");

    // Contrast is a factor, and values below zero are cut off.
    let (half, strong) = (noise("contrast = 0.5", 1.0), noise("contrast = 8", 1.0));
    for (a, b) in half.iter().zip(&strong) {
        let expected = (1.0 + 16.0 * (a - 1.0)).max(0.0);
        assert!((b - expected).abs() < 1e-5, "{a} {b}");
    }
    assert!(strong.contains(&0.0));
    // Octaves of zero strength are like none, and features of all sizes look alike.
    assert_eq!(
        bits(&noise("octaves = 1", 1.0)),
        bits(&noise("octaves = 5, gain = 0", 1.0))
    );
    assert_eq!(bits(&noise("seed = 5", 4.0)), bits(&one));
    // Gradient noise of one octave is zero at the corners of its cells.
    let corners = medium(
        "min = [-0.75, -0.75, -0.75], max = [11.25, 11.25, 11.25], voxel = 1.5, noise = { size = 1.5, octaves = 1, contrast = 3 }",
        "",
        &[],
    );
    for i in 0..512 {
        let p = DVec3::new((i % 8) as f64, (i / 8 % 8) as f64, (i / 64) as f64) * 1.5;
        assert_eq!(at(&corners, p), 1.0, "{p}");
    }
}

#[test]
fn plans_say_how_transmittance_is_found() {
    let mist = "[world]\nmedium = \"mist\"\n[media.mist]\ntype = \"heterogeneous\"\nsigma_a = 0\nsigma_s = 1
        transmittance = { free_flights = 8 }\ndensity = { min = [0, 0, 0], max = [2, 1, 1] }\n[[lights]]\ntype = \"point\"
        position = [0, 1, 0]\npower = 1\n";
    let haze = "[media.haze]\ntype = \"homogeneous\"\nsigma_a = 0\nsigma_s = 1\n";
    for (text, expected) in [
        (
            mist.to_string(),
            "uses   transmittance by random walks      8 free flights in a box of 64 x 32 x 32 samples\n",
        ),
        (
            haze.to_string(),
            "skips  transmittance by random walks      no heterogeneous medium\n",
        ),
        (
            mist.to_string() + haze,
            "uses   transmittance in closed form       1 homogeneous medium\n",
        ),
    ] {
        let scene = Scene::new(load(&text, &[]));
        let settings = scene.description().defaults.job_settings();
        let plan = RenderPlan::new(&scene, settings).to_string();
        assert!(plan.contains(expected), "{plan}");
    }
}

/// Light from infinity reaches the world's medium, which ends at its box, as it reaches the interior of a shape around
/// it.
#[test]
fn light_from_infinity_reaches_a_bounded_world_medium() {
    let mut suite = Suite::new(0.01);
    for light in [
        "type = \"directional\"\ndirection = [1, -2, -0.5]\nirradiance = 2",
        "type = \"environment\"\nradiance = 0.5",
    ] {
        let world = "[world]\nmedium = \"mist\"\n";
        let shape = "[materials.boundary]\ntype = \"null\"\n[[shapes]]\ntype = \"cube\"\nmaterial = \"boundary\"
            interior = \"mist\"\ntransform = [{ scale = 1.5 }]\n";
        let [world, shape] = [world, shape].map(|place| {
            let text = format!(
                "[render]\npaths = 1000\nradius = 0.2\n[media.mist]\ntype = \"heterogeneous\"\nsigma_a = 0.2\nsigma_s = 0.6
                density = {{ min = [-1, -1, -1], max = [1, 1, 1], noise = {{ size = 1 }} }}\n{place}[[lights]]\n{light}\n"
            );
            let scene = Scene::new(load(&text, &[]));
            let settings = scene.description().defaults.job_settings();
            let plan = RenderPlan::new(&scene, settings);
            let mean = |pass| {
                let pixels = render_pass(&scene, &plan, pass).expect("a pass").film.pixels;
                pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels.len() as f64
            };
            (0..400).map(mean).collect::<MeanEstimate>()
        });
        assert!(world.mean() > 20.0 * world.std_error(), "{world:?} {shape:?}");
        let name = format!("{light}: {} and {}", world.mean(), shape.mean());
        suite.p_value(name, world.p_value_same(&shape));
    }
    suite.finish();
}

/// The reader accepts the examples of docs/scenes.md.
#[test]
fn examples_of_the_description_load() {
    let text = include_str!("../../../docs/scenes.md");
    let media = text.split("\n## ").find(|s| s.starts_with("Media\n")).unwrap();
    let examples = media.split("```toml\n").skip(1);
    let mut count = 0;
    for example in examples {
        let example = example.split("```").next().unwrap();
        // Of the volume files, the tests have one with a single grid.
        let example = ["flame", "temperature"]
            .iter()
            .fold(example.to_string(), |example, grid| {
                example.replace(&format!("{{ file = \"fire.vdb\", grid = \"{grid}\" }}"), "\"density\"")
            });
        let example = example
            .replace("cloud.vdb", "blosc.vdb")
            .replace("fire.vdb", "blosc.vdb");
        let scene = load(&example, &["blosc.vdb"]);
        let of_grids = |medium: &&Medium| matches!(medium, Medium::Heterogeneous(_));
        assert_eq!(scene.media.iter().filter(of_grids).count(), 1);
        count += 1;
    }
    assert_eq!(count, 3);
}
