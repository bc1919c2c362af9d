//! `beamfarm replay`: one pass again, in this process.

use crate::failure::Failure;
use crate::output::{Output, check};
use crate::settings::{DeviceArgs, SettingsArgs};
use beamfarm_image::atomic::write_file;
use beamfarm_image::exr::{BlockMeta, encode_block, pixel_hash};
use beamfarm_image::job::{Block, MAX_PASSES};
use beamfarm_image::merge::Node;
use beamfarm_proto::VERSION;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_worker::engine::{Engines, Planned};
use beamfarm_worker::say;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

pub const EXAMPLES: &str = "\
Examples:
  beamfarm replay scene.toml --pass 17
  beamfarm replay scene.toml --pass 17 -o pass17.exr

Prints the hash of the pass's pixels: the one that a farm logs for this pass with
--log beamfarm_coordinator=debug, when scene, seed, paths and alpha are the same, and what a
pilot found: of a job with --time it may have found something else, which -D says.";

#[derive(Args)]
pub struct ReplayArgs {
    #[command(flatten)]
    settings: SettingsArgs,

    /// Which pass, counted from zero
    #[arg(long, value_name = "I", value_parser = clap::value_parser!(u64).range(..MAX_PASSES))]
    pass: u64,

    /// Write the pass to this file as well
    #[arg(short, long, value_name = "OUT.exr", help_heading = "Output")]
    output: Option<PathBuf>,

    /// Threads [default: one per core]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Device")]
    threads: Option<u16>,

    #[command(flatten)]
    device: DeviceArgs,
}

pub fn main(args: ReplayArgs) -> Result<(), Failure> {
    args.output.as_deref().map_or(Ok(()), check)?;
    let asked = SettingsArgs {
        device: Some(args.device.here()),
        ..args.settings.clone()
    };
    let loaded = asked.load(false)?;
    if loaded.standard_error {
        let message = "--aov stderr: one pass tells nothing about its error";
        return Err(Failure::usage(message));
    }
    loaded.announce();
    let output = match &args.output {
        Some(path) => Some(Output::new(Some(path), &args.settings.of.scene, "", false)?),
        None => None,
    };
    // Zero threads mean one per core.
    let threads = args.threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(Failure::io)?;
    let (settings, layers, hash) = (loaded.settings, loaded.layers, loaded.bundle.hash());
    let engines = Engines::new(&args.device.gpu.unwrap_or_default());
    let (image, seconds) = pool.install(|| {
        let scene = Scene::new(loaded.description);
        let plan = RenderPlan::new(&scene, settings).with_layers(&scene, &layers);
        let plan = plan.map_err(Failure::usage)?;
        let engine = engines.engine(Arc::new(Planned { scene, plan }))?;
        let begun = Instant::now();
        let image = engine.pass(args.pass)?;
        Ok::<_, Failure>((image, begun.elapsed().as_secs_f64()))
    })?;
    say!("pass {} pixels {}", args.pass, pixel_hash(&image.film));
    let stats = image.stats;
    say!(
        "{seconds:.3} s, {} photon paths, {} beams, {} surface photons, {} beam evaluations",
        stats.paths,
        stats.beams,
        stats.surface_photons,
        stats.beam_evaluations
    );
    // Devices do not measure it.
    if stats.beam_bytes > 0 {
        say!("{:.0} bytes a beam", stats.bytes_per_beam());
    }
    let bad = stats.non_finite;
    if bad > 0 {
        return Err(Failure::job(format!("{bad} pixel values are not finite")));
    }
    if let Some(output) = output {
        let meta = BlockMeta {
            scene: hash,
            block: Block::leaf(args.pass),
            seed: settings.seed,
            alpha: settings.alpha,
            radius_scale: image.radius_scale,
            version: VERSION.into(),
            engine: settings.engine,
        };
        let node = Node::leaf(args.pass, image.film)
            .with_layers(image.layers)
            .with_mattes(image.mattes);
        let bytes = encode_block(&node, &meta, &layers)?;
        write_file(&output.exr, &bytes)?;
    }
    Ok(())
}
