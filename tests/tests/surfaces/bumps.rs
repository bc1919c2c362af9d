//! Shadowing by bumps and normal maps: diffuse surfaces by the formula of Conty Estevez et al. (2019), metal not at
//! all, by a furnace; and photons against paths where both are involved.

use super::coats::room;
use beamfarm_harness::Suite;
use beamfarm_harness::render::{average, blocks_each_way, scene, truth};
use beamfarm_render::math::{Ray, Rgb, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::SurfaceInteraction;
use beamfarm_render::world::bsdf::{Bsdf, TransportMode};

/// Alternating slopes of 0.8 and 0.3: steep enough for light to come from below the surface.
const STEEP: &str = "{ checkerboard = [[0.9, 0.5, 0.8], [0.35, 0.7, 0.85]], uv = [{ scale = 4 }] }";

/// A ball that fills the picture up to its rim, in even light.
fn ball(material: &str) -> String {
    format!(
        "image = {{ width = 24, height = 24 }}\nrender = {{ passes = 40, paths = 100, seed = 3 }}\n\
         camera = {{ origin = [0, 0, 6], target = [0, 0, 0], fov = 18 }}\n\
         [[lights]]\ntype = \"environment\"\nradiance = 1.0\n\
         [[shapes]]\ntype = \"sphere\"\nmaterial = \"m\"\n[materials.m]\nnormal_map = {STEEP}\n{material}\n"
    )
}

/// In even light everything that reflects all is white, up to the rim, by passes and by the path tracer.
#[test]
fn metal_has_no_black_rings() {
    for (material, [of_pixels, of_blocks]) in [
        ("type = \"mirror\"", [0.9999f32, 0.9999]),
        (
            "type = \"principled\"\nbase_color = 1.0\nmetallic = 1.0\nroughness = 0.1",
            [0.6, 0.75],
        ),
        (
            "type = \"principled\"\nbase_color = 1.0\nmetallic = { checkerboard = [1.0, 0.99999] }\nroughness = 0.1",
            [0.6, 0.75],
        ),
        (
            "type = \"rough_conductor\"\nalpha = 0.01\neta = 0.0\nk = 1.0",
            [0.6, 0.75],
        ),
    ] {
        let scene = scene(&ball(material));
        let paths = truth(&scene, 32, 8, 4);
        let passes = average(&scene);
        for pixel in &passes.beauty.pixels {
            // A mirror's reflection is kept above the surface, but not all of a lobe around it. If they were shadowed
            // like diffuse light, 0.05 would remain.
            assert!(pixel.iter().all(|value| *value >= of_pixels), "{material}: {pixel:?}");
        }
        for block in &paths.blocks {
            assert!(
                block
                    .iter()
                    .all(|value| value.mean() >= f64::from(of_blocks) && value.mean() < 1.02),
                "{material}: {block:?}"
            );
        }
    }
}

/// The hit, from above, at a place on a ball whose material has a map, and its normal before the map.
fn met(material: &str, sampler: &mut Sampler, check: impl Fn(&SurfaceInteraction<'_>, Vec3, Vec3)) {
    let scene = scene(&ball(material));
    let center = -scene.description().camera.position + Vec3::new(0.0, 0.0, 6.0);
    for _ in 0..400 {
        let dir = warp::uniform_sphere(sampler.next_2d());
        let across = warp::uniform_sphere(sampler.next_2d()).cross(dir);
        let ray = Ray {
            origin: center - dir * 3.0 + across,
            dir,
        };
        let Some(mut hit) = scene.first_hit(&ray, |_| false) else {
            continue;
        };
        let before = hit.ns;
        let material = scene.material(&hit);
        let at = scene.interaction(material, &mut hit, dir, None);
        check(&at, before, hit.ns);
    }
}

/// Smith's shadowing for a surface with slopes like the map's, implemented again from the paper: roughness from the
/// tangent between the normals, and the cosine of light to the original normal.
fn shadowed(before: Vec3, turned: Vec3, light: Vec3) -> f32 {
    let cos = before.dot(turned);
    let tan2 = 1.0 / (cos * cos) - 1.0;
    let alpha2 = (0.125 * tan2).clamp(0.0, 1.0);
    let i = before.dot(light);
    let tan2 = 1.0 / (i * i) - 1.0;
    2.0 / (1.0 + (1.0 + alpha2 * tan2).sqrt())
}

#[test]
fn diffuse_lobes_are_shadowed_and_reflections_are_not() {
    let mut sampler = Sampler::new(7, 0, Purpose::Test, 0);
    let mut lights = Sampler::new(8, 0, Purpose::Test, 0);
    let mut dir = || warp::uniform_sphere(lights.next_2d());
    let dirs: Vec<Vec3> = (0..20).map(|_| dir()).collect();
    for (material, all) in [
        ("type = \"diffuse\"", Some(true)),
        ("type = \"diffuse\"\nroughness = 0.5", Some(true)),
        ("type = \"sheen\"\nroughness = 0.5", Some(true)),
        (
            "type = \"translucent\"\nreflectance = 0.4\ntransmittance = 0.4",
            Some(true),
        ),
        ("type = \"plastic\"", Some(true)),
        ("type = \"velvet\"\nroughness = 0.5", Some(false)),
        (
            "type = \"rough_conductor\"\nalpha = 0.3\neta = 1.4\nk = 1.6",
            Some(false),
        ),
        ("type = \"rough_dielectric\"\nalpha = 0.3\nior = 1.5", Some(false)),
        ("type = \"rough_plastic\"\nalpha = 0.3", None),
        ("type = \"principled\"\nmetallic = 0.4\nroughness = 0.6", None),
        (
            "type = \"principled\"\nmetallic = 0.4\nroughness = 0.6\nmultiple_scattering = true",
            None,
        ),
        (
            "type = \"principled\"\nmetallic = 0.4\nroughness = 0.6\nsheen = 0.7",
            None,
        ),
        (
            "type = \"principled\"\nmetallic = 0.1\nroughness = 0.6\nspec_trans = 0.3",
            None,
        ),
    ] {
        met(material, &mut sampler, |at, before, turned| {
            for light in &dirs {
                let (wo, wi) = (at.local_wo, at.frame.to_local(*light));
                let factor = shadowed(before, turned, *light);
                // For photons, light and camera change places.
                for (mode, from, to) in [(TransportMode::Radiance, wo, wi), (TransportMode::Flux, wi, wo)] {
                    let value = |bsdf: &Bsdf<'_>| bsdf.eval(from, to, mode);
                    let expected = match (all, at.bsdf.gloss_and_base()) {
                        (Some(true), _) => value(&at.bsdf) * factor,
                        (None, Some([gloss, base])) => value(&gloss) + value(&base) * factor,
                        _ => value(&at.bsdf),
                    };
                    let found = at.bsdf.eval_bumped(at.bump_shadowing.as_ref(), from, to, mode);
                    assert!(close(found, expected, 2e-3), "{material} {mode:?}: {found} {expected}");
                }
            }
        });
    }
}

fn close(a: Rgb, b: Rgb, share: f32) -> bool {
    (a - b).abs().max_element() <= share * b.max_element() + 1e-6
}

/// A sample's weight is its value over its density, whichever lobe it comes from.
#[test]
fn samples_of_bumpy_surfaces_weigh_what_values_and_densities_say() {
    let mut sampler = Sampler::new(9, 0, Purpose::Test, 0);
    let draws = std::cell::RefCell::new(Sampler::new(10, 0, Purpose::Test, 0));
    for material in [
        "type = \"diffuse\"",
        "type = \"rough_plastic\"\nalpha = 0.3",
        "type = \"principled\"\nmetallic = 0.4\nroughness = 0.6",
        "type = \"principled\"\nmetallic = 0.4\nroughness = 0.6\nsheen = 0.7\nclearcoat = 0.9",
    ] {
        met(material, &mut sampler, |at, _, _| {
            let bumps = at.bump_shadowing.as_ref();
            let mut draws = draws.borrow_mut();
            for mode in [TransportMode::Radiance, TransportMode::Flux] {
                let (lobe, u) = (draws.next_1d(), draws.next_2d());
                let Some(sample) = at.bsdf.sample(at.local_wo, lobe, u, mode) else {
                    continue;
                };
                let value = at.bsdf.eval_bumped(bumps, at.local_wo, sample.wi, mode);
                let expected = value * (sample.wi.z.abs() / sample.pdf);
                let found = at.bsdf.weight_bumped(bumps, at.local_wo, &sample, mode);
                assert!(close(found, expected, 2e-3), "{material} {mode:?}: {found} {expected}");
            }
        });
    }
}

/// Walls that are metal in some places and dielectric in others, with a normal map: by camera paths, by photons that go
/// from wall to wall, and by the path tracer.
#[test]
fn photons_and_paths_find_the_same_light_on_bumpy_metal() {
    let mut suite = Suite::new(1e-2);
    for (name, fields) in [
        ("metal", "metallic = 1.0\nroughness = 0.6\n"),
        (
            "both",
            "metallic = { checkerboard = [0.0, 1.0], uv = [{ scale = 3 }] }\nroughness = 0.6\n",
        ),
        (
            "smooth",
            "metallic = { checkerboard = [0.0, 1.0], uv = [{ scale = 3 }] }\nroughness = 0.2\n",
        ),
    ] {
        let room = scene(&room(&format!(
            "base_color = [0.7, 0.5, 0.3]\nnormal_map = {STEEP}\n{fields}"
        )));
        let truth = truth(&room, 63, 16, 8);
        for (way, found) in blocks_each_way(&room, 8) {
            suite.same_blocks(&format!("{name} {way:?}"), &found, &truth, 5e-3);
            assert!(found.noise(&truth) < 0.04, "{way:?}: {}", found.noise(&truth));
        }
    }
    suite.finish();
}
