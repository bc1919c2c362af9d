//! Aimed photons.

use super::{compare, scenes, settings};
use crate::kernels::TRACE;
use crate::testing::{same_layout, tested};
use crate::world::FlatWorld;
use crate::world::aims::{Aim, AimDisc};
use crate::world::lights::{AREA, DIRECTIONAL, ENVIRONMENT, POINT, SMOOTH_SPOT, SPOT, SUN, TWO_SIDED_AREA};
use crate::world::tests::scenes::sky_with_a_sun;
use beamfarm_image::job::{JobSettings, Technique, Techniques};
use beamfarm_render::math::{Frame, Rgb, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::light::{Environment, Light, LightKind, Ramp, Spot};
use glam::Mat3;
use std::collections::BTreeMap;

fn aimed(scene: &Scene, surfaces: Option<Technique>) -> RenderPlan {
    let settings = settings(400, None, surfaces);
    let techniques = Techniques {
        aimed: Some(true),
        ..settings.techniques
    };
    RenderPlan::new(scene, JobSettings { techniques, ..settings })
}

/// Under a uniform sky, with a spot whose falloff is linear.
fn under_a_sky() -> Scene {
    let all = scenes::all();
    let (_, floor) = all.iter().find(|(name, _)| *name == "under a lamp").unwrap();
    let mut scene = floor.description().clone();
    let lamp = scene.lights.pop().unwrap();
    scene.objects.iter_mut().for_each(|object| object.light = None);
    let kinds = [
        LightKind::Environment(Environment::new(None, Rgb::new(0.5, 0.6, 0.9), Mat3::IDENTITY)),
        LightKind::Spot(Spot {
            position: Vec3::new(0.4, 1.2, -0.2),
            frame: Frame::from_normal(Vec3::new(-0.3, -0.9, 0.1).normalize()),
            intensity: Rgb::new(3.0, 4.0, 5.0),
            cutoff: 0.6,
            beam_width: 0.2,
            ramp: Ramp::Linear,
            radius: 0.0,
            soft: false,
        }),
    ];
    scene.lights.extend(kinds.map(|kind| Light { kind, ..lamp.clone() }));
    Scene::new(scene)
}

/// The same under an image sky with a sun in it: two lights.
fn under_a_picture() -> Scene {
    let scene = under_a_sky();
    let mut scene = scene.description().clone();
    let light = scene.lights.remove(0);
    scene.lights = sky_with_a_sun()
        .into_iter()
        .map(|sky| Light {
            kind: LightKind::Environment(sky),
            ..light.clone()
        })
        .collect();
    Scene::new(scene)
}

/// Path by path as on the processor, with the same numbers and through the same discs.
#[test]
fn photons_that_are_aimed_leave_what_they_leave_on_a_processor() {
    let Some(tested) = tested() else { return };
    let mut kinds = BTreeMap::new();
    for (name, scene) in scenes::all()
        .into_iter()
        .chain([("under a sky", under_a_sky()), ("under a picture", under_a_picture())])
    {
        for (surfaces, pass) in [(None, 0), (Some(Technique::Photons), 50)] {
            let plan = aimed(&scene, surfaces);
            let world = FlatWorld::new(&scene, u64::MAX).unwrap().planned_by(&scene, &plan);
            for (light, aim) in world.lights.iter().zip(&world.aims.aims) {
                *kinds.entry(light.kind).or_insert(0) += u32::from(aim.count > 0);
            }
            compare(tested, name, &scene, &plan, pass);
        }
    }
    // All except those with image lights.
    let of_all = [
        POINT,
        SPOT,
        SMOOTH_SPOT,
        DIRECTIONAL,
        SUN,
        AREA,
        TWO_SIDED_AREA,
        ENVIRONMENT,
    ];
    assert!(
        of_all
            .iter()
            .all(|kind| kinds.get(kind).is_some_and(|count| *count > 0)),
        "{kinds:?}"
    );
}

#[test]
fn aims_lie_in_memory_as_kernels_have_them() {
    same_layout!(
        &TRACE,
        Aim {
            plain,
            first,
            count,
            root,
            emitted,
            own_pdf,
            own_directions
        }
    );
    same_layout!(
        &TRACE,
        AimDisc {
            center,
            radius,
            normal,
            cos_spread,
            density,
            sum,
            cone,
            cone_pdf
        }
    );
}
