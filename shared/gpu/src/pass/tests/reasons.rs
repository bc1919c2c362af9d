//! Plans that devices cannot render report their reasons.

use super::{ball, furnace, glass, plan};
use crate::error::Error;
use crate::pass::GpuPass;
use crate::testing::tested;
use beamfarm_image::job::Targeting;
use beamfarm_image::layer::Layer;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::{Scene, SceneDescription};

fn scene(targeting: Targeting) -> Scene {
    let mut scene: SceneDescription = furnace(0.5);
    let clear = glass(&mut scene, 1.5);
    ball(&mut scene, [0.0, 0.0, 0.0], 0.6, clear);
    scene.defaults.targeting = targeting;
    Scene::new(scene)
}

fn reasons(scene: &Scene, plan: &RenderPlan) -> Vec<String> {
    let reasons = GpuPass::reasons(scene, plan, 1 << 30);
    reasons.iter().map(ToString::to_string).collect()
}

#[test]
fn plans_say_what_of_them_kernels_do_not_do() {
    let scene = scene(Targeting::Off);
    let offered = plan(&scene, 1);
    assert_eq!(reasons(&scene, &offered), Vec::<String>::new());
    let layers = [Layer::Depth, Layer::Objects];
    let with_depth = offered.clone().with_layers(&scene, &layers).unwrap();
    assert_eq!(reasons(&scene, &with_depth), Vec::<String>::new());
    let mut waves = offered.clone();
    waves.waves = 9;
    let no_waves = "plan: waves: there are 9, and 8 are the most";
    assert_eq!(reasons(&scene, &waves), [no_waves]);
    let Some(tested) = tested() else { return };
    let error = GpuPass::new(tested, &scene, &waves).err().map(|error| match error {
        Error::Unsuitable { reasons, .. } => reasons,
        other => other.to_string(),
    });
    assert_eq!(error, Some(no_waves.to_owned()));
}

#[test]
fn photons_that_are_dropped_where_they_miss_are_not_for_kernels() {
    let rejecting = scene(Targeting::Reject);
    let no_drops = "plan: targets: kernels have no photons that are dropped where they miss";
    assert_eq!(reasons(&rejecting, &plan(&rejecting, 1)), [no_drops]);
    let aiming = scene(Targeting::On);
    let aimed = plan(&aiming, 1);
    assert!(aimed.targets.is_some());
    assert_eq!(reasons(&aiming, &aimed), Vec::<String>::new());
}

/// The predicted memory of paths is what they take, or up to a tenth less.
#[test]
fn memory_is_known_before() {
    let Some(tested) = tested() else { return };
    let scene = scene(Targeting::Off);
    let plan = plan(&scene, 1);
    let memory = GpuPass::memory(&scene, &plan);
    assert_eq!(memory.total(), memory.world + memory.photons + memory.paths);
    let pass = GpuPass::new(tested, &scene, &plan).unwrap();
    let taken = pass.bytes_of_paths();
    assert!(
        memory.paths <= taken && taken <= memory.paths + memory.paths / 10,
        "{} and not {taken}",
        memory.paths
    );
}
