//! `beamfarm explain`: the plan of a scene.

use crate::failure::Failure;
use crate::output::print_text;
use crate::settings::SettingsArgs;
use beamfarm_image::job::{JobSettings, Techniques};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::pilot::Choice;
use beamfarm_render::world::Scene;
use beamfarm_scene::Extent;
use clap::Args;

#[derive(Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    settings: SettingsArgs,
}

pub fn main(args: ExplainArgs) -> Result<(), Failure> {
    let loaded = args.settings.load(false)?;
    let extents = args.settings.of.file()?.extents()?;
    loaded.announce();
    let hash = loaded.bundle.hash();
    let scene = Scene::new(loaded.description);
    let plan = RenderPlan::new(&scene, loaded.settings)
        .with_layers(&scene, &loaded.layers)
        .map_err(Failure::usage)?;
    let choice = loaded.choice.as_ref().map(candidates).unwrap_or_default();
    let places = places(&extents);
    print_text(&format!("scene {hash}\n{plan}{choice}{places}"))
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
