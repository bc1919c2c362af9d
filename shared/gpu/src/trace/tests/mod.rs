use super::*;
use crate::testing::{same_layout, tested};
use crate::world::FlatWorld;
use beamfarm_image::job::{JobSettings, ScheduleKind, Technique, Techniques};
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::trace::trace_paths;
use beamfarm_render::cpu::photon_map;
use beamfarm_render::math::Vec3;
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;

mod footprint;
mod scenes;

const ROOM: Capacities = Capacities {
    beams: 1 << 16,
    photons: 1 << 16,
};

fn settings(paths: u32, media: Option<Technique>, surfaces: Option<Technique>) -> JobSettings {
    JobSettings {
        seed: 7,
        alpha: 0.6,
        schedule: ScheduleKind::Pass,
        budget: None,
        paths_per_pass: paths,
        reference_paths: 2000,
        techniques: Techniques {
            media,
            surfaces,
            caustics: None,
            aimed: Some(false),
        },
    }
}

/// What a device has traced.
#[derive(Debug, PartialEq)]
struct Traced {
    told: Told,
    /// By path: the numbers of the first.
    beam_places: Vec<u32>,
    photon_places: Vec<u32>,
    beams: Vec<Beam>,
    ends: Vec<BeamEnds>,
    photons: Vec<SurfacePhoton>,
}

fn trace(
    tested: &Tested,
    scene: &Scene,
    plan: &RenderPlan,
    pass: u64,
    most: Capacities,
    sizes: rounds::Sizes,
) -> Traced {
    let device = &tested.device;
    let world = FlatWorld::new(scene, device.largest_buffer()).unwrap();
    let world = world.upload(device).unwrap();
    let tables = TraceTables::new(scene, plan, pass).upload(device).unwrap();
    let paths = plan.surface_paths;
    let trace = Trace::with(tested, &world, (paths, most), sizes).unwrap();
    let mut work = device.work();
    trace.run(&mut work, &world, &tables).unwrap();
    work.submit().unwrap();
    let told = device.read::<Told>(trace.told(), 1).unwrap()[0];
    let count = |buffer: &Buffer| device.read::<u32>(buffer, 1).unwrap()[0] as usize;
    let (beams, photons) = (count(trace.beam_count()), count(trace.photon_count()));
    assert_eq!(beams, told.beams.min(most.beams) as usize);
    assert_eq!(photons, told.photons.min(most.photons) as usize);
    Traced {
        told,
        beam_places: device.read(&trace.beam_places, paths as usize).unwrap(),
        photon_places: device.read(&trace.photon_places, paths as usize).unwrap(),
        beams: device.read(trace.beams(), beams).unwrap(),
        ends: device.read(trace.beam_ends(), beams).unwrap(),
        photons: device.read(trace.photons(), photons).unwrap(),
    }
}

fn sizes(tested: &Tested, most: u32) -> rounds::Sizes {
    rounds::Sizes {
        most,
        ..rounds::Sizes::of(&tested.device)
    }
}

/// Of list `places`, what is of a path.
fn of_path<'a, T>(all: &'a [T], places: &[u32], path: usize) -> &'a [T] {
    let end = places.get(path + 1).map_or(all.len(), |end| *end as usize);
    &all[places[path] as usize..end]
}

/// How far apart numbers are, over the larger one and a size.
fn apart(a: impl Into<Vec3>, b: impl Into<Vec3>, size: f32) -> f32 {
    let (a, b) = (a.into(), b.into());
    if a == b {
        return 0.0;
    }
    (a - b).length() / (size + a.length().max(b.length()))
}

fn splat(x: f32) -> [f32; 3] {
    [x; 3]
}

/// How far apart a beam is from the processor's, by the largest relative difference; infinite where it is another.
fn apart_beam(got: &Beam, expected: &PhotonBeam) -> f32 {
    if got.medium != u32::from(expected.medium) {
        return f32::INFINITY;
    }
    let [start, end] = expected.extent;
    let size = expected.length.abs() + expected.radius;
    let all = [
        apart(got.origin, expected.origin, 1.0),
        apart(got.dir, expected.dir, 0.0),
        apart(got.power, expected.power, 0.0),
        apart(splat(got.length), splat(expected.length), expected.radius),
        apart(splat(got.radius), splat(expected.radius), 0.0),
        apart(splat(got.radius_slope), splat(expected.radius_slope), 0.1),
        apart(splat(got.extent[0]), splat(start), size),
        apart(splat(got.extent[1]), splat(end), size),
    ];
    all.into_iter().fold(0.0, f32::max)
}

fn apart_photon(got: &SurfacePhoton, expected: &photon_map::SurfacePhoton) -> f32 {
    let expected = SurfacePhoton::from(expected);
    if (got.arrival, got.found_by) != (expected.arrival, expected.found_by) {
        return f32::INFINITY;
    }
    let all = [
        apart(got.point, expected.point, 1.0),
        apart(got.ng, expected.ng, 0.0),
        apart(got.wi, expected.wi, 0.0),
        apart(got.power, expected.power, 0.0),
        apart(splat(got.radius), splat(expected.radius), 0.0),
        apart(splat(got.expected), splat(expected.expected), 0.0),
    ];
    all.into_iter().fold(0.0, f32::max)
}

/// Path by path, what a device leaves is what the processor leaves, but for rounding, which makes a few paths go
/// another way: behind balls, edges, and by roulette. Returns numbers of beams and photons.
fn compare(tested: &Tested, name: &str, scene: &Scene, plan: &RenderPlan, pass: u64) -> [u32; 2] {
    let got = trace(tested, scene, plan, pass, ROOM, sizes(tested, 4096));
    assert_eq!(got.told.unfinished, 0, "{name}");
    let mut other = Vec::new();
    let (mut sum, mut expected_sum) = ([Vec3::ZERO; 2], [Vec3::ZERO; 2]);
    let mut counts = [0; 2];
    for path in 0..plan.surface_paths {
        let expected = trace_paths(scene, plan, pass, path..path + 1);
        let expected_beams: Vec<PhotonBeam> = match plan.beams {
            true => expected.beams.iter().chain(&expected.smooth_beams).copied().collect(),
            false => Vec::new(),
        };
        let expected_photons = if plan.surface_photons {
            &expected.surface[..]
        } else {
            &[]
        };
        let beams = of_path(&got.beams, &got.beam_places, path as usize);
        let photons = of_path(&got.photons, &got.photon_places, path as usize);
        counts[0] += expected_beams.len() as u32;
        counts[1] += expected_photons.len() as u32;
        sum[0] += beams.iter().map(|b| Vec3::from(b.power)).sum::<Vec3>();
        sum[1] += photons.iter().map(|p| Vec3::from(p.power)).sum::<Vec3>();
        expected_sum[0] += expected_beams.iter().map(|b| b.power).sum::<Vec3>();
        expected_sum[1] += expected_photons.iter().map(|p| p.power).sum::<Vec3>();
        let of_beams = beams.iter().zip(&expected_beams).map(|(a, b)| apart_beam(a, b));
        let of_photons = photons.iter().zip(expected_photons).map(|(a, b)| apart_photon(a, b));
        let most = of_beams.chain(of_photons).fold(0.0, f32::max);
        if beams.len() != expected_beams.len() || photons.len() != expected_photons.len() || !(most < 2e-3) {
            other.push((path, most));
        }
    }
    println!(
        "{name}, pass {pass}: {} paths, {counts:?} beams and photons, {} other paths, sums {sum:?} {expected_sum:?}",
        plan.surface_paths,
        other.len()
    );
    for (path, most) in other.iter().take(3) {
        println!("  path {path}: {most}");
    }
    assert!(
        other.len() as f32 <= 0.01 * plan.surface_paths as f32,
        "{name}, pass {pass}: {other:?}"
    );
    for (sum, expected) in sum.into_iter().zip(expected_sum) {
        assert!(
            apart(sum, expected, 0.0) < 0.02,
            "{name}, pass {pass}: {sum} {expected}"
        );
    }
    counts
}

#[test]
fn paths_leave_what_they_leave_on_a_processor() {
    let Some(tested) = tested() else { return };
    for (name, scene) in scenes::all() {
        let (photons, paths) = (Some(Technique::Photons), Some(Technique::Paths));
        for (media, surfaces, pass) in [
            (None, None, 0),
            (photons, photons, 50),
            (paths, photons, 3),
            (photons, paths, 0),
        ] {
            let plan = RenderPlan::new(&scene, settings(500, media, surfaces));
            compare(tested, name, &scene, &plan, pass);
        }
    }
}

#[test]
fn numbers_lie_in_memory_as_kernels_have_them() {
    same_layout!(
        &TRACE,
        Told {
            beams,
            photons,
            unfinished
        }
    );
    let (size, _) = crate::testing::layout(&TRACE, "PhotonPath");
    assert_eq!(u64::from(size), STATE);
}
