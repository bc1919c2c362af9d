use super::*;
use crate::beams::{FlatWalls, Near};
use crate::self_test::Tested;
use crate::testing::{same_layout, tested};
use crate::world::FlatWorld;
use beamfarm_image::job::{EngineKind, JobSettings, ScheduleKind, Technique, Techniques};
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::trace::trace_paths;
use beamfarm_render::cpu::photon_map;
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::medium::Medium;
use rounds::Round;

mod aims;
mod footprint;
mod rules;
mod scenes;
mod waves;

/// Rays per path: more than any path needs here.
const MOST: u32 = 4096;

/// Batch sizes.
const TOGETHER: rounds::Sizes = rounds::Sizes {
    batch: 1000,
    turns: 32,
    most: MOST,
};

const ROOM: Capacities = Capacities {
    beams: 1 << 16,
    photons: 1 << 16,
    steps: 1 << 17,
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
        engine: EngineKind::Gpu,
    }
}

/// The device's results.
#[derive(Debug, PartialEq)]
struct Traced {
    told: Told,
    /// By path: the index of the first.
    beam_places: Vec<u32>,
    photon_places: Vec<u32>,
    beams: Vec<Beam>,
    ends: Vec<BeamEnds>,
    photons: Vec<SurfacePhoton>,
    /// For beams in varying densities.
    steps: Vec<u32>,
}

impl Traced {
    /// Transmittance along a beam at a distance.
    fn transmittance(&self, beam: usize, distance: f32, sigma_t: Rgb) -> Rgb {
        let [first, count] = [0, 1].map(|k| self.steps[2 * beam + k] as usize);
        let steps = self.steps[first..first + 6 * count].chunks(6);
        let steps = steps.map(|words| [0, 1, 2, 3, 4, 5].map(|k| f32::from_bits(words[k])));
        let last = steps.take_while(|step| step[0] <= distance).last();
        let Some([at, x, y, z, depth, decay]) = last else {
            return Rgb::ONE;
        };
        let depth = depth + decay * (distance - at);
        Rgb::new(x, y, z) * (sigma_t * -depth).exp()
    }
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
    let world = world.planned_by(scene, plan);
    let world = world.upload(device).unwrap();
    let tables = TraceTables::new(scene, plan, pass).upload(device).unwrap();
    let paths = plan.surface_paths;
    let trace = Trace::with(tested, &world, (paths, most), sizes).unwrap();
    let mut work = device.work();
    trace.run(&mut work, &world, &tables).unwrap();
    if let Some(walls) = FlatWalls::new(scene) {
        let walls = walls.upload(device).unwrap();
        let near = Near {
            geometry: &world.geometry,
            walls: &walls,
        };
        let find = PhotonWalls::new(tested, &world.geometry).unwrap();
        find.run(&mut work, &near, trace.photon_count(), trace.photons())
            .unwrap();
    }
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
        steps: match trace.steps() {
            Some(steps) => device
                .read(steps, 2 * most.beams as usize + 6 * told.steps.min(most.steps) as usize)
                .unwrap(),
            None => Vec::new(),
        },
    }
}

/// A path's share of a list, by `places`.
fn of_path<'a, T>(all: &'a [T], places: &[u32], path: usize) -> &'a [T] {
    let end = places.get(path + 1).map_or(all.len(), |end| *end as usize);
    &all[places[path] as usize..end]
}

/// Difference, relative to the larger value and a size.
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

/// Largest relative difference between a beam and the processor's; infinite if it is a different one.
fn apart_beam(got: &Beam, expected: &PhotonBeam) -> f32 {
    let wave = expected.wave.map_or(0, |wave| wave.index() as u32 + 1);
    if got.medium != u32::from(expected.medium) | wave << Beam::WAVE_BITS {
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

/// `classes`: by the kind of a light.
fn apart_photon(got: &SurfacePhoton, expected: &photon_map::SurfacePhoton, classes: &[u32]) -> f32 {
    let of_light = (classes.get(usize::from(expected.light_kind))).map_or(0, |class| 1 << (8 + class));
    let expected = SurfacePhoton::from(expected);
    if (got.arrival, got.found_by) != (expected.arrival, expected.found_by | of_light) {
        return f32::INFINITY;
    }
    let all = [
        apart(got.point, expected.point, 1.0),
        apart(got.ng, expected.ng, 0.0),
        apart(got.wi, expected.wi, 0.0),
        apart(got.power, expected.power, 0.0),
        apart(splat(got.radius), splat(expected.radius), 0.0),
        apart(splat(got.expected), splat(expected.expected), 0.0),
        apart(splat(got.height), splat(expected.height), 0.0),
        match got.beyond.iter().any(|x| x.is_nan()) == expected.beyond.iter().any(|x| x.is_nan()) {
            true if got.beyond[0].is_nan() => 0.0,
            true => apart(got.beyond, expected.beyond, 0.0),
            false => f32::INFINITY,
        },
    ];
    all.into_iter().fold(0.0, f32::max)
}

/// Path by path, the device stores what the processor does. Rounding sends a few paths another way: behind balls, at
/// edges, and by roulette. Returns the numbers of beams, of photons, and of photons that walls cross.
fn compare(tested: &Tested, name: &str, scene: &Scene, plan: &RenderPlan, pass: u64) -> [u32; 3] {
    let got = trace(tested, scene, plan, pass, ROOM, TOGETHER);
    assert_eq!(got.told.unfinished, 0, "{name}");
    let mut other = Vec::new();
    let (mut sum, mut expected_sum) = ([Vec3::ZERO; 2], [Vec3::ZERO; 2]);
    let mut counts = [0; 3];
    let mut walked = 0;
    let rules = scene.description().rules.as_ref();
    let classes = rules.map_or(&[][..], |rules| &rules.light_kinds.1);
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
        counts[2] += expected_photons.iter().filter(|p| p.walls.height > 0.0).count() as u32;
        sum[0] += beams.iter().map(|b| Vec3::from(b.power)).sum::<Vec3>();
        sum[1] += photons.iter().map(|p| Vec3::from(p.power)).sum::<Vec3>();
        expected_sum[0] += expected_beams.iter().map(|b| b.power).sum::<Vec3>();
        expected_sum[1] += expected_photons.iter().map(|p| p.power).sum::<Vec3>();
        let of_beams = beams.iter().zip(&expected_beams).map(|(a, b)| apart_beam(a, b));
        let first = got.beam_places[path as usize] as usize;
        let of_functions = expected_beams.iter().take(beams.len()).enumerate().map(|(i, beam)| {
            let medium = &scene.description().media[usize::from(beam.medium)];
            if matches!(medium, Medium::Homogeneous(_)) {
                return 0.0;
            }
            let functions = if i < expected.beams.len() {
                &expected.steps
            } else {
                &expected.smooth_steps
            };
            let (function, sigma_t) = (functions.get(beam.steps), medium.sigma_t());
            let at = |k: u8| {
                let distance = beam.length * f32::from(k) / 8.0;
                let own = function.at(distance, sigma_t);
                let there = got.transmittance(first + i, distance, sigma_t);
                walked += u32::from(own != Rgb::ONE);
                // At a step, either side is right.
                if apart(there, own, 1e-3) < 2e-3 { 0 } else { 1 }
            };
            let other: u32 = (0..=8).map(at).sum();
            if other > 1 { f32::INFINITY } else { 0.0 }
        });
        let of_functions = of_functions.fold(0.0, f32::max);
        let of_photons = photons
            .iter()
            .zip(expected_photons)
            .map(|(a, b)| apart_photon(a, b, classes));
        let most = of_beams.chain(of_photons).fold(of_functions, f32::max);
        if beams.len() != expected_beams.len()
            || photons.len() != expected_photons.len()
            || most.is_nan()
            || most >= 2e-3
        {
            other.push((path, most));
        }
    }
    println!(
        "{name}, pass {pass}: {} paths, {counts:?} beams, photons and crossed ones, {} other paths, sums {sum:?} {expected_sum:?}",
        plan.surface_paths,
        other.len()
    );
    match name {
        // At nine places along each beam, some in thin smoke: functions that are 1 everywhere would prove nothing.
        "smokes" => assert!(walked > counts[0], "{name}: {walked}"),
        _ => assert!(walked <= 500, "{name}: {walked}"),
    }
    for (path, most) in other.iter().take(3) {
        println!("  path {path}: {most}");
    }
    assert!(
        other.len() as f32 <= 0.005 * plan.surface_paths as f32,
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
    let (photons, paths) = (Some(Technique::Photons), Some(Technique::Paths));
    let (mut counts, mut shared) = ([0; 3], 0);
    for (name, scene) in scenes::all() {
        let more: &[_] = match name {
            "box of fog" => &[(paths, photons, 3), (photons, paths, 0)],
            "under a lamp" => &[(paths, paths, 0)],
            _ => &[],
        };
        for (media, surfaces, pass) in [&[(None, None, 0), (photons, photons, 50)], more].concat() {
            let plan = RenderPlan::new(&scene, settings(400, media, surfaces));
            let tables = TraceTables::new(&scene, &plan, pass);
            let is_shared = tables.plan.goes_on == 0 && tables.lights.iter().any(|light| light.in_caustic > 0.0);
            let [beams, surface, crossed] = compare(tested, name, &scene, &plan, pass);
            shared += u32::from(is_shared) * surface;
            counts[0] += beams;
            counts[1] += surface;
            counts[2] += crossed;
        }
    }
    assert!(counts[0] > 5000 && counts[1] > 3000 && counts[2] > 100, "{counts:?}");
    // Where photons stop, and camera paths find caustics as well.
    assert!(shared > 30, "{shared}");
}

fn bits<T: Pod>(all: &[T]) -> &[u8] {
    bytemuck::cast_slice(all)
}

/// The same bits for any batch sizes and on repetition: rounds of one ray, few paths together.
#[test]
fn paths_leave_the_same_however_many_are_followed_together() {
    let Some(tested) = tested() else { return };
    let [_, (name, scene), ..] = scenes::all();
    let plan = RenderPlan::new(&scene, settings(200, None, None));
    let traced = |batch: u32, turns: u32| {
        trace(
            tested,
            &scene,
            &plan,
            1,
            ROOM,
            rounds::Sizes {
                batch,
                turns,
                ..TOGETHER
            },
        )
    };
    let expected = traced(1000, 32);
    assert!(expected.beams.len() > 300 && expected.photons.len() > 30, "{name}");
    assert_eq!(expected.told.unfinished, 0);
    for (batch, turns) in [(1000, 32), (1000, 7), (33, 64)] {
        let got = traced(batch, turns);
        assert_eq!((got.told, &got.beam_places), (expected.told, &expected.beam_places));
        assert!(bits(&got.beams) == bits(&expected.beams), "{batch}, {turns}");
        assert!(bits(&got.ends) == bits(&expected.ends), "{batch}, {turns}");
        assert!(bits(&got.photons) == bits(&expected.photons), "{batch}, {turns}");
    }
}

/// Insufficient room is reported, and nothing is written beyond it; likewise for too few rays.
#[test]
fn what_has_no_room_is_told() {
    let Some(tested) = tested() else { return };
    let [_, (_, scene), ..] = scenes::all();
    let plan = RenderPlan::new(&scene, settings(200, None, None));
    let all = trace(tested, &scene, &plan, 1, ROOM, TOGETHER);
    let few = Capacities {
        beams: 100,
        photons: 10,
        steps: 0,
    };
    let got = trace(tested, &scene, &plan, 1, few, TOGETHER);
    assert_eq!(got.told, all.told);
    assert!(bits(&got.beams) == bits(&all.beams[..100]) && bits(&got.photons) == bits(&all.photons[..10]));
    let one = rounds::Sizes {
        turns: 1,
        most: 1,
        ..TOGETHER
    };
    let short = trace(tested, &scene, &plan, 1, ROOM, one);
    assert!(
        short.told.unfinished > 100 && short.told.beams < all.told.beams,
        "{:?}",
        short.told
    );
}

/// What a ray meets first, as the end of a beam: distance, normal, and kind.
fn end_on(scene: &Scene, origin: Vec3, dir: Vec3) -> (f32, Vec3, u32) {
    let description = scene.description();
    match scene.first_hit(&Ray { origin, dir }, |_| false) {
        None => (f32::INFINITY, Vec3::ZERO, BeamEnds::NONE),
        Some(hit) => {
            let object = &description.objects[hit.object as usize];
            let passes = description.materials[object.material as usize].has(BsdfFlags::TRANSMITS);
            let is = match passes && object.boundary.is_some() {
                true => BeamEnds::BOUNDARY,
                false => BeamEnds::SURFACE,
            };
            (hit.t, hit.ng, is)
        }
    }
}

/// As met from the beams' own positions.
#[test]
fn beams_know_what_they_start_and_end_on() {
    let Some(tested) = tested() else { return };
    let mut counts = [[0; 3]; 2];
    for (_, scene) in scenes::all()
        .into_iter()
        .filter(|(name, _)| ["ball of glass", "fogs"].contains(name))
    {
        let plan = RenderPlan::new(&scene, settings(300, Some(Technique::Photons), None));
        let got = trace(tested, &scene, &plan, 0, ROOM, TOGETHER);
        for (beam, ends) in got.beams.iter().zip(&got.ends) {
            let (origin, dir) = (Vec3::from(beam.origin), Vec3::from(beam.dir));
            let (t, normal, is) = end_on(&scene, origin, dir);
            let expected = if beam.length == t {
                (normal, is)
            } else {
                (Vec3::ZERO, BeamEnds::NONE)
            };
            assert!(beam.length <= t, "{beam:?} {t}");
            assert!(
                (Vec3::from(ends.end), ends.end_is) == expected,
                "{beam:?} {ends:?} {expected:?}"
            );
            counts[1][ends.end_is as usize] += 1;
            // Rays start slightly off the surface that they leave.
            let (t, normal, is) = end_on(&scene, origin + dir * 1e-3, -dir);
            let is_near = t * normal.dot(dir).abs() < 1e-3 * normal.dot(dir).abs() + 1e-4;
            if ends.start_is == BeamEnds::NONE {
                assert!(!is_near, "{beam:?} {ends:?}");
            } else if is_near {
                assert!(
                    (Vec3::from(ends.start) - normal).length() < 1e-2,
                    "{beam:?} {ends:?} {normal}"
                );
                assert_eq!(ends.start_is, is, "{beam:?} {ends:?}");
                counts[0][ends.start_is as usize] += 1;
            }
        }
    }
    assert!(
        counts.iter().all(|counts| counts[1] > 5 && counts[2] > 30),
        "{counts:?}"
    );
    assert!(counts[1][0] > 100, "{counts:?}");
}

#[test]
fn numbers_lie_in_memory_as_kernels_have_them() {
    same_layout!(
        &TRACE,
        Told {
            beams,
            photons,
            unfinished,
            steps
        }
    );
    same_layout!(
        &TRACE,
        Round {
            first,
            count,
            writes,
            turns,
            beams,
            photons,
            steps
        }
    );
    same_layout!(
        &TRACE,
        TracePlan {
            stream,
            center,
            bounds,
            view,
            paths,
            beam_paths,
            is_even,
            has_view,
            goes_on,
            ends_paths,
            has_boundaries,
            keeps,
            lights,
            kernel_paths,
            surface_footprint,
            radius_scale,
            surface_scale,
            floor,
            ceiling,
            smooth_ceiling,
            in_kernel,
            least_flight,
            waves,
            etas
        }
    );
    same_layout!(
        &TRACE,
        TracedLight {
            sum,
            in_caustic,
            bits,
            class_bit,
            hides,
            light_group
        }
    );
    same_layout!(
        &TRACE,
        TracedMedium {
            reach,
            least_sigma_t,
            widest_sharp,
            widest_smooth,
            flags,
            hides
        }
    );
    same_layout!(&TRACE, TracedObject { widest, bits, hides });
    let (size, _) = crate::testing::layout(&TRACE, "PhotonPath");
    assert_eq!(u64::from(size), STATE);
}
