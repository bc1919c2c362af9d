//! What object visibility rules cost rays, and passes: `cargo bench -p beamfarm-scene --bench rules`.
//! Without rules, rays are searched for by the same code as ever, in which nothing is left of the rules.

// What criterion's macros make has no docs.
#![allow(missing_docs)]

use beamfarm_image::bundle::Bundle;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp::uniform_sphere;
use beamfarm_render::world::Scene;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::Geometry;
use beamfarm_render::world::mask::{Ruled, Start, Unruled, VisibilityMask};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::fmt::Write;
use std::hint::black_box;
use std::time::Duration;

/// Objects along each side of a block of them.
const SIDE: usize = 8;
const RAYS: usize = 4096;

/// Spheres, cubes and cut-up meshes in a room, one glass, lit by a lamp and a spot. With rules: each object hides
/// others, which are far away and small, from each type of ray.
fn scene(ruled: bool) -> Scene {
    let mut text = String::from(
        "[image]\nwidth = 160\nheight = 120\n[camera]\norigin = [0, 0, 9]\ntarget = [0, 0, 0]\nfov = 50\n\
         [render]\npaths = 20000\n\
         [materials.glass]\ntype = \"dielectric\"\nior = 1.5\n[materials.satin]\ntype = \"rough_plastic\"\nalpha = 0.3\n\
         [[shapes]]\nname = \"room\"\ntype = \"cube\"\nflip_normals = true\ntransform = [{ scale = 10 }]\n\
         [[lights]]\nname = \"spot\"\ntype = \"spot\"\nposition = [3, 8, 8]\ntarget = [0, 0, 0]\nintensity = 300\n\
         [[shapes]]\nname = \"lamp\"\ntype = \"sphere\"\ncenter = [-6, 7, 4]\nemission = { radiance = 9 }\n",
    );
    let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
    for i in 0..SIDE * SIDE * SIDE {
        let kind = ["sphere", "cube"][i % 2];
        let material = if i % 16 == 0 { "glass" } else { "satin" };
        let at = |step: usize| (i / step % SIDE) as f32 - 0.5 * (SIDE as f32 - 1.0);
        let (x, y, z) = (at(1), at(SIDE), at(SIDE * SIDE));
        let size = 0.1 + 0.3 * sampler.next_1d();
        write!(
            text,
            "[[shapes]]\nname = \"o{i}\"\ntype = \"{kind}\"\nmaterial = \"{material}\"\n\
             transform = [{{ scale = {size} }}, {{ translate = [{x}, {y}, {z}] }}]\n"
        )
        .expect("memory");
    }
    for i in 0..4 {
        write!(
            text,
            "[[shapes]]\nname = \"far{i}\"\ntype = \"sphere\"\ncenter = [9.8, -9.8, 9.{i}]\nradius = 0.01\n"
        )
        .expect("memory");
    }
    if ruled {
        // The same for all, so that gather rays and photons share their work as they do without rules.
        text += "[[rules]]\nrays = [\"shadow\", \"photon\"]\nexclude = [\"far0\", \"far1\", \"far2\", \"far3\"]\n";
        for i in 0..4 {
            let of = |i: usize| {
                let names = (0..SIDE * SIDE * SIDE).filter(|j| j % 4 == i);
                let names: Vec<String> = names.map(|j| format!("\"o{j}\"")).collect();
                names.join(", ")
            };
            write!(
                text,
                "[[rules]]\non = [\"camera\", \"room\", \"lamp\", \"spot\", {}]\n\
                 rays = [\"camera\", \"reflected\", \"refracted\"]\nexclude = [\"far{i}\"]\n",
                of(i)
            )
            .expect("memory");
        }
    }
    let scene = "scene.toml".to_string();
    let files = [(scene.clone(), text.into_bytes())].into();
    let description = beamfarm_scene::load(&Bundle { scene, files }).expect("a scene");
    assert_eq!(description.rules.is_some(), ruled);
    Scene::new(description)
}

fn rays() -> Vec<Ray> {
    let mut sampler = Sampler::new(2, 0, Purpose::Test, 0);
    let ray = |_| {
        let point = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
        Ray {
            origin: (point - 0.5) * 8.0,
            dir: uniform_sphere(sampler.next_2d()),
        }
    };
    (0..RAYS).map(ray).collect()
}

/// Sum of the distances of all hits of rays that start at some object, and the number of rays that are stopped.
fn trace(description: &SceneDescription, geometry: &Geometry, rays: &[Ray], mask: impl VisibilityMask) -> (f32, usize) {
    let objects = &description.objects;
    let (mut sum, mut stopped) = (0.0, 0);
    for (i, ray) in rays.iter().enumerate() {
        let object = (i % objects.len()) as u32;
        let hidden = mask.from(Start::Photon(object));
        let hides = |object| mask.hides(hidden, object);
        let hit = geometry.intersect(objects, ray, f32::INFINITY, &hides);
        sum += hit.map_or(0.0, |hit| hit.t);
        let hidden = mask.from(Start::Shadow(object));
        let hides = |object| mask.hides(hidden, object);
        stopped += usize::from(geometry.occluded(objects, ray, 2.0, &hides));
    }
    (sum, stopped)
}

fn benches(criterion: &mut Criterion) {
    let (plain, ruled) = (scene(false), scene(true));
    let rays = rays();
    let geometry = Geometry::new(&plain.description().objects);
    let rules = ruled.description().rules.as_ref().expect("rules");
    let found = trace(plain.description(), &geometry, &rays, Unruled);
    assert_eq!(found, trace(ruled.description(), &geometry, &rays, Ruled(rules)));

    let mut group = criterion.benchmark_group("rays");
    group.throughput(Throughput::Elements(2 * RAYS as u64));
    group.measurement_time(Duration::from_secs(4));
    group.bench_function("without rules", |b| {
        b.iter(|| black_box(trace(plain.description(), &geometry, black_box(&rays), Unruled)));
    });
    group.bench_function("with rules on every object", |b| {
        b.iter(|| black_box(trace(ruled.description(), &geometry, black_box(&rays), Ruled(rules))));
    });
    group.finish();

    let mut group = criterion.benchmark_group("pass");
    group.measurement_time(Duration::from_secs(6)).sample_size(20);
    for (name, scene) in [("without rules", &plain), ("with rules on every object", &ruled)] {
        let plan = RenderPlan::new(scene, scene.description().defaults.job_settings());
        group.bench_function(name, |b| {
            b.iter(|| black_box(render_pass(scene, &plan, 0).expect("a pass")))
        });
    }
    group.finish();
}

criterion_group!(rules, benches);
criterion_main!(rules);
