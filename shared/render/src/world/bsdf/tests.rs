use super::BsdfFlags as F;
use super::*;
use crate::sampler::{Purpose, Sampler};
use crate::world::scalar::Scalar;
use crate::world::texture::{Texture, TexturePoint};

const DISTRIBUTIONS: [Distribution; 2] = [Distribution::Ggx, Distribution::Beckmann];
const MODES: [TransportMode; 2] = [TransportMode::Radiance, TransportMode::Flux];

fn grey(value: f32) -> Texture {
    Texture::Constant(Rgb::splat(value))
}

/// One of each kind, with the most demanding parameters.
fn materials() -> Vec<Material> {
    let mut materials = vec![Material::new(MaterialKind::Null, false)];
    for two_sided in [false, true] {
        let (gold, gold_k) = conductor_preset("gold").unwrap();
        let mirror = Rgb::splat(1e30);
        let mut push = |kind| materials.push(Material::new(kind, two_sided));
        push(MaterialKind::Diffuse { reflectance: grey(1.0) });
        push(MaterialKind::Mirror { reflectance: grey(0.9) });
        for roughness in [0.0, 0.15, 1.0].map(Scalar::constant) {
            push(MaterialKind::OrenNayar {
                reflectance: grey(1.0),
                roughness: roughness.clone(),
            });
            push(MaterialKind::Sheen {
                reflectance: grey(1.0),
                roughness,
            });
        }
        for (eta, k) in [(gold, gold_k), (Rgb::ZERO, mirror), (Rgb::ONE, Rgb::ZERO)] {
            push(MaterialKind::Conductor {
                eta,
                k,
                reflectance: grey(1.0),
            });
            for (alpha, distribution) in rough() {
                push(MaterialKind::RoughConductor {
                    distribution,
                    alpha,
                    eta,
                    k,
                    reflectance: grey(1.0),
                });
            }
        }
    }
    for (beta, absorption) in [([0.0, 0.0], 0.0), ([0.3, 0.3], 0.2), ([1.0, 1.0], 1e6)] {
        materials.push(Material::new(
            MaterialKind::Hair {
                pigment: Pigment::Absorption(grey(absorption)),
                fibre: Fibre::new(beta, 2.0, 1.55, 1.0),
            },
            false,
        ));
    }
    let near_one = [0.999, 0.999_9, 0.999_999, 1.0, 1.000_000_1, 1.000_101, 1.01];
    for eta in near_one.into_iter().chain([1.0 / 2.4, 1.5, 10.0]) {
        materials.extend(dielectrics(eta));
        for two_sided in [false, true] {
            materials.extend(coated(eta, two_sided));
        }
    }
    let drawn: Vec<Material> = (0..)
        .zip(&materials)
        .filter_map(|(i, m)| drawn_out(m, i))
        .step_by(2)
        .collect();
    materials.extend(drawn);
    let keeping: Vec<Material> = materials.iter().filter_map(keeping_energy).collect();
    materials.extend(keeping);
    materials
}

/// The same with anisotropic microfacets, where possible, in one of the ways to specify them.
fn drawn_out(material: &Material, way: usize) -> Option<Material> {
    use MaterialKind::{Principled, RoughConductor, RoughDielectric};
    let number = Scalar::constant;
    let stretch = match (&material.kind, way % 5) {
        (RoughConductor { .. } | RoughDielectric { .. } | Principled { .. }, 0) => Stretch::Burley(number(1.0)),
        (RoughConductor { .. } | RoughDielectric { .. } | Principled { .. }, 1) => Stretch::Strength(number(1.0)),
        (RoughConductor { .. } | RoughDielectric { .. }, way) => Stretch::Across(number([0.0, 0.3, 10.0][way - 2])),
        (Principled { .. }, _) => Stretch::Burley(number(0.5)),
        _ => return None,
    };
    Some(Material::from(MaterialDescription {
        anisotropy: Some(Box::new(Anisotropy {
            stretch,
            rotation: number(0.0),
            tangent: Tangent::U,
        })),
        ..material.clone().into()
    }))
}

/// Facets with two roughnesses are isotropic ones on a stretched plane: densities of visible normals integrate to one
/// over slopes, and both ways to specify the widths agree.
#[test]
fn visible_normals_of_two_roughnesses_are_a_density() {
    for distribution in DISTRIBUTIONS {
        for [along, across] in [[0.2, 0.2], [0.1, 0.6], [0.9, 0.15]] {
            let facets = microfacet::Facets {
                distribution,
                alpha: f32::sqrt(along * across),
                aspect: f32::sqrt(across / along),
            };
            for wo in [
                Vec3::Z,
                Vec3::new(0.6, 0.0, 0.8),
                Vec3::new(0.48, 0.84, 0.25).normalize(),
            ] {
                let n = 400;
                let mut sum = 0.0;
                for i in 0..n {
                    let t = (f64::from(i) + 0.5) / f64::from(n);
                    // Slopes of any length, in units of the roughnesses.
                    let (length, width) = (t / (1.0 - t), 1.0 / ((1.0 - t) * (1.0 - t)));
                    for j in 0..n {
                        let (sin, cos) = libm::sincos((f64::from(j) + 0.5) / f64::from(n) * std::f64::consts::TAU);
                        let x = (f64::from(along) * length * cos) as f32;
                        let y = (f64::from(across) * length * sin) as f32;
                        let m = Vec3::new(-x, -y, 1.0).normalize();
                        // Solid angle of a square of slopes: the cube of the cosine.
                        let area = f64::from(along * across) * length * width * std::f64::consts::TAU;
                        let visible = facets.g1(wo) * wo.dot(m).max(0.0) / wo.z * facets.density(m) * (m.z * m.z * m.z);
                        sum += f64::from(visible) * area / f64::from(n * n);
                    }
                }
                assert!(
                    (sum - 1.0).abs() < 4e-3,
                    "{distribution:?} {along} {across} {wo}: {sum}"
                );
            }
            for (towards, alpha) in [(Vec3::X, along), (Vec3::NEG_Y, across)] {
                assert!((facets.alpha_towards(towards) / alpha - 1.0).abs() < 1e-6);
            }
        }
    }
}

/// Principled surfaces of Mitsuba and Cycles, and that of KHR_materials_anisotropy.
#[test]
fn roughnesses_of_two_directions_are_those_of_other_programs() {
    let at = TexturePoint::default();
    let of = |stretch, alpha: f32| {
        let anisotropy = Anisotropy {
            stretch,
            rotation: Scalar::constant(0.0),
            tangent: Tangent::U,
        };
        let [mean, aspect] = anisotropy.stretched(alpha, &at);
        [mean / aspect, mean * aspect]
    };
    let number = Scalar::constant;
    for (found, expected) in [
        (
            of(Stretch::Burley(number(0.8)), 0.25),
            [0.25 / 0.28f32.sqrt(), 0.25 * 0.28f32.sqrt()],
        ),
        (of(Stretch::Burley(number(0.0)), 0.25), [0.25, 0.25]),
        (of(Stretch::Across(number(0.4)), 0.1), [0.1, 0.4]),
        (of(Stretch::Strength(number(0.5)), 0.2), [0.4, 0.2]),
        (of(Stretch::Strength(number(1.0)), 0.2), [1.0, 0.2]),
    ] {
        for i in 0..2 {
            assert!((found[i] / expected[i] - 1.0).abs() < 1e-5, "{found:?} {expected:?}");
        }
    }
    assert_eq!(of(Stretch::Across(number(0.3)), 0.3), [0.3, 0.3]);
}

/// The same with all bounces among its microfacets, where possible.
fn keeping_energy(material: &Material) -> Option<Material> {
    use MaterialKind::{Principled, RoughConductor, RoughDielectric};
    let has_facets = matches!(
        material.kind,
        RoughConductor { .. } | RoughDielectric { .. } | Principled { .. }
    );
    has_facets.then(|| {
        Material::from(MaterialDescription {
            multiple_scattering: true,
            ..material.clone().into()
        })
    })
}

fn rough() -> impl Iterator<Item = (Scalar, Distribution)> {
    let alphas = [0.0, 1e-3, 0.1, 1.0, 10.0].map(Scalar::constant);
    alphas
        .into_iter()
        .flat_map(|alpha| DISTRIBUTIONS.map(|distribution| (alpha.clone(), distribution)))
}

fn dielectrics(eta: f32) -> Vec<Material> {
    let tint = Tint::NONE;
    let smooth = MaterialKind::Dielectric {
        eta,
        tint: tint.clone(),
    };
    let pane = MaterialKind::ThinDielectric {
        eta,
        tint: tint.clone(),
    };
    let rough = rough().map(|(alpha, distribution)| MaterialKind::RoughDielectric {
        distribution,
        alpha,
        eta,
        tint: tint.clone(),
    });
    let kinds = [smooth, pane].into_iter().chain(rough);
    kinds.map(|kind| Material::new(kind, false)).collect()
}

/// Surfaces with several lobes.
fn coated(eta: f32, two_sided: bool) -> Vec<Material> {
    let mut kinds = vec![];
    for reflectance in [0.0, 1.0] {
        kinds.push(MaterialKind::Plastic {
            reflectance: grey(reflectance),
            specular_reflectance: grey(1.0),
            coat: Coat::new(eta, true),
        });
        for roughness in [0.0, 1.0] {
            let extras = |spec_trans| Extras {
                spec_tint: Scalar::constant(0.5),
                spec_trans: Scalar::constant(spec_trans),
                sheen: Scalar::constant(1.0),
                sheen_tint: Scalar::constant(0.5),
                clearcoat: Scalar::constant(1.0),
                clearcoat_gloss: Scalar::constant(1.0 - roughness),
                flatness: Scalar::constant(0.5),
                ..Extras::NONE
            };
            let over = Extras {
                specular_color: Texture::Constant(Rgb::new(1.0, 0.5, 0.1)),
                coat: Some(ClearCoat {
                    weight: Scalar::constant(0.7),
                    roughness: Scalar::constant(roughness),
                    eta: 1.6,
                    facing: CoatFacing::Below,
                }),
                film: Some(ThinFilm {
                    weight: Scalar::constant(0.8),
                    thickness: Scalar::constant(0.3),
                    eta: 1.33,
                }),
                ..Extras::NONE
            };
            let skin = Extras {
                subsurface: Some(Subsurface::new(
                    Scalar::constant(0.6),
                    Rgb::splat(0.5),
                    (Rgb::ONE, 0.0),
                    eta,
                )),
                ..extras(0.0)
            };
            let fuzz = Fuzz {
                weight: Scalar::constant(0.8),
                roughness: Scalar::constant(roughness),
                color: Texture::Constant(Rgb::new(1.0, 0.5, 0.1)),
            };
            let fuzzy = |extras: Extras| Extras {
                fuzz: Some(fuzz.clone()),
                diffuse_roughness: Scalar::constant(0.5),
                ..extras
            };
            // Nothing sinks into a black surface.
            let skins = (reflectance > 0.0)
                .then(|| [skin.clone(), fuzzy(skin)])
                .into_iter()
                .flatten();
            let layered = [extras(0.0), extras(0.7), over.clone()].into_iter();
            let fuzzies = (eta == 1.5).then(|| [fuzzy(extras(0.7)), fuzzy(over)]);
            let layered = layered.chain(fuzzies.into_iter().flatten()).chain(skins);
            let layered = layered.map(|extras| (0.25, Some(extras)));
            for (metallic, extras) in [(0.5, None)].into_iter().chain(layered) {
                kinds.push(MaterialKind::Principled {
                    base_color: grey(reflectance),
                    metallic: Scalar::constant(metallic),
                    roughness: Scalar::constant(roughness),
                    interface: Interface::Eta(eta),
                    extras: extras.map(Box::new),
                });
            }
        }
    }
    for (distribution, alpha) in [(DISTRIBUTIONS[0], 1e-3), (DISTRIBUTIONS[1], 0.5)] {
        kinds.push(MaterialKind::RoughPlastic {
            reflectance: grey(1.0),
            specular_reflectance: grey(1.0),
            coat: Box::new(RoughCoat::new(distribution, alpha, eta, false)),
        });
    }
    kinds.into_iter().map(|kind| Material::new(kind, two_sided)).collect()
}

/// Unit vectors all over the sphere, denser at the poles and around the horizon, and some exactly on it.
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
                        let name = || format!("{bsdf:?} {wo} {lobe} {u}: {s:?}");
                        assert!((s.wi.length() - 1.0).abs() < 1e-6, "{}", name());
                        assert!(s.weight.min_element() >= 0.0, "{}", name());
                        let mixed = matches!(
                            bsdf,
                            Bsdf::Plastic(_)
                                | Bsdf::RoughPlastic(_)
                                | Bsdf::Principled(_)
                                | Bsdf::Layered(_)
                                | Bsdf::OrenNayar(_)
                                | Bsdf::Sheen(_)
                                | Bsdf::RoughConductor(RoughConductor {
                                    mean_fresnel: Some(_),
                                    ..
                                })
                                | Bsdf::RoughDielectric(RoughDielectric { kept: Some(_), .. })
                                | Bsdf::Hair(_)
                        );
                        assert!(mixed || s.weight.max_element() <= 1.000_001, "{}", name());
                        assert!(s.weight.is_finite(), "{}", name());
                        assert!(s.pdf > 0.0 && s.pdf.is_finite(), "{}", name());
                        let radiance = bsdf.sample(wo, lobe, u, TransportMode::Radiance).unwrap();
                        assert_eq!((radiance.wi, radiance.pdf), (s.wi, s.pdf), "{}", name());
                        assert!(radiance.weight.is_finite(), "{}", name());
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
        if material.has(BsdfFlags::TRANSMITS) {
            continue;
        }
        // A lit back does what the front does.
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

fn blend(first: &Material, second: &Material) -> Material {
    let parts = Box::new([first.clone(), second.clone()]);
    let weight = grey(0.4);
    Material::new(MaterialKind::Blend { parts, weight }, true)
}

fn half_there(material: &Material) -> Material {
    Material::from(MaterialDescription {
        opacity: Some(grey(0.5)),
        ..material.clone().into()
    })
}

/// The flags that samples of a material reveal, and those that its BSDFs claim.
fn shown(material: &Material) -> F {
    let mut sampler = Sampler::new(5, 0, Purpose::Test, 0);
    let (at, mut shown) = (TexturePoint::default(), F::SPECULAR);
    for wo in directions().into_iter().flat_map(|wo| [wo; 8]) {
        let Some(met) = material.met(&at, || sampler.next_1d()) else {
            shown |= F::PASSABLE;
            continue;
        };
        let bsdf = met.bsdf(&at);
        let (u_lobe, u) = (sampler.next_1d(), sampler.next_2d());
        let sample = |bsdf: Bsdf| bsdf.sample(wo, u_lobe, u, TransportMode::Radiance);
        shown |= bsdf.flags() - (F::SMOOTH | F::TRANSMITS);
        if let Some(sample) = sample(bsdf) {
            let of_lobe = F::DELTA.when(sample.delta) | (F::WIDE | F::FOLLOWED).when(!sample.delta);
            let goes_through = !sample.transmitted || bsdf.has(F::TRANSMITS);
            assert!(bsdf.has(of_lobe) && goes_through, "{bsdf:?} {sample:?}");
            shown |= F::DELTA.when(sample.delta) | F::REFRACTS.when(sample.transmitted);
            shown -= F::SPECULAR.when(!sample.delta);
        }
        let is_right = |sample: BsdfSample| sample.delta == bsdf.has(F::SPECULAR);
        assert!(sample(bsdf.without_delta()).is_none_or(is_right), "{bsdf:?}");
        assert_eq!(bsdf.narrow_and_wide(wo).is_some(), bsdf.has(F::NARROW_LOBE), "{bsdf:?}");
    }
    shown
}

#[test]
fn flags_are_what_samples_show() {
    let kinds = [dielectrics(1.5), coated(1.5, true)].concat();
    let null = Material::new(MaterialKind::Null, true);
    let mut typical: Vec<_> = kinds.windows(2).map(|pair| blend(&pair[0], &pair[1])).collect();
    typical.push(blend(&kinds[0], &null));
    let nested = typical.iter().zip(&kinds);
    let nested: Vec<_> = nested
        .map(|(first, second)| blend(first, &half_there(second)))
        .collect();
    typical.extend([kinds, nested].concat());
    typical.extend(typical.clone().iter().map(half_there));
    for material in &typical {
        let sampled = F::DELTA | F::TRANSMITS;
        assert_eq!(material.flags() & sampled, shown(material) & sampled, "{material:?}");
    }
    for material in typical.into_iter().chain(materials()) {
        let (flags, shown) = (material.flags(), shown(&material));
        assert!(flags.contains(shown - F::SPECULAR), "{shown:?} {material:?}");
        assert!(shown.contains(flags & F::SPECULAR), "{shown:?} {material:?}");
    }
    let black = Material::new(MaterialKind::Diffuse { reflectance: grey(0.0) }, true);
    assert_eq!(black.bsdf(&TexturePoint::default()), Bsdf::Black);
    assert!(!black.is_specular());
}

#[test]
fn blends_bound_media_and_disperse_as_their_parts_do() {
    let kinds = dielectrics(1.5);
    let (glass, pane) = (&kinds[0], &kinds[1]);
    let matt = Material::new(MaterialKind::Diffuse { reflectance: grey(1.0) }, true);
    let bounds = |material: &Material| material.has(F::BOUNDS_MEDIA);
    assert!(bounds(glass) && bounds(&blend(glass, &matt)));
    assert!(!bounds(pane) && !bounds(&matt) && !bounds(&blend(glass, pane)) && !bounds(&half_there(glass)));
    let prism = Material::from(MaterialDescription {
        dispersion: Some(Box::new(Dispersion {
            inside: Index::of_abbe(1.5, 60.0),
            outside: Index::Constant(1.0),
        })),
        ..glass.clone().into()
    });
    assert!(prism.has(F::DISPERSES) && blend(&matt, &prism).has(F::DISPERSES) && !glass.has(F::DISPERSES));
}

#[test]
fn refraction_obeys_snell_and_scales_radiance() {
    let material = &dielectrics(1.5)[0];
    let bsdf = material.bsdf(&TexturePoint::default());
    let sample = |wo, mode| bsdf.sample(wo, 0.999, Vec2::ZERO, mode).unwrap();
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let into = sample(wo, TransportMode::Radiance);
    assert!(into.transmitted && into.delta);
    assert!((into.wi - Vec3::new(-0.4, 0.0, -(1.0f32 - 0.16).sqrt())).length() < 1e-6);
    assert!((into.weight.x - 1.0 / 2.25).abs() < 1e-6);
    assert_eq!(sample(wo, TransportMode::Flux).weight, Rgb::ONE);
    // Out again the same way.
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
    for material in dielectrics(1.0)
        .into_iter()
        .chain([Material::new(MaterialKind::Null, false)])
    {
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

/// Also for what is left without a narrow lobe.
#[test]
fn gloss_and_base_are_the_whole() {
    let at = TexturePoint::default();
    let mut parted = 0;
    for material in materials() {
        let whole = material.bsdf(&at);
        let up = directions().into_iter().filter(|dir| dir.z > 1e-3);
        for wo in up.clone() {
            let wide = whole.narrow_and_wide(wo).map(|(_, [_, wide])| wide);
            for bsdf in [Some(whole), wide].into_iter().flatten() {
                let Some(lobes) = bsdf.gloss_and_base() else { continue };
                parted += 1;
                for wi in up.clone() {
                    let value = |bsdf: &Bsdf| bsdf.eval(wo, wi, TransportMode::Radiance);
                    let (all, sum) = (value(&bsdf), value(&lobes[0]) + value(&lobes[1]));
                    assert!(
                        (all - sum).abs().max_element() <= 1e-5 * all.max_element(),
                        "{all} {sum} {bsdf:?}"
                    );
                }
            }
        }
    }
    assert!(parted > 100, "{parted}");
}
