//! Passes of scenes with varying densities, against the processor's: see `expectation.rs`.

use super::expectation::{agrees, by_paths, lit_room, small};
use super::{add_medium, ball, fill, fog, glass, is_long, material, matt, quad};
use beamfarm_image::job::Technique;
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::MaterialKind;
use beamfarm_render::world::medium::bricks::Bricks;
use beamfarm_render::world::medium::procedural::{Blob, Noise, Recipe};
use beamfarm_render::world::medium::transmittance::Estimator;
use beamfarm_render::world::medium::{Heterogeneous, Medium, MediumId};
use beamfarm_render::world::phase::Phase;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// A cloud of bricks: clumps of noise in a ball, with a density up to 1, over the cube [-1, 1]^3.
fn smoke(sigma: [[f32; 3]; 2], estimator: Estimator, map: DAffine3) -> Medium {
    let recipe = Recipe {
        corners: [DVec3::splat(-1.0), DVec3::ONE],
        voxel: 0.1,
        height: None,
        blobs: vec![Blob {
            center: DVec3::ZERO,
            radius: 0.45,
            density: 1.0,
        }],
        noise: Some(Noise {
            size: 0.7,
            octaves: 2,
            gain: 0.5,
            contrast: 2.0,
            seed: 3,
        }),
        graph: None,
    };
    let bricks = Arc::new(Bricks::new(&recipe.sample().unwrap()).unwrap());
    let phase = Phase::blend(0.4, [-0.2, 0.6]);
    Medium::Heterogeneous(Heterogeneous::new(
        sigma.map(Rgb::from_array),
        phase,
        estimator,
        bricks,
        map,
    ))
}

/// A ball of smoke in a room with a lamp, in front of a free-standing wall; callers may add more.
fn smoky(sigma: [[f32; 3]; 2], estimator: Estimator) -> (SceneDescription, MediumId) {
    let mut scene = lit_room();
    let grey = matt(&mut scene, [0.6; 3]);
    let corners = [[-2.0, -2.0], [0.2, -2.0], [0.2, 1.2], [-2.0, 1.2]];
    quad(&mut scene, corners.map(|[z, y]| Vec3::new(-1.1, y, z)), grey);
    let middle = DAffine3::from_translation(DVec3::new(-0.3, 0.0, -0.2));
    let cloud = add_medium(&mut scene, "cloud", smoke(sigma, estimator, middle));
    let nothing = material(&mut scene, MaterialKind::Null, true);
    let around = ball(&mut scene, [-0.3, 0.0, -0.2], 0.75, nothing);
    fill(&mut scene, around, cloud, None);
    (scene, cloud)
}

/// Beams contribute all light.
pub(super) fn in_smoke() -> SceneDescription {
    let (mut scene, _) = smoky([[0.3; 3], [2.0; 3]], Estimator::ResidualRatioTracking);
    scene.defaults.techniques.media = Some(Technique::Photons);
    scene
}

/// Camera paths find all light, with every transmittance estimator.
#[test]
fn a_ball_of_smoke() {
    let (scene, _) = smoky([[0.3; 3], [4.0; 3]], Estimator::ResidualRatioTracking);
    agrees("a ball of smoke", by_paths(scene), 0.02);
    let free = Estimator::FreeFlight { distances: 4 };
    let (scene, _) = smoky([[0.2; 3], [1.0, 2.0, 4.0]], free);
    agrees("a ball of smoke by free flights", small(by_paths(scene)), 0.05);
}

/// Beams contribute all its light, including direct light from the lamp.
pub(super) fn by_beams() -> SceneDescription {
    let (mut scene, _) = smoky([[0.3; 3], [4.0; 3]], Estimator::RatioTracking);
    scene.defaults.techniques.media = Some(Technique::Photons);
    small(scene)
}

#[test]
fn beams_in_a_ball_of_smoke() {
    agrees("beams in a ball of smoke", by_beams(), 0.1);
}

/// Coloured smoke in fog.
#[test]
fn coloured_smoke_in_fog() {
    if !is_long() {
        return;
    }
    let sigma = [[0.5, 0.1, 0.2], [1.0, 3.0, 5.0]];
    let (mut scene, cloud) = smoky(sigma, Estimator::ResidualRatioTracking);
    let air = fog(&mut scene, 0.1, 0.3);
    scene.world_medium = air;
    let last = scene.objects.len() as u32 - 1;
    fill(&mut scene, last, cloud, air);
    scene.defaults.techniques.media = Some(Technique::Photons);
    agrees("coloured smoke in fog", small(scene), 0.1);
}

/// Beams contain a lamp's caustics, and camera paths find the rest. Glass needs other kernels, which take long to
/// compile.
#[test]
fn smoke_around_glass() {
    if !is_long() {
        return;
    }
    let (mut scene, _) = smoky([[0.3; 3], [2.0; 3]], Estimator::ResidualRatioTracking);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [-0.3, 0.9, -0.2], 0.15, clear);
    scene.defaults.techniques.media = Some(Technique::Paths);
    agrees("smoke around glass", small(scene), 0.1);
}
