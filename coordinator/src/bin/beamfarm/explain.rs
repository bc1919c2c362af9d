//! `beamfarm explain`: the plan of a scene.

use crate::failure::Failure;
use crate::job::SettingsArgs;
use crate::output::print_text;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use clap::Args;

#[derive(Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    settings: SettingsArgs,
}

pub fn main(args: ExplainArgs) -> Result<(), Failure> {
    let loaded = args.settings.load()?;
    loaded.announce();
    let hash = loaded.bundle.hash();
    let scene = Scene::new(loaded.description);
    let plan = RenderPlan::new(&scene, loaded.settings)
        .with_layers(&scene, &loaded.layers)
        .map_err(Failure::usage)?;
    print_text(&format!("scene {hash}\n{plan}"))
}
