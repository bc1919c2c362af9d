//! Mitsuba scenes against pictures that Mitsuba 3 made of them. The passes are late ones, whose radii have shrunk so
//! far that their bias is below the noise.

use beamfarm_harness::mitsuba;
use beamfarm_harness::render::{images, is_long};
use beamfarm_image::job::{EngineKind, JobSettings};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::plan::RenderPlan;
use beamfarm_worker::engine::{EngineError, Engines, Planned};
use std::sync::Arc;

/// The radius scale of beams is a fifth from here on.
const FIRST_PASS: u64 = 128;

/// Compares [`images`] of `passes` passes of `paths` photon paths.
fn compare(name: &str, passes: u64, paths: u32) {
    let scene = mitsuba::scene(name);
    let settings = JobSettings {
        paths_per_pass: paths,
        reference_paths: paths,
        ..scene.description().defaults.job_settings()
    };
    let plan = RenderPlan::new(&scene, settings);
    let passes = FIRST_PASS..FIRST_PASS + images(passes);
    mitsuba::compare(
        name,
        passes.map(|i| render_pass(&scene, &plan, i).expect("a pass").film),
    );
}

/// The same with passes of a device, with as many passes and photon paths as one in software renders in a minute or
/// two. Scenes that devices do not render must give the reason.
fn compare_device(name: &str) {
    if !is_long() {
        return;
    }
    let scene = mitsuba::scene(name);
    let mut settings = JobSettings {
        paths_per_pass: 4000,
        reference_paths: 4000,
        engine: EngineKind::Gpu,
        ..scene.description().defaults.job_settings()
    };
    settings.techniques.aimed = Some(false);
    let plan = RenderPlan::new(&scene, settings);
    let engine = match Engines::new("").engine(Arc::new(Planned { scene, plan })) {
        Ok(engine) => engine,
        Err(why @ (EngineError::NoDevice(_) | EngineError::Scene(_))) => return println!("{name}: {why}"),
        Err(error) => panic!("{name}: {error}"),
    };
    let passes = FIRST_PASS..FIRST_PASS + 24;
    mitsuba::compare(name, passes.map(|i| engine.pass(i).unwrap().film));
}

macro_rules! scenes {
    ($($test:ident: $name:literal, $passes:literal, $paths:literal;)*) => {
        $(
            #[test]
            fn $test() {
                compare($name, $passes, $paths);
            }
        )*

        mod devices {
            $(
                #[test]
                fn $test() {
                    super::compare_device($name);
                }
            )*
        }
    };
}

scenes! {
    surfaces: "surfaces", 64, 10_000;
    specular: "specular", 64, 20_000;
    glossy: "glossy", 64, 20_000;
    plastic: "plastic", 64, 20_000;
    lens: "lens", 64, 10_000;
    textures: "textures", 64, 10_000;
    shapes: "shapes", 256, 10_000;
    environment: "environment", 64, 10_000;
    fog: "fog", 64, 20_000;
    fog_hg: "fog-hg", 64, 20_000;
    fog_blend: "fog-blend", 64, 20_000;
    chromatic: "chromatic", 64, 20_000;
    spot_fog: "spot-fog", 64, 20_000;
    cloud: "cloud", 64, 20_000;
    amber: "amber", 64, 20_000;
    furnace: "furnace", 64, 20_000;
}
