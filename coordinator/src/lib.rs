//! The command `beamfarm`: what becomes of a command line?
//!
//! ```text
//!  arguments ─── settings ───── job ───── Farm ───── conduct ───── output
//!                scene, pilot:  JobSpec    ▲         until the     EXR, PNG, CSV,
//!                Loaded                    │ passes  job ends      report, exit code
//!                                          │
//!                          local: worker processes on this machine (`render`)
//!                          workers on other machines               (`serve`)
//! ```
//!
//! **Data.** `settings` holds the options; `loaded` reads their scene and lets a pilot choose what neither sets. `job`
//! turns that into a job for the coordinator, and `directory` finds what an earlier run left of it. `conduct` serves
//! the job until it ends, shows its progress, and writes the image. `frames` does so for the frames of an animation.
//!
//! **Entrance.** [`command`] parses the arguments, runs a subcommand and returns its exit code. Programs without a
//! command line, such as the Python package, use [`embedded`].
//!
//! **Where to look.** Most subcommands have a file of their name; `live` has a folder, and those that measure are in
//! `measure`.
//!
//! # Example
//!
//! ```
//! use beamfarm_command::embedded::{Asked, explain};
//! use beamfarm_scene::SceneText;
//!
//! let text = r#"
//! image = { width = 32, height = 24 }
//! camera = { origin = [0, 0, 3], target = [0, 0, 0], fov = 40 }
//! shapes = [{ type = "sphere", center = [0, 0, 0], radius = 1 }]
//! lights = [{ type = "point", position = [2, 2, 3], power = 100 }]
//! "#;
//! let scene = SceneText { path: "ball.toml".into(), text: text.into(), ..SceneText::default() };
//! let asked = Asked { scene: scene.into(), seed: Some(7), ..Asked::default() };
//! // Told every tenth of a second how far it is; false would stop it.
//! let explained = explain(&asked, &mut |_| true)?;
//! assert_eq!((explained.size, explained.settings.seed), ([32, 24], 7));
//! assert!(explained.text.contains("photons"), "{}", explained.text);
//! # Ok::<(), beamfarm_command::embedded::Failure>(())
//! ```

mod address;
mod again;
mod aov;
mod at_work;
mod blame;
mod conduct;
mod contest;
mod convert;
mod denoise;
mod devices;
mod directory;
mod documents;
mod early;
pub mod embedded;
mod explain;
mod failure;
mod frame_list;
mod frames;
mod history;
mod image;
mod import;
mod job;
mod live;
mod loaded;
mod local;
mod measure;
mod merge;
mod onlookers;
mod open_page;
mod outlook;
mod output;
mod progress;
mod remote;
mod render;
mod replay;
mod security;
mod serve;
mod settings;
mod sketch;
mod status;
mod steer;
mod summary;
mod view_args;

use beamfarm_scene::json_schema;
use beamfarm_worker::cli::{self, LogArgs, WorkerArgs};
use beamfarm_worker::engine::spare_desktop;
use beamfarm_worker::exit;
use clap::{Parser, Subcommand};
use failure::Failure;
use measure::{bench, compare, convergence, reference};
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  beamfarm scene.toml                             short for `beamfarm render scene.toml`: all cores, the
                                                  scene's own number of passes, scene.exr and scene.png here
  beamfarm render scene.toml --scale 25% -D camera.fov=40
  beamfarm render scene.toml --time 5m -o out/a.exr
  beamfarm live scene.toml --open                 look around and change it in the browser
  beamfarm explain scene.toml                     what a pass does, and why
  beamfarm reference scene.toml --time 10m -o reference.exr
  beamfarm compare scene.exr reference.exr
  beamfarm bench scene.toml --reference reference.exr
                                                  error against time, as tables and plots

  Over several machines:
  beamfarm serve scene.toml --listen 0.0.0.0:7325 --token-file token
  beamfarm worker --connect http://HOST:7325 --token-file token
                                                  on each of them
  beamfarm status http://HOST:7325 --token-file token
                                                  its state; or open the URL in a browser

Lengths are in scene units, radiance in W/(m^2 sr), times as 90s, 5m or 1h30m.
The image is the average of passes 0 to N-1 whatever the number of workers: the same scene and seed
give the same bits.";

/// Renders light in participating media with progressive photon beams, on one machine or many
#[derive(Parser)]
#[command(name = "beamfarm", version, long_version = cli::long_version(), after_help = format!("{EXAMPLES}\n\n{}", exit::HELP))]
struct Options {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    log: LogArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene on this machine
    #[command(after_help = render::EXAMPLES, after_long_help = format!("{}\n\n{}", render::EXAMPLES, history::HELP))]
    Render(render::RenderArgs),
    /// Look at a scene and change it in the browser, while it renders
    #[command(after_help = live::EXAMPLES)]
    Live(live::LiveArgs),
    /// Hand the passes of a scene out to workers on other machines
    #[command(after_help = serve::EXAMPLES, after_long_help = format!("{}\n\n{}", serve::EXAMPLES, history::HELP))]
    Serve(serve::ServeArgs),
    /// Render passes for a coordinator on another machine, until its job is done
    #[command(after_help = WORKER_EXAMPLES)]
    Worker(WorkerArgs),
    /// Merge jobs that each rendered part of the passes into one image
    #[command(after_help = merge::EXAMPLES)]
    Merge(merge::MergeArgs),
    /// Print the state of a job
    #[command(after_help = status::EXAMPLES)]
    Status(status::StatusArgs),
    /// End a job and write the image of the passes that are complete
    #[command(after_help = steer::CANCEL_EXAMPLES)]
    Cancel(remote::RemoteArgs),
    /// Hand out no more passes of a job until `resume`
    #[command(after_help = steer::PAUSE_EXAMPLES)]
    Pause(remote::RemoteArgs),
    /// Hand out the passes of a paused job again
    #[command(after_help = steer::PAUSE_EXAMPLES)]
    Resume(remote::RemoteArgs),
    /// Give a running job more passes
    #[command(after_help = steer::EXTEND_EXAMPLES)]
    Extend(steer::ExtendArgs),
    /// Write the image of a running job now; the job goes on
    #[command(after_help = steer::WRITE_EXAMPLES)]
    Write(remote::RemoteArgs),
    /// Render one pass of a scene again and print the hash of its pixels
    #[command(after_help = replay::EXAMPLES)]
    Replay(replay::ReplayArgs),
    /// Measure error against time: of scenes, configurations and other renderers
    #[command(after_help = bench::EXAMPLES, after_long_help = format!("{}\n\n{}", bench::EXAMPLES, bench::SUITES))]
    Bench(bench::BenchArgs),
    /// A run of `bench`
    #[command(name = bench::CHILD, hide = true)]
    BenchRun,
    /// Render a scene with an unbiased path tracer: the ground truth where it converges
    #[command(after_help = reference::EXAMPLES)]
    #[command(after_long_help = format!("{}\n\n{}", reference::EXAMPLES, reference::LIMITS))]
    Reference(reference::ReferenceArgs),
    /// Print how far an image is from a reference
    #[command(after_help = format!("{}\n\n{}", compare::EXAMPLES, compare::MEANING))]
    Compare(compare::CompareArgs),
    /// Render one pixel over and over, and compare its variance and bias with the theory of convergence
    #[command(after_help = convergence::EXAMPLES)]
    Convergence(convergence::ConvergenceArgs),
    /// Denoise an image that has the layers for it
    #[command(after_help = denoise::EXAMPLES)]
    Denoise(denoise::DenoiseArgs),
    /// Convert a Mitsuba scene or a glTF file to the native form
    #[command(after_help = convert::EXAMPLES)]
    Convert(convert::ConvertArgs),
    /// Print the plan of a scene: what a pass does and why, what the pilot chose, and where things are
    #[command(after_help = explain::EXAMPLES)]
    Explain(explain::ExplainArgs),
    /// List the devices for `--engine gpu`, and test each
    #[command(after_help = devices::MEANING)]
    Devices,
    /// Print the JSON Schema of scene files, for editors
    #[command(after_help = documents::SCHEMA)]
    Schema,
    /// Print a script that completes commands and options in a shell
    #[command(after_help = documents::COMPLETIONS)]
    Completions(documents::CompletionsArgs),
    /// Write the manual pages of all commands into a folder
    #[command(after_help = documents::MAN)]
    Man(documents::ManArgs),
}

const WORKER_EXAMPLES: &str = "\
Examples:
  beamfarm worker --connect http://coordinator:7325 --token-file token
  beamfarm worker --connect https://coordinator:7325 --tls-ca ca.pem --tls-cert me.pem --tls-key me.key
  beamfarm worker --connect http://localhost:7325 --threads 8 --patience 10m
  beamfarm worker --connect http://coordinator:7325 --engine gpu --gpu all
                                                  a worker for each card of this machine

After SIGINT or SIGTERM the worker delivers the pass at hand; a second signal kills it. A worker that dies
loses nothing: its pass is handed out again.";

/// `beamfarm scene.toml` is `beamfarm render scene.toml`.
fn with_render(mut args: Vec<OsString>) -> Vec<OsString> {
    let endings = ["toml", "xml", "glb", "gltf"];
    let is_scene = |arg: &OsString| {
        let ending = Path::new(arg).extension().and_then(|ending| ending.to_str());
        ending.is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
    };
    if args.get(1).is_some_and(is_scene) {
        args.insert(1, "render".into());
    }
    args
}

/// The command, from its arguments to its exit code.
pub fn command() -> ExitCode {
    // SAFETY: this is the only thread.
    unsafe { spare_desktop() };
    let options = Options::parse_from(with_render(std::env::args_os().collect()));
    // Workers on other machines and servers run unattended and keep a log; a person at a terminal wants the bar.
    let level = match options.command {
        Command::Serve(_) | Command::Worker(_) => "info",
        _ => "warn",
    };
    if let Err(message) = options.log.init(level, progress::LogWriter::default) {
        return Failure::usage(message).report();
    }
    let done = match options.command {
        Command::Render(args) => render::main(args, &options.log),
        Command::Live(args) => live::main(args, &options.log),
        Command::Serve(args) => serve::main(args),
        Command::Worker(args) => return cli::main(args),
        Command::Merge(args) => merge::main(args),
        Command::Status(args) => status::main(args),
        Command::Cancel(args) => steer::cancel(args),
        Command::Pause(args) => steer::pause(args),
        Command::Resume(args) => steer::resume(args),
        Command::Extend(args) => steer::extend(args),
        Command::Write(args) => steer::write(args),
        Command::Replay(args) => replay::main(args),
        Command::Bench(args) => bench::main(args),
        Command::BenchRun => bench::child(),
        Command::Reference(args) => reference::main(args),
        Command::Compare(args) => compare::main(args),
        Command::Convergence(args) => convergence::main(args),
        Command::Denoise(args) => denoise::main(args),
        Command::Convert(args) => convert::main(args),
        Command::Explain(args) => explain::main(args),
        Command::Devices => devices::main(),
        Command::Completions(args) => documents::completions::<Options>(args),
        Command::Man(args) => documents::man::<Options>(&args),
        Command::Schema => output::print_text(&json_schema().to_string()),
    };
    match done {
        Ok(()) => ExitCode::from(exit::DONE),
        Err(failure) => failure.report(),
    }
}
