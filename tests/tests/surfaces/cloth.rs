//! Rough diffuse surfaces and layers of fibres: energy, reciprocity, agreement with Cycles 4.5, and photons against
//! paths.

use super::energy::{COSINES, albedo, direction, grey, principled};
use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks_each_way, scene, truth};
use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::bsdf::{
    Bsdf, ClearCoat, CoatFacing, Extras, Fuzz, Material, MaterialKind, Microfibers, OrenNayar, Sheen, Subsurface,
    TransportMode,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};
use std::f64::consts::PI;

fn rough(reflectance: f32, roughness: f32) -> Bsdf<'static> {
    Bsdf::OrenNayar(OrenNayar {
        reflectance: Rgb::splat(reflectance),
        roughness,
        two_sided: false,
    })
}

fn fibers(color: f32, roughness: f32) -> Bsdf<'static> {
    Bsdf::Sheen(Sheen {
        fibers: Microfibers {
            color: Rgb::splat(color),
            roughness,
        },
        two_sided: false,
    })
}

fn fuzz(roughness: f32) -> Extras {
    Extras {
        fuzz: Some(Fuzz {
            weight: Scalar::constant(0.8),
            roughness: Scalar::constant(roughness),
            color: Texture::Constant(Rgb::new(1.0, 0.7, 0.4)),
        }),
        ..Extras::NONE
    }
}

/// Roughness, reflectance and cosine, and the share of even light that Cycles 4.5 shows for them.
const OREN_NAYAR: [(f32, f32, f32, f64); 6] = [
    (1.0, 1.0, 0.2, 1.0),
    (1.0, 1.0, 1.0, 1.0),
    (0.3, 1.0, 0.5, 1.0),
    (1.0, 0.5, 0.2, 0.4796),
    (1.0, 0.5, 0.7, 0.4296),
    (1.0, 0.5, 1.0, 0.4136),
];

#[test]
fn rough_diffuse_surfaces_are_as_bright_as_in_cycles() {
    for (roughness, reflectance, cos, expected) in OREN_NAYAR {
        let found = albedo(&rough(reflectance, roughness), direction(cos));
        assert!(
            (found - expected).abs() < 2e-3,
            "{roughness} {reflectance} {cos}: {found}"
        );
    }
    // A smooth one is Lambertian.
    let smooth = rough(0.5, 0.0).eval(direction(0.3), Vec3::new(-0.6, 0.0, 0.8), TransportMode::Radiance);
    assert!((f64::from(smooth.x) * PI - 0.5).abs() < 1e-6);
}

/// Fujii's qualitative model sends more light back to where it comes from, and less beyond.
#[test]
fn rough_diffuse_surfaces_send_light_back() {
    let (surface, wo) = (rough(0.8, 1.0), Vec3::new(0.8, 0.0, 0.6));
    let value = |wi: Vec3| surface.eval(wo, wi, TransportMode::Radiance).x;
    let [back, beyond] = [value(wo), value(Vec3::new(-0.8, 0.0, 0.6))];
    assert!(back > 1.3 * 0.8 / PI as f32 && beyond < 0.6 * back, "{back} {beyond}");
}

#[test]
fn rough_bases_and_fibers_above_what_is_white_are_white() {
    let at = TexturePoint::default();
    for roughness in [0.1f32, 0.3, 0.6, 1.0] {
        for cos in COSINES {
            let rough = Extras {
                diffuse_roughness: Scalar::constant(roughness),
                ..Extras::NONE
            };
            let fuzzy = Extras {
                fuzz: Some(Fuzz {
                    weight: Scalar::constant(1.0),
                    roughness: Scalar::constant(roughness),
                    color: grey(1.0),
                }),
                ..Extras::NONE
            };
            for (name, extras, least) in [("rough", rough, 0.97), ("fuzzy", fuzzy, 0.994)] {
                let material = principled(1.0, 0.0, 0.5, 1.5, Some(extras));
                let found = albedo(&material.bsdf(&at), direction(cos));
                assert!((least..1.006).contains(&found), "{name} {roughness} {cos}: {found}");
            }
        }
    }
}

/// Rows of roughness, cosine, and the share of even light that Cycles 4.5 shows.
const FIBERS: [(f32, f32, f64); 16] = [
    (0.2, 0.05, 0.4827),
    (0.2, 0.1, 0.2985),
    (0.2, 0.2, 0.0878),
    (0.2, 0.4, 0.0054),
    (0.5, 0.05, 0.6243),
    (0.5, 0.1, 0.5521),
    (0.5, 0.2, 0.4257),
    (0.5, 0.4, 0.2229),
    (0.5, 0.7, 0.0694),
    (0.5, 1.0, 0.0186),
    (0.8, 0.1, 0.6422),
    (0.8, 0.4, 0.4408),
    (0.8, 1.0, 0.1759),
    (1.0, 0.1, 0.6979),
    (1.0, 0.4, 0.5440),
    (1.0, 1.0, 0.3419),
];

/// Rows of roughness, cosines to the camera and to a lamp, the angle between the two seen from above, and what Cycles
/// 4.5 shows for a lamp with an irradiance of one across its light.
const BY_A_LAMP: [(f32, [f32; 2], f32, f64); 14] = [
    (0.2, [0.2, 0.2], 0.0, 0.0318),
    (0.2, [0.2, 0.2], 1.5, 0.0313),
    (0.2, [0.2, 0.2], 3.0, 0.0308),
    (0.5, [0.2, 0.2], 0.0, 0.1454),
    (0.5, [0.2, 0.2], 1.5, 0.1216),
    (0.5, [0.2, 0.2], 3.0, 0.1010),
    (0.5, [0.2, 0.7], 0.0, 0.0504),
    (0.5, [0.2, 0.7], 3.0, 0.0374),
    (0.5, [0.7, 0.2], 0.0, 0.0147),
    (0.5, [0.7, 0.7], 3.0, 0.0096),
    (0.8, [0.2, 0.7], 0.0, 0.1322),
    (0.8, [0.2, 0.7], 3.0, 0.0930),
    (0.8, [0.7, 0.2], 1.5, 0.0293),
    (0.8, [0.7, 0.7], 0.0, 0.0653),
];

#[test]
fn fibers_send_back_what_they_do_in_cycles() {
    for (roughness, cos, expected) in FIBERS {
        let found = albedo(&fibers(1.0, roughness), direction(cos));
        let off = (found - expected).abs();
        assert!(off < 3e-3 + 0.02 * expected, "{roughness} {cos}: {found} {expected}");
    }
    for (roughness, [o, i], turn, expected) in BY_A_LAMP {
        let (sin, cos) = libm::sincosf(turn);
        let [sin_o, sin_i] = [o, i].map(|cos: f32| (1.0 - cos * cos).sqrt());
        let (wo, wi) = (Vec3::new(sin_o, 0.0, o), Vec3::new(sin_i * cos, sin_i * sin, i));
        let found = f64::from(fibers(1.0, roughness).eval(wo, wi, TransportMode::Radiance).x * i);
        let off = (found - expected).abs();
        assert!(
            off < 2e-4 + 0.03 * expected,
            "{roughness} {o} {i} {turn}: {found} {expected}"
        );
    }
}

fn surfaces() -> Vec<(&'static str, Material)> {
    let skin = Extras {
        subsurface: Some(Subsurface::new(
            Scalar::constant(0.6),
            Rgb::splat(0.5),
            (Rgb::ONE, 0.0),
            1.5,
        )),
        ..fuzz(0.5)
    };
    let glass = Extras {
        spec_trans: Scalar::constant(0.6),
        ..fuzz(0.5)
    };
    let varnish = Extras {
        coat: Some(ClearCoat {
            weight: Scalar::constant(0.7),
            roughness: Scalar::constant(0.4),
            eta: 1.5,
            facing: CoatFacing::Below,
        }),
        diffuse_roughness: Scalar::constant(0.8),
        ..fuzz(0.3)
    };
    let sheen = MaterialKind::Sheen {
        reflectance: grey(0.8),
        roughness: Scalar::constant(0.3),
    };
    let mut all = vec![("fibers", Material::new(sheen, true))];
    for (name, extras) in [("skin", skin), ("glass", glass), ("varnish", varnish)] {
        let mut material = principled(0.6, 0.2, 0.6, 1.5, Some(extras));
        if name != "varnish" {
            material = Material::new(material.kind.clone(), false);
        }
        all.push((name, material));
    }
    all
}

/// The flux of a photon is the radiance of a camera path: photons meet the same surface as cameras, although its value
/// is not symmetric.
#[test]
fn photons_meet_the_fibers_that_cameras_see() {
    let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
    for (name, material) in surfaces() {
        let bsdf = material.bsdf(&TexturePoint::default());
        let mut differ = 0;
        for _ in 0..2000 {
            let [a, b] = [0, 1].map(|_| warp::uniform_sphere(rng.next_2d()));
            let there = bsdf.eval(a, b, TransportMode::Radiance);
            let back = bsdf.eval(b, a, TransportMode::Flux);
            // Microfacets seen edge-on.
            let error = (there - back).abs() / there.max(Rgb::splat(1e-4));
            assert!(error.max_element() < 0.01, "{name} {a} {b}: {there} {back}");
            let other = bsdf.eval(b, a, TransportMode::Radiance);
            differ += i32::from((there - other).abs().max_element() > 0.01 * there.max_element());
        }
        assert!(differ > 100, "{name}: {differ}");
    }
}

/// Sample weights have a small bound, so there are no fireflies, not even from photons.
#[test]
fn samples_of_fibers_weigh_little() {
    let mut rng = Sampler::new(2, 0, Purpose::Test, 0);
    for roughness in [0.0f32, 0.1, 0.2, 0.4, 0.7, 1.0] {
        let surface = fibers(1.0, roughness);
        for mode in [TransportMode::Radiance, TransportMode::Flux] {
            let mut most = 0.0f32;
            for _ in 0..20_000 {
                let wo = warp::cosine_hemisphere(rng.next_2d());
                if let Some(sample) = surface.sample(wo, 0.5, rng.next_2d(), mode) {
                    most = most.max(sample.weight.x);
                }
            }
            let bound = if mode == TransportMode::Radiance { 1.0 } else { 5.0 };
            assert!(most < bound, "{roughness} {mode:?}: {most}");
        }
    }
}

/// A lamp behind a lens, and walls and a ball of cloth: by camera paths, by photons that go from cloth to cloth, and by
/// the path tracer.
#[test]
fn photons_and_paths_find_the_same_light_among_cloth() {
    let room = scene(
        r#"
[image]
width = 16
height = 16
[render]
passes = 200
paths = 8000
radius = 0.04
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, -0.1, 0.0]
fov = 80.0
[materials.wall]
type = "principled"
base_color = [0.7, 0.5, 0.3]
roughness = 0.6
diffuse_roughness = 0.9
sheen_weight = 1
sheen_roughness = 0.3
sheen_color = [0.6, 0.8, 1.0]
[materials.cloth]
type = "sheen"
reflectance = [1.0, 0.8, 0.6]
roughness = 0.4
[materials.clay]
type = "diffuse"
reflectance = [0.3, 0.5, 0.7]
roughness = 1
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.45, -0.5, -0.3]
radius = 0.4
material = "cloth"
[[shapes]]
type = "sphere"
center = [0.5, -0.6, -0.3]
radius = 0.35
material = "clay"
[[shapes]]
type = "sphere"
center = [0.0, 0.2, -0.1]
radius = 0.2
material = "glass"
[[shapes]]
type = "sphere"
center = [0.1, 0.7, -0.1]
radius = 0.2
emission = { radiance = [3.0, 2.5, 2.0] }
"#,
    );
    let truth = truth(&room, 36, 8, 8);
    let mut suite = Suite::new(1e-2);
    for (way, found) in blocks_each_way(&room, 8) {
        suite.same_blocks(&format!("{way:?}"), &found, &truth, 5e-3);
        assert!(found.noise(&truth) < 0.03, "{way:?}: {}", found.noise(&truth));
    }
    suite.finish();
}
