//! Photons and beams that the camera hardly sees or cannot see.

use beamfarm_harness::render::{plan_of, scene};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_image::job::JobSettings;
use beamfarm_render::cpu::beam::PhotonBeam;
use beamfarm_render::cpu::beam::trace::trace_photons;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::plan::engine::PassImage;
use beamfarm_render::plan::frustum::Frustum;
use beamfarm_render::plan::kernel::KernelRadii;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp::uniform_sphere;
use beamfarm_render::world::Scene;

/// A lamp next to a tile, in endless fog.
fn open_fog(camera: &str, more: &str) -> Scene {
    let fov = match camera.contains("view_width") {
        true => "projection = \"orthographic\"",
        false => "fov = 40.0",
    };
    scene(&format!(
        r#"
[image]
width = 24
height = 16
[render]
paths = 1000
radius = 0.05
[world]
medium = "fog"
[camera]
origin = [0.2, 0.3, 3.0]
target = [0.1, 0.0, 0.0]
{fov}
{camera}
[media.fog]
type = "homogeneous"
sigma_a = [0.05, 0.1, 0.08]
sigma_s = [0.5, 0.4, 0.45]
phase = {{ type = "hg", g = 0.4 }}
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "rectangle"
material = "black"
transform = [{{ scale = 0.01 }}, {{ translate = [0.5, 0.5, 0.0] }}]
{more}
[[lights]]
type = "point"
position = [-0.4, 0.2, 0.0]
power = [10.0, 20.0, 30.0]
"#
    ))
}

const GLASS: &str = "[[shapes]]\ntype = \"sphere\"\nmaterial = \"glass\"\nradius = 0.2\n";

/// Everything near a camera ray is in view, and most of the rest is not.
#[test]
fn what_camera_rays_come_near_is_in_view() {
    for lens in [
        "",
        "aperture = 0.3\nfocus_distance = 2.0",
        "view_width = 2.0\nprincipal_point = [0.1, -0.2]",
        "view_width = 2.0\naperture = 0.3\nfocus_distance = 2.0",
    ] {
        let scene = open_fog(lens, "");
        let camera = scene.description().camera;
        let view = Frustum::of(&scene).unwrap();
        let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
        let mut meets = |middle: Vec3, off: f32| {
            let dir = uniform_sphere(sampler.next_2d());
            let (before, after) = (4.0 * sampler.next_1d(), 4.0 * sampler.next_1d());
            let radius = 0.3 * sampler.next_1d();
            let aside = dir.any_orthonormal_vector() * (off * radius);
            let beam = PhotonBeam {
                origin: middle + aside - dir * before,
                dir,
                length: before + after,
                extent: [0.0, before + after],
                power: Rgb::ONE,
                radius,
                radius_slope: 0.0,
                medium: 0,
                group: None,
                wave: None,
                steps: 0,
                walls: [0; 2],
            };
            view.meets(beam.ends(), beam.max_radius())
        };
        let mut points = Sampler::new(6, 0, Purpose::Test, 0);
        for _ in 0..20_000 {
            let image = points.next_2d() * Vec2::new(camera.width as f32, camera.height as f32);
            let ray = camera.ray(image, points.next_2d());
            let point = ray.at(20.0 * points.next_1d() * points.next_1d());
            assert!(meets(point, 0.99), "{lens}: {point}");
        }
        let mut anywhere = || uniform_sphere(points.next_2d()) * 12.0;
        let seen = (0..2000).filter(|_| meets(anywhere(), 0.0)).count();
        assert!(seen < 1000, "{lens}: {seen}");
    }
}

/// Where something may turn camera paths, they may go anywhere.
#[test]
fn all_is_in_view_of_what_turns_paths() {
    let at = |z: f32| open_fog("", &format!("{GLASS}center = [0.0, 0.0, {z}]\n"));
    assert!(Frustum::of(&at(0.0)).is_none());
    assert!(Frustum::of(&at(2.9)).is_none());
    assert!(Frustum::of(&at(9.0)).is_some());
}

/// Beams that are left out add nothing: the picture has the same mean with fewer of them.
#[test]
fn beams_out_of_view_do_not_matter() {
    let scene = open_fog("aperture = 0.1\nfocus_distance = 3.0", "");
    let some = plan_of(&scene);
    assert!(some.view.is_some());
    let mut all = some.clone();
    all.view = None;
    // Photons and camera paths are the same; random points of chords are not.
    let mut difference = MeanEstimate::new();
    let mut stored = [0, 0];
    for pass in 0..200 {
        let images = [&some, &all].map(|plan| render_pass(&scene, plan, pass).expect("a pass"));
        for (stored, image) in stored.iter_mut().zip(&images) {
            *stored += image.stats.beams;
        }
        let sum = |image: PassImage| image.film.pixels.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
        let [some, all] = images.map(sum);
        difference.add(some - all);
    }
    assert!(2 * stored[0] < stored[1], "{stored:?}");
    let mut suite = Suite::new(1e-3);
    suite.mean("difference", &difference, 0.0);
    suite.finish();
}

/// The fog absorbs all that is emitted, although photons far away end by chance.
#[test]
fn what_flies_away_is_not_lost() {
    let scene = open_fog("", "");
    let settings = JobSettings {
        paths_per_pass: 3000,
        ..scene.description().defaults.job_settings()
    };
    let mut plan = RenderPlan::new(&scene, settings);
    plan.view = None;
    plan.radii = KernelRadii::fixed(1e-4);
    let medium = &scene.description().media[0];
    let sigma_t = medium.sigma_t();
    let albedo = medium.sigma_s() / sigma_t;
    let mut total = [(); 3].map(|_| MeanEstimate::new());
    for pass in 0..200 {
        let photons = trace_photons(&scene, &plan, pass);
        assert!(photons.beams.is_empty() && !photons.smooth_beams.is_empty());
        for c in 0..3 {
            let lost = |b: &PhotonBeam| f64::from(b.power[c]) * -libm::expm1(-f64::from(sigma_t[c] * b.length));
            let scattered: f64 = photons.smooth_beams.iter().map(lost).sum();
            total[c].add(scattered);
        }
    }
    // Light straight from the lamp leaves no beams: the beams hold what was scattered once, twice, ... n times.
    let mut suite = Suite::new(1e-3);
    for (c, power) in [10.0, 20.0, 30.0].into_iter().enumerate() {
        let albedo = f64::from(albedo[c]);
        suite.mean(format!("channel {c}"), &total[c], power * albedo / (1.0 - albedo));
    }
    suite.finish();
}
