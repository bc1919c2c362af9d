//! The angles of a prism and of the rainbow.

use beamfarm_harness::render::scene;
use beamfarm_image::job::JobSettings;
use beamfarm_render::cpu::beam::trace::trace_photons;
use beamfarm_render::math::{Frame, Rgb, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::world::bsdf::{Bsdf, Dielectric, Index, TransportMode};
use beamfarm_render::world::spectrum::{WAVES, WaveSet};

/// Fraunhofer's lines C, D, e, F and g, nm.
const LINES: [f64; 5] = [656.28, 589.29, 546.07, 486.13, 435.83];

fn glass(eta: f64) -> Bsdf<'static> {
    Bsdf::Dielectric(Dielectric {
        eta: eta as f32,
        reflectance: Rgb::ONE,
        transmittance: Rgb::ONE,
    })
}

/// The direction in which light leaves a surface of this normal: refracted, or else reflected.
fn through(bsdf: &Bsdf, dir: Vec3, normal: Vec3, refracted: bool) -> Option<Vec3> {
    let frame = Frame::from_normal(normal);
    let ways = bsdf.branches(frame.to_local(-dir), TransportMode::Flux)?;
    let way = ways.into_iter().find(|way| way.transmitted == refracted)?;
    (way.pdf > 0.0).then(|| frame.to_world(way.wi))
}

fn degrees(radians: f32) -> f64 {
    f64::from(radians).to_degrees()
}

/// The angle by which a prism of 60 degrees turns light at this angle of incidence.
fn deviation(bsdf: &Bsdf, incidence: f32) -> Option<f64> {
    let normal = |angle: f32| {
        let (sin, cos) = libm::sincosf(angle.to_radians());
        Vec3::new(cos, sin, 0.0)
    };
    let (entry, exit) = (normal(150.0), normal(30.0));
    // Towards the base.
    let dir = -normal(150.0 + incidence);
    let inside = through(bsdf, dir, entry, true)?;
    let out = through(bsdf, inside, exit, true)?;
    Some(degrees(libm::acosf(dir.dot(out).clamp(-1.0, 1.0))))
}

/// sin((A + d) / 2) = n sin(A / 2), with Sellmeier's n.
#[test]
fn a_prism_turns_each_line_by_no_less_than_the_formula_says() {
    for substance in ["bk7", "sf11", "water"] {
        let index = Index::preset(substance).unwrap();
        for nm in LINES {
            let n = index.at(nm);
            let bsdf = glass(n);
            let angles = (2000..8900).filter_map(|angle| deviation(&bsdf, angle as f32 / 100.0));
            let least = angles.fold(f64::INFINITY, f64::min);
            let expected = 2.0 * libm::asin(n * 0.5).to_degrees() - 60.0;
            assert!(
                (least - expected).abs() < 0.02,
                "{substance}, {nm} nm: {least} for {expected}"
            );
        }
    }
}

/// The angle between where the light comes from and where it goes after one reflection inside a ball.
fn bow(bsdf: &Bsdf, offset: f32) -> Option<f64> {
    let dir = Vec3::X;
    let at = |previous: Vec3, dir: Vec3| previous - 2.0 * previous.dot(dir) * dir;
    let entry = Vec3::new(-libm::sqrtf(1.0 - offset * offset), offset, 0.0);
    let inside = through(bsdf, dir, entry, true)?;
    let back = at(entry, inside);
    let returned = through(bsdf, inside, back, false)?;
    let out = through(bsdf, returned, at(back, returned), true)?;
    Some(degrees(libm::acosf((-dir).dot(out).clamp(-1.0, 1.0))))
}

/// 42.4 degrees for red and 40.6 for violet, as in every textbook.
#[test]
fn a_rainbow_has_its_angles() {
    let water = Index::preset("water").unwrap();
    for (nm, expected) in [(700.0, 42.4), (400.0, 40.6)] {
        let bsdf = glass(water.at(nm));
        let largest = (1..1000)
            .filter_map(|i| bow(&bsdf, i as f32 / 1000.0))
            .fold(0.0, f64::max);
        assert!((largest - expected).abs() < 0.1, "{nm} nm: {largest}");
    }
}

/// Photons leave the prism in the direction of their wavelength, and each wavelength of the pass has equally many,
/// within five standard deviations of a count.
#[test]
fn photons_of_a_pass_leave_a_prism_by_their_wavelengths() {
    let scene = scene(
        r#"
[image]
width = 8
height = 8
[camera]
origin = [0.0, 0.0, -3.0]
target = [0.0, 0.0, 10.0]
fov = 90.0
[materials.flint]
type = "dielectric"
ior = { preset = "sf11" }
[[shapes]]
type = "cube"
material = "flint"
transform = [{ scale = [40.0, 40.0, 1.0] }]
# What it sends back would come by other ways.
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "rectangle"
material = "black"
transform = [{ scale = 200.0 }, { rotate = { axis = [1, 0, 0], angle = 180 } }, { translate = [0, 0, 0.9] }]
[[lights]]
type = "spot"
position = [-6.0, 0.0, -9.0]
target = [0.0, 0.0, -1.0]
cutoff_angle = 0.01
beam_width = 0.009
power = 1.0
"#,
    );
    let settings = JobSettings {
        seed: 4,
        paths_per_pass: 40_000,
        ..scene.description().defaults.job_settings()
    };
    let photons = trace_photons(&scene, &RenderPlan::new(&scene, settings), 3).surface;
    let (waves, flint) = (WaveSet::of_pass(WAVES, 4, 3), Index::preset("sf11").unwrap());
    let entered = photons.iter().filter(|photon| photon.wave.is_some()).count();
    for wave in waves.iter() {
        let of_wave = photons.iter().filter(|photon| photon.wave == Some(wave.number));
        let mut count = 0;
        for photon in of_wave {
            // Sines to the normal: 0.6 outside.
            let sine = f64::from(libm::sqrtf(photon.wi.x * photon.wi.x + photon.wi.y * photon.wi.y));
            let expected = 0.6 / flint.at(f64::from(wave.nm));
            assert!((sine - expected).abs() < 2e-4, "{} nm: {sine} for {expected}", wave.nm);
            count += 1;
        }
        let share = 1.0 / waves.iter().count() as f64;
        let deviation = libm::sqrt(entered as f64 * share * (1.0 - share));
        assert!(
            (f64::from(count) - entered as f64 * share).abs() < 5.0 * deviation,
            "{count} of {entered}"
        );
    }
    assert!(entered > 10_000, "{entered}");
}
