use super::*;
use crate::world::scalar::Scalar;
use crate::world::texture::{Texture, TexturePoint};

const DISTRIBUTIONS: [Distribution; 2] = [Distribution::Ggx, Distribution::Beckmann];
const MODES: [TransportMode; 2] = [TransportMode::Radiance, TransportMode::Flux];

fn material(kind: MaterialKind, two_sided: bool) -> Material {
    Material::new(kind, two_sided)
}

fn grey(value: f32) -> Texture {
    Texture::Constant(Rgb::splat(value))
}

/// One of each kind, with the most trying parameters.
fn materials() -> Vec<Material> {
    let mut materials = vec![material(MaterialKind::Null, false)];
    for two_sided in [false, true] {
        let (gold, gold_k) = conductor_preset("gold").unwrap();
        let mirror = Rgb::splat(1e30);
        materials.push(material(MaterialKind::Diffuse { reflectance: grey(1.0) }, two_sided));
        materials.push(material(MaterialKind::Mirror { reflectance: grey(0.9) }, two_sided));
        for (eta, k) in [(gold, gold_k), (Rgb::ZERO, mirror), (Rgb::ONE, Rgb::ZERO)] {
            materials.push(material(
                MaterialKind::Conductor {
                    eta,
                    k,
                    reflectance: grey(1.0),
                },
                two_sided,
            ));
            for alpha in [0.0, 1e-3, 0.1, 1.0, 10.0] {
                for distribution in DISTRIBUTIONS {
                    materials.push(material(
                        MaterialKind::RoughConductor {
                            distribution,
                            alpha: Scalar::constant(alpha),
                            eta,
                            k,
                            reflectance: grey(1.0),
                        },
                        two_sided,
                    ));
                }
            }
        }
    }
    for eta in [
        1.0 / 2.4,
        0.999,
        0.999_9,
        0.999_999,
        1.0,
        1.000_000_1,
        1.000_101,
        1.01,
        1.5,
        10.0,
    ] {
        let tint = Tint::NONE;
        materials.push(material(
            MaterialKind::ThinDielectric {
                eta,
                tint: tint.clone(),
            },
            false,
        ));
        materials.push(material(
            MaterialKind::Dielectric {
                eta,
                tint: tint.clone(),
            },
            false,
        ));
        for alpha in [0.0, 1e-3, 0.1, 1.0, 10.0] {
            for distribution in DISTRIBUTIONS {
                materials.push(material(
                    MaterialKind::RoughDielectric {
                        distribution,
                        alpha: Scalar::constant(alpha),
                        eta,
                        tint: tint.clone(),
                    },
                    false,
                ));
            }
        }
        for two_sided in [false, true] {
            materials.extend(coated(eta, two_sided));
        }
    }
    materials
}

/// Surfaces with several lobes.
fn coated(eta: f32, two_sided: bool) -> Vec<Material> {
    let mut materials = vec![];
    for reflectance in [0.0, 1.0] {
        materials.push(material(
            MaterialKind::Plastic {
                reflectance: grey(reflectance),
                specular_reflectance: grey(1.0),
                coat: Coat::new(eta, true),
            },
            two_sided,
        ));
        for roughness in [0.0, 1.0] {
            materials.push(material(
                MaterialKind::Principled {
                    base_color: grey(reflectance),
                    metallic: Scalar::constant(0.5),
                    roughness: Scalar::constant(roughness),
                    interface: Interface::Eta(eta),
                    extras: None,
                },
                two_sided,
            ));
            for spec_trans in [0.0, 0.7] {
                let extras = Extras {
                    spec_tint: Scalar::constant(0.5),
                    spec_trans: Scalar::constant(spec_trans),
                    sheen: Scalar::constant(1.0),
                    sheen_tint: Scalar::constant(0.5),
                    clearcoat: Scalar::constant(1.0),
                    clearcoat_gloss: Scalar::constant(1.0 - roughness),
                    flatness: Scalar::constant(0.5),
                };
                materials.push(material(
                    MaterialKind::Principled {
                        base_color: grey(reflectance),
                        metallic: Scalar::constant(0.25),
                        roughness: Scalar::constant(roughness),
                        interface: Interface::Eta(eta),
                        extras: Some(Box::new(extras)),
                    },
                    two_sided,
                ));
            }
        }
    }
    for (distribution, alpha) in [(DISTRIBUTIONS[0], 1e-3), (DISTRIBUTIONS[1], 0.5)] {
        materials.push(material(
            MaterialKind::RoughPlastic {
                reflectance: grey(1.0),
                specular_reflectance: grey(1.0),
                coat: Box::new(RoughCoat::new(distribution, alpha, eta, false)),
            },
            two_sided,
        ));
    }
    materials
}

/// Unit vectors all over the sphere, crowded at the poles and about the horizon, and exactly on it.
fn directions() -> Vec<Vec3> {
    let mut directions = vec![];
    for z in [1.0f32, 0.999_999_94, 0.9, 0.5, 1e-2, 1e-4, 1e-8, 1e-20, 1e-38, 0.0] {
        for phi in [0.0, 2.0] {
            let (sin, cos) = libm::sincosf(phi);
            let r = (1.0 - z * z).sqrt();
            directions.push(Vec3::new(r * cos, r * sin, z));
            directions.push(Vec3::new(r * cos, r * sin, -z));
        }
    }
    directions
}

#[test]
fn everything_is_finite_for_any_directions() {
    for material in materials() {
        let bsdf = material.bsdf(&TexturePoint::default());
        for wo in directions() {
            for wi in directions() {
                for mode in MODES {
                    let value = bsdf.eval(wo, wi, mode);
                    assert!(
                        value.is_finite() && value.min_element() >= 0.0,
                        "{bsdf:?} {wo} {wi}: {value}"
                    );
                }
                let pdf = bsdf.pdf(wo, wi);
                assert!(pdf.is_finite() && pdf >= 0.0, "{bsdf:?} {wo} {wi}: {pdf}");
            }
        }
    }
}

#[test]
fn samples_are_unit_finite_and_never_gain_energy() {
    let top = 1.0 - 1.0 / (1u32 << 24) as f32;
    let uniforms = [0.0, 1e-7, 0.04, 0.25, 0.5, 0.75, 0.999, top];
    for material in materials() {
        let bsdf = material.bsdf(&TexturePoint::default());
        for wo in directions() {
            for u in uniforms {
                for v in uniforms {
                    for lobe in [0.0, 0.5, top] {
                        let u = Vec2::new(u, v);
                        let Some(s) = bsdf.sample(wo, lobe, u, TransportMode::Flux) else {
                            continue;
                        };
                        let name = format!("{bsdf:?} {wo} {lobe} {u}: {s:?}");
                        assert!((s.wi.length() - 1.0).abs() < 1e-6, "{name}");
                        assert!(s.weight.min_element() >= 0.0, "{name}");
                        let mixed = matches!(
                            bsdf,
                            Bsdf::Plastic(_) | Bsdf::RoughPlastic(_) | Bsdf::Principled(_) | Bsdf::Layered(_)
                        );
                        assert!(mixed || s.weight.max_element() <= 1.000_001, "{name}");
                        assert!(s.weight.is_finite(), "{name}");
                        assert!(s.pdf > 0.0 && s.pdf.is_finite(), "{name}");
                        let radiance = bsdf.sample(wo, lobe, u, TransportMode::Radiance).unwrap();
                        assert_eq!((radiance.wi, radiance.pdf), (s.wi, s.pdf), "{name}");
                        assert!(radiance.weight.is_finite(), "{name}");
                    }
                }
            }
        }
    }
}

#[test]
fn backs_of_one_sided_surfaces_are_black() {
    for material in materials() {
        let bsdf = material.bsdf(&TexturePoint::default());
        let (front, back) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, -0.8));
        let sample = |wo| bsdf.sample(wo, 0.9, Vec2::new(0.3, 0.4), TransportMode::Flux);
        if material.transmits() {
            continue;
        }
        // What the front does, a lit back does too.
        let lit = material.two_sided && sample(front).is_some();
        assert_eq!(sample(back).is_some(), lit, "{bsdf:?}");
        if let Some(f) = sample(front) {
            assert!(f.wi.z > 0.0 && !f.transmitted);
        }
        assert_eq!(bsdf.eval(front, back, TransportMode::Flux), Rgb::ZERO);
        let value = bsdf.eval(back, back, TransportMode::Flux);
        let mirrored = bsdf.eval(front, front, TransportMode::Flux);
        let expected = if material.two_sided { mirrored } else { Rgb::ZERO };
        assert_eq!(value, expected, "{bsdf:?}");
    }
}

#[test]
fn specular_materials_are_those_of_delta_lobes() {
    for material in materials() {
        let bsdf = material.bsdf(&TexturePoint::default());
        let wo = Vec3::new(0.0, 0.6, 0.8);
        let bsdf = bsdf.without_delta();
        if let Some(sample) = bsdf.sample(wo, 0.9, Vec2::new(0.3, 0.4), TransportMode::Flux) {
            assert_eq!(sample.delta, material.is_specular(), "{bsdf:?}");
        }
    }
    let black = material(MaterialKind::Diffuse { reflectance: grey(0.0) }, true);
    assert_eq!(black.bsdf(&TexturePoint::default()), Bsdf::Black);
    assert!(!black.is_specular());
}

#[test]
fn refraction_obeys_snell_and_scales_radiance() {
    let kind = MaterialKind::Dielectric {
        eta: 1.5,
        tint: Tint::NONE,
    };
    let material = material(kind, false);
    let bsdf = material.bsdf(&TexturePoint::default());
    let sample = |wo, mode| bsdf.sample(wo, 0.999, Vec2::ZERO, mode).unwrap();
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let into = sample(wo, TransportMode::Radiance);
    assert!(into.transmitted && into.delta);
    assert!((into.wi - Vec3::new(-0.4, 0.0, -(1.0f32 - 0.16).sqrt())).length() < 1e-6);
    assert!((into.weight.x - 1.0 / 2.25).abs() < 1e-6);
    assert_eq!(sample(wo, TransportMode::Flux).weight, Rgb::ONE);
    // Out again along the same way.
    let out = sample(into.wi, TransportMode::Radiance);
    assert!((out.wi - wo).length() < 1e-6);
    assert!((into.weight.x * out.weight.x - 1.0).abs() < 1e-6);
    assert!((into.pdf - out.pdf).abs() < 1e-6);
    // Beyond the critical angle nothing leaves.
    let inside = Vec3::new(0.8, 0.0, -0.6);
    let total = sample(inside, TransportMode::Radiance);
    assert!(!total.transmitted);
    assert_eq!((total.weight, total.pdf), (Rgb::ONE, 1.0));
    assert_eq!(total.wi, Vec3::new(-0.8, 0.0, -0.6));
}

#[test]
fn index_matched_boundaries_let_light_straight_through() {
    for kind in [
        MaterialKind::Dielectric {
            eta: 1.0,
            tint: Tint::NONE,
        },
        MaterialKind::ThinDielectric {
            eta: 1.0,
            tint: Tint::NONE,
        },
        MaterialKind::RoughDielectric {
            distribution: Distribution::Ggx,
            alpha: Scalar::constant(0.3),
            eta: 1.0,
            tint: Tint::NONE,
        },
        MaterialKind::Null,
    ] {
        let material = material(kind, false);
        let bsdf = material.bsdf(&TexturePoint::default());
        for wo in directions() {
            for mode in MODES {
                for lobe in [0.0, 0.999] {
                    let s = bsdf.sample(wo, lobe, Vec2::new(0.2, 0.7), mode).unwrap();
                    assert!((s.wi + wo).length() < 1e-6 && s.transmitted && s.delta, "{wo} {s:?}");
                    assert_eq!((s.weight, s.pdf), (Rgb::ONE, 1.0));
                }
            }
        }
    }
}
