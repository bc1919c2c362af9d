//! Passes of a device against passes of processors by the same plan, on random scenes: the means of many passes are the
//! same, block by block.
//!
//! Both draw photons with the same random numbers, so that the differences have less noise than either picture. Tails
//! are heavy: a scene that differs is rendered again, four times as long and with other random numbers, and then once
//! more, before it counts. The first scenes must give the bits that every device gives.
//!
//! 2 scenes by default; 300 with BEAMFARM_LONG=1. BEAMFARM_SCENES and BEAMFARM_FIRST_SEED set the number and the first
//! seed; each scene then prints a line.

use beamfarm_harness::MeanEstimate;
use beamfarm_harness::random_scene::RandomScene;
use beamfarm_harness::render::{Blocks, is_long};
use beamfarm_harness::suite::sidak;
use beamfarm_image::exr::pixel_hash;
use beamfarm_image::film::Film;
use beamfarm_image::job::{EngineKind, JobSettings, Technique, Techniques};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_worker::engine::{EngineError, Engines, Planned, Where, check};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// What every device renders of the first scenes, until the computation of a pass changes: seeds, and the hash of the
/// first pass examined.
const HASHES: &str = include_str!("../../data/devices.txt");

/// Pixels along the side of a block.
const BLOCK: usize = 8;
/// Photon paths of a pass.
const PATHS: u32 = 300;
/// How often a scene that differs is examined, each time longer.
const LOOKS: u32 = 3;
/// How much longer each time.
const LONGER: u64 = 4;
/// Share of a block's mean that single precision may change.
const ROUNDING: f64 = 1e-5;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap())
}

/// The ways to find the light, each in turn.
fn techniques(seed: u64) -> Techniques {
    let way = |nth: u32| match seed / 3_u64.pow(nth) % 3 {
        0 => None,
        1 => Some(Technique::Photons),
        _ => Some(Technique::Paths),
    };
    Techniques {
        media: way(0),
        surfaces: way(1),
        caustics: way(2),
        aimed: match seed / 27 % 3 {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        },
    }
}

/// Student's test of a mean that should be zero.
fn p_value(of: &MeanEstimate, scale: f64) -> f64 {
    let error = of.std_error().hypot(ROUNDING * scale);
    if error == 0.0 && of.mean() == 0.0 {
        return 1.0;
    }
    match StudentsT::new(0.0, 1.0, (of.count() - 1) as f64) {
        Ok(student) => 2.0 * student.sf((of.mean() / error).abs()),
        Err(_) => f64::NAN,
    }
}

/// The largest difference, if any is significant.
fn difference(films: &[[Film; 2]], significance: f64) -> Option<String> {
    let own = films.iter().map(|[own, _]| own.clone());
    let less = films.iter().map(|[own, other]| {
        let mut less = own.clone();
        let both = less
            .pixels
            .as_flattened_mut()
            .iter_mut()
            .zip(other.pixels.as_flattened());
        both.for_each(|(own, other)| *own -= other);
        less
    });
    let (own, less) = (Blocks::new(own, BLOCK), Blocks::new(less, BLOCK));
    let cells = |of: &Blocks| [&[of.whole], of.blocks.as_slice()].concat();
    let cells: Vec<_> = cells(&own).into_iter().zip(cells(&less)).collect();
    let level = sidak(significance, 3 * cells.len());
    let all = cells.iter().enumerate().flat_map(|(cell, (own, less))| {
        let channels = own.iter().zip(less).enumerate();
        channels.map(move |(c, (own, less))| (p_value(less, own.mean().abs()), cell, c, own, less))
    });
    let (p, cell, channel, own, less) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (p.is_nan() || p < level).then(|| {
        let of = match cell {
            0 => "image".to_owned(),
            cell => format!("block {}", cell - 1),
        };
        let (mean, other) = (own.mean(), own.mean() - less.mean());
        let error = less.std_error();
        format!("{of}, channel {channel}: {mean:.4e} for {other:.4e} +- {error:.1e}, p = {p:.1e}")
    })
}

/// Which passes of a scene to render, how many, and by which plan.
struct Look {
    settings: JobSettings,
    first: u64,
    passes: u64,
}

/// The same passes by a device and by processors.
fn films(engines: &Engines, scene: &RandomScene, look: &Look) -> Result<Vec<[Film; 2]>, EngineError> {
    let scene = scene.load().unwrap();
    let plan = RenderPlan::new(&scene, look.settings);
    let planned = Arc::new(Planned { scene, plan });
    let engine = engines.engine(planned.clone())?;
    let passes = look.first..look.first + look.passes;
    let both = passes.map(|index| {
        let own = engine.pass(index).unwrap();
        let other = render_pass(&planned.scene, &planned.plan, index).unwrap();
        for pass in [&own, &other] {
            assert_eq!(pass.stats.non_finite, 0);
        }
        [own.film, other.film]
    });
    Ok(both.collect())
}

/// Whether a scene whose bits are known has them; an error if it has others.
fn has_its_bits(seed: u64, film: &Film) -> Result<(), String> {
    let known = HASHES.lines().find_map(|line| line.strip_prefix(&format!("{seed} ")));
    let hash = pixel_hash(film);
    println!("{seed} {hash}");
    match known {
        Some(known) if known != hash => Err(format!("its bits are {hash}, and not {known}")),
        _ => Ok(()),
    }
}

/// The result for a scene; an error if there is a fault.
fn examine(engines: &Engines, seed: u64, passes: u64, significance: f64) -> Result<&'static str, String> {
    let scene = RandomScene::new(seed);
    let loaded = scene.load()?;
    let settings = JobSettings {
        seed,
        engine: EngineKind::Gpu,
        paths_per_pass: PATHS,
        techniques: techniques(seed),
        ..loaded.description().defaults.job_settings()
    };
    if let Err(EngineError::Scene(reasons)) = check(&loaded, &RenderPlan::new(&loaded, settings), &Where::Elsewhere) {
        println!("    {}", reasons.join("\n    "));
        return Ok("not for devices");
    }
    let mut differs = String::new();
    let mut bits = Ok(());
    for look in 0..LOOKS {
        let look = Look {
            settings: JobSettings {
                seed: seed + 1_000_000 * u64::from(look),
                ..settings
            },
            // Large kernels for some scenes, small ones for others.
            first: if seed.is_multiple_of(2) { 0 } else { 50 },
            passes: passes * LONGER.pow(look),
        };
        let films = match films(engines, &scene, &look) {
            Ok(films) => films,
            Err(EngineError::NoDevice(_)) => return Ok("no device"),
            Err(error) => return Err(error.to_string()),
        };
        if differs.is_empty() {
            bits = has_its_bits(seed, &films[0][0]);
        }
        match difference(&films, significance) {
            None => return bits.map(|()| if differs.is_empty() { "same" } else { "noise" }),
            Some(found) => differs = found,
        }
    }
    Err(differs)
}

/// All together at a significance of 1e-2.
#[test]
fn devices_are_right_on_random_scenes() {
    let (scenes, passes) = if is_long() { (300, 24) } else { (2, 8) };
    let scenes = number("BEAMFARM_SCENES").unwrap_or(scenes);
    let first = number("BEAMFARM_FIRST_SEED").unwrap_or(0);
    let significance = sidak(1e-2, usize::try_from(scenes).unwrap());
    let engines = Engines::new("");
    let mut counts = BTreeMap::new();
    let mut faults = Vec::new();
    for seed in first..first + scenes {
        let started = Instant::now();
        let outcome = examine(&engines, seed, passes, significance);
        let (word, rest) = match &outcome {
            Ok(word) => (*word, String::new()),
            Err(differs) => ("DIFFERS", format!(": {differs}")),
        };
        let seconds = started.elapsed().as_secs_f64();
        let summary = RandomScene::new(seed).summary();
        println!("seed {seed}: {word}{rest} [{summary}; {seconds:.1} s]");
        *counts.entry(word).or_insert(0) += 1;
        if outcome.is_err() {
            faults.push(format!("seed {seed}{rest}"));
        }
    }
    println!("{counts:?}");
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
