//! Development driver.
use beamfarm_shared::{job::*, merge::*, metrics, pass::render_pass, plan::*, scene};
use std::path::Path;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let bundle = scene::read_bundle(Path::new(&args[1])).unwrap_or_else(|e| panic!("{e}"));
    let mut d = scene::SceneDescription::load(&bundle).unwrap_or_else(|e| panic!("{e}"));
    let passes: u64 = args[2].parse().unwrap();
    if let Ok(p) = std::env::var("PATHS") {
        d.defaults.paths_per_pass = p.parse().unwrap();
    }
    let e = d.defaults.exposure;
    let s = Scene::new(d);
    let f = s.description().defaults;
    let settings = JobSettings {
        seed: f.seed,
        alpha: f.alpha,
        schedule: f.schedule,
        paths_per_pass: f.paths_per_pass,
        reference_paths: f.paths_per_pass,
    };
    let plan = RenderPlan::new(&s, settings);
    print!("{plan}");
    let c = s.description().camera;
    let mut sum = TreeSum::new(c.width, c.height);
    let reference = args
        .get(4)
        .map(|p| beamfarm_shared::exr::read_rgb(Path::new(p)).unwrap());
    let t0 = std::time::Instant::now();
    let mut stats = PassStats::default();
    for i in 0..passes {
        let p = render_pass(&s, &plan, i);
        stats += p.stats;
        sum.insert(Node::leaf(i, p.film)).unwrap();
        if (i + 1).is_power_of_two() {
            let a = sum.average().unwrap();
            print!(
                "{:4} passes {:7.2}s {:?} rse {:.4}",
                i + 1,
                t0.elapsed().as_secs_f64(),
                stats,
                a.relative_standard_error()
            );
            if let Some(r) = &reference {
                let m = metrics::compare(&a.beauty, r).unwrap();
                print!("\n   {}", m.to_string().replace('\n', "\n   "));
            }
            println!();
        }
    }
    let a = sum.average().unwrap();
    let meta = beamfarm_shared::exr::ImageMeta {
        scene: bundle.hash(),
        settings,
        render_seconds: 0.0,
        version: "0.1.0".into(),
    };
    beamfarm_shared::exr::write_image(Path::new(&args[3]), &a, &meta).unwrap();
    beamfarm_shared::png::write_png(&Path::new(&args[3]).with_extension("png"), &a.beauty, e)
        .unwrap();
}
