//! Layers of light groups agree with the picture and with the processor's.

use super::expectation::{layers_agree, lit_room};
use super::pictures::{add_sky, things};
use super::waves::flint_in_fog;
use super::{ball, emits, fill, fog, glass, is_long, matt, plan, render};
use crate::testing::tested;
use crate::world::tests::scenes::add_light;
use beamfarm_image::film::Film;
use beamfarm_image::job::Targeting;
use beamfarm_image::layer::{Layer, LightGroup};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::Vec3;
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::{Scene, SceneDescription};

fn add_bulb(scene: &mut SceneDescription, position: [f32; 3], intensity: [f32; 3]) {
    let [position, intensity] = [position, intensity].map(Vec3::from_array);
    add_light(scene, "bulb", LightKind::Point { position, intensity });
}

/// Each light in its own group, and a layer for every group.
fn apart(scene: &mut SceneDescription) -> Vec<Layer> {
    let group = |i: usize| LightGroup::named(&format!("light {i}"));
    for (i, light) in scene.lights.iter_mut().enumerate() {
        light.group = group(i);
    }
    (0..scene.lights.len()).map(|i| Layer::Light(group(i))).collect()
}

/// Five lights, which take two records of three groups, around a glass ball in a room full of fog.
fn lit_by_five() -> SceneDescription {
    let mut scene = lit_room();
    let black = matt(&mut scene, [0.0; 3]);
    let glows = ball(&mut scene, [-1.2, 1.0, -1.0], 0.3, black);
    emits(&mut scene, glows, [0.5, 2.0, 4.0]);
    add_bulb(&mut scene, [1.4, 0.5, 0.3], [0.8, 0.2, 0.1]);
    add_bulb(&mut scene, [-1.4, -1.5, -1.0], [0.1, 0.9, 0.2]);
    add_bulb(&mut scene, [0.0, 1.5, 1.0], [0.3, 0.3, 0.9]);
    let mist = fog(&mut scene, 0.1, 0.3);
    scene.world_medium = mist;
    let clear = glass(&mut scene, 1.5);
    let clear = ball(&mut scene, [-0.5, -0.4, 0.2], 0.5, clear);
    for object in [glows, clear] {
        fill(&mut scene, object, None, mist);
    }
    scene
}

fn sum(film: &Film) -> [f64; 3] {
    let channel = |c: usize| film.pixels.iter().map(|pixel| f64::from(pixel[c])).sum();
    [0, 1, 2].map(channel)
}

/// In each pixel the groups add up to the picture, whose bits do not depend on the layers. And each group shows its own
/// lights: noise in either engine is below a fifth, and lights differ in colour.
#[test]
fn groups_of_lights_sum_up_to_the_picture() {
    let Some(tested) = tested() else { return };
    let mut scene = lit_by_five();
    let layers = apart(&mut scene);
    let scene = Scene::new(scene);
    let alone = plan(&scene, 3);
    assert!(alone.beams && alone.surface_photons);
    // Others between them, and one group without a layer.
    let mut some = layers.clone();
    some.remove(1);
    some.insert(2, Layer::Volume);
    for (layers, index) in [(&layers, 1), (&some, 0)] {
        let with_layers = plan(&scene, 3).with_layers(&scene, layers).unwrap();
        let expected = render(tested, &scene, &alone, index);
        let got = render(tested, &scene, &with_layers, index);
        assert!(got.film.pixels == expected.film.pixels);
        let of_groups: Vec<_> = (layers.iter().zip(&got.layers))
            .filter(|(layer, _)| matches!(layer, Layer::Light(_)))
            .collect();
        for (layer, film) in &of_groups {
            let lit = film.pixels.iter().filter(|pixel| **pixel != [0.0; 3]).count();
            assert!(lit > 700, "{layer:?}: {lit}");
        }
        let of_processors = render_pass(&scene, &with_layers, index).unwrap();
        for ((layer, got), expected) in layers.iter().zip(&got.layers).zip(&of_processors.layers) {
            let (got, expected) = (sum(got), sum(expected));
            let ratios = [0, 1, 2].map(|c| got[c] / expected[c]);
            println!("{layer:?}: {ratios:.3?}");
            assert!(
                ratios.iter().all(|ratio| (0.8..1.25).contains(ratio)),
                "{layer:?}: {ratios:?}"
            );
        }
        if of_groups.len() < 5 {
            continue;
        }
        for (i, pixel) in got.film.pixels.iter().enumerate() {
            for (c, all) in pixel.iter().enumerate() {
                let sum: f32 = of_groups.iter().map(|(_, film)| film.pixels[i][c]).sum();
                assert!((sum - all).abs() <= 1e-5 * all, "{i}: {sum} and not {all}");
            }
        }
    }
}

/// By light, against processors, with beams, photons and paths; with wavelengths; and in front of a sky.
#[test]
fn groups_of_lights_have_the_processors_expectation() {
    if !is_long() {
        return;
    }
    let mut scene = lit_by_five();
    let layers = apart(&mut scene);
    layers_agree("groups of lights", scene, &layers, 0.1);
    let mut scene = flint_in_fog();
    add_bulb(&mut scene, [0.0, 1.5, 1.0], [0.3, 0.3, 0.9]);
    let layers = apart(&mut scene);
    layers_agree("groups of lights that are split", scene, &layers, 0.1);
    let mut scene = things();
    add_sky(&mut scene);
    add_bulb(&mut scene, [0.0, 1.5, 1.0], [3.0, 3.0, 9.0]);
    let layers = apart(&mut scene);
    layers_agree("a sky and a bulb", scene, &layers, 0.06);
}

/// Results of rays alone match the processor's pixel by pixel, and beam counts agree.
#[test]
fn targets_and_beams_are_counted() {
    let Some(tested) = tested() else { return };
    let mut scene = lit_by_five();
    scene.defaults.targeting = Targeting::On;
    let scene = Scene::new(scene);
    let layers = [Layer::Targets, Layer::BeamDensity];
    let plan = plan(&scene, 3).with_layers(&scene, &layers).unwrap();
    assert!(plan.targets.is_some());
    let expected = render_pass(&scene, &plan, 2).unwrap();
    let got = render(tested, &scene, &plan, 2);
    assert!(got.layers[0].pixels == expected.layers[0].pixels);
    assert!(got.layers[0].pixels.iter().any(|pixel| pixel[0] > 0.0));
    let [got, expected] = [&got, &expected].map(|image| sum(&image.layers[1])[0]);
    println!("{got} beams, {expected} by processors");
    assert!((got / expected - 1.0).abs() < 0.1, "{got} and not {expected}");
}
