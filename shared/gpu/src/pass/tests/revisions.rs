//! Changing scenes, whose unchanged data stays on the device.

use super::expectation::{lit_room, plans_agree};
use super::{ball, glass, material, matt, plan};
use crate::pass::{GpuPass, Kept};
use crate::testing::tested;
use beamfarm_image::film::Film;
use beamfarm_image::job::{JobSettings, Technique};
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::estimators::PathEnds;
use beamfarm_render::world::bsdf::{Distribution, MaterialKind};
use beamfarm_render::world::light::LightKind;
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::Texture;
use beamfarm_render::world::{Scene, SceneDescription};

/// A pass of a scene, and the data that it leaves.
fn revised(scene: &Scene, plan: &RenderPlan, kept: Option<Kept>) -> (Film, Option<Kept>) {
    let tested = tested().unwrap();
    let pass = GpuPass::of_revision(tested, scene, plan, kept).unwrap();
    let film = pass.render(3).unwrap().film;
    (film, pass.keep())
}

/// Independent of what was there before: camera, lamp, surfaces, objects, picture size and plan change.
#[test]
fn revisions_have_the_bits_of_other_passes() {
    let Some(tested) = tested() else { return };
    let mut scene = lit_room();
    let mut kept = None;
    let changes: [fn(&mut SceneDescription); 7] = [
        |_| {},
        |scene| scene.camera.position.x += 0.2,
        |scene| {
            let LightKind::Area { radiance, .. } = &mut scene.lights[0].kind else {
                panic!("it is a lamp")
            };
            *radiance = Vec3::new(1.0, 2.0, 6.0);
        },
        |scene| {
            let blue = matt(scene, [0.1, 0.2, 0.8]);
            scene.objects[6].material = blue;
        },
        |scene| {
            let clear = glass(scene, 1.5);
            ball(scene, [-0.6, -0.3, 0.0], 0.4, clear);
        },
        |scene| (scene.camera.width, scene.camera.height) = (24, 16),
        |scene| scene.defaults.paths_per_pass = Some(700),
    ];
    let mut before = Film::new(1, 1);
    for change in changes {
        change(&mut scene);
        let scene = Scene::new(scene.clone());
        let plan = plan(&scene, 5);
        let (film, left) = revised(&scene, &plan, kept);
        assert_ne!(film.pixels, before.pixels);
        let alone = GpuPass::new(tested, &scene, &plan).unwrap().render(3).unwrap();
        assert_eq!(film.pixels, alone.film.pixels);
        (kept, before) = (left, film);
    }
}

/// Sketches, whose paths end at first surfaces except those with narrow lobes.
#[test]
fn sketches_have_the_processors_expectation() {
    let mut scene = lit_room();
    scene.defaults.techniques.surfaces = Some(Technique::Photons);
    let glossy = MaterialKind::RoughConductor {
        distribution: Distribution::Ggx,
        alpha: Scalar::constant(0.2),
        eta: Rgb::new(0.2, 0.4, 1.3),
        k: Rgb::new(3.9, 2.4, 2.2),
        reflectance: Texture::Constant(Rgb::splat(0.9)),
    };
    let glossy = material(&mut scene, glossy, true);
    ball(&mut scene, [-0.8, 0.2, -0.2], 0.5, glossy);
    let sketch = |scene: &Scene, seed: u64| {
        let settings = JobSettings {
            seed,
            ..scene.description().defaults.job_settings()
        };
        let plan = RenderPlan::provisional(scene, settings);
        assert_eq!(plan.estimators.ends(), PathEnds::First);
        plan
    };
    plans_agree("sketches", scene, sketch, 0.05);
}
