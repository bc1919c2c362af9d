//! What `beamfarm render` takes beyond rendering alone: `cargo run --release -p beamfarm-tests --example
//! render_overhead -- target/release/beamfarm TURNS SCENE PASSES [SCENE PASSES]...`.
//!
//! The whole commands `render` and `bench` take turns, with the same number of passes and all cores. Both read the
//! scene twice, in two processes, use the same pilot, and look at the image after 1, 2, 4, ... passes. Only `render`
//! leases and sends passes, adds them up in another process and writes EXR and PNG; only `bench` draws plots. The
//! program prints the medians of the ratios of the turns.
//!
//! `-- target/release/beamfarm short COUNT SCENE [OPTION]...` renders a quick scene COUNT times and prints how long
//! each run took: none may take far longer than most.

use std::process::{Command, Stdio};
use std::time::Instant;

type AnyError = Box<dyn std::error::Error>;

const USAGE: &str = "expected the program, TURNS and pairs of SCENE PASSES, or the program, short, COUNT and a SCENE";
/// More than this many times the median is far longer.
const FAR_LONGER: f64 = 3.0;

fn main() -> Result<(), AnyError> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.as_slice() {
        [program, short, count, rest @ ..] if short == "short" && !rest.is_empty() => {
            render_again_and_again(program, count.parse()?, rest)
        }
        [program, turns, scenes @ ..] if !scenes.is_empty() && scenes.len().is_multiple_of(2) => {
            for scene in scenes.chunks(2) {
                compare(program, turns.parse()?, &scene[0], &scene[1])?;
            }
            Ok(())
        }
        _ => Err(USAGE.into()),
    }
}

/// What a command took.
#[derive(Clone, Copy)]
struct Took {
    seconds: f64,
    cpu_seconds: f64,
}

fn compare(program: &str, turns: usize, scene: &str, passes: &str) -> Result<(), AnyError> {
    let folder = tempfile::tempdir()?;
    let render = || {
        let mut command = Command::new(program);
        command.args(["render", scene, "--passes", passes, "-o"]);
        time(command.arg(folder.path().join("image.exr")))
    };
    let bench = || {
        let mut command = Command::new(program);
        command.args(["bench", scene, "--passes", passes, "-o"]);
        time(command.arg(folder.path().join("bench")))
    };
    println!("{scene}, {passes} passes: render, bench");
    let mut ratios: [Vec<f64>; 2] = Default::default();
    for turn in 0..turns {
        // They alternate in who goes first.
        let (render, bench) = match turn % 2 {
            0 => (render()?, bench()?),
            _ => {
                let bench = bench()?;
                (render()?, bench)
            }
        };
        let of_turn = [render.seconds / bench.seconds, render.cpu_seconds / bench.cpu_seconds];
        println!(
            "  {:.2} s, {:.2} s, of the processors {:.2} s, {:.2} s: {of_turn:.3?}",
            render.seconds, bench.seconds, render.cpu_seconds, bench.cpu_seconds
        );
        for (ratios, ratio) in ratios.iter_mut().zip(of_turn) {
            ratios.push(ratio);
        }
    }
    let [time, of_processors] = ratios.map(median);
    println!("  median: time {time:.3}, the processors' time {of_processors:.3}");
    Ok(())
}

fn render_again_and_again(program: &str, count: usize, scene: &[String]) -> Result<(), AnyError> {
    let folder = tempfile::tempdir()?;
    let mut seconds = Vec::new();
    for _ in 0..count {
        let mut command = Command::new(program);
        command.arg("render").args(scene).arg("-o");
        seconds.push(time(command.arg(folder.path().join("image.exr")))?.seconds);
    }
    println!("seconds in their order: {seconds:.3?}");
    let median = median(seconds.clone());
    let longest = seconds.iter().copied().fold(0.0, f64::max);
    println!("median {median:.3} s, longest {longest:.3} s");
    match longest > FAR_LONGER * median {
        true => Err("one took far longer than most".into()),
        false => Ok(()),
    }
}

fn time(command: &mut Command) -> Result<Took, AnyError> {
    let (begun, before) = (Instant::now(), cpu_seconds()?);
    let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status()?;
    if !status.success() {
        return Err(format!("{command:?}: {status}").into());
    }
    Ok(Took {
        seconds: begun.elapsed().as_secs_f64(),
        cpu_seconds: cpu_seconds()? - before,
    })
}

/// CPU seconds of this process's finished children, and of theirs (Linux).
fn cpu_seconds() -> Result<f64, AnyError> {
    let text = std::fs::read_to_string("/proc/self/stat")?;
    let fields = text.rsplit(')').next().unwrap_or("").split_whitespace();
    let ticks = fields.skip(13).take(2).map(str::parse::<f64>);
    Ok(ticks.sum::<Result<f64, _>>()? / 100.0)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() % 2 {
        0 => f64::midpoint(values[middle - 1], values[middle]),
        _ => values[middle],
    }
}
