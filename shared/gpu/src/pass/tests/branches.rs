//! Camera paths that split at smooth glass and smooth coats.

use super::expectation::{agrees, by_paths, lit_room, small};
use super::{ball, emits, fill, fog, glass, is_long, material, matt, plan, quad, render, room, stage};
use crate::testing::tested;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::world::bsdf::{Coat, MaterialKind, Tint};
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::{Scene, SceneDescription};

fn pane(scene: &mut SceneDescription, z: f32, surface: u32) {
    let corners = [[-1.2, -1.4], [1.1, -1.3], [1.2, 1.4], [-1.1, 1.2]];
    quad(scene, corners.map(|[x, y]| Vec3::new(x, y, z + 0.2 * x)), surface);
}

fn lacquer(scene: &mut SceneDescription, reflectance: [f32; 3]) -> u32 {
    let kind = MaterialKind::Plastic {
        reflectance: Texture::Constant(Rgb::from_array(reflectance)),
        specular_reflectance: Texture::Constant(Rgb::ONE),
        coat: Coat::new(1.5, false),
    };
    material(scene, kind, true)
}

/// Panes one behind the other, so that more branches wait than there is room for; a glass ball with a bubble; a coat.
fn add_glasses(scene: &mut SceneDescription) {
    let (eta, tint) = (1.5, Tint::NONE);
    let sheet = material(scene, MaterialKind::ThinDielectric { eta, tint }, true);
    for i in 0..4 {
        pane(scene, 0.9 - 0.25 * i as f32, sheet);
    }
    let clear = glass(scene, 1.5);
    ball(scene, [-0.5, -0.2, -0.9], 0.6, clear);
    let bubble = glass(scene, 1.0 / 1.5);
    ball(scene, [-0.5, -0.2, -0.9], 0.4, bubble);
    let coated = lacquer(scene, [0.1, 0.3, 0.7]);
    ball(scene, [0.7, -0.3, -0.9], 0.5, coated);
}

/// Walls of all colours that only emit, so that paths meet all light directly. Only branches with less than a
/// thousandth of a pixel's light are random, so both engines agree pixel by pixel.
#[test]
fn light_that_branches_meet_is_that_of_processors_pixel_by_pixel() {
    let Some(tested) = tested() else { return };
    let mut scene = stage();
    let black = matt(&mut scene, [0.0; 3]);
    for (i, wall) in room(&mut scene, black).into_iter().enumerate() {
        emits(&mut scene, wall, [0, 1, 2].map(|c| 0.2 + ((3 * i + 5 * c) % 7) as f32));
    }
    let (eta, tint) = (1.5, Tint::NONE);
    let sheet = material(&mut scene, MaterialKind::ThinDielectric { eta, tint }, true);
    pane(&mut scene, 0.8, sheet);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [-0.5, -0.2, -0.5], 0.6, clear);
    // Its base is black, so that only the coat reflects.
    let coated = lacquer(&mut scene, [0.0; 3]);
    ball(&mut scene, [0.7, -0.3, -0.5], 0.5, coated);
    let scene = Scene::new(by_paths(scene));
    let plan = plan(&scene, 5);
    let [expected, got] = [
        render_pass(&scene, &plan, 3).unwrap().film,
        render(tested, &scene, &plan, 3).film,
    ];
    let largest = |rgb: [f32; 3]| rgb.into_iter().fold(0.0, f32::max);
    let differs = |(a, b): (&[f32; 3], &[f32; 3])| {
        let off = std::array::from_fn(|c| (a[c] - b[c]).abs());
        largest(off) > 0.01 * largest(*a)
    };
    let others = expected.pixels.iter().zip(&got.pixels).filter(|pair| differs(*pair));
    // Without branches there are hundreds.
    assert!(others.count() <= 5);
}

/// Kernels with all features take long to compile.
#[test]
fn glasses_by_paths() {
    if !is_long() {
        return;
    }
    let mut scene = lit_room();
    add_glasses(&mut scene);
    agrees("glasses by paths", small(by_paths(scene)), 0.1);
}

#[test]
fn glasses_with_photons() {
    if !is_long() {
        return;
    }
    let mut scene = lit_room();
    add_glasses(&mut scene);
    agrees("glasses with photons", small(scene), 0.1);
}

/// Weak branches see fog only now and then.
#[test]
fn glasses_in_fog() {
    if !is_long() {
        return;
    }
    let mut scene = lit_room();
    let mist = fog(&mut scene, 0.1, 0.3);
    scene.world_medium = mist;
    let clear = glass(&mut scene, 1.5);
    let outer = ball(&mut scene, [-0.5, -0.2, 0.0], 0.6, clear);
    fill(&mut scene, outer, mist, mist);
    let coated = lacquer(&mut scene, [0.1, 0.3, 0.7]);
    ball(&mut scene, [0.7, -0.3, -0.2], 0.5, coated);
    agrees("glasses in fog", small(scene.clone()), 0.1);
    agrees("glasses in fog by paths", small(by_paths(scene)), 0.1);
}
