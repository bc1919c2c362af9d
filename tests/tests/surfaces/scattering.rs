//! Physics of surfaces and phase functions: energy, reciprocity, mean cosines, and agreement with Mitsuba 3.

use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::bsdf::{
    Bsdf, Distribution, RoughConductor, RoughDielectric, TransportMode, fresnel_dielectric,
};
use beamfarm_render::world::phase::Phase;

const SIGNIFICANCE: f64 = 0.01;
const SAMPLES: u32 = 40_000;

fn rng(chunk: u64) -> Sampler {
    Sampler::new(1, 0, Purpose::Test, chunk)
}

fn direction(degrees: f32) -> Vec3 {
    let (sin, cos) = libm::sincosf(degrees.to_radians());
    Vec3::new(0.8 * sin, 0.6 * sin, cos)
}

fn rough_dielectric(alpha: f32, eta: f32) -> Bsdf<'static> {
    Bsdf::RoughDielectric(RoughDielectric {
        distribution: Distribution::Ggx,
        alpha,
        aspect: 1.0,
        eta,
        reflectance: Rgb::ONE,
        transmittance: Rgb::ONE,
        kept: None,
    })
}

/// A conductor that reflects everything: only the microfacets lose light.
fn white_conductor(alpha: f32) -> Bsdf<'static> {
    Bsdf::RoughConductor(RoughConductor {
        distribution: Distribution::Ggx,
        alpha,
        aspect: 1.0,
        eta: Rgb::ZERO,
        k: Rgb::splat(1e6),
        reflectance: Rgb::ONE,
        two_sided: true,
        mean_fresnel: None,
    })
}

fn scattering_bsdfs() -> Vec<(String, Bsdf<'static>)> {
    let mut bsdfs = vec![(
        "diffuse".to_owned(),
        Bsdf::Diffuse {
            reflectance: Rgb::ONE,
            two_sided: true,
        },
    )];
    for alpha in [0.2, 0.5, 1.0] {
        bsdfs.push((format!("conductor {alpha}"), white_conductor(alpha)));
        for eta in [1.5, 1.0 / 1.5, 2.4] {
            bsdfs.push((format!("dielectric {alpha}, eta {eta}"), rough_dielectric(alpha, eta)));
        }
    }
    for (alpha, aspect) in [(0.3, 0.4), (0.4, 2.0)] {
        let [Bsdf::RoughConductor(metal), Bsdf::RoughDielectric(glass)] =
            [white_conductor(alpha), rough_dielectric(alpha, 1.5)]
        else {
            unreachable!("what they are made as");
        };
        bsdfs.extend([
            (
                format!("conductor {alpha} {aspect}"),
                Bsdf::RoughConductor(RoughConductor { aspect, ..metal }),
            ),
            (
                format!("dielectric {alpha} {aspect}"),
                Bsdf::RoughDielectric(RoughDielectric { aspect, ..glass }),
            ),
        ]);
    }
    bsdfs
}

/// Energy-conserving rough glass, which is not reciprocal.
fn white_glass() -> Vec<(String, Bsdf<'static>)> {
    let mut bsdfs = vec![];
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for (alpha, aspect) in [(0.05, 1.0), (0.25, 1.0), (0.64, 1.0), (1.0, 1.0), (0.3, 0.5)] {
            for eta in [1.5, 1.0 / 1.5, 2.4, 1.2] {
                let name = format!("white glass {distribution:?} {alpha} {aspect}, eta {eta}");
                let glass = RoughDielectric {
                    distribution,
                    alpha,
                    aspect,
                    eta,
                    reflectance: Rgb::ONE,
                    transmittance: Rgb::ONE,
                    kept: Some(Rgb::ONE),
                };
                bsdfs.push((name, Bsdf::RoughDielectric(glass)));
            }
        }
    }
    bsdfs
}

/// Mean weight of `sample`: the albedo towards `wo`.
fn albedo_by_sampling(bsdf: &Bsdf, wo: Vec3, mode: TransportMode, chunk: u64) -> MeanEstimate {
    let mut rng = rng(chunk);
    (0..SAMPLES)
        .map(|_| {
            let (lobe, u) = (rng.next_1d(), rng.next_2d());
            bsdf.sample(wo, lobe, u, mode).map_or(0.0, |s| f64::from(s.weight.x))
        })
        .collect()
}

/// The same from `eval` alone, over directions drawn independently of the surface.
fn albedo_by_value(bsdf: &Bsdf, wo: Vec3, mode: TransportMode, chunk: u64) -> MeanEstimate {
    let mut rng = rng(chunk);
    (0..4 * SAMPLES)
        .map(|_| {
            let up = warp::cosine_hemisphere(rng.next_2d());
            let wi = if rng.next_1d() < 0.5 { up } else { -up };
            // Cosine over density.
            let weight = 2.0 * std::f32::consts::PI;
            f64::from(bsdf.eval(wo, wi, mode).x * weight)
        })
        .collect()
}

#[test]
fn sampling_and_values_agree_on_the_albedo() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let mut chunk = 0;
    let glass = white_glass().into_iter().step_by(7);
    for (name, bsdf) in scattering_bsdfs().into_iter().chain(glass) {
        for degrees in [10.0, 60.0, 85.0, 115.0, 160.0] {
            for mode in [TransportMode::Radiance, TransportMode::Flux] {
                let wo = direction(degrees);
                let sampled = albedo_by_sampling(&bsdf, wo, mode, chunk);
                let integrated = albedo_by_value(&bsdf, wo, mode, chunk + 1);
                suite.same_mean(format!("{name} at {degrees}, {mode:?}"), &sampled, &integrated);
                chunk += 2;
            }
        }
    }
    suite.finish();
}

/// In a white furnace a surface sends back no more than it gets. Diffuse and smooth ones send back all of it; rough
/// ones lose what a single bounce among the microfacets cannot carry.
#[test]
fn furnace_never_gains_and_smooth_surfaces_lose_nothing() {
    let mut bsdfs = scattering_bsdfs();
    bsdfs.push(("smooth conductor".to_owned(), white_conductor(1e-3)));
    bsdfs.push(("smooth dielectric".to_owned(), rough_dielectric(1e-3, 1.5)));
    for (name, bsdf) in bsdfs {
        for degrees in [1.0, 30.0, 60.0, 80.0, 100.0, 150.0] {
            let albedo = albedo_by_sampling(&bsdf, direction(degrees), TransportMode::Flux, 5);
            let name = format!("{name} at {degrees}: {}", albedo.mean());
            assert!(albedo.mean() <= 1.0 + 1e-6, "{name}");
            let floor = if name.contains("diffuse") || name.contains("smooth") {
                0.999
            } else {
                0.3
            };
            assert!(albedo.mean() > floor, "{name}");
        }
    }
}

/// In a white furnace the camera sees white through energy-conserving rough glass, from either side; through
/// anisotropic glass, no more than that.
#[test]
fn white_glass_is_white_to_the_camera() {
    for (name, bsdf) in white_glass() {
        let Bsdf::RoughDielectric(glass) = bsdf else {
            unreachable!("what they are made as");
        };
        for degrees in [1.0, 30.0, 60.0, 80.0, 100.0, 150.0, 179.0] {
            let wo = direction(degrees);
            let mut rng = rng(3);
            let eta = if wo.z > 0.0 { glass.eta } else { 1.0 / glass.eta };
            // Radiance is greater in a denser medium.
            let albedo: MeanEstimate = (0..SAMPLES)
                .map(|_| {
                    let (lobe, u) = (rng.next_1d(), rng.next_2d());
                    let sample = bsdf.sample(wo, lobe, u, TransportMode::Radiance);
                    sample.map_or(0.0, |s| {
                        f64::from(s.weight.x * if s.transmitted { eta * eta } else { 1.0 })
                    })
                })
                .collect();
            let name = format!("{name} at {degrees}: {}", albedo.mean());
            // The error of the table, and that of the mean.
            let off = 0.03 + 4.0 * albedo.std_error();
            let least = if glass.aspect == 1.0 { 1.0 - off } else { 0.65 };
            assert!((least..1.0 + off).contains(&albedo.mean()), "{name}");
        }
    }
}

/// What photons carry to the camera equals what camera paths find.
#[test]
fn white_glass_is_the_same_to_photons() {
    let mut rng = rng(0);
    for (name, bsdf) in white_glass() {
        for _ in 0..500 {
            let [a, b] = [0, 1].map(|_| warp::uniform_sphere(rng.next_2d()));
            let camera = bsdf.eval(a, b, TransportMode::Radiance).x;
            let photon = bsdf.eval(b, a, TransportMode::Flux).x;
            assert!(
                (camera - photon).abs() <= 0.01 * camera.max(1e-3),
                "{name} {a} {b}: {camera} {photon}"
            );
        }
    }
}

/// f(a, b) / eta(a)^2 = f(b, a) / eta(b)^2 for radiance (Veach 1997, eq. 5.14), and photons' flux is the adjoint.
#[test]
fn values_are_reciprocal() {
    let mut rng = rng(0);
    for (name, bsdf) in scattering_bsdfs() {
        let eta = match bsdf {
            Bsdf::RoughDielectric(b) => b.eta,
            _ => 1.0,
        };
        let mut seen = 0;
        let mut errors = MeanEstimate::new();
        for _ in 0..2000 {
            let a = warp::uniform_sphere(rng.next_2d());
            let b = warp::uniform_sphere(rng.next_2d());
            let forth = bsdf.eval(a, b, TransportMode::Radiance).x;
            let back = bsdf.eval(b, a, TransportMode::Radiance).x;
            let flux = bsdf.eval(b, a, TransportMode::Flux).x;
            let index2 = |d: Vec3| if d.z > 0.0 { 1.0 } else { eta * eta };
            let back = back * index2(a) / index2(b);
            for other in [flux, back] {
                // The cosine of one microfacet seen edge-on has no precision left; that of all together has.
                let error = (forth - other).abs() / forth.max(1e-4);
                assert!(error < 0.01, "{name} {a} {b}: {forth} {other}");
                errors.add(f64::from(error));
            }
            seen += i32::from(forth > 0.0);
        }
        assert!(errors.mean() < 2e-5, "{name}: {}", errors.mean());
        assert!(seen > 400, "{name}: only {seen} pairs scatter");
    }
}

/// An almost smooth boundary reflects Fresnel's share.
#[test]
fn nearly_smooth_boundaries_reflect_as_smooth_ones() {
    let bsdf = rough_dielectric(1e-3, 1.5);
    let mut suite = Suite::new(SIGNIFICANCE);
    for (i, degrees) in [0.0, 45.0, 70.0, 165.0, 145.0].into_iter().enumerate() {
        let wo = direction(degrees);
        let mut rng = rng(i as u64);
        let reflected: MeanEstimate = (0..SAMPLES)
            .map(|_| {
                let (lobe, u) = (rng.next_1d(), rng.next_2d());
                let sample = bsdf.sample(wo, lobe, u, TransportMode::Flux);
                f64::from(u8::from(sample.is_some_and(|s| !s.transmitted)))
            })
            .collect();
        let eta = if wo.z > 0.0 { 1.5 } else { 1.0 / 1.5 };
        let expected = f64::from(fresnel_dielectric(wo.z.abs(), eta).0);
        suite.mean(format!("{degrees} degrees"), &reflected, expected);
    }
    suite.finish();
}

#[test]
fn hg_mean_cosine_is_g() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let old = direction(70.0);
    for (i, g) in [-0.999, -0.6, 0.0, 0.01, 0.5, 0.85, 0.999].into_iter().enumerate() {
        let phase = Phase::HenyeyGreenstein { g };
        let mut rng = rng(i as u64);
        let cosine: MeanEstimate = (0..SAMPLES)
            .map(|_| f64::from(phase.sample(old, rng.next_2d()).dot(old)))
            .collect();
        suite.mean(format!("sampled, g = {g}"), &cosine, f64::from(g));
        // From the values: cosines drawn from another lobe of the same sign, with weights.
        let proposal = Phase::HenyeyGreenstein { g: 0.9 * g };
        let (mut total, mut mean) = (MeanEstimate::new(), MeanEstimate::new());
        for _ in 0..SAMPLES {
            let new = proposal.sample(old, rng.next_2d());
            let weight = phase.eval_directions(old, new) / proposal.eval_directions(old, new);
            total.add(f64::from(weight));
            mean.add(f64::from(weight * new.dot(old)));
        }
        suite.mean(format!("integral, g = {g}"), &total, 1.0);
        suite.mean(format!("weighted, g = {g}"), &mean, f64::from(g));
    }
    suite.finish();
}

/// Values and densities of rough surfaces from Mitsuba 3.9.1; see tests/data/mitsuba_bsdf.py.
#[test]
fn rough_surfaces_are_those_of_mitsuba() {
    let mut rows = 0;
    for row in include_str!("../../data/mitsuba_bsdf.csv").lines() {
        let columns: Vec<&str> = row.split(',').collect();
        let [alpha, eta, k] = [1, 2, 3].map(|i| columns[i].parse::<f32>().expect(row));
        let numbers: Vec<f32> = columns[5..].iter().map(|c| c.parse().expect(row)).collect();
        let bsdf = match columns[0] {
            "conductor" => Bsdf::RoughConductor(RoughConductor {
                distribution: Distribution::Ggx,
                alpha,
                aspect: 1.0,
                eta: Rgb::splat(eta),
                k: Rgb::splat(k),
                reflectance: Rgb::ONE,
                two_sided: false,
                mean_fresnel: None,
            }),
            _ => rough_dielectric(alpha, eta),
        };
        let mode = match columns[4] {
            "radiance" => TransportMode::Radiance,
            _ => TransportMode::Flux,
        };
        let wo = Vec3::from_slice(&numbers[0..3]);
        let wi = Vec3::from_slice(&numbers[3..6]);
        for (ours, theirs) in [(bsdf.eval(wo, wi, mode).x, numbers[6]), (bsdf.pdf(wo, wi), numbers[7])] {
            let tolerance = 1e-4 * theirs + 1e-8;
            assert!((ours - theirs).abs() < tolerance, "{row}: {ours}, expected {theirs}");
        }
        rows += 1;
    }
    assert!(rows > 100);
}
