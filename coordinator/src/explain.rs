//! `beamfarm explain`: the plan of a scene.

use crate::failure::Failure;
use crate::output::print_text;
use crate::settings::{DeviceArgs, Loaded, SettingsArgs};
use beamfarm_image::job::{EngineKind, JobSettings, Techniques};
use beamfarm_image::layer::Layer;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::pilot::Choice;
use beamfarm_render::world::Scene;
use beamfarm_scene::Extent;
use beamfarm_worker::engine::{self, EngineError, Needed, Where};
use clap::Args;
use indicatif::BinaryBytes;

#[derive(Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    settings: SettingsArgs,

    #[command(flatten)]
    device: DeviceArgs,
}

pub fn main(args: ExplainArgs) -> Result<(), Failure> {
    // What a device cannot do is told beside the plan.
    let settings = SettingsArgs {
        device: None,
        ..args.settings.clone()
    };
    let loaded = settings.load(false)?;
    let extents = args.settings.of.file()?.extents()?;
    loaded.announce();
    // A driver is only asked for by name: what it says of its limits is the machine's, and not the scene's.
    let place = match args.device.gpu {
        Some(_) => args.device.here(),
        None => Where::Elsewhere,
    };
    print_text(&text(loaded, &extents, &place)?)
}

/// The plan of a scene, what a pilot chose among, and what a device at this place says of it.
pub fn text(loaded: Loaded, extents: &[Extent], place: &Where) -> Result<String, Failure> {
    let hash = loaded.bundle.hash();
    let scene = Scene::new(loaded.description);
    let plan = RenderPlan::new(&scene, loaded.settings)
        .with_layers(&scene, &loaded.layers)
        .map_err(Failure::usage)?;
    let choice = loaded.choice.as_ref().map(candidates).unwrap_or_default();
    let there = JobSettings {
        engine: EngineKind::Gpu,
        ..loaded.settings
    };
    let engine = engine(&scene, there, &loaded.layers, place)?;
    let places = places(extents);
    Ok(format!("scene {hash}\n{plan}{choice}{engine}{places}"))
}

/// Whether devices can render the scene, and what that takes, or all that keeps it from them; nothing where the program
/// has no such engine.
fn engine(scene: &Scene, settings: JobSettings, layers: &[Layer], place: &Where) -> Result<String, Failure> {
    let plan = RenderPlan::new(scene, settings).with_layers(scene, layers);
    Ok(match engine::check(scene, &plan.map_err(Failure::usage)?, place) {
        Ok(Needed { world, photons, paths }) => {
            let [all, world, photons, paths] = [world + photons + paths, world, photons, paths].map(BinaryBytes);
            format!("engine: gpu possible, takes {all}: scene {world}, photons {photons}, camera paths {paths}\n")
        }
        Err(EngineError::Scene(reasons)) => {
            let lines = reasons
                .iter()
                .map(|reason| format!("engine: gpu not possible, {reason}\n"));
            lines.collect()
        }
        Err(EngineError::NotBuilt) => String::new(),
        Err(error) => return Err(error.into()),
    })
}

/// Where things are: a line each, and one for all.
fn places(extents: &[Extent]) -> String {
    let lines = extents.iter().map(
        |Extent {
             name,
             corners: [low, high],
         }| {
            let point = |[x, y, z]: &[f64; 3]| format!("[{x:.4}, {y:.4}, {z:.4}]");
            format!("at  {name}: {} to {}\n", point(low), point(high))
        },
    );
    lines.collect()
}

/// What a pilot chose among, a line each.
fn candidates(choice: &Choice) -> String {
    let first = choice.candidates[0].cost();
    let lines = choice.candidates.iter().enumerate().map(|(number, candidate)| {
        let mark = if number == choice.best { "in " } else { "out" };
        // A picture without any light has no error.
        let cost = if first > 0.0 { candidate.cost() / first } else { 1.0 };
        let JobSettings {
            techniques,
            paths_per_pass,
            ..
        } = candidate.settings;
        let techniques = match techniques == Techniques::default() {
            true => "as in most scenes".to_owned(),
            false => techniques.to_string(),
        };
        format!("{mark}  error x time {cost:<17.3} {techniques}: {paths_per_pass} photon paths a pass\n")
    });
    lines.collect()
}
