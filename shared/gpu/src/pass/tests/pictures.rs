//! Passes with image-based lights have the processor's expectation.

use super::expectation::{agrees, by_paths, small};
use super::{add_light, ball, emits, fog, glass, lamp, matt, quad, room, stage};
use crate::world::tests::scenes::sky_with_a_sun;
use beamfarm_render::math::{Rgb, Vec2, Vec3, tan};
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::{Mesh, Placement, Shape};
use beamfarm_render::world::light::{LightKind, Pattern, Projector, lit_part};
use beamfarm_render::world::texture::{Image, Texture, TextureFilter, Wrap};
use glam::Affine2;
use std::sync::Arc;

/// 8 x 6 pixels: dark in one half, coloured in the other.
fn picture() -> Arc<Image> {
    let pixel = |i: u32| {
        let (x, y) = ((i % 8) as f32, (i / 8) as f32);
        match x < 3.0 {
            true => Rgb::ZERO,
            false => Rgb::new(0.2 * x, 0.3 * y, 1.0),
        }
    };
    Arc::new(Image {
        width: 8,
        height: 6,
        pixels: (0..48).map(pixel).collect(),
        alpha: Vec::new(),
    })
}

/// A floor, a wall and two balls, one of them of glass.
pub(super) fn things() -> SceneDescription {
    let mut scene = stage();
    let grey = matt(&mut scene, [0.6, 0.5, 0.4]);
    let floor = [[-2.0, 2.0], [2.0, 2.0], [2.0, -2.0], [-2.0, -2.0]];
    quad(&mut scene, floor.map(|[x, z]| Vec3::new(x, -1.2, z)), grey);
    ball(&mut scene, [0.7, -0.6, -0.5], 0.6, grey);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [-0.6, -0.3, 0.0], 0.6, clear);
    scene
}

pub(super) fn texture() -> Texture {
    Texture::Image {
        image: picture(),
        filter: TextureFilter::Bilinear,
        wrap: Wrap::Repeat,
        image_from_uv: Affine2::IDENTITY,
    }
}

/// A window in the ceiling that emits an image, and a ball that emits another.
#[test]
fn lamps_of_radiance_that_varies() {
    let mut scene = stage();
    let grey = matt(&mut scene, [0.6; 3]);
    room(&mut scene, grey);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [-0.6, -0.3, 0.0], 0.6, clear);
    lamp(&mut scene, 0.8, [1.0; 3]);
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mesh = Mesh {
        positions: corners.map(|[x, z]| Vec3::new(0.8 * x, 1.9, 0.8 * z)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: corners.map(|[x, z]| 0.5 * Vec2::new(x + 1.0, z + 1.0)).to_vec(),
        ..Mesh::default()
    };
    let black = matt(&mut scene, [0.0; 3]);
    let bulb = ball(&mut scene, [0.8, -0.9, -0.6], 0.4, black);
    emits(&mut scene, bulb, [1.0; 3]);
    for (light, scale) in [(0, [4.0, 3.0, 2.0]), (1, [2.0, 2.0, 4.0])] {
        let LightKind::Area {
            object,
            radiance,
            pattern,
            ..
        } = &mut scene.lights[light].kind
        else {
            panic!("it is no lamp")
        };
        let shape = &mut scene.objects[*object as usize].shape;
        if light == 0 {
            *shape = Shape::Mesh {
                mesh: Arc::new(mesh.clone()),
                placement: Placement::IDENTITY,
            };
        }
        let (found, mean) = Pattern::new(texture(), Rgb::from_array(scale), shape, None).unwrap();
        (*radiance, *pattern) = (mean, Some(Arc::new(found)));
    }
    agrees("lamps of radiance that varies", scene, 0.05);
}

/// A sky with a bright sun in it, split into two lights, rotated.
pub(super) fn add_sky(scene: &mut SceneDescription) {
    let skies = sky_with_a_sun();
    assert_eq!(skies.len(), 2);
    for sky in skies {
        add_light(scene, "sky", LightKind::Environment(sky));
    }
}

#[test]
fn a_sky_with_a_sun() {
    let mut scene = things();
    add_sky(&mut scene);
    agrees("a sky with a sun", scene, 0.05);
}

#[test]
fn a_sky_seen_by_paths() {
    let mut scene = things();
    add_sky(&mut scene);
    agrees("a sky seen by paths", by_paths(scene), 0.05);
}

pub(super) fn add_projector(scene: &mut SceneDescription, cone: Option<[f32; 2]>) {
    let (image, filter) = (picture(), TextureFilter::Bilinear);
    let forward = Vec3::new(0.1, -1.0, -0.2).normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let projector = Projector {
        position: Vec3::new(0.0, 1.7, 0.3),
        axes: [right, right.cross(forward), forward],
        half: match cone {
            Some([cutoff, _]) => Vec2::splat(tan(cutoff)),
            None => Vec2::new(0.8, 0.6),
        },
        lit: lit_part(&image, filter),
        image,
        filter,
        intensity: Rgb::new(6.0, 5.0, 4.0),
        cone,
    };
    add_light(scene, "projector", LightKind::Projector(projector));
}

/// A projector in fog, and a spot with an image in its cone.
#[test]
fn pictures_in_fog() {
    let mut scene = things();
    let grey = matt(&mut scene, [0.6; 3]);
    room(&mut scene, grey);
    add_projector(&mut scene, None);
    add_projector(&mut scene, Some([0.7, 0.5]));
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    agrees("pictures in fog", small(scene), 0.1);
}
