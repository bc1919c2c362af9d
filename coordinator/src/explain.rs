//! `beamfarm explain`: the plan of a scene.

use crate::failure::Failure;
use crate::loaded::Loaded;
use crate::output::print_text;
use crate::settings::{DeviceArgs, SettingsArgs};
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

pub const EXAMPLES: &str = "\
Examples:
  beamfarm explain scene.toml
  beamfarm explain scene.toml | grep ^skips           what passes leave out, and why
  beamfarm explain scene.toml | grep -E '^(chosen|tried)'
                                                      what the pilot compared
  beamfarm explain scene.toml | grep ^at              where things are, for the camera and lights
  beamfarm explain scene.toml -D render.caustics=paths
                                                      what another choice would change
  beamfarm explain scene.toml --gpu 0                 whether this device can render it, too

One fact a line: `uses` and `skips` name a stage of every pass or one that the scene does without. A pilot renders small
pictures before the first pass and compares ways to find the light: `chosen` is the one that passes take, `tried` are
the others. It compares only what neither the scene nor an option decides.";

/// Heading of a pilot's candidates.
const PILOT: &str = "What the pilot compared, by squared error x time: 0.5 takes half the time for the same noise.\n\
                     The first is 1, and stays unless another is clearly better:";

pub fn main(args: ExplainArgs) -> Result<(), Failure> {
    // What a device cannot do is reported next to the plan.
    let settings = SettingsArgs {
        device: None,
        ..args.settings.clone()
    };
    let loaded = settings.load(false)?;
    let extents = args.settings.of.file()?.extents()?;
    loaded.announce();
    // A driver is only asked if it was named: its limits belong to the machine, not to the scene.
    let place = match args.device.gpu {
        Some(_) => args.device.here(),
        None => Where::Elsewhere,
    };
    print_text(&text(loaded, &extents, &place)?)
}

/// The plan of a scene, the pilot's candidates, and whether the device at this place can render it.
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
    Ok(format!("scene {hash}\n\n{plan}{choice}{engine}{places}"))
}

/// Whether devices can render the scene and what that takes, or everything that prevents it. Empty if the program has
/// no such engine.
fn engine(scene: &Scene, settings: JobSettings, layers: &[Layer], place: &Where) -> Result<String, Failure> {
    let plan = RenderPlan::new(scene, settings).with_layers(scene, layers);
    Ok(match engine::check(scene, &plan.map_err(Failure::usage)?, place) {
        Ok(Needed { world, photons, paths }) => {
            let [all, world, photons, paths] = [world + photons + paths, world, photons, paths].map(BinaryBytes);
            format!("\nengine: gpu possible, takes {all}: scene {world}, photons {photons}, camera paths {paths}\n")
        }
        Err(EngineError::Scene(reasons)) => {
            let lines = reasons
                .iter()
                .map(|reason| format!("engine: gpu not possible, {reason}\n"));
            format!("\n{}", lines.collect::<String>())
        }
        Err(EngineError::NotBuilt) => String::new(),
        Err(error) => return Err(error.into()),
    })
}

/// Where things are: one line each, and one for all.
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
    match lines.collect::<String>() {
        lines if lines.is_empty() => lines,
        lines => format!("\nWhere things are, corners of their boxes in scene units:\n{lines}"),
    }
}

/// The pilot's candidates, one line each.
fn candidates(choice: &Choice) -> String {
    let first = choice.candidates[0].cost();
    let lines = choice.candidates.iter().enumerate().map(|(number, candidate)| {
        let mark = if number == choice.best { "chosen" } else { "tried " };
        // A black picture has no error.
        let cost = if first > 0.0 { candidate.cost() / first } else { 1.0 };
        let JobSettings {
            techniques,
            paths_per_pass,
            ..
        } = candidate.settings;
        let techniques = match techniques == Techniques::default() {
            true => "default techniques".to_owned(),
            false => techniques.to_string(),
        };
        format!("{mark}  {cost:>7.3}  {techniques}: {paths_per_pass} photon paths a pass\n")
    });
    let lines: String = lines.collect();
    format!("\n{PILOT}\n{lines}")
}
