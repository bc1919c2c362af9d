//! Passes with aimed photons have the processor's expectation.

use super::expectation::agrees;
use super::pictures::{add_projector, add_sky, texture, things};
use super::{is_long, lamp, plan};
use beamfarm_image::job::Targeting;
use beamfarm_render::math::Rgb;
use beamfarm_render::plan::targeting::Targets;
use beamfarm_render::world::light::{LightKind, Pattern};
use beamfarm_render::world::{Scene, SceneDescription};
use std::sync::Arc;

/// All photons are aimed.
fn aimed(mut scene: SceneDescription) -> SceneDescription {
    scene.defaults.targeting = Targeting::On;
    let plan = plan(&Scene::new(scene.clone()), 100);
    let aims = plan.targets.as_deref().into_iter().flat_map(Targets::aims);
    assert_eq!(aims.count(), scene.lights.len());
    scene
}

#[test]
fn a_sky_with_a_sun_is_aimed() {
    if !is_long() {
        return;
    }
    let mut scene = things();
    add_sky(&mut scene);
    // Through glass, the processor's paths split: a few passes show the sun in it, which the device's paths miss.
    let [grey, .., ball] = &mut scene.objects[..] else {
        panic!("there are things")
    };
    (ball.material, ball.boundary) = (grey.material, None);
    agrees("an aimed sky", aimed(scene), 0.05);
}

#[test]
fn pictures_are_aimed() {
    if !is_long() {
        return;
    }
    let mut scene = things();
    add_projector(&mut scene, None);
    lamp(&mut scene, 0.4, [1.0; 3]);
    let LightKind::Area {
        object,
        radiance,
        pattern,
        ..
    } = &mut scene.lights[1].kind
    else {
        panic!("it is no lamp")
    };
    let shape = &scene.objects[*object as usize].shape;
    let (found, mean) = Pattern::new(texture(), Rgb::new(4.0, 3.0, 2.0), shape, None).unwrap();
    (*radiance, *pattern) = (mean, Some(Arc::new(found)));
    agrees("aimed pictures", aimed(scene), 0.06);
}
