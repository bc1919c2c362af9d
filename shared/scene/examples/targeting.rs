//! What photon targeting gains or costs, as rows of a Markdown table:
//! `cargo run --release -p beamfarm-scene --example targeting -- SCENE.toml [WIDTH [PASSES [TURNS]]]`
//!
//! Images of so many passes, each with a seed of its own, are made without targeting, as `"auto"` decides where that is
//! not the same, and with `"on"`, in turns, so that whatever else the machine does meets all. Ratios are to those
//! without: of processor time, of all threads and with the pilot's; of relMSE, from the variance of the images, as the
//! mean is the same; and of their product, below 1 where targeting pays. Standard errors are by leaving out turns, one
//! by one. Where `"auto"` decides against, its picture is that without targeting to the last bit, and what it costs is
//! the pilot: the first column says how much of the time of the scene's own passes in the scene's own size that is.
//! Linux, which tells a thread's time.

use beamfarm_image::job::{JobSettings, Targeting};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_scene::read_bundle;

/// Values of the pixels.
type Image = Vec<f64>;

struct Way {
    name: &'static str,
    scene: Scene,
    images: Vec<Image>,
    seconds: Vec<f64>,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let path = args.next().ok_or("expected a scene")?;
    let mut number = |default| args.next().map_or(Ok(default), |n| n.parse::<u32>());
    let (width, passes, turns) = (number(160)?, number(4)?, number(8)?);
    let description = beamfarm_scene::load(&read_bundle(path.as_ref())?)?;
    let way = |name, targeting, width: u32| {
        let mut description = description.clone();
        description.defaults.targeting = targeting;
        let camera = &mut description.camera;
        camera.height = width * camera.height / camera.width;
        camera.width = width;
        Way {
            name,
            scene: Scene::new(description),
            images: Vec::new(),
            seconds: Vec::new(),
        }
    };
    let mut ways = vec![
        way("off", Targeting::Off, width),
        way("auto", Targeting::Auto, width),
        way("on", Targeting::On, width),
    ];
    let settings = description.defaults.job_settings();
    let begun = cpu_seconds()?;
    let auto = RenderPlan::new(&ways[1].scene, settings);
    let pilot = cpu_seconds()? - begun;
    let told = auto.to_string();
    let told = told.lines().find(|line| line.contains("photon targeting"));
    println!("{}", told.unwrap_or_default());
    let off = auto.targets.is_none();
    if off {
        let own = way("own", Targeting::Off, description.camera.width);
        let plan = RenderPlan::new(&own.scene, settings);
        let begun = cpu_seconds()?;
        std::hint::black_box(render_pass(&own.scene, &plan, 0).expect("a pass"));
        let pass = cpu_seconds()? - begun;
        let own_passes = description.defaults.passes;
        println!(
            "| {path} | auto: off, {:.3} s, {:.2} % of {own_passes} passes of {pass:.2} s |",
            pilot,
            100.0 * pilot / (pass * own_passes as f64)
        );
        ways.remove(1);
    } else {
        println!("| {path} | auto: on, {pilot:.3} s |");
    }
    for turn in 0..turns {
        let mut settings = settings;
        settings.seed += u64::from(turn);
        for way in &mut ways {
            way.render(settings, passes)?;
        }
    }
    compare(&ways, passes, turns);
    Ok(())
}

impl Way {
    /// Render an image, and take the time.
    fn render(&mut self, settings: JobSettings, passes: u32) -> Result<(), Box<dyn std::error::Error>> {
        let begun = cpu_seconds()?;
        let plan = RenderPlan::new(&self.scene, settings);
        let mut image: Image = Vec::new();
        for pass_index in 0..u64::from(passes) {
            let film = render_pass(&self.scene, &plan, pass_index).expect("a pass").film;
            image.resize(film.pixels.len() * 3, 0.0);
            for (sum, value) in image.iter_mut().zip(film.pixels.iter().flatten()) {
                *sum += f64::from(*value) / f64::from(passes);
            }
        }
        self.seconds.push(cpu_seconds()? - begun);
        self.images.push(image);
        Ok(())
    }
}

/// Print times and errors over those of the first way.
fn compare(ways: &[Way], passes: u32, turns: u32) {
    let all: Vec<usize> = (0..turns as usize).collect();
    let scale: Image = (0..ways[0].images[0].len())
        .map(|i| {
            let mean = ways[0].images.iter().map(|image| image[i]).sum::<f64>() / f64::from(turns);
            mean * mean + 0.01
        })
        .collect();
    for way in &ways[1..] {
        let ratios = |turns: &[usize]| {
            let seconds = |way: &Way| turns.iter().map(|&i| way.seconds[i]).sum::<f64>();
            let time = seconds(way) / seconds(&ways[0]);
            let error = variance(way, turns, &scale) / variance(&ways[0], turns, &scale);
            [time, error, time * error]
        };
        let of_all = ratios(&all);
        let mut deviations = [0.0; 3];
        for i in 0..all.len() {
            let left: Vec<usize> = all.iter().copied().filter(|&j| j != i).collect();
            for ((sum, a), b) in deviations.iter_mut().zip(ratios(&left)).zip(of_all) {
                *sum += (a - b) * (a - b);
            }
        }
        let n = f64::from(turns);
        let told: Vec<String> = (of_all.iter().zip(deviations))
            .map(|(ratio, sum)| format!("{ratio:.3} ± {:.3}", (sum * (n - 1.0) / n).sqrt()))
            .collect();
        let name = way.name;
        let camera = way.scene.description().camera;
        let (width, height) = (camera.width, camera.height);
        println!(
            "| | {name}, {width}x{height}, {passes} passes, {turns} turns | {} |",
            told.join(" | ")
        );
    }
}

/// Mean over the pixels of the images' variance, relative as relMSE is.
fn variance(way: &Way, turns: &[usize], scale: &Image) -> f64 {
    let n = turns.len() as f64;
    let of_one = |i: usize| {
        let values = turns.iter().map(|&turn| way.images[turn][i]);
        let mean = values.clone().sum::<f64>() / n;
        values.map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0)
    };
    let relative = scale.iter().enumerate().map(|(i, scale)| of_one(i) / scale);
    relative.sum::<f64>() / scale.len() as f64
}

/// Processor time of all threads so far.
fn cpu_seconds() -> Result<f64, Box<dyn std::error::Error>> {
    let mut nanoseconds = 0.0;
    for task in std::fs::read_dir("/proc/self/task")? {
        let told = std::fs::read_to_string(task?.path().join("schedstat"))?;
        let ran = told.split_whitespace().next().ok_or("no times")?;
        nanoseconds += ran.parse::<f64>()?;
    }
    Ok(nanoseconds * 1e-9)
}
