//! Coats with another normal than the layer below: densities, furnaces, the same surfaces made otherwise, and photons
//! against paths.

use super::energy::{albedo, direction, grey};
use beamfarm_harness::render::{blocks_each_way, scene, truth};
use beamfarm_harness::{Chi2, Suite};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::bsdf::{
    Bsdf, ClearCoat, CoatFacing, Extras, Fuzz, Interface, Material, MaterialDescription, MaterialKind, Subsurface,
    TransportMode,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};

const MODES: [TransportMode; 2] = [TransportMode::Radiance, TransportMode::Flux];

fn coat(roughness: f32) -> Extras {
    Extras {
        coat: Some(ClearCoat {
            weight: Scalar::constant(0.9),
            roughness: Scalar::constant(roughness),
            eta: 1.6,
            facing: CoatFacing::Below,
        }),
        ..Extras::NONE
    }
}

fn surface(metallic: f32, roughness: f32, extras: Extras) -> Bsdf<'static> {
    let material = Material::from(MaterialDescription {
        multiple_scattering: true,
        ..MaterialDescription::new(
            MaterialKind::Principled {
                base_color: grey(1.0),
                metallic: Scalar::constant(metallic),
                roughness: Scalar::constant(roughness),
                interface: Interface::Eta(1.5),
                extras: Some(Box::new(extras)),
            },
            true,
        )
    });
    // Leaked: tests end soon.
    let material: &'static Material = Box::leak(Box::new(material));
    material.bsdf(&TexturePoint::default())
}

fn surfaces() -> Vec<(&'static str, Bsdf<'static>)> {
    let skin = Extras {
        subsurface: Some(Subsurface::new(
            Scalar::constant(0.6),
            Rgb::splat(0.5),
            (Rgb::ONE, 0.0),
            1.5,
        )),
        ..coat(0.5)
    };
    let fuzzy = Extras {
        fuzz: Some(Fuzz {
            weight: Scalar::constant(0.8),
            roughness: Scalar::constant(0.4),
            color: Texture::Constant(Rgb::ONE),
        }),
        ..coat(0.6)
    };
    vec![
        ("dielectric", surface(0.0, 0.6, coat(0.5))),
        ("metal", surface(1.0, 0.5, coat(0.4))),
        ("skin", surface(0.0, 0.5, skin)),
        ("fuzzy", surface(0.3, 0.6, fuzzy)),
    ]
}

/// Normals of the layer below and of the coat.
fn normals() -> [[Vec3; 2]; 3] {
    let turned = |x: f32, y: f32| Vec3::new(x, y, 1.0).normalize();
    [
        [turned(0.5, -0.2), Vec3::Z],
        [Vec3::Z, turned(-0.3, 0.4)],
        [turned(0.4, 0.3), turned(-0.3, 0.2)],
    ]
}

#[test]
fn both_parts_are_sampled_by_their_densities() {
    let mut suite = Suite::new(1e-2);
    for (name, bsdf) in surfaces() {
        for (i, both) in normals().into_iter().enumerate() {
            let bsdf = bsdf.facing(both);
            for wo in [direction(0.8), direction(0.45), -direction(0.6)] {
                // As the code that perturbs normals ensures.
                if both.iter().any(|n| n.dot(wo) * wo.z <= 0.0) {
                    continue;
                }
                let mut integral = 0.0;
                for side in [1.0, -1.0] {
                    let sample = |s: &mut Sampler| {
                        let (lobe, u) = (s.next_1d(), s.next_2d());
                        let sample = bsdf.sample(wo, lobe, u, TransportMode::Radiance)?;
                        (sample.wi.z * side > 0.0).then_some(sample.wi)
                    };
                    let pdf = |wi: Vec3| f32::from(wi.z * side > 0.0) * bsdf.pdf(wo, wi);
                    let axis = both[0] * (2.0 * both[0].dot(wo)) - wo;
                    let result = Chi2::default().sphere(axis, sample, pdf);
                    integral += result.integral;
                    if result.integral > 0.0 {
                        suite.chi2(format!("{name} {i} {wo} {side}"), &result);
                    }
                }
                assert!((0.4..1.001).contains(&integral), "{name} {i} {wo}: {integral}");
            }
        }
    }
    suite.finish();
}

#[test]
fn samples_weigh_what_values_and_densities_say() {
    let mut rng = Sampler::new(3, 0, Purpose::Test, 0);
    let mut most = 0.0f32;
    for (name, bsdf) in surfaces() {
        for bsdf in normals().map(|both| bsdf.facing(both)) {
            for wo in [direction(0.9), direction(0.5), -direction(0.7)] {
                for mode in MODES {
                    for _ in 0..2000 {
                        let (lobe, u) = (rng.next_1d(), rng.next_2d());
                        let Some(sample) = bsdf.sample(wo, lobe, u, mode) else {
                            continue;
                        };
                        let value = bsdf.eval(wo, sample.wi, mode);
                        let expected = value * (sample.wi.z.abs() / bsdf.pdf(wo, sample.wi));
                        let error = (expected - sample.weight).abs().max_element();
                        assert!(
                            error <= 1e-4 * sample.weight.max_element(),
                            "{name} {wo} {sample:?} {expected}"
                        );
                        assert_eq!(sample.transmitted, sample.wi.z * wo.z < 0.0);
                        most = most.max(sample.weight.max_element());
                    }
                }
            }
        }
    }
    assert!(most < 30.0, "{most}");
}

/// The value from a light to the camera is the same from whichever end a path starts.
#[test]
fn values_are_those_of_the_light_and_the_camera() {
    let mut rng = Sampler::new(4, 0, Purpose::Test, 0);
    for (name, bsdf) in surfaces() {
        for bsdf in normals().map(|both| bsdf.facing(both)) {
            for _ in 0..2000 {
                let [camera, light] = [(); 2].map(|()| beamfarm_render::warp::uniform_sphere(rng.next_2d()));
                let from_camera = bsdf.eval(camera, light, TransportMode::Radiance);
                let from_light = bsdf.eval(light, camera, TransportMode::Flux);
                let error = (from_camera - from_light).abs().max_element();
                assert!(
                    error <= 1e-4 * from_camera.max_element() && from_camera.is_finite(),
                    "{name} {camera} {light}: {from_camera} {from_light}"
                );
            }
        }
    }
}

/// No more light leaves than arrives. With both normals along the shape's, everything is as without them.
#[test]
fn no_light_is_gained_by_two_normals() {
    for (name, bsdf) in surfaces() {
        for both in normals() {
            let turned = bsdf.facing(both);
            for cos in [0.99, 0.7, 0.4, 0.15] {
                let wo = direction(cos);
                if both.iter().any(|n| n.dot(wo) <= 0.0) {
                    continue;
                }
                let found = albedo(&turned, wo);
                assert!((0.2..1.006).contains(&found), "{name} {cos}: {found}");
            }
        }
        let same = bsdf.facing([Vec3::Z; 2]);
        let mut rng = Sampler::new(5, 0, Purpose::Test, 0);
        for _ in 0..2000 {
            let [wo, wi] = [(); 2].map(|()| beamfarm_render::warp::uniform_sphere(rng.next_2d()));
            for mode in MODES {
                let (a, b) = (bsdf.eval(wo, wi, mode), same.eval(wo, wi, mode));
                assert!(
                    (a - b).abs().max_element() <= 1e-4 * a.max_element(),
                    "{name} {wo} {wi}: {a} {b}"
                );
            }
            let (a, b) = (bsdf.pdf(wo, wi), same.pdf(wo, wi));
            assert!((a - b).abs() <= 1e-4 * a, "{name} {wo} {wi}: {a} {b}");
        }
    }
}

pub fn room(material: &str) -> String {
    format!(
        r#"
[image]
width = 16
height = 16
[render]
passes = 600
paths = 8000
radius = 0.04
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, -0.2, 0.0]
fov = 80.0
[materials.wall]
type = "principled"
{material}
[materials.clay]
type = "diffuse"
reflectance = 0.6
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.4, -0.5, -0.3]
radius = 0.4
material = "clay"
[[shapes]]
type = "sphere"
center = [0.1, 0.7, -0.1]
radius = 0.2
emission = {{ radiance = [3.0, 2.5, 2.0] }}
"#
    )
}

/// Slopes of (0.65, 0.7, 0.9) * 2 - 1.
const MAP: &str = "{ checkerboard = [[0.65, 0.7, 0.9], [0.35, 0.45, 0.9]], uv = [{ scale = 4 }] }";

/// Walls below a coat that smooths them, and below one with its own bumps: by camera paths, by photons that go from
/// wall to wall, and by the path tracer.
#[test]
fn photons_and_paths_find_the_same_light_below_coats() {
    let mut suite = Suite::new(1e-2);
    let base = "base_color = [0.7, 0.5, 0.3]\nroughness = 0.5\ncoat_weight = 1\ncoat_roughness = 0.4\n";
    for (name, fields) in [
        ("levels", format!("{base}normal_map = {MAP}\ncoat_levels = true")),
        ("own", format!("{base}coat_normal_map = {MAP}")),
    ] {
        let room = scene(&room(&fields));
        let truth = truth(&room, 63, 16, 8);
        for (way, found) in blocks_each_way(&room, 8) {
            suite.same_blocks(&format!("{name} {way:?}"), &found, &truth, 5e-3);
            assert!(found.noise(&truth) < 0.03, "{way:?}: {}", found.noise(&truth));
        }
    }
    suite.finish();
}

/// The value towards a camera for light from one side, times the cosine to the frame's normal and the shadowing by
/// bumps.
fn shaded(fields: &str, light: Vec3) -> Rgb {
    let scene = scene(&format!(
        "image = {{ width = 8, height = 8 }}\ncamera = {{ origin = [0, 0, 1], target = [0, 0, 0], fov = 40 }}\n\
         [[lights]]\ntype = \"environment\"\nradiance = 1.0\n[[shapes]]\ntype = \"rectangle\"\nmaterial = \"m\"\n\
         [materials.m]\ntype = \"principled\"\nroughness = 0.4\n{fields}\n"
    ));
    let ray = Ray {
        origin: scene.description().camera.position + Vec3::new(0.03, 0.02, 0.0),
        dir: Vec3::new(0.2, 0.1, -1.0).normalize(),
    };
    let mut hit = scene.first_hit(&ray, |_| false).expect("the rectangle");
    let material = scene.material(&hit);
    let at = scene.interaction(material, &mut hit, ray.dir, None);
    let wi = at.frame.to_local(light);
    let bumps = at.bump_shadowing.as_ref();
    (at.bsdf).eval_bumped(bumps, at.local_wo, wi, TransportMode::Radiance) * wi.z.abs()
}

/// Each layer alone is as where both have the perturbed normal: below a coat of almost nothing, and a coat over black.
#[test]
fn parts_are_those_of_surfaces_that_are_turned_whole() {
    for light in [
        Vec3::new(0.3, 0.2, 0.9),
        Vec3::new(-0.7, 0.3, 0.5),
        Vec3::new(0.2, 0.9, 0.1),
    ] {
        let light = light.normalize();
        let of_base = |coat: &str| {
            shaded(
                &format!("base_color = [0.6, 0.4, 0.2]\nnormal_map = {MAP}\n{coat}"),
                light,
            )
        };
        let (expected, found) = (of_base(""), of_base("coat_weight = 1e-6\ncoat_levels = true"));
        assert!(
            (expected - found).abs().max_element() < 1e-4 * expected.max_element(),
            "{expected} {found}"
        );
        let of_coat = |fields: &str| {
            let base = "base_color = 0.0\nspecular = 0.0\ncoat_weight = 1\ncoat_roughness = 0.4\n";
            shaded(&format!("{base}{fields}"), light)
        };
        let whole = of_coat(&format!("normal_map = {MAP}"));
        for same in [
            of_coat(&format!("coat_normal_map = {MAP}")),
            of_coat(&format!(
                "normal_map = {{ checkerboard = [0.5, 0.9] }}\ncoat_normal_map = {MAP}"
            )),
        ] {
            assert!(
                (whole - same).abs().max_element() < 1e-4 * whole.max_element(),
                "{whole} {same}"
            );
        }
        let (even, level) = (of_coat(""), of_coat(&format!("normal_map = {MAP}\ncoat_levels = true")));
        assert!(
            (even - level).abs().max_element() < 1e-4 * even.max_element(),
            "{even} {level}"
        );
        assert!(
            (even - whole).abs().max_element() > 0.05 * even.max_element(),
            "{even} {whole}"
        );
    }
}
