//! One random scene, by its seed: compared, printed, or reduced as long as it stays wrong.
//!
//!     cargo run -p beamfarm-tests --example random_scene -- SEED [--print] [--shrink] [--images N] [--samples N]
//!     cargo run -p beamfarm-tests --example random_scene -- SEED --write FOLDER
//!     cargo run -p beamfarm-tests --example random_scene -- FOLDER/NAME.toml ...

use beamfarm_harness::differential::Effort;
use beamfarm_harness::differential::many::examine_alone;
use beamfarm_harness::differential::shrink::shrink;
use beamfarm_harness::random_scene::RandomScene;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let mut effort = Effort {
        images: 48,
        samples: 8,
        significance: 1e-5,
        seconds: f64::INFINITY,
    };
    let (mut prints, mut shrinks, mut what) = (false, false, None);
    let mut folder = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut count = || -> Result<u64, Box<dyn Error>> { Ok(arguments.next().ok_or("expected a number")?.parse()?) };
        match argument.as_str() {
            "--print" => prints = true,
            "--write" => folder = arguments.next(),
            "--shrink" => shrinks = true,
            "--images" => effort.images = count()?.max(2),
            "--samples" => effort.samples = count()?.max(1),
            _ => what = Some(argument),
        }
    }
    let what = what.ok_or("expected a seed, or a scene file")?;
    let (scene, name) = match what.parse() {
        Ok(seed) => (RandomScene::new(seed), what),
        Err(_) => {
            let path = Path::new(&what);
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            (RandomScene::read(path)?, name.into_owned())
        }
    };
    if prints {
        println!("{}", scene.toml());
        return Ok(());
    }
    if let Some(folder) = folder {
        scene.write(Path::new(&folder), &format!("random-{name}"))?;
        return Ok(());
    }
    println!("{}", scene.summary());
    match examine_alone(&scene, &effort) {
        Ok(verdict) => println!("{verdict}"),
        Err(message) => println!("PANIC: {message}"),
    }
    if shrinks {
        let small = shrink(&scene, &effort, |scene, verdict| match verdict {
            Ok(verdict) => println!("{verdict} [{}]", scene.summary()),
            Err(message) => println!("PANIC: {message} [{}]", scene.summary()),
        });
        let path = small.write(Path::new("random-scenes"), &format!("{name}-small"))?;
        println!("{}\nwrote {}", small.toml(), path.display());
    }
    Ok(())
}
