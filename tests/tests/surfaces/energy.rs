//! Energy-conserving microfacets: white furnaces, reciprocity, and agreement with Cycles.

use beamfarm_render::math::{Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::bsdf::{
    Anisotropy, Bsdf, ClearCoat, CoatFacing, Distribution, Extras, Interface, Material, MaterialDescription,
    MaterialKind, Stretch, Tangent, ThinFilm, TransportMode,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};
use std::f64::consts::PI;

fn keeping(kind: MaterialKind) -> Material {
    Material::from(MaterialDescription {
        multiple_scattering: true,
        ..MaterialDescription::new(kind, true)
    })
}

pub fn grey(value: f32) -> Texture {
    Texture::Constant(Rgb::splat(value))
}

fn metal(distribution: Distribution, alpha: f32, reflectance: f32) -> Material {
    keeping(MaterialKind::RoughConductor {
        distribution,
        alpha: Scalar::constant(alpha),
        eta: Rgb::ZERO,
        k: Rgb::splat(1.0),
        reflectance: grey(reflectance),
    })
}

pub fn principled(color: f32, metallic: f32, roughness: f32, eta: f32, extras: Option<Extras>) -> Material {
    keeping(MaterialKind::Principled {
        base_color: grey(color),
        metallic: Scalar::constant(metallic),
        roughness: Scalar::constant(roughness),
        interface: Interface::Eta(eta),
        extras: extras.map(Box::new),
    })
}

pub fn direction(cos: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).sqrt();
    Vec3::new(0.8 * sin, 0.6 * sin, cos)
}

/// The integral of value times cosine over the hemisphere, by quadrature in spherical coordinates around the mirror
/// direction, where lobes are narrow.
pub fn albedo(bsdf: &Bsdf, wo: Vec3) -> f64 {
    let peak = Vec3::new(-wo.x, -wo.y, wo.z);
    let (s, t) = peak.any_orthonormal_pair();
    let (rings, sectors) = (300, 256);
    let mut sum = 0.0;
    for i in 0..rings {
        // Denser around the peak.
        let u = (f64::from(i) + 0.5) / f64::from(rings);
        let theta = PI * u * u * u;
        let width = 3.0 * PI * u * u / f64::from(rings);
        let (sin, cos) = libm::sincos(theta);
        for j in 0..sectors {
            let (sin_phi, cos_phi) = libm::sincos((f64::from(j) + 0.5) / f64::from(sectors) * 2.0 * PI);
            let wi = peak * cos as f32 + (s * cos_phi as f32 + t * sin_phi as f32) * sin as f32;
            if wi.z > 0.0 {
                let value = bsdf.eval(wo, wi, TransportMode::Radiance).x * wi.z;
                sum += f64::from(value) * sin * width * 2.0 * PI / f64::from(sectors);
            }
        }
    }
    sum
}

pub const COSINES: [f32; 6] = [0.05, 0.15, 0.3, 0.55, 0.8, 1.0];

#[test]
fn white_metal_is_white() {
    let at = TexturePoint::default();
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for alpha in [0.02f32, 0.1, 0.3, 0.6, 1.0] {
            for cos in COSINES {
                let material = metal(distribution, alpha, 1.0);
                let found = albedo(&material.bsdf(&at), direction(cos));
                assert!((found - 1.0).abs() < 2e-3, "{distribution:?} {alpha} {cos}: {found}");
            }
        }
    }
}

#[test]
fn white_bases_beneath_layers_are_white() {
    let at = TexturePoint::default();
    for (roughness, eta) in [(0.2, 1.5), (0.5, 1.33), (0.7, 1.5), (1.0, 1.8), (0.6, 1.0)] {
        for (metallic, extras) in [(0.0, None), (0.6, None), (1.0, None), (0.3, Some(Extras::NONE))] {
            for cos in COSINES {
                let material = principled(1.0, metallic, roughness, eta, extras.clone());
                let found = albedo(&material.bsdf(&at), direction(cos));
                assert!(
                    (found - 1.0).abs() < 5e-3,
                    "{roughness} {eta} {metallic} {cos}: {found}"
                );
            }
        }
    }
}

/// Rough glass with a base, and below a film: the camera's view of a white furnace, summed over both sides.
#[test]
fn white_glass_over_bases_is_white() {
    let at = TexturePoint::default();
    let film = |thickness| ThinFilm {
        weight: Scalar::constant(1.0),
        thickness: Scalar::constant(thickness),
        eta: 1.8,
    };
    for (roughness, eta, share, film) in [
        (0.5, 1.5, 1.0, None),
        (0.8, 1.5, 0.5, None),
        (1.0, 1.33, 1.0, None),
        (0.7, 1.8, 0.3, None),
        (0.2, 1.5, 1.0, Some(film(0.3))),
        (0.3, 1.33, 1.0, Some(film(0.5))),
    ] {
        let extras = Extras {
            spec_trans: Scalar::constant(share),
            film,
            ..Extras::NONE
        };
        let material = principled(1.0, 0.0, roughness, eta, Some(extras));
        let bsdf = material.bsdf(&at);
        for cos in COSINES {
            for sign in [1.0, -1.0] {
                // From inside, only its glass matters.
                let expected = if sign > 0.0 { 1.0 } else { f64::from(share) };
                let wo = direction(cos) * sign;
                let relative = if sign > 0.0 { eta } else { 1.0 / eta };
                let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
                let mut sum = 0.0;
                let count = 20_000;
                for _ in 0..count {
                    let (lobe, u) = (rng.next_1d(), rng.next_2d());
                    if let Some(sample) = bsdf.sample(wo, lobe, u, TransportMode::Radiance) {
                        let scale = if sample.transmitted { relative * relative } else { 1.0 };
                        sum += f64::from(sample.weight.x * scale);
                    }
                }
                let found = sum / f64::from(count);
                assert!(
                    (found - expected).abs() < 0.03,
                    "{roughness} {eta} {share} {cos} {sign}: {found}"
                );
            }
        }
    }
}

/// The same microfacets, rougher in one direction than in the other.
fn brushed(material: Material, anisotropic: f32) -> Material {
    Material::from(MaterialDescription {
        anisotropy: Some(Box::new(Anisotropy {
            stretch: Stretch::Burley(Scalar::constant(anisotropic)),
            rotation: Scalar::constant(0.0),
            tangent: Tangent::U,
        })),
        ..material.into()
    })
}

/// Compensation returns less than the loss where they are very rough, and nowhere more.
#[test]
fn brushed_surfaces_are_not_brighter_than_white() {
    let at = TexturePoint::default();
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for (alpha, anisotropic, least) in [
            (0.05f32, 0.5, 0.97),
            (0.1, 0.8, 0.9),
            (0.25, 0.5, 0.9),
            (0.25, 0.9, 0.7),
            (0.6, 0.6, 0.7),
        ] {
            for cos in COSINES {
                let sin = (1.0 - cos * cos).sqrt();
                for [x, y] in [[1.0, 0.0], [0.6, 0.8], [0.0, 1.0]] {
                    let wo = Vec3::new(x * sin, y * sin, cos);
                    let white = brushed(metal(distribution, alpha, 1.0), anisotropic);
                    let found = albedo(&white.bsdf(&at), wo);
                    // More is lost towards the horizon.
                    let least = if cos < 0.2 { least - 0.07 } else { least };
                    assert!(
                        (least..1.005).contains(&found),
                        "{distribution:?} {alpha} {anisotropic} {wo}: {found}"
                    );
                }
            }
        }
    }
    for (roughness, anisotropic, metallic) in [(0.3, 0.8, 0.0), (0.5, 0.5, 0.4), (0.7, 0.9, 0.0)] {
        for cos in COSINES {
            let sin = (1.0 - cos * cos).sqrt();
            for wo in [Vec3::new(sin, 0.0, cos), Vec3::new(0.0, sin, cos)] {
                let white = brushed(principled(1.0, metallic, roughness, 1.5, None), anisotropic);
                let found = albedo(&white.bsdf(&at), wo);
                assert!((0.85..1.01).contains(&found), "{roughness} {anisotropic} {wo}: {found}");
            }
        }
    }
}

type Row = (f32, f32, [f64; 3], [f64; 3], f64);

/// Cycles 4.5.15: a plane under an even world of radiance 1, seen by an orthographic camera, 1024 samples. Rows of
/// roughness, cosine, and the light of a metal of base colour (0.9, 0.6, 0.3), of a Glossy BSDF (Multiscatter GGX) of
/// that colour, and of a dielectric of index 1.5 with a base of 0.8. Cycles scales its single bounce; a reciprocal
/// model differs a little where metal is dark, very rough and seen head-on.
const CYCLES: [Row; 9] = [
    (0.3, 0.15, [0.9202, 0.6927, 0.4780], [0.8895, 0.5741, 0.2777], 0.8570),
    (0.3, 0.4, [0.9046, 0.6211, 0.3434], [0.8971, 0.5915, 0.2925], 0.8254),
    (0.3, 1.0, [0.8993, 0.5979, 0.2981], [0.8993, 0.5978, 0.2980], 0.8079),
    (0.6, 0.15, [0.8930, 0.5948, 0.3246], [0.8833, 0.5590, 0.2664], 0.8176),
    (0.6, 0.4, [0.8807, 0.5560, 0.2739], [0.8762, 0.5411, 0.2517], 0.8115),
    (0.6, 1.0, [0.8821, 0.5545, 0.2625], [0.8812, 0.5524, 0.2609], 0.8067),
    (1.0, 0.15, [0.8455, 0.4982, 0.2375], [0.8406, 0.4862, 0.2220], 0.8094),
    (1.0, 0.4, [0.8084, 0.4222, 0.1793], [0.8035, 0.4136, 0.1721], 0.8060),
    (1.0, 1.0, [0.7723, 0.3502, 0.1274], [0.7668, 0.3423, 0.1231], 0.8028),
];

#[test]
fn cycles_shows_the_same() {
    let at = TexturePoint::default();
    let near = |name: String, found: f64, expected: f64| {
        assert!(
            (found - expected).abs() < 0.02 * expected + 0.002,
            "{name}: {found} {expected}"
        );
    };
    for (roughness, cos, metals, glossy, dielectric) in CYCLES {
        let wo = direction(cos);
        for (i, color) in [0.9, 0.6, 0.3].into_iter().enumerate() {
            let name = |kind| format!("{kind} {roughness} {cos} {color}");
            let found = albedo(&principled(color, 1.0, roughness, 1.5, None).bsdf(&at), wo);
            near(name("metal"), found, metals[i]);
            let found = albedo(&metal(Distribution::Ggx, roughness * roughness, color).bsdf(&at), wo);
            near(name("glossy"), found, glossy[i]);
        }
        let found = albedo(&principled(0.8, 0.0, roughness, 1.5, None).bsdf(&at), wo);
        near(format!("dielectric {roughness} {cos}"), found, dielectric);
    }
}

fn everything() -> Extras {
    Extras {
        spec_tint: Scalar::constant(0.7),
        sheen: Scalar::constant(0.4),
        clearcoat: Scalar::constant(0.5),
        flatness: Scalar::constant(0.3),
        ..Extras::NONE
    }
}

fn rough_base() -> Extras {
    Extras {
        diffuse_roughness: Scalar::constant(0.8),
        ..coated(0.7, 0.3, 1.5)
    }
}

fn over() -> Extras {
    Extras {
        specular_color: Texture::Constant(Rgb::new(1.0, 0.6, 0.2)),
        film: Some(ThinFilm {
            weight: Scalar::constant(0.8),
            thickness: Scalar::constant(0.4),
            eta: 1.33,
        }),
        ..coated(0.7, 0.3, 1.5)
    }
}

fn coated(weight: f32, roughness: f32, eta: f32) -> Extras {
    Extras {
        coat: Some(ClearCoat {
            weight: Scalar::constant(weight),
            roughness: Scalar::constant(roughness),
            eta,
            facing: CoatFacing::Below,
        }),
        ..Extras::NONE
    }
}

/// What a coat does not reflect or absorb reaches the layer below: nothing is gained, and white bases and smooth metals
/// lose hardly anything.
#[test]
fn white_surfaces_beneath_coats_are_white() {
    let at = TexturePoint::default();
    for (roughness, coat, eta) in [(0.15, 0.2, 1.5), (0.5, 0.2, 1.33), (0.7, 0.5, 1.5), (1.0, 0.7, 1.8)] {
        for (metallic, weight) in [(0.0, 1.0), (0.0, 0.5), (1.0, 1.0)] {
            for cos in COSINES {
                let extras = coated(weight, coat, eta);
                let material = principled(1.0, metallic, roughness, 1.5, Some(extras));
                let found = albedo(&material.bsdf(&at), direction(cos));
                // Rough metal sends light into directions where the coat reflects more.
                let least = if metallic > 0.0 && roughness > 0.2 { 0.75 } else { 0.955 };
                let name = format!("{roughness} {coat} {eta} {metallic} {weight} {cos}: {found}");
                assert!((least..1.006).contains(&found), "{name}");
            }
        }
    }
}

/// Cycles' formula, integrated in double precision over all light: rows of roughness, cosine and albedo.
const VELVET: [(f32, f32, f64); 6] = [
    (0.3, 0.05, 0.862),
    (0.3, 0.2, 0.485),
    (0.5, 0.1, 0.838),
    (0.5, 0.5, 0.280),
    (1.0, 0.2, 0.851),
    (1.0, 0.8, 0.334),
];

#[test]
fn velvet_sends_back_less_than_it_gets() {
    let at = TexturePoint::default();
    for (roughness, cos, expected) in VELVET {
        let kind = MaterialKind::Velvet {
            reflectance: grey(1.0),
            roughness: Scalar::constant(roughness),
        };
        let found = albedo(&Material::new(kind, false).bsdf(&at), direction(cos));
        assert!((found - expected).abs() < 0.01, "{roughness} {cos}: {found} {expected}");
    }
}

#[test]
fn energy_is_kept_both_ways() {
    let at = TexturePoint::default();
    let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
    for roughness in [0.1, 0.5, 1.0] {
        for material in [
            metal(Distribution::Beckmann, roughness * roughness, 0.7),
            principled(0.6, 0.0, roughness, 1.5, None),
            principled(0.6, 0.4, roughness, 1.7, Some(everything())),
            principled(0.6, 0.4, roughness, 1.7, Some(over())),
            Material::new(
                MaterialKind::OrenNayar {
                    reflectance: grey(0.7),
                    roughness: Scalar::constant(roughness),
                },
                true,
            ),
            principled(0.6, 0.4, roughness, 1.7, Some(rough_base())),
            Material::new(
                MaterialKind::Velvet {
                    reflectance: grey(0.7),
                    roughness: Scalar::constant(roughness),
                },
                true,
            ),
            brushed(metal(Distribution::Ggx, roughness * roughness, 0.7), 0.8),
            brushed(principled(0.6, 0.4, roughness, 1.7, Some(everything())), 0.6),
        ] {
            let bsdf = material.bsdf(&at);
            for _ in 0..200 {
                let [a, b] = [0, 1].map(|_| warp::cosine_hemisphere(rng.next_2d()));
                let there = bsdf.eval(a, b, TransportMode::Radiance);
                let back = bsdf.eval(b, a, TransportMode::Radiance);
                let off = (there - back).abs().max_element();
                assert!(off <= 1e-4 * there.max_element(), "{bsdf:?} {a} {b}: {there} {back}");
            }
        }
    }
}
