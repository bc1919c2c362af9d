//! Compares the mean over many seeds, block by block, with that of the processor's passes for the same plan. Passes
//! with one seed draw the same random numbers in both engines, so their difference has less noise than either.

use super::{
    BY_PATHS, add_object, ball, diffuse, emits, fill, fog, furnace, glass, is_long, lamp, material, matt, plan, quad,
    render, room, stage,
};
use crate::testing::tested;
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::bsdf::{
    Coat, Distribution, Extras, Interface, MaterialDescription, MaterialKind, NormalPerturbation, RoughCoat, Tint,
};
use beamfarm_render::world::camera::Projection;
use beamfarm_render::world::geometry::{Placement, Shape};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, Wrap};
use beamfarm_render::world::{Scene, SceneDescription};
use glam::{Affine2, Affine3A, Quat};
use std::sync::Arc;
use std::time::Instant;

/// Blocks per side of the picture.
const BLOCKS: usize = 4;
/// Chance that all comparisons of a picture together fail.
const LEVEL: f64 = 1e-4;

/// Mean of each channel of each block.
fn means(film: &Film) -> Vec<f64> {
    let (width, height) = (film.width as usize, film.height as usize);
    let mut sums = vec![0.0; 3 * BLOCKS * BLOCKS];
    for (i, pixel) in film.pixels.iter().enumerate() {
        let (x, y) = (i % width, i / width);
        let block = y * BLOCKS / height * BLOCKS + x * BLOCKS / width;
        for (channel, value) in pixel.iter().enumerate() {
            sums[3 * block + channel] += f64::from(*value);
        }
    }
    let pixels = (width * height / BLOCKS / BLOCKS) as f64;
    sums.iter().map(|sum| sum / pixels).collect()
}

/// Mean, and its variance.
fn estimate(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let squares = values.map(|value| (value - mean) * (value - mean)).sum::<f64>();
    [mean, squares / (n - 1.0) / n]
}

/// Probability of a difference of at least this many standard errors, with this many degrees of freedom: Student's
/// distribution, approximated by a normal one (Wallace 1959).
fn probability(t: f64, freedom: f64) -> f64 {
    let z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * (freedom * libm::log1p(t * t / freedom)).sqrt();
    libm::erfc(z / std::f64::consts::SQRT_2)
}

/// Result of a comparison.
struct Worst {
    p: f64,
    what: String,
}

/// Asserts that both engines have the same expectation, for the whole picture and block by block. The standard error of
/// the whole picture's mean must be at most `blur` of it, so that the test is significant.
pub(super) fn agrees(name: &str, scene: SceneDescription, blur: f64) {
    layers_agree(name, scene, &[], blur);
}

/// The same, including layers, all together.
pub(super) fn layers_agree(name: &str, scene: SceneDescription, layers: &[Layer], blur: f64) {
    let plan = |scene: &Scene, seed: u64| plan(scene, seed).with_layers(scene, layers).unwrap();
    plans_agree(name, scene, plan, blur);
}

/// The same with other plans.
pub(super) fn plans_agree(name: &str, scene: SceneDescription, plan: impl Fn(&Scene, u64) -> RenderPlan, blur: f64) {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(scene);
    let layers = plan(&scene, 100).layers.layers;
    let seeds: u64 = if is_long() { 200 } else { 8 };
    for pass_index in [0, 50] {
        let started = Instant::now();
        let pass = |engine: usize, seed: u64| {
            let plan = plan(&scene, 100 + seed);
            let pass = match engine {
                0 => render_pass(&scene, &plan, pass_index).unwrap(),
                _ => render(tested, &scene, &plan, pass_index),
            };
            assert_eq!(pass.stats.non_finite, 0, "{name}");
            let films = [&pass.film].into_iter().chain(&pass.layers);
            films.flat_map(means).collect::<Vec<f64>>()
        };
        let [expected, got] = [0, 1].map(|engine| (0..seeds).map(|seed| pass(engine, seed)).collect::<Vec<_>>());
        let compared = |of: &dyn Fn(&[f64]) -> f64| {
            let both = || expected.iter().zip(&got).map(|(a, b)| [of(a), of(b)]);
            let [[a, va], [b, vb]] = [0, 1].map(|engine| estimate(both().map(|pair| pair[engine])));
            let [difference, variance] = estimate(both().map(|[a, b]| b - a));
            let error = variance.sqrt().max(1e-6 * a.abs());
            let t = difference / error;
            let p = probability(t, (seeds - 1) as f64);
            let what = format!("{b:.4e} and not {a:.4e}, {t:.1} standard errors, p = {p:.1e}");
            (Worst { p, what }, [va, vb, variance].map(|v| v.sqrt() / a))
        };
        let of_film = 3 * BLOCKS * BLOCKS;
        let cells = of_film * (1 + layers.len());
        let least = 1.0 - libm::pow(1.0 - LEVEL, 1.0 / (cells + 1) as f64);
        let mut worst = Worst {
            p: 1.0,
            what: String::new(),
        };
        for cell in 0..cells {
            let (found, _) = compared(&|film| film[cell]);
            if found.p < worst.p {
                let (block, channel) = (cell % of_film / 3, cell % 3);
                let film = match cell / of_film {
                    0 => String::new(),
                    layer => format!("{:?}, ", layers[layer - 1]),
                };
                let what = format!("{film}block {block}, channel {channel}: {}", found.what);
                worst = Worst { what, ..found };
            }
        }
        let (whole, errors) = compared(&|films| films[..of_film].iter().sum::<f64>());
        println!(
            "{name}, pass {pass_index}: {}; errors {:.2e} {:.2e}, of the difference {:.2e}; {}; {:.1} s",
            whole.what,
            errors[0],
            errors[1],
            errors[2],
            worst.what,
            started.elapsed().as_secs_f64(),
        );
        assert!(whole.p > least, "{name}, pass {pass_index}: {}", whole.what);
        assert!(worst.p > least, "{name}, pass {pass_index}: {}", worst.what);
        assert!(
            errors.iter().all(|error| *error < blur),
            "{name}, pass {pass_index}: {errors:?}"
        );
    }
}

/// A room with a lamp and a red ball.
pub(super) fn lit_room() -> SceneDescription {
    let mut scene = stage();
    let grey = matt(&mut scene, [0.6; 3]);
    room(&mut scene, grey);
    let red = matt(&mut scene, [0.7, 0.2, 0.1]);
    ball(&mut scene, [0.7, -0.6, -0.5], 0.6, red);
    lamp(&mut scene, 0.6, [4.0, 3.0, 2.0]);
    scene
}

/// Camera paths find all light.
pub(super) fn by_paths(mut scene: SceneDescription) -> SceneDescription {
    scene.defaults.techniques = BY_PATHS;
    scene
}

#[test]
fn a_furnace() {
    agrees("a furnace", by_paths(furnace(0.5)), 0.01);
}

#[test]
fn a_room() {
    agrees("a room", by_paths(lit_room()), 0.02);
}

/// Parallel rays, out of focus.
#[test]
fn a_room_by_parallel_rays() {
    let mut scene = lit_room();
    scene.camera.projection = Projection::Orthographic;
    scene.camera.half_width = 1.5;
    (scene.camera.aperture, scene.camera.focus_distance) = (0.1, 2.0);
    agrees("a room by parallel rays", scene, 0.05);
}

#[test]
fn a_furnace_of_fog() {
    let mut scene = furnace(0.5);
    scene.world_medium = fog(&mut scene, 0.0, 0.5);
    agrees("a furnace of fog", by_paths(scene), 0.01);
}

#[test]
fn a_ball_of_fog() {
    let mut scene = lit_room();
    let mist = fog(&mut scene, 0.1, -0.5);
    let nothing = material(&mut scene, MaterialKind::Null, true);
    let cloud = ball(&mut scene, [-0.5, 0.0, 0.0], 0.7, nothing);
    fill(&mut scene, cloud, mist, None);
    agrees("a ball of fog", by_paths(scene), 0.02);
}

/// Photons contribute caustics; camera paths end at photons.
#[test]
fn a_ball_of_glass() {
    let mut scene = lit_room();
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [-0.6, -0.3, 0.0], 0.6, clear);
    agrees("a ball of glass", scene, 0.05);
}

#[test]
fn a_pane_and_a_mirror() {
    let mut scene = lit_room();
    let (eta, tint) = (1.5, Tint::NONE);
    let pane = material(&mut scene, MaterialKind::ThinDielectric { eta, tint }, true);
    let corners = [[-1.0, -1.5], [1.0, -1.5], [1.0, 1.0], [-1.0, 1.0]];
    quad(&mut scene, corners.map(|[x, y]| Vec3::new(x, y, 0.3)), pane);
    let reflectance = Texture::Constant(Rgb::splat(0.9));
    let mirror = material(&mut scene, MaterialKind::Mirror { reflectance }, true);
    ball(&mut scene, [-0.6, -0.3, -0.6], 0.5, mirror);
    agrees("a pane and a mirror", scene, 0.05);
}

/// Beams are slow on software drivers.
pub(super) fn small(mut scene: SceneDescription) -> SceneDescription {
    if !is_long() {
        (scene.camera.width, scene.camera.height) = (16, 16);
    }
    scene
}

/// Beams contribute the light of fog, photons that of surfaces.
#[test]
fn a_room_of_fog() {
    let mut scene = lit_room();
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    agrees("a room of fog", small(scene), 0.1);
}

/// Round lamps: a ball in fog, and a disc that shines down.
#[test]
fn round_lamps_in_fog() {
    let mut scene = stage();
    let grey = matt(&mut scene, [0.6; 3]);
    room(&mut scene, grey);
    let black = matt(&mut scene, [0.0; 3]);
    let bulb = ball(&mut scene, [0.6, 0.9, -0.4], 0.25, black);
    emits(&mut scene, bulb, [9.0, 7.0, 5.0]);
    let down = Affine3A::from_scale_rotation_translation(
        Vec3::splat(0.5),
        Quat::from_rotation_x(std::f32::consts::FRAC_PI_2),
        Vec3::new(-0.8, 1.8, 0.0),
    );
    let placement = Placement {
        render_from_object: down,
        object_from_render: down.inverse(),
    };
    let plate = add_object(&mut scene, Shape::Disc { placement, flip: false }, black);
    emits(&mut scene, plate, [3.0, 4.0, 6.0]);
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    agrees("round lamps in fog", scene, 0.1);
}

#[test]
fn glass_in_glass_in_fog() {
    if !is_long() {
        return;
    }
    let mut scene = lit_room();
    let air = fog(&mut scene, 0.1, 0.0);
    scene.world_medium = air;
    let clear = glass(&mut scene, 1.5);
    let outer = ball(&mut scene, [-0.6, -0.3, 0.0], 0.7, clear);
    fill(&mut scene, outer, None, air);
    let bubble = glass(&mut scene, 1.0 / 1.5);
    let hollow = ball(&mut scene, [-0.6, -0.3, 0.0], 0.5, bubble);
    fill(&mut scene, hollow, air, None);
    agrees("glass in glass in fog", small(scene), 0.1);
}

/// Beams and photons do not light anything behind it.
#[test]
fn a_wall_in_fog() {
    let mut scene = lit_room();
    scene.world_medium = fog(&mut scene, 0.1, 0.0);
    let grey = matt(&mut scene, [0.6; 3]);
    let corners = [[-2.0, -2.0], [0.5, -2.0], [0.5, 1.2], [-2.0, 1.2]];
    quad(&mut scene, corners.map(|[z, y]| Vec3::new(-0.7, y, z)), grey);
    agrees("a wall in fog", small(scene), 0.1);
}

/// Balls of all rough or coated materials, in a room whose floor is a blend mixed by an image.
fn room_of_surfaces() -> SceneDescription {
    let mut scene = lit_room();
    let grey = |value: f32| Texture::Constant(Rgb::splat(value));
    let metal = MaterialKind::RoughConductor {
        distribution: Distribution::Ggx,
        alpha: Scalar::constant(0.05),
        eta: Rgb::new(0.2, 0.9, 1.1),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: grey(1.0),
    };
    let brushed = MaterialKind::RoughConductor {
        distribution: Distribution::Beckmann,
        alpha: Scalar::constant(0.3),
        eta: Rgb::new(0.2, 0.9, 1.1),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: grey(0.9),
    };
    let frosted = MaterialKind::RoughDielectric {
        distribution: Distribution::Ggx,
        alpha: Scalar::constant(0.3),
        eta: 1.5,
        tint: Tint::NONE,
    };
    let lacquer = MaterialKind::Plastic {
        reflectance: Texture::Constant(Rgb::new(0.1, 0.3, 0.7)),
        specular_reflectance: grey(1.0),
        coat: Coat::new(1.5, false),
    };
    let satin = MaterialKind::RoughPlastic {
        reflectance: Texture::Constant(Rgb::new(0.6, 0.3, 0.1)),
        specular_reflectance: grey(1.0),
        coat: Box::new(RoughCoat::new(Distribution::Ggx, 0.06, 1.5, true)),
    };
    let paint = |extras: Option<Extras>| MaterialKind::Principled {
        base_color: Texture::Constant(Rgb::new(0.7, 0.5, 0.2)),
        metallic: Scalar::constant(0.3),
        roughness: Scalar::constant(0.4),
        interface: Interface::Specular(Scalar::constant(0.5)),
        extras: extras.map(Box::new),
    };
    let coated = paint(Some(Extras {
        clearcoat: Scalar::constant(1.0),
        clearcoat_gloss: Scalar::constant(0.8),
        sheen: Scalar::constant(0.5),
        spec_trans: Scalar::constant(0.3),
        ..Extras::NONE
    }));
    let kinds = [metal, brushed, frosted, lacquer, satin, paint(None), coated];
    for (i, kind) in kinds.into_iter().enumerate() {
        let (column, row) = ((i % 4) as f32, (i / 4) as f32);
        let surface = material(&mut scene, kind, true);
        ball(&mut scene, [0.75 * column - 1.1, 0.9 - 0.9 * row, -0.3], 0.33, surface);
    }
    scene
}

#[test]
fn surfaces_by_paths() {
    agrees("surfaces by paths", by_paths(room_of_surfaces()), 0.05);
}

#[test]
fn surfaces_with_photons() {
    agrees("surfaces with photons", room_of_surfaces(), 0.1);
}

/// A floor that is a blend, a leaf with holes, a bumpy wall; a lamp behind the leaf.
#[test]
fn surfaces_that_vary() {
    let mut scene = lit_room();
    let squares = |colors: [f32; 2]| Texture::Checkerboard {
        colors: colors.map(Rgb::splat),
        squares_from_uv: Affine2::from_scale(Vec2::splat(3.0)),
    };
    let metal = MaterialKind::RoughConductor {
        distribution: Distribution::Ggx,
        alpha: Scalar::of(squares([0.05, 0.4])),
        eta: Rgb::new(0.2, 0.9, 1.1),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: Texture::Constant(Rgb::ONE),
    };
    let matt_part = diffuse(Texture::Constant(Rgb::new(0.2, 0.5, 0.3)));
    let parts = [matt_part, metal].map(|kind| MaterialDescription::new(kind, true).into());
    let blend = MaterialKind::Blend {
        parts: Box::new(parts),
        weight: squares([0.2, 0.7]),
    };
    let blend = material(&mut scene, blend, true);
    ball(&mut scene, [-0.8, 0.3, -0.6], 0.5, blend);
    let leaf = MaterialDescription {
        opacity: Some(squares([0.3, 0.9])),
        ..MaterialDescription::new(diffuse(Texture::Constant(Rgb::new(0.1, 0.6, 0.1))), true)
    };
    scene.materials.push(leaf.into());
    let leaf = scene.materials.len() as u32 - 1;
    ball(&mut scene, [0.0, 1.3, 0.0], 0.45, leaf);
    let waves = Arc::new(Image {
        width: 4,
        height: 4,
        pixels: (0..16).map(|i| Rgb::splat(0.1 * (i * 7 % 5) as f32)).collect(),
        alpha: Vec::new(),
    });
    let height = Texture::Image {
        image: waves,
        filter: TextureFilter::Bilinear,
        wrap: Wrap::Repeat,
        image_from_uv: Affine2::from_scale(Vec2::splat(2.0)),
    };
    let bumpy = MaterialDescription {
        normal_perturbation: Some(NormalPerturbation::BumpMap { height, scale: 0.5 }),
        ..MaterialDescription::new(diffuse(Texture::Constant(Rgb::splat(0.7))), true)
    };
    scene.materials.push(bumpy.into());
    let bumpy = scene.materials.len() as u32 - 1;
    ball(&mut scene, [0.9, 0.5, -0.6], 0.5, bumpy);
    agrees("surfaces that vary", scene, 0.1);
}

/// Normal maps on metal, on a partly metallic surface, beneath a rough coat, and on a mirror.
#[test]
fn bumpy_gloss() {
    let mut scene = lit_room();
    let squares = |colors: [Rgb; 2]| Texture::Checkerboard {
        colors,
        squares_from_uv: Affine2::from_scale(Vec2::splat(6.0)),
    };
    let slopes = [Rgb::new(0.85, 0.5, 0.85), Rgb::new(0.35, 0.7, 0.85)];
    let grey = |value: f32| Texture::Constant(Rgb::splat(value));
    let principled = |metallic: Scalar, roughness: f32| MaterialKind::Principled {
        base_color: grey(0.7),
        metallic,
        roughness: Scalar::constant(roughness),
        interface: Interface::Eta(1.5),
        extras: None,
    };
    let parts = Scalar::of(squares([Rgb::ZERO, Rgb::ONE]));
    let coated = MaterialKind::RoughPlastic {
        reflectance: grey(0.5),
        specular_reflectance: grey(1.0),
        coat: Box::new(RoughCoat::new(Distribution::Ggx, 0.2, 1.5, false)),
    };
    let kinds = [
        principled(Scalar::constant(1.0), 0.6),
        principled(parts, 0.25),
        coated,
        MaterialKind::Mirror { reflectance: grey(0.9) },
    ];
    for (i, kind) in kinds.into_iter().enumerate() {
        let bumpy = MaterialDescription {
            normal_perturbation: Some(NormalPerturbation::NormalMap(squares(slopes))),
            ..MaterialDescription::new(kind, true)
        };
        scene.materials.push(bumpy.into());
        let bumpy = scene.materials.len() as u32 - 1;
        ball(&mut scene, [0.7 * i as f32 - 1.05, 0.5, -0.5], 0.33, bumpy);
    }
    agrees("bumpy gloss", scene, 0.1);
}
