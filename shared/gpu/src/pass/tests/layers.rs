//! Layers other than the picture agree with the processor's passes.

use super::expectation::{agrees, layers_agree, lit_room};
use super::pictures::{add_sky, texture, things};
use super::{ball, fog, is_long, lamp, material, matt, plan, quad, render, stage};
use crate::testing::tested;
use crate::world::tests::scenes::{add_object, diffuse};
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_image::matte::Matte;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::world::bsdf::{Distribution, MaterialDescription, MaterialKind};
use beamfarm_render::world::geometry::{Mesh, Placement, Shape};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::{Scene, SceneDescription};
use glam::Affine3A;
use std::sync::Arc;

/// From the first surface of each pixel.
const OF_FIRSTS: [Layer; 5] = [
    Layer::Depth,
    Layer::Normal,
    Layer::Albedo,
    Layer::Objects,
    Layer::Materials,
];

/// From what its path finds.
const OF_LIGHT: [Layer; 4] = [Layer::Alpha, Layer::Direct, Layer::Surface, Layer::Volume];

/// Surfaces of many kinds in front of a sky, some behind glass.
fn many() -> SceneDescription {
    let mut scene = things();
    add_sky(&mut scene);
    let alpha = Scalar::constant(0.3);
    let white = Texture::Constant(Rgb::splat(0.9));
    let gold = MaterialKind::RoughConductor {
        distribution: Distribution::Ggx,
        alpha: alpha.clone(),
        eta: Rgb::new(0.2, 0.4, 1.3),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: white.clone(),
    };
    let gold = material(&mut scene, gold, true);
    ball(&mut scene, [-0.9, 0.9, -0.4], 0.4, gold);
    let patterned = matt(&mut scene, [0.5; 3]);
    scene.materials[patterned as usize] =
        MaterialDescription::new(MaterialKind::Diffuse { reflectance: texture() }, true).into();
    quad(
        &mut scene,
        [[0.2, 0.4], [1.4, 0.4], [1.4, 1.4], [0.2, 1.4]].map(|[x, y]| Vec3::new(x, y, -0.8)),
        patterned,
    );
    scene
}

/// Rectangles with a colour at each corner: untransformed, rotated, multiplied by a texture; and one without colours.
fn coloured() -> SceneDescription {
    let mut scene = stage();
    lamp(&mut scene, 0.6, [4.0, 3.0, 2.0]);
    let times = Some(Arc::new(texture()));
    let [own, times] = [None, times].map(|times| material(&mut scene, diffuse(Texture::VertexColors(times)), true));
    let corners = [[-0.6, -0.6], [0.6, -0.6], [0.6, 0.6], [-0.6, 0.6]];
    let colors = [[0.9, 0.1, 0.0], [0.2, 0.8, 0.1], [0.1, 0.1, 0.9], [0.0, 0.7, 0.5]];
    let turned = Affine3A::from_translation(Vec3::new(0.5, -0.6, 0.1)) * Affine3A::from_rotation_z(0.7);
    let turned = turned * Affine3A::from_scale(Vec3::new(0.5, 1.2, 1.0));
    let up = Affine3A::from_translation(Vec3::new(-0.6, 0.4, 0.0));
    let aside = Affine3A::from_translation(Vec3::new(0.9, 0.7, 0.0));
    for (from_object, material, has_colors) in [(up, own, true), (turned, times, true), (aside, own, false)] {
        let mesh = Mesh {
            positions: corners.map(|[x, y]| Vec3::new(x, y, -0.2)).to_vec(),
            uvs: corners.map(|[x, y]| Vec2::new(x, y)).to_vec(),
            colors: if has_colors {
                colors.map(Rgb::from_array).to_vec()
            } else {
                Vec::new()
            },
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let placement = Placement {
            render_from_object: from_object,
            object_from_render: from_object.inverse(),
        };
        let mesh = Arc::new(mesh);
        add_object(&mut scene, Shape::Mesh { mesh, placement }, material);
    }
    scene
}

/// Colours interpolate between corners.
#[test]
fn colours_of_vertices_are_the_processors() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(coloured());
    let plan = plan(&scene, 3).with_layers(&scene, &[Layer::Albedo]).unwrap();
    let expected = render_pass(&scene, &plan, 1).unwrap();
    let got = render(tested, &scene, &plan, 1);
    let values: std::collections::BTreeSet<_> = got.layers[0].pixels.iter().map(|p| p.map(f32::to_bits)).collect();
    assert!(values.len() > 200, "{}", values.len());
    for (expected, got) in expected.layers.iter().zip(&got.layers) {
        let differing = differing(expected, got);
        assert!(differing <= 3, "{differing}");
    }
    if is_long() {
        agrees("colours of vertices", coloured(), 0.06);
    }
}

/// Number of differing pixels.
fn differing(a: &Film, b: &Film) -> usize {
    let differ = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-4 * a[c].abs().max(1.0));
    a.pixels.iter().zip(&b.pixels).filter(|pair| differ(*pair)).count()
}

/// Pixel by pixel, except for a few at edges: without semi-transparent surfaces there is no randomness. Layers of light
/// add up to the picture.
#[test]
fn first_surfaces_are_the_processors() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(many());
    let layers = [
        &[Layer::Direct, Layer::Surface, Layer::Volume, Layer::Odd, Layer::Alpha],
        &OF_FIRSTS[..],
    ]
    .concat();
    for index in [0, 1] {
        let plan = plan(&scene, 3).with_layers(&scene, &layers).unwrap();
        let expected = render_pass(&scene, &plan, index).unwrap();
        let got = render(tested, &scene, &plan, index);
        assert_eq!((got.layers.len(), got.mattes.len()), (8, 2));
        let black = Film::new(got.film.width, got.film.height);
        assert_eq!(got.layers[3].pixels, [black, got.film.clone()][index as usize].pixels);
        for (i, pixel) in got.film.pixels.iter().enumerate() {
            let sum = [0, 1, 2].map(|c| (0..3).map(|part| got.layers[part].pixels[i][c]).sum::<f32>());
            assert_eq!(sum, *pixel);
        }
        for (layer, (expected, got)) in layers.iter().zip(expected.layers.iter().zip(&got.layers)).skip(4) {
            let values: std::collections::BTreeSet<_> = got.pixels.iter().map(|p| p.map(f32::to_bits)).collect();
            let least = if *layer == Layer::Alpha { 2 } else { 7 };
            assert!(values.len() >= least, "{layer:?}: {}", values.len());
            let differing = differing(expected, got);
            println!("{layer:?}: {differing} pixels differ");
            assert!(differing <= 5, "{layer:?}: {differing}");
        }
        for (expected, got) in expected.mattes.iter().zip(&got.mattes) {
            let ids = |matte: &Matte| -> Vec<Option<u32>> {
                matte
                    .by_pixel()
                    .map(|entries| entries.first().map(|entry| entry.id))
                    .collect()
            };
            let (expected, got) = (ids(expected), ids(got));
            let differing = expected.iter().zip(&got).filter(|(a, b)| a != b).count();
            assert!(differing <= 5, "{differing}");
        }
    }
}

/// With randomness: in fog, in front of a sky, through a semi-transparent curtain, and with a lens.
#[test]
fn layers_have_the_processors_expectation() {
    if !is_long() {
        return;
    }
    let mut scene = many();
    let mut curtain = MaterialDescription::new(
        MaterialKind::Diffuse {
            reflectance: Texture::Constant(Rgb::new(0.2, 0.3, 0.8)),
        },
        true,
    );
    curtain.opacity = Some(Texture::Constant(Rgb::splat(0.5)));
    scene.materials.push(curtain.into());
    let curtain = scene.materials.len() as u32 - 1;
    let corners = [[-1.5, -1.5], [0.0, -1.5], [0.0, 1.5], [-1.5, 1.5]];
    quad(&mut scene, corners.map(|[x, y]| Vec3::new(x, y, 0.9)), curtain);
    scene.camera.aperture = 0.05;
    scene.camera.focus_distance = 2.0;
    let layers = [&OF_LIGHT[..], &OF_FIRSTS[..3]].concat();
    layers_agree("layers before a sky", scene, &layers, 0.06);
    let mut scene = lit_room();
    scene.world_medium = fog(&mut scene, 0.1, 0.3);
    layers_agree("layers in fog", scene, &layers, 0.08);
}
