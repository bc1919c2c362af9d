//! How much the noise of an animation flickers.
//!
//! ```text
//! beamfarm render SCENE --frames 1-8 --passes 4    -o same.####.exr
//! beamfarm render SCENE --frames 1-8 --passes 4    -o each.####.exr --seed-per-frame
//! beamfarm render SCENE --frames 1-8 --passes 1024 -o clean.####.exr --seed 1
//! cargo run --release -p beamfarm-tests --example flicker -- same.####.exr clean.####.exr 1 8
//! cargo run --release -p beamfarm-tests --example flicker -- each.####.exr clean.####.exr 1 8
//! ```
//!
//! A frame's error is its difference from the clean frame. The program prints the error's root mean square as a share
//! of the mean, and the root mean square of its change from frame to frame as a share of what independent errors would
//! give: 0 is noise that stands still, 1 is new noise in every frame. Both are too large by the clean frames' own
//! error.

use beamfarm_image::exr::read_rgb;
use beamfarm_image::film::Film;
use std::path::PathBuf;

type AnyError = Box<dyn std::error::Error>;

fn main() -> Result<(), AnyError> {
    let mut args = std::env::args().skip(1);
    let usage = "expected NOISY.####.exr CLEAN.####.exr FIRST LAST";
    let mut next = || args.next().ok_or(usage);
    let (noisy, clean) = (next()?, next()?);
    let (first, last): (i64, i64) = (next()?.parse()?, next()?.parse()?);
    let (mut before, mut squares, mut of_changes, mut sum) = (None::<Vec<f64>>, 0.0, 0.0, 0.0);
    for frame in first..=last {
        let truth = read_rgb(&numbered(&clean, frame))?;
        let errors = errors(&read_rgb(&numbered(&noisy, frame))?, &truth)?;
        sum += values(&truth).sum::<f64>() / errors.len() as f64;
        squares += mean_square(errors.iter().copied());
        if let Some(before) = &before {
            of_changes += mean_square(errors.iter().zip(before).map(|(now, before)| now - before));
        }
        before = Some(errors);
    }
    let frames = (last - first + 1) as f64;
    if frames < 2.0 {
        return Err("expected two frames at least".into());
    }
    let error = squares / frames;
    let change = of_changes / (frames - 1.0);
    println!("error    {:.2} % of the mean", 100.0 * error.sqrt() / (sum / frames));
    println!("flicker  {:.3}", (change / (2.0 * error)).sqrt());
    Ok(())
}

/// The file of a frame.
fn numbered(name: &str, frame: i64) -> PathBuf {
    let width = name.matches('#').count();
    let number = format!("{frame:0width$}");
    PathBuf::from(name.replacen(&"#".repeat(width), &number, 1))
}

fn values(film: &Film) -> impl Iterator<Item = f64> {
    film.pixels.as_flattened().iter().map(|value| f64::from(*value))
}

fn errors(noisy: &Film, clean: &Film) -> Result<Vec<f64>, AnyError> {
    if (noisy.width, noisy.height) != (clean.width, clean.height) {
        return Err("the images have other sizes".into());
    }
    Ok(values(noisy).zip(values(clean)).map(|(a, b)| a - b).collect())
}

fn mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.map(|value| value * value).sum::<f64>() / count
}
