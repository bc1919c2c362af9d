//! Materials as scene files name them: their values against Mitsuba 3, and their samplers against their values.

use beamfarm_harness::render::scene;
use beamfarm_harness::{Chi2, MeanEstimate, Suite};
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::Scene;
use beamfarm_render::world::bsdf::{Bsdf, BsdfFlags, Material, TransportMode};
use beamfarm_render::world::texture::TexturePoint;

const SIGNIFICANCE: f64 = 0.01;

/// Ordered by name, as scenes keep them.
const MATERIALS: &str = r#"
[image]
width = 8
height = 8
[camera]
origin = [0, 0, 5]
target = [0, 0, 0]
fov = 40
[materials.beckmann_conductor]
type = "rough_conductor"
multiple_scattering = false
distribution = "beckmann"
alpha = 0.3
eta = 1.4
k = 1.6
two_sided = false
[materials.beckmann_dielectric]
type = "rough_dielectric"
multiple_scattering = false
distribution = "beckmann"
alpha = 0.4
ior = 1.5
specular_reflectance = [0.9, 0.7, 0.5]
specular_transmittance = [0.2, 0.6, 0.8]
[materials.glass]
type = "dielectric"
ior = 1.5
specular_reflectance = [0.9, 0.7, 0.5]
specular_transmittance = [0.2, 0.6, 0.8]
[materials.metal]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
metallic = 0.7
roughness = 0.3
specular = 0.4
[materials.metal_bare]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
metallic = 0.9
roughness = 0.5
specular = 0
[materials.pane]
type = "thin_dielectric"
ior = 1.5
specular_reflectance = [0.9, 0.7, 0.5]
specular_transmittance = [0.2, 0.6, 0.8]
[materials.plastic]
type = "plastic"
reflectance = [0.8, 0.4, 0.1]
ior = 1.5
[materials.plastic_nonlinear]
type = "plastic"
reflectance = [0.8, 0.4, 0.1]
ior = 1.5
nonlinear = true
specular_reflectance = [0.9, 0.7, 0.5]
[materials.principled]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
roughness = 0.6
[materials.principled_coated]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
roughness = 0.5
spec_tint = 0.6
sheen = 0.5
sheen_tint = 0.4
clearcoat = 0.8
clearcoat_gloss = 0.3
flatness = 0.3
[materials.principled_glass]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
metallic = 0.2
roughness = 0.6
spec_trans = 0.7
ior = 1.5
[materials.principled_ior]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
roughness = 0.4
ior = 1.8
[materials.principled_skin]
type = "principled"
multiple_scattering = false
base_color = [0.8, 0.4, 0.1]
metallic = 0.1
roughness = 0.3
specular = 0.5
clearcoat = 0.3
subsurface = 0.7
subsurface_radius = [1.0, 0.5, 0.2]
[materials.rough_plastic]
type = "rough_plastic"
reflectance = [0.8, 0.4, 0.1]
ior = 1.5
alpha = 0.1
[materials.rough_plastic_beckmann]
type = "rough_plastic"
distribution = "beckmann"
reflectance = [0.8, 0.4, 0.1]
ior = 1.5
alpha = 0.3
nonlinear = true
specular_reflectance = [0.9, 0.7, 0.5]
[materials.rough_plastic_very]
type = "rough_plastic"
reflectance = [0.8, 0.4, 0.1]
ior = 1.5
alpha = 0.6
[materials.translucent]
type = "translucent"
reflectance = [0.3, 0.2, 0.1]
transmittance = [0.2, 0.5, 0.6]
"#;

struct Named {
    scene: Scene,
    names: Vec<&'static str>,
}

impl Named {
    fn new() -> Self {
        let names = MATERIALS
            .lines()
            .filter_map(|line| line.strip_prefix("[materials.")?.strip_suffix("]"));
        Self {
            scene: scene(MATERIALS),
            names: names.collect(),
        }
    }

    fn all(&self) -> impl Iterator<Item = (&'static str, &Material)> {
        let materials = &self.scene.description().materials;
        assert!(self.names.is_sorted() && self.names.len() == materials.len());
        self.names.iter().copied().zip(materials)
    }

    fn bsdf(&self, name: &str) -> Bsdf<'_> {
        let (_, material) = self.all().find(|(n, _)| *n == name).expect(name);
        material.bsdf(&TexturePoint::default())
    }
}

/// Values of Mitsuba 3.9.1; see tests/data/mitsuba_materials.py.
#[test]
fn values_are_those_of_mitsuba() {
    let named = Named::new();
    let (mut rows, mut failed) = (0, false);
    for row in include_str!("../../data/mitsuba_materials.csv").lines() {
        let columns: Vec<&str> = row.split(',').collect();
        let bsdf = named.bsdf(columns[0]);
        let numbers: Vec<f32> = columns[2..].iter().map(|c| c.parse().expect(row)).collect();
        let [wo, wi, expected] = [0, 3, 6].map(|i| Vec3::from_slice(&numbers[i..i + 3]));
        let mode = TransportMode::Radiance;
        let value = match columns[1] {
            "value" => bsdf.eval(wo, wi, mode),
            lobe => {
                let u = if lobe == "reflect" { 0.0 } else { 0.999_999 };
                let sample = bsdf.sample(wo, u, Vec2::splat(0.5), mode).expect(row);
                assert!(sample.delta, "{row}");
                assert!((sample.wi - wi).length() < 1e-5, "{row}: {sample:?}");
                sample.weight * sample.pdf
            }
        };
        // Mitsuba approximates Beckmann's masking, up to 0.35 % per factor, and a smooth coat's mean reflectance.
        let tolerance = match columns[0] {
            name if name.contains("beckmann") => 7e-3,
            name if name.contains("plastic") => 2e-3,
            _ => 2e-4,
        };
        let error = (value - expected).abs() - expected * tolerance;
        if error.max_element() >= 1e-6 {
            eprintln!("{row}: {value} {}", value / expected - 1.0);
            failed = true;
        }
        rows += 1;
    }
    assert!(!failed && rows > 180);
}

fn direction(degrees: f32) -> Vec3 {
    let (sin, cos) = libm::sincosf(degrees.to_radians());
    Vec3::new(0.8 * sin, 0.6 * sin, cos)
}

const INCIDENCES: [f32; 5] = [1.0, 35.0, 70.0, 86.0, 140.0];

/// Each side of the surface separately. Together with the delta lobes' probabilities the densities integrate to one,
/// less the light lost because microfacets have no second bounce.
#[test]
fn samples_follow_their_densities() {
    let named = Named::new();
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, material) in named.all() {
        let bsdf = material.bsdf(&TexturePoint::default());
        if material.is_specular() {
            continue;
        }
        for degrees in INCIDENCES {
            let wo = direction(degrees);
            let mut integral = f64::from(bsdf.delta_probability(wo));
            for reflected in [true, false] {
                let wanted = |wi: &Vec3| (wi.z * wo.z > 0.0) == reflected;
                let sample = |s: &mut Sampler| {
                    let (lobe, u) = (s.next_1d(), s.next_2d());
                    bsdf.sample(wo, lobe, u, TransportMode::Radiance)
                        .filter(|sample| !sample.delta)
                        .map(|sample| sample.wi)
                        .filter(wanted)
                };
                let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
                let mean: Vec3 = (0..50_000).filter_map(|_| sample(&mut rng)).take(2_000).sum();
                let axis = mean.try_normalize().unwrap_or(Vec3::Z);
                let pdf = |wi| f32::from(wanted(&wi)) * bsdf.pdf(wo, wi);
                let result = Chi2::default().sphere(axis, sample, pdf);
                integral += result.integral;
                if result.integral > 0.0 {
                    suite.chi2(format!("{name} at {degrees}, reflected {reflected}"), &result);
                }
            }
            let black = wo.z < 0.0 && !material.has(BsdfFlags::TRANSMITS);
            let range = if black { 0.0..=0.0 } else { 0.75..=1.001 };
            assert!(range.contains(&integral), "{name} at {degrees}: {integral}");
        }
    }
    suite.finish();
}

#[test]
fn weights_are_value_times_cosine_over_density() {
    let named = Named::new();
    let mut rng = Sampler::new(7, 0, Purpose::Test, 0);
    for (name, material) in named.all() {
        let bsdf = material.bsdf(&TexturePoint::default());
        for degrees in INCIDENCES {
            for mode in [TransportMode::Radiance, TransportMode::Flux] {
                for _ in 0..500 {
                    let wo = direction(degrees);
                    let (lobe, u) = (rng.next_1d(), rng.next_2d());
                    let Some(sample) = bsdf.sample(wo, lobe, u, mode) else {
                        continue;
                    };
                    let name = format!("{name} at {degrees} degrees, {mode:?}, {sample:?}");
                    assert_eq!(sample.transmitted, sample.wi.z * wo.z < 0.0, "{name}");
                    assert!((sample.wi.length() - 1.0).abs() < 1e-6, "{name}");
                    if sample.delta {
                        continue;
                    }
                    let pdf = bsdf.pdf(wo, sample.wi);
                    let value = bsdf.eval(wo, sample.wi, mode) * (sample.wi.z.abs() / pdf);
                    let error = (value - sample.weight).abs().max_element();
                    assert!(error <= 2e-4 * sample.weight.max_element(), "{name}: {value}");
                    assert!((pdf / sample.pdf - 1.0).abs() < 2e-3, "{name}: {pdf}");
                }
            }
        }
    }
}

/// The albedo from samples equals that from values, and is at most one; also without delta lobes.
#[test]
fn albedos_agree_and_never_gain() {
    let named = Named::new();
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, material) in named.all() {
        if material.is_specular() {
            continue;
        }
        for (chunk, degrees) in INCIDENCES.into_iter().enumerate() {
            let wo = direction(degrees);
            let mut rng = Sampler::new(3, 0, Purpose::Test, chunk as u64);
            let mode = TransportMode::Flux;
            let bsdf = material.bsdf(&TexturePoint::default());
            let smooth = bsdf.without_delta();
            let (mut whole, mut sampled, mut integrated) =
                (MeanEstimate::new(), MeanEstimate::new(), MeanEstimate::new());
            for _ in 0..40_000 {
                let (lobe, u) = (rng.next_1d(), rng.next_2d());
                let weight = |b: &Bsdf| {
                    let sample = b.sample(wo, lobe, u, mode);
                    sample.map_or(0.0, |s| f64::from(s.weight.x))
                };
                whole.add(weight(&bsdf));
                sampled.add(weight(&smooth));
                assert_eq!(smooth.delta_probability(wo), 0.0);
                for _ in 0..4 {
                    let up = warp::cosine_hemisphere(rng.next_2d());
                    let wi = if rng.next_1d() < 0.5 { up } else { -up };
                    let value = bsdf.eval(wo, wi, mode).x * 2.0 * std::f32::consts::PI;
                    integrated.add(f64::from(value));
                }
            }
            let name = format!("{name} at {degrees} degrees");
            // Burley's lobes are not balanced against each other: their sum is slightly too large at grazing angles,
            // and a coat and sheen add to it.
            let bound = match &name {
                name if name.contains("principled_coated") => 1.1,
                // Light that enters crosses the surface twice, each time scaled by the root of its share.
                name if name.contains("principled_skin") => 1.2,
                name if name.contains("principled") => 1.05,
                _ => 1.0,
            };
            let mean = whole.mean();
            assert!(mean <= bound + 4.0 * whole.std_error(), "{name}: {mean}");
            suite.same_mean(name, &sampled, &integrated);
        }
    }
    suite.finish();
}

/// f(a, b) / eta(a)^2 = f(b, a) / eta(b)^2 for radiance (Veach 1997, eq. 5.14), and photons' flux is the adjoint.
#[test]
fn values_are_reciprocal() {
    let named = Named::new();
    let mut rng = Sampler::new(5, 0, Purpose::Test, 0);
    for (name, material) in named.all() {
        let bsdf = material.bsdf(&TexturePoint::default());
        for _ in 0..2000 {
            let a = warp::uniform_sphere(rng.next_2d());
            let b = warp::uniform_sphere(rng.next_2d());
            let forth = bsdf.eval(a, b, TransportMode::Radiance);
            let flux = bsdf.eval(b, a, TransportMode::Flux);
            let eta2 = |d: Vec3| {
                let eta = material.eta_of_crossing(d.z < 0.0, None).max(1.0);
                eta * eta
            };
            let back = bsdf.eval(b, a, TransportMode::Radiance) * (eta2(b) / eta2(a)).recip();
            for other in [flux, back] {
                let error = (forth - other).abs() / forth.max(Rgb::splat(1e-4));
                assert!(error.max_element() < 0.01, "{name} {a} {b}: {forth} {other}");
            }
        }
    }
}

/// A white base below a coat that reflects and absorbs nothing loses nothing.
#[test]
fn furnace_of_a_coated_white_base() {
    let white = MATERIALS.replace("[0.8, 0.4, 0.1]", "1.0");
    let scene = scene(&white);
    let mut rng = Sampler::new(9, 0, Purpose::Test, 0);
    let mut suite = Suite::new(SIGNIFICANCE);
    let mut bsdfs = scene
        .description()
        .materials
        .iter()
        .map(|m| m.bsdf(&TexturePoint::default()));
    let plastic = bsdfs.find(|bsdf| matches!(bsdf, Bsdf::Plastic(_)));
    let plastic = plastic.expect("a smooth coat");
    for degrees in [1.0, 35.0, 70.0, 86.0] {
        let mut albedo = MeanEstimate::new();
        for _ in 0..40_000 {
            let (lobe, u) = (rng.next_1d(), rng.next_2d());
            let sample = plastic.sample(direction(degrees), lobe, u, TransportMode::Radiance);
            albedo.add(sample.map_or(0.0, |s| f64::from(s.weight.x)));
        }
        suite.mean(format!("{degrees} degrees"), &albedo, 1.0);
    }
    suite.finish();
}
