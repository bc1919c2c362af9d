//! Every sampler of directions on surfaces and in media against its density: chi-square, fixed seeds, one significance
//! per test function.

use beamfarm_harness::quadrature::Rect;
use beamfarm_harness::render::is_long;
use beamfarm_harness::{Chi2, Suite};
use beamfarm_render::math::{Rgb, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::bsdf::{
    Anisotropy, Bsdf, BsdfFlags, ClearCoat, CoatFacing, Dielectric, Distribution, Extras, Fibre, Fuzz, Hair, Interface,
    Material, MaterialDescription, MaterialKind, Microfibers, RoughConductor, RoughDielectric, Sheen, Stretch, Tangent,
    ThinFilm, TransportMode, Velvet, conductor_preset,
};
use beamfarm_render::world::phase::Phase;
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};

const SIGNIFICANCE: f64 = 0.01;

fn direction(degrees: f32, azimuth: f32) -> Vec3 {
    let (sin, cos) = libm::sincosf(degrees.to_radians());
    let (sin_phi, cos_phi) = libm::sincosf(azimuth.to_radians());
    Vec3::new(sin * cos_phi, sin * sin_phi, cos)
}

#[test]
fn warps_follow_their_densities() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let test = Chi2::default();
    let axis = direction(30.0, 50.0);
    suite.chi2(
        "sphere",
        &test.sphere(
            axis,
            |s| Some(warp::uniform_sphere(s.next_2d())),
            |_| warp::uniform_sphere_pdf(),
        ),
    );
    suite.chi2(
        "hemisphere",
        &test.sphere(
            axis,
            |s| Some(warp::cosine_hemisphere(s.next_2d())),
            |d| warp::cosine_hemisphere_pdf(d.z),
        ),
    );
    for cos_max in [-0.5, 0.3, 0.999] {
        suite.chi2(
            format!("cone {cos_max}"),
            &test.sphere(
                Vec3::Z,
                |s| Some(warp::uniform_cone(s.next_2d(), cos_max)),
                |d| f32::from(d.z >= cos_max) * warp::uniform_cone_pdf(cos_max),
            ),
        );
    }
    let square = Rect {
        x: (-1.0, 1.0),
        y: (-1.0, 1.0),
    };
    suite.chi2(
        "disk",
        &test.plane(
            square,
            |s| Some(warp::concentric_disk(s.next_2d())),
            |p| f32::from(p.length() <= 1.0) * warp::concentric_disk_pdf(),
        ),
    );
    suite.chi2(
        "triangle",
        &test.plane(
            square,
            |s| Some(warp::uniform_triangle(s.next_2d())),
            |p| {
                let inside = p.min_element() >= 0.0 && p.x + p.y <= 1.0;
                f32::from(inside) * warp::uniform_triangle_pdf()
            },
        ),
    );
    suite.finish();
}

#[test]
fn phase_functions_are_sampled_exactly() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let old = direction(100.0, 20.0);
    let single = [-0.999, -0.9, -0.4, 0.0, 1e-4, 0.3, 0.7, 0.95, 0.999];
    let blends = [
        (0.3, [0.0, 0.7]),
        (0.8, [0.9, -0.5]),
        (1e-3, [0.3, 0.0]),
        (0.5, [0.2, 0.6]),
    ];
    let single = single.map(|g| Phase::blend(0.0, [g, 0.0]));
    let blends = blends.map(|(weight, g)| Phase::blend(weight, g));
    for phase in single.into_iter().chain(blends) {
        let g = match phase {
            Phase::Isotropic => 0.0,
            Phase::HenyeyGreenstein { g } => g,
            Phase::Blend { g, .. } => g[0],
        };
        let axis = if g < 0.0 { -old } else { old };
        suite.chi2(
            format!("{phase:?}"),
            &Chi2::default().sphere(
                axis,
                |s| Some(phase.sample(old, s.next_2d())),
                |new| phase.eval_directions(old, new),
            ),
        );
    }
    suite.finish();
}

fn rough_bsdfs() -> Vec<(String, Bsdf<'static>)> {
    let (eta, k) = conductor_preset("gold").expect("a preset");
    let mut bsdfs = vec![];
    for two_sided in [false, true] {
        let reflectance = Rgb::new(0.2, 0.5, 0.9);
        bsdfs.push((
            format!("diffuse, two-sided {two_sided}"),
            Bsdf::Diffuse { reflectance, two_sided },
        ));
        bsdfs.push((
            format!("conductor 0.3, two-sided {two_sided}"),
            Bsdf::RoughConductor(RoughConductor {
                distribution: Distribution::Ggx,
                alpha: 0.3,
                aspect: 1.0,
                eta,
                k,
                reflectance,
                two_sided,
                mean_fresnel: None,
            }),
        ));
    }
    for alpha in [1e-3, 0.05, 1.0] {
        bsdfs.push((
            format!("conductor {alpha}"),
            Bsdf::RoughConductor(RoughConductor {
                distribution: Distribution::Ggx,
                alpha,
                aspect: 1.0,
                eta,
                k,
                reflectance: Rgb::ONE,
                two_sided: false,
                mean_fresnel: None,
            }),
        ));
    }
    for alpha in [0.05, 0.3, 1.0] {
        bsdfs.push((
            format!("conductor {alpha}, all bounces, two-sided true"),
            Bsdf::RoughConductor(RoughConductor {
                distribution: Distribution::Beckmann,
                alpha,
                aspect: 1.0,
                eta,
                k,
                reflectance: Rgb::new(0.2, 0.5, 0.9),
                mean_fresnel: Some(Rgb::new(0.7, 0.8, 0.9)),
                two_sided: true,
            }),
        ));
    }
    for (metallic, roughness, extras) in [
        (0.0, 0.3, None),
        (0.5, 0.9, None),
        (1.0, 1.0, None),
        (0.3, 0.7, Some(every_lobe())),
        (0.3, 0.7, Some(glass_beneath_a_film())),
        (0.3, 0.7, Some(all_that_lies_over())),
        (0.3, 0.7, Some(fuzzy())),
    ] {
        let has_coat = extras.as_ref().is_some_and(|extras| extras.coat.is_some());
        let has_fuzz = extras.as_ref().is_some_and(|extras| extras.fuzz.is_some());
        let kind = MaterialKind::Principled {
            base_color: Texture::Constant(Rgb::new(0.8, 0.5, 0.2)),
            metallic: Scalar::constant(metallic),
            roughness: Scalar::constant(roughness),
            interface: Interface::Eta(1.5),
            extras,
        };
        let material = Material::from(MaterialDescription {
            multiple_scattering: true,
            ..MaterialDescription::new(kind, true)
        });
        // Leaked: tests end soon.
        let material: &'static Material = Box::leak(Box::new(material));
        bsdfs.push((
            format!("principled {metallic} {roughness}, coat {has_coat}, fuzz {has_fuzz}, all bounces, two-sided true"),
            material.bsdf(&TexturePoint::default()),
        ));
    }
    for roughness in [0.2, 1.0] {
        bsdfs.push((
            format!("velvet {roughness}, two-sided true"),
            Bsdf::Velvet(Velvet {
                reflectance: Rgb::new(0.2, 0.5, 0.9),
                roughness,
                two_sided: true,
            }),
        ));
    }
    for roughness in [0.2, 0.7] {
        bsdfs.push((
            format!("sheen {roughness}, two-sided true"),
            Bsdf::Sheen(Sheen {
                fibers: Microfibers {
                    color: Rgb::new(0.2, 0.5, 0.9),
                    roughness,
                },
                two_sided: true,
            }),
        ));
    }
    for beta in [[0.2, 0.5], [0.6, 0.2]] {
        bsdfs.push((
            format!("hair {beta:?}"),
            Bsdf::Hair(Hair {
                fibre: Fibre::new(beta, 3.0, 1.55, 1.0),
                absorption: Rgb::new(0.1, 0.3, 0.9),
            }),
        ));
    }
    for (distribution, [along, across], mean_fresnel) in [
        (Distribution::Ggx, [0.12, 0.8], None),
        (Distribution::Beckmann, [0.6, 0.15], Some(Rgb::new(0.7, 0.8, 0.9))),
    ] {
        bsdfs.push((
            format!("conductor {along} {across}, all bounces, two-sided true"),
            Bsdf::RoughConductor(RoughConductor {
                distribution,
                alpha: f32::sqrt(along * across),
                aspect: f32::sqrt(across / along),
                eta,
                k,
                reflectance: Rgb::new(0.2, 0.5, 0.9),
                mean_fresnel,
                two_sided: true,
            }),
        ));
    }
    bsdfs.push((
        "dielectric 0.4 0.1".to_owned(),
        Bsdf::RoughDielectric(RoughDielectric {
            aspect: 0.5,
            ..rough_dielectric(0.2, 1.5)
        }),
    ));
    bsdfs.push((
        "principled, brushed, all bounces, two-sided true".to_owned(),
        brushed_bsdf(Some(every_lobe())),
    ));
    for (alpha, aspect, eta) in [(0.4, 1.0, 1.5), (0.3, 0.5, 1.0 / 1.33)] {
        bsdfs.push((
            format!("dielectric {alpha} {aspect}, eta {eta}, that keeps all"),
            Bsdf::RoughDielectric(RoughDielectric {
                aspect,
                kept: Some(Rgb::new(0.3, 0.6, 0.9)),
                ..rough_dielectric(alpha, eta)
            }),
        ));
    }
    for (alpha, eta) in [
        (1e-3, 1.5),
        (0.05, 1.5),
        (0.05, 1.0 / 1.33),
        (0.3, 1.5),
        (0.3, 0.5),
        (0.3, 1.01),
        (1.0, 1.5),
    ] {
        bsdfs.push((
            format!("dielectric {alpha}, eta {eta}"),
            Bsdf::RoughDielectric(rough_dielectric(alpha, eta)),
        ));
    }
    bsdfs
}

/// Half metal, rougher along x than along y.
fn brushed_bsdf(extras: Option<Box<Extras>>) -> Bsdf<'static> {
    let kind = MaterialKind::Principled {
        base_color: Texture::Constant(Rgb::new(0.8, 0.5, 0.2)),
        metallic: Scalar::constant(0.5),
        roughness: Scalar::constant(0.6),
        interface: Interface::Eta(1.5),
        extras,
    };
    let material = Material::from(MaterialDescription {
        multiple_scattering: true,
        anisotropy: Some(Box::new(Anisotropy {
            stretch: Stretch::Burley(Scalar::constant(0.9)),
            rotation: Scalar::constant(0.0),
            tangent: Tangent::U,
        })),
        ..MaterialDescription::new(kind, true)
    });
    // Leaked: tests end soon.
    let material: &'static Material = Box::leak(Box::new(material));
    material.bsdf(&TexturePoint::default())
}

fn glass_beneath_a_film() -> Box<Extras> {
    Box::new(Extras {
        spec_trans: Scalar::constant(0.8),
        film: Some(ThinFilm {
            weight: Scalar::constant(0.9),
            thickness: Scalar::constant(0.35),
            eta: 1.8,
        }),
        ..Extras::NONE
    })
}

fn every_lobe() -> Box<Extras> {
    Box::new(Extras {
        spec_tint: Scalar::constant(0.5),
        spec_trans: Scalar::constant(0.4),
        sheen: Scalar::constant(0.5),
        clearcoat: Scalar::constant(0.8),
        ..Extras::NONE
    })
}

fn all_that_lies_over() -> Box<Extras> {
    Box::new(Extras {
        specular_color: Texture::Constant(Rgb::new(1.0, 0.6, 0.2)),
        coat: Some(ClearCoat {
            weight: Scalar::constant(0.8),
            roughness: Scalar::constant(0.3),
            eta: 1.6,
            facing: CoatFacing::Below,
        }),
        film: Some(ThinFilm {
            weight: Scalar::constant(0.9),
            thickness: Scalar::constant(0.4),
            eta: 1.33,
        }),
        ..Extras::NONE
    })
}

fn fuzzy() -> Box<Extras> {
    Box::new(Extras {
        fuzz: Some(Fuzz {
            weight: Scalar::constant(0.8),
            roughness: Scalar::constant(0.4),
            color: Texture::Constant(Rgb::new(1.0, 0.6, 0.2)),
        }),
        diffuse_roughness: Scalar::constant(0.5),
        ..Extras::NONE
    })
}

fn rough_dielectric(alpha: f32, eta: f32) -> RoughDielectric {
    RoughDielectric {
        distribution: Distribution::Ggx,
        alpha,
        aspect: 1.0,
        eta,
        reflectance: Rgb::ONE,
        transmittance: Rgb::ONE,
        kept: None,
    }
}

fn incidences() -> impl Iterator<Item = (f32, Vec3)> {
    [0.0, 35.0, 70.0, 88.0, 110.0, 138.0, 170.0]
        .into_iter()
        .map(|degrees| (degrees, direction(degrees, 25.0)))
}

/// Each side of the surface separately, around the mean of its samples. Together the densities integrate to one, less
/// the light lost because microfacets have no second bounce: none for diffuse surfaces, almost none for smooth ones.
#[test]
fn bsdfs_are_sampled_in_proportion_to_their_densities() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, bsdf) in rough_bsdfs() {
        let both = bsdf.has(BsdfFlags::TRANSMITS);
        for (degrees, wo) in incidences().step_by(if is_long() { 1 } else { 3 }) {
            let mut integral = 0.0;
            for reflected in [true, false] {
                let wanted = |wi: &Vec3| (wi.z * wo.z > 0.0) == reflected;
                let sample = |s: &mut Sampler| {
                    let (lobe, u) = (s.next_1d(), s.next_2d());
                    bsdf.sample(wo, lobe, u, TransportMode::Radiance)
                        .map(|sample| sample.wi)
                        .filter(wanted)
                };
                let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
                let mut some: Vec<Vec3> = (0..50_000).filter_map(|_| sample(&mut rng)).take(2_000).collect();
                // Cells are finest around the axis: for a narrow lobe with a wide one, around the narrow one.
                if name.contains("all bounces") {
                    some.sort_by(|a, b| bsdf.pdf(wo, *b).total_cmp(&bsdf.pdf(wo, *a)));
                    some.truncate(some.len() / 2);
                }
                let axis = some.iter().sum::<Vec3>().try_normalize().unwrap_or(Vec3::Z);
                let pdf = |wi| f32::from(wanted(&wi)) * bsdf.pdf(wo, wi);
                let result = Chi2::default().sphere(axis, sample, pdf);
                integral += result.integral;
                if reflected || both {
                    suite.chi2(format!("{name} at {degrees}, reflected {reflected}"), &result);
                } else {
                    assert_eq!(result.integral, 0.0, "{name}");
                }
            }
            let name = format!("{name} at {degrees} degrees: {integral}");
            let black = wo.z < 0.0 && !both && !name.contains("two-sided true");
            let lossless = (["diffuse", "0.001", "hair"].iter()).any(|of| name.contains(of));
            let range = match (black, lossless) {
                (true, _) => 0.0..=0.0,
                (_, true) => 0.998..=1.001,
                _ => 0.4..=1.001,
            };
            assert!(range.contains(&integral), "{name}");
        }
    }
    suite.finish();
}

/// In both modes, the weight that `sample` returns is eval * cos / pdf for its direction.
#[test]
fn sample_weights_are_value_times_cosine_over_density() {
    let mut rng = Sampler::new(7, 0, Purpose::Test, 0);
    for (name, bsdf) in rough_bsdfs() {
        for (degrees, wo) in incidences() {
            for mode in [TransportMode::Radiance, TransportMode::Flux] {
                for _ in 0..500 {
                    let (lobe, u) = (rng.next_1d(), rng.next_2d());
                    let Some(sample) = bsdf.sample(wo, lobe, u, mode) else {
                        continue;
                    };
                    let name = format!("{name} at {degrees} degrees, {mode:?}, {sample:?}");
                    assert!(!sample.delta, "{name}");
                    assert_eq!(sample.transmitted, sample.wi.z * wo.z < 0.0, "{name}");
                    assert!((sample.wi.length() - 1.0).abs() < 1e-6, "{name}");
                    let pdf = bsdf.pdf(wo, sample.wi);
                    let value = bsdf.eval(wo, sample.wi, mode) * (sample.wi.z.abs() / pdf);
                    // Rounding of the two directions changes their half vector by the rounding over the roughness.
                    let tolerance = weight_tolerance(&bsdf);
                    let error = (value - sample.weight).abs().max_element();
                    assert!(error <= tolerance * sample.weight.max_element(), "{name}: {value}");
                    assert!((pdf / sample.pdf - 1.0).abs() < 20.0 * tolerance, "{name}: {pdf}");
                }
            }
        }
    }
}

fn weight_tolerance(bsdf: &Bsdf) -> f32 {
    match *bsdf {
        Bsdf::RoughConductor(RoughConductor { alpha, .. }) => 1e-4 + 1e-6 / alpha,
        Bsdf::RoughDielectric(b) => 1e-4 + 2e-6 / (b.alpha * (b.eta - 1.0).abs().min(1.0)),
        Bsdf::Hair(_) => 1e-3,
        _ => 1e-5,
    }
}

/// Delta lobes: never in eval or pdf, and chosen with the probability that they state.
#[test]
fn delta_lobes_are_chosen_with_their_probabilities() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let bsdf = Bsdf::Dielectric(Dielectric {
        eta: 1.5,
        reflectance: Rgb::ONE,
        transmittance: Rgb::ONE,
    });
    for (degrees, wo) in incidences() {
        let mut rng = Sampler::new(3, 0, Purpose::Test, 1);
        let mut observed = [0u64; 2];
        let mut probability = [0.0f64; 2];
        for _ in 0..20_000 {
            let sample = bsdf
                .sample(wo, rng.next_1d(), Vec2::ZERO, TransportMode::Radiance)
                .unwrap();
            assert!(sample.delta);
            assert_eq!(bsdf.pdf(wo, sample.wi), 0.0);
            assert_eq!(bsdf.eval(wo, sample.wi, TransportMode::Radiance), Rgb::ZERO);
            let lobe = usize::from(sample.transmitted);
            observed[lobe] += 1;
            probability[lobe] = f64::from(sample.pdf);
            probability[1 - lobe] = 1.0 - probability[lobe];
        }
        let (_, _, p) = beamfarm_harness::chi2::chi2(&observed, &probability.map(|p| p * 20_000.0));
        suite.p_value(format!("{degrees} degrees"), p);
    }
    suite.finish();
}
