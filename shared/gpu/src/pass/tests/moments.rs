//! Passes of moving scenes.

use super::expectation::agrees;
use super::{ball, fill, fog, glass, is_long, lamp, matt, plan, room, stage};
use crate::pass::GpuPass;
use crate::testing::tested;
use beamfarm_image::film::Film;
use beamfarm_image::layer::Layer;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::Vec3;
use beamfarm_render::world::medium::Medium;
use beamfarm_render::world::{Motion, Scene, SceneDescription};

/// A glass ball that flies through a room, under a growing lamp, in front of a sinking camera.
fn room_at(time: f64) -> SceneDescription {
    let time = time as f32;
    let mut scene = stage();
    let grey = matt(&mut scene, [0.6; 3]);
    room(&mut scene, grey);
    let clear = glass(&mut scene, 1.5);
    let flies = ball(&mut scene, [1.6 * time - 0.6, -0.3, 0.0], 0.5, clear);
    lamp(&mut scene, 0.4 + 0.4 * time, [4.0, 3.0, 2.0]);
    let around = fog(&mut scene, 0.1, 0.3);
    scene.world_medium = around;
    fill(&mut scene, flies, None, around);
    scene.camera.position += Vec3::new(0.0, -0.3 * time, 0.0);
    scene
}

/// The same with air that clears up.
fn clearing_at(time: f64) -> SceneDescription {
    let mut scene = room_at(time);
    if time > 0.5 {
        let Medium::Homogeneous(fog) = &mut scene.media[0] else {
            panic!("it is even")
        };
        fog.sigma_s = Vec3::ZERO;
    }
    scene
}

fn moving(at: fn(f64) -> SceneDescription) -> SceneDescription {
    let mut scene = at(0.5);
    scene.motion = Some(Motion::new([0.0, 1.0], move |time| Ok(at(time))));
    scene
}

/// The plan changes for a while, and with it the data on the device.
#[test]
fn moments_may_have_plans_of_their_own() {
    if is_long() {
        agrees("air that clears up", moving(clearing_at), 0.12);
    }
}

/// Against the processor: the first surfaces of each pass match exactly.
#[test]
fn passes_see_the_moments_of_a_processor() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(moving(clearing_at));
    let plan = plan(&scene, 5)
        .with_layers(&scene, &[Layer::Depth, Layer::Motion])
        .unwrap();
    let pass = GpuPass::new(tested, &scene, &plan).unwrap();
    let mut before = Film::new(1, 1);
    for (index, image) in (0..4).zip(pass.render_all(&[0, 1, 2, 3]).unwrap()) {
        let expected = render_pass(&scene, &plan, index).unwrap();
        let depths = expected.layers[0].pixels.iter().zip(&image.layers[0].pixels);
        let differing = depths
            .filter(|(a, b)| (a[0] - b[0]).abs() > 1e-4 || a[1] != b[1])
            .count();
        assert!(differing <= 3, "{differing}");
        assert_ne!(before.pixels, image.layers[0].pixels);
        assert_eq!(expected.layers[1].pixels, image.layers[1].pixels);
        assert!(image.layers[1].pixels.iter().any(|motion| motion[0] > 1.0));
        before = image.layers[0].clone();
    }
}

/// Independent of earlier passes on the same buffers.
#[test]
fn passes_of_moments_have_their_own_bits() {
    let Some(tested) = tested() else { return };
    let scene = Scene::new(moving(clearing_at));
    let plan = plan(&scene, 5);
    let pass = GpuPass::new(tested, &scene, &plan).unwrap();
    assert_eq!(pass.passes_together(), 1);
    let together = pass.render_all(&[0, 1, 2, 3]).unwrap();
    for (index, image) in [3, 1, 0].map(|index| (index, &together[index as usize])) {
        let other = GpuPass::new(tested, &scene, &plan).unwrap();
        let alone = other.render(index).unwrap();
        assert_eq!(alone.film.pixels, image.film.pixels);
    }
    assert_ne!(together[0].film.pixels, together[1].film.pixels);
}

/// An invalid moment is reported for the pass that sees it.
#[test]
fn moments_that_are_not_there_are_errors() {
    let Some(tested) = tested() else { return };
    let mut scene = room_at(0.5);
    scene.motion = Some(Motion::new([0.0, 1.0], |_| Err("the ball has burst".to_owned())));
    let scene = Scene::new(scene);
    let plan = plan(&scene, 5);
    let pass = GpuPass::new(tested, &scene, &plan).unwrap();
    let error = pass.render(4).unwrap_err().to_string();
    assert!(
        error.contains("pass 4") && error.contains("the ball has burst"),
        "{error}"
    );
}
