//! Layers: what they hold, that they add up to the beauty, and that they do not change the beauty.

use beamfarm_harness::render::{scene, with_threads};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_image::film::Film;
use beamfarm_image::job::ReferenceSettings;
use beamfarm_image::layer::{Layer, LayerCounts, LightGroup};
use beamfarm_image::matte::{Entry, id_of_name};
use beamfarm_image::merge::{Node, TreeSum};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::cpu::reference::{SampleLayers, render_sample, render_sample_with_layers};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::aov::light_layers;
use beamfarm_render::plan::engine::PassImage;
use beamfarm_render::world::Scene;

/// All kinds of light paths: two groups of lights in three lights, a visible lamp, an environment, fog in a box,
/// mirror, glass, gloss, indirect light.
const ROOM: &str = r#"
[image]
width = 40
height = 32
[render]
paths = 3000
[camera]
origin = [0.0, 1.0, 2.6]
target = [0.0, 1.0, 0.0]
fov = 60.0
[media.fog]
type = "homogeneous"
sigma_a = [0.1, 0.2, 0.3]
sigma_s = 0.4
phase = { type = "hg", g = 0.5 }
[materials.boundary]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.steel]
type = "rough_conductor"
alpha = 0.3
preset = "iridium"
[[shapes]]
type = "cube"
material = "boundary"
interior = "fog"
transform = [{ scale = 1.2 }, { translate = [0, 1, 0] }]
[[shapes]]
name = "floor"
type = "rectangle"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 4.0 }, { translate = [0, -0.3, 0] }]
[[shapes]]
name = "ball"
type = "sphere"
center = [0.4, 0.6, 0.3]
radius = 0.4
material = "glass"
interior = "none"
exterior = "fog"
[[shapes]]
name = "steel"
type = "sphere"
center = [-0.5, 0.5, 0.0]
radius = 0.4
material = "steel"
[[shapes]]
name = "lamp"
type = "sphere"
center = [0.0, 2.6, -0.5]
radius = 0.25
emission = { radiance = [8.0, 6.0, 4.0], group = "warm" }
[[lights]]
name = "bulb"
type = "point"
group = "warm"
position = [-1.0, 1.5, 1.0]
power = 20.0
[[lights]]
name = "spot"
type = "spot"
position = [1.5, 2.5, 1.0]
target = [0, 0.5, 0]
power = [2.0, 4.0, 20.0]
[[lights]]
name = "sky"
type = "environment"
radiance = [0.1, 0.1, 0.2]
"#;

fn layers(scene: &Scene) -> Vec<Layer> {
    use Layer::*;
    let mut layers = vec![Depth, Normal, Albedo, Direct, Surface, Volume, BeamDensity];
    layers.extend(light_layers(scene.description()));
    layers
}

fn pass(scene: &Scene, layers: &[Layer], pass_index: u64) -> PassImage {
    let settings = scene.description().defaults.job_settings();
    let plan = RenderPlan::new(scene, settings).with_layers(scene, layers).unwrap();
    render_pass(scene, &plan, pass_index).expect("a pass")
}

/// The parts sum to the beauty up to the rounding of a few thousand additions.
fn assert_sum(beauty: &Film, parts: &[&Film]) {
    for (i, pixel) in beauty.pixels.iter().enumerate() {
        for (c, value) in pixel.iter().enumerate() {
            let sum: f32 = parts.iter().map(|part| part.pixels[i][c]).sum();
            assert!(
                (sum - value).abs() <= 1e-4 * value.abs(),
                "pixel {i}, channel {c}: {sum}, expected {value}"
            );
        }
    }
}

#[test]
fn the_layer_of_odd_passes_is_their_beauty_and_black_in_others() {
    let scene = scene(ROOM);
    for pass_index in [4, 5] {
        let with = pass(&scene, &[Layer::Odd], pass_index);
        match pass_index {
            5 => assert!(with.layers[0] == with.film, "bits"),
            _ => assert_eq!(with.layers[0], Film::new(with.film.width, with.film.height)),
        }
    }
}

#[test]
fn the_beauty_is_the_sum_of_its_parts_and_the_same_without_them() {
    let scene = scene(ROOM);
    let layers = layers(&scene);
    let names: Vec<String> = layers[7..].iter().map(Layer::to_string).collect();
    assert_eq!(names, ["light_warm", "light_spot", "light_sky"]);
    for pass_index in [0, 5] {
        let with = pass(&scene, &layers, pass_index);
        let without = pass(&scene, &[], pass_index);
        assert!(with.film == without.film, "bits");
        assert_eq!(with.stats, without.stats);
        assert_eq!((with.layers.len(), without.layers.len()), (layers.len(), 0));
        let parts: Vec<&Film> = with.layers.iter().collect();
        assert_sum(&with.film, &parts[3..6]);
        assert_sum(&with.film, &parts[7..]);
        for (part, name) in parts[3..].iter().zip(&layers[3..]) {
            let lit = part.pixels.iter().filter(|p| p[0] > 0.0).count();
            assert!(lit > 20, "{name}: {lit} pixels");
        }
        let beams: f64 = parts[6].pixels.iter().map(|p| f64::from(p[0])).sum();
        // Each pixel counts for itself; neighbours that share the scattered light they gather look up each beam once.
        let found = with.stats.beam_evaluations as f64;
        assert!(0.3 * beams < found && found <= beams, "{found} of {beams}");
    }
}

/// A layer holds the same alone as among others, and with any number of threads.
#[test]
fn layers_do_not_depend_on_each_other_nor_on_threads() {
    let scene = scene(ROOM);
    let all = layers(&scene);
    let together = pass(&scene, &all, 3);
    for (layer, film) in all.iter().zip(&together.layers) {
        let alone = with_threads(3, || pass(&scene, std::slice::from_ref(layer), 3));
        assert!(alone.layers[0] == *film, "{layer}");
    }
}

/// The same light in a scene of its own gives the same picture on average. Significance 9e-3 for all channels of all
/// groups.
#[test]
fn a_group_is_what_its_lights_alone_would_give() {
    let whole = scene(ROOM);
    let layers = light_layers(whole.description());
    let lights = [
        (
            "warm",
            ["[[lights]]\nname = \"spot\"", "[[lights]]\nname = \"sky\""].as_slice(),
        ),
        (
            "spot",
            &[
                "[[lights]]\nname = \"bulb\"",
                "[[lights]]\nname = \"sky\"",
                "emission = {",
            ],
        ),
        (
            "sky",
            &[
                "[[lights]]\nname = \"bulb\"",
                "[[lights]]\nname = \"spot\"",
                "emission = {",
            ],
        ),
    ];
    let passes = 24;
    let mean = |film: &Film, c: usize| {
        let sum: f64 = film.pixels.iter().map(|p| f64::from(p[c])).sum();
        sum / film.pixels.len() as f64
    };
    let mut groups = vec![[MeanEstimate::new(); 3]; layers.len()];
    for pass_index in 0..passes {
        let image = pass(&whole, &layers, pass_index);
        for (group, film) in groups.iter_mut().zip(&image.layers) {
            for (c, channel) in group.iter_mut().enumerate() {
                channel.add(mean(film, c));
            }
        }
    }
    let mut suite = Suite::new(9e-3);
    for ((name, others), group) in lights.into_iter().zip(&groups) {
        let mut text = ROOM.to_owned();
        for other in others {
            // A lamp keeps its black surface.
            let (from, to) = match other.starts_with("emission") {
                true => {
                    let from = text.find(other).unwrap();
                    (from, from + text[from..].find('\n').unwrap())
                }
                false => {
                    let from = text.find(other).unwrap();
                    let next = text[from + 1..].find("[[lights]]");
                    (from, next.map_or(text.len(), |n| from + 1 + n))
                }
            };
            let off = if other.starts_with("emission") {
                "emission = { radiance = 0.0 }"
            } else {
                ""
            };
            text.replace_range(from..to, off);
        }
        let alone = scene(&text);
        let mut means = [MeanEstimate::new(); 3];
        for pass_index in 0..passes {
            let image = pass(&alone, &[], 1000 + pass_index);
            for (c, channel) in means.iter_mut().enumerate() {
                channel.add(mean(&image.film, c));
            }
        }
        for c in 0..3 {
            // Radii shrink with the pass, so late passes differ by their bias, which is far below the noise here.
            suite.same_mean(format!("{name}, channel {c}"), &group[c], &means[c]);
        }
    }
    suite.finish();
}

#[test]
fn geometry_layers_are_those_of_the_first_surface() {
    // A wall across the axis behind a medium's boundary, and a mirror in front of it in the left half.
    let scene = scene(
        r#"
[image]
width = 16
height = 8
[camera]
origin = [3, 0, 5]
target = [3, 0, 0]
fov = 40
[materials.red]
type = "diffuse"
reflectance = [0.7, 0.2, 0.1]
[materials.boundary]
type = "null"
[materials.silver]
type = "mirror"
reflectance = 0.9
[[shapes]]
type = "cube"
material = "boundary"
transform = [{ scale = 0.5 }, { translate = [3, 0, 3] }]
[[shapes]]
type = "rectangle"
material = "red"
transform = [{ scale = [20, 20, 1] }, { translate = [23, 0, 0] }]
[[shapes]]
type = "rectangle"
material = "silver"
transform = [{ scale = [2, 5, 1] }, { rotate = { axis = [0, 1, 0], angle = 30 } }, { translate = [1.2679491924311228, 0, 2] }]
[[lights]]
type = "point"
position = [3, 0, 4]
power = 10
"#,
    );
    let image = pass(&scene, &[Layer::Depth, Layer::Normal, Layer::Albedo], 0);
    let [depth, normal, albedo] = &image.layers[..] else {
        panic!("three layers");
    };
    let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    // The right half meets the wall, whose distance along the axis is 5 everywhere.
    for i in (0..8 * 16).filter(|i| i % 16 >= 8) {
        assert!(near(depth.pixels[i], [5.0, 1.0, 0.0]), "{:?}", depth.pixels[i]);
        assert!(near(normal.pixels[i], [0.0, 0.0, 1.0]));
        assert!(near(albedo.pixels[i], [0.7, 0.2, 0.1]));
    }
    for i in (0..8 * 16).filter(|i| i % 16 < 7) {
        assert!(depth.pixels[i][0] > 3.0 && depth.pixels[i][0] < 5.0 && depth.pixels[i][1] == 1.0);
        assert!(
            near(normal.pixels[i], [0.5, 0.0, 0.75f32.sqrt()]),
            "{:?}",
            normal.pixels[i]
        );
        assert!(near(albedo.pixels[i], [0.9; 3]));
    }
}

#[test]
fn nothing_is_there_where_a_ray_meets_nothing() {
    let empty = "[image]\nwidth = 4\nheight = 4\n[camera]\norigin = [0, 0, 0]\ntarget = [0, 0, 1]\nfov = 30\n\
        [[lights]]\ntype = \"environment\"\nradiance = [1.0, 2.0, 3.0]\n";
    let scene = scene(empty);
    let image = pass(&scene, &layers(&scene), 0);
    for (film, expected) in image.layers.iter().zip([
        [0.0; 3],
        [0.0; 3],
        [0.0; 3],
        [1.0, 2.0, 3.0],
        [0.0; 3],
        [0.0; 3],
        [0.0; 3],
        [1.0, 2.0, 3.0],
    ]) {
        assert!(film.pixels.iter().all(|p| *p == expected));
    }
}

/// Every pass records what its rays hit. They pass boundaries of media, and hit a cut-out as often as its opacity says.
#[test]
fn mattes_are_of_the_first_surface() {
    let text = r#"
[image]
width = 12
height = 4
[camera]
origin = [0, 0, 5]
target = [0, 0, 0]
fov = 40
[materials.red]
type = "diffuse"
[materials.lace]
type = "diffuse"
opacity = 0.25
[materials.boundary]
type = "null"
[[shapes]]
name = "air"
type = "cube"
material = "boundary"
transform = [{ translate = [0, 0, 3] }]
[[shapes]]
name = "wall"
type = "rectangle"
material = "red"
transform = [{ scale = [10, 10, 1] }, { translate = [10, 0, 0] }]
[[shapes]]
name = "curtain"
type = "rectangle"
material = "lace"
transform = [{ scale = [10, 10, 1] }, { translate = [10, 0, 1] }]
[[shapes]]
name = "pole"
type = "instances"
shape = { type = "cylinder", radius = 0.1, p0 = [0, -9, 0], p1 = [0, 9, 0] }
transforms = [[{ translate = [-1, 0, 0] }]]
[[lights]]
type = "point"
position = [3, 0, 4]
power = 10
"#;
    let scene = scene(text);
    let settings = scene.description().defaults.job_settings();
    let layers = [Layer::Depth, Layer::Objects, Layer::Materials];
    let plan = RenderPlan::new(&scene, settings).with_layers(&scene, &layers).unwrap();
    let mut sum = TreeSum::new(12, 4).with_layers(LayerCounts::of(&layers));
    let passes = 512;
    for i in 0..passes {
        let pass = render_pass(&scene, &plan, i).expect("a pass");
        sum.insert(
            Node::leaf(i, pass.film)
                .with_layers(pass.layers)
                .with_mattes(pass.mattes),
        )
        .unwrap();
    }
    let average = sum.average().unwrap();
    let names = scene.description().names();
    assert_eq!(names.objects, ["air", "wall", "curtain", "pole[0]"]);
    for (matte, [wall, curtain, pole]) in average
        .mattes
        .iter()
        .zip([["wall", "curtain", "pole[0]"], ["red", "lace", "default"]])
    {
        let pixels: Vec<&[Entry]> = matte.by_pixel().collect();
        let share = |pixel: usize, name: &str| {
            let found = pixels[pixel].iter().find(|entry| entry.id == id_of_name(name));
            found.map_or(0.0, |entry| f64::from(entry.passes) / passes as f64)
        };
        // Binomial, 512 draws with probability 1/4: five standard deviations.
        let spread = 5.0 * (0.25 * 0.75 / passes as f64).sqrt();
        for pixel in [7, 11, 12 + 8, 36 + 10] {
            assert!((share(pixel, curtain) - 0.25).abs() < spread, "{pixel}");
            assert!(
                (share(pixel, curtain) + share(pixel, wall) - 1.0).abs() < 1e-12,
                "{pixel}"
            );
        }
        let of_pole: f64 = (0..6).map(|pixel| share(pixel, pole)).sum();
        let width = 2.0 * 0.1 * 12.0 / (2.0 * 5.0 * libm::tan(20f64.to_radians()));
        // Rays in a pixel are stratified; half of a pixel hits the pole.
        assert!((of_pole - width).abs() < 0.05, "{of_pole} for {width}");
        assert!(pixels[0].is_empty());
    }
}

/// By channel, a slab of a medium transmits exp(-sigma_t d), a cut-out of opacity 0.25 three quarters; glass covers.
/// For both ways to gather a medium's light. Significance 1e-6, by the spread of the passes.
#[test]
fn alpha_is_what_covers() {
    for technique in ["photons", "paths"] {
        let text = format!(
            r#"
[image]
width = 3
height = 1
[render]
paths = 200
media = "{technique}"
[camera]
origin = [0, 0, 100]
target = [0, 0, 0]
fov = 4
[media.mist]
type = "homogeneous"
sigma_a = [0.1, 0.3, 0.0]
sigma_s = 0.2
[materials.boundary]
type = "null"
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.lace]
type = "diffuse"
opacity = 0.25
[[shapes]]
type = "cube"
material = "boundary"
interior = "mist"
transform = [{{ scale = [1.1, 5, 1] }}, {{ translate = [-2.35, 0, 0] }}]
[[shapes]]
type = "rectangle"
material = "lace"
transform = [{{ scale = [1.1, 5, 1] }}]
[[shapes]]
type = "cube"
material = "glass"
transform = [{{ scale = [1.1, 5, 1] }}, {{ translate = [2.35, 0, 0] }}]
[[lights]]
type = "environment"
radiance = 1.0
"#
        );
        let scene = scene(&text);
        let settings = scene.description().defaults.job_settings();
        let plan = RenderPlan::new(&scene, settings)
            .with_layers(&scene, &[Layer::Alpha])
            .unwrap();
        let passes: Vec<Film> = (0..400)
            .map(|i| render_pass(&scene, &plan, i).expect("a pass").layers[0].clone())
            .collect();
        let mist: f64 = [0.3, 0.5, 0.2]
            .iter()
            .map(|sigma: &f64| (1.0 - libm::exp(-2.0 * sigma)) / 3.0)
            .sum();
        for (i, expected) in [mist, 0.25, 1.0].into_iter().enumerate() {
            let values = passes.iter().map(|film| f64::from(film.pixels[i][0]));
            let (n, mean) = (passes.len() as f64, values.clone().sum::<f64>() / passes.len() as f64);
            let error = (values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n * (n - 1.0))).sqrt();
            // Rays are up to two degrees off the axis, so their way is longer by 6e-4.
            let (off, allowed) = ((mean - expected).abs(), 4.9 * error + 1e-3);
            assert!(
                off <= allowed,
                "{technique}, pixel {i}: {mean} for {expected}, {allowed} allowed"
            );
        }
    }
}

#[test]
fn a_layer_of_no_light_is_refused() {
    let scene = scene(ROOM);
    let settings = scene.description().defaults.job_settings();
    let layer = Layer::Light(LightGroup::named("moon"));
    let error = RenderPlan::new(&scene, settings).with_layers(&scene, &[layer]);
    assert_eq!(
        error.unwrap_err().to_string(),
        "there is no light or group of lights `moon`"
    );
}

/// Passes and path-tracer samples give the same layers. Means of 24 images over the whole; kernels may blur what passes
/// see by 2 %. Significance 1e-3.
#[test]
fn layers_of_samples_are_those_of_passes() {
    let lights = "[[lights]]\nname = \"bulb\"\ntype = \"point\"";
    let mut toml = ROOM.replace(lights, "[[shapes]]\nname = \"bulb\"\ntype = \"sphere\"");
    // A path tracer does not find small lights through glass.
    toml = toml.replace(
        "group = \"warm\"\nposition = [-1.0, 1.5, 1.0]\npower = 20.0",
        "center = [-1.0, 1.5, 1.0]\nradius = 0.2\nemission = { power = 20.0, group = \"warm\" }",
    );
    let spot = toml.find("[[lights]]\nname = \"spot\"").unwrap();
    let sky = toml.find("[[lights]]\nname = \"sky\"").unwrap();
    toml.replace_range(spot..sky, "");
    let scene = scene(&toml);
    let mut layers = vec![Layer::Direct, Layer::Surface, Layer::Volume];
    layers.extend(light_layers(scene.description()));
    let sampled = SampleLayers::new(&scene, &layers).unwrap();
    let settings = ReferenceSettings {
        seed: 4,
        max_depth: None,
    };
    let mean = |film: &Film| {
        let sum: f64 = film.pixels.iter().flatten().map(|v| f64::from(*v)).sum();
        sum / film.pixels.len() as f64
    };
    let mut means = vec![[MeanEstimate::new(); 2]; layers.len()];
    for index in 0..24 {
        let ours = pass(&scene, &layers, 500 + index);
        for (sums, film) in means.iter_mut().zip(&ours.layers) {
            sums[0].add(mean(film));
        }
        for sample in 4 * index..4 * (index + 1) {
            let theirs = render_sample_with_layers(&scene, &settings, &sampled, sample, || true).unwrap();
            let alone = render_sample(&scene, &settings, sample, || true).unwrap();
            assert!(theirs.film == alone, "bits");
            let parts: Vec<&Film> = theirs.layers.iter().collect();
            assert_sum(&theirs.film, &parts[..3]);
            assert_sum(&theirs.film, &parts[3..]);
            for (sums, film) in means.iter_mut().zip(&theirs.layers) {
                sums[1].add(mean(film));
            }
        }
    }
    let mut suite = Suite::new(1e-3);
    for (layer, [ours, theirs]) in layers.iter().zip(&means) {
        suite.same_mean_within(layer.to_string(), ours, theirs, 0.02);
    }
    suite.finish();
    let depth = SampleLayers::new(&scene, &[Layer::Depth]).unwrap_err();
    assert!(depth.to_string().contains("`depth`"), "{depth}");
}
