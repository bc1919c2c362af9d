//! Surfaces that emit on both sides.

use crate::surfaces::lights::setup::{BOUNDS, PATHS, PHOTONS, SIGNIFICANCE, emitter, found_once, patterned, shapes};
use beamfarm_harness::render::{blocks, scene};
use beamfarm_harness::{MeanEstimate, Suite};
use beamfarm_render::math::{PI, Ray, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::geometry::{Geometry, Object};
use beamfarm_render::world::light::{EmissionUniforms, Light, LightKind};

fn on_both((objects, mut light): (Vec<Object>, Light)) -> (Vec<Object>, Light) {
    if let LightKind::Area { two_sided, .. } = &mut light.kind {
        *two_sided = true;
    }
    (objects, light)
}

/// Photons carry the light's power in the mean, and half of them leave on either side with the stated density.
#[test]
fn photons_leave_on_both_sides() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, shape) in shapes() {
        let one = emitter(shape.clone());
        let power = one.1.power(&one.0, &BOUNDS).x;
        let (objects, light) = on_both(one);
        assert!((light.power(&objects, &BOUNDS).x / power - 2.0).abs() < 1e-6, "{name}");
        let mut rng = Sampler::new(3, 0, Purpose::Test, 0);
        let (mut mean, mut front) = (MeanEstimate::new(), MeanEstimate::new());
        for _ in 0..50_000 {
            let u = EmissionUniforms::draw(&mut rng);
            let sample = light.sample_emission(&objects, &BOUNDS, u);
            let normal = sample.normal.unwrap();
            let cos = normal.dot(sample.dir);
            assert!(cos >= 0.0 && (sample.pdf_dir - cos / (2.0 * PI)).abs() < 1e-5, "{name}");
            let outside = emitter(shape.clone())
                .1
                .sample_emission(&objects, &BOUNDS, u)
                .normal
                .unwrap();
            front.add(f64::from(u8::from(outside.dot(normal) > 0.0)));
            mean.add(f64::from(sample.power.x));
        }
        suite.mean(format!("{name}, power"), &mean, f64::from(2.0 * power));
        suite.mean(format!("{name}, sides"), &front, 0.5);
    }
    suite.finish();
}

/// Inverse densities of what is visible sum to the solid angle that the light fills, and all of it shines.
#[test]
fn both_sides_are_sampled() {
    let mut suite = Suite::new(SIGNIFICANCE);
    for (name, shape) in shapes() {
        for (objects, light) in [on_both(emitter(shape.clone())), on_both(patterned(shape))] {
            let geometry = Geometry::new(&objects);
            for from in [
                Vec3::new(0.2, 2.0, 0.4),
                Vec3::new(0.5, -1.5, -2.0),
                Vec3::new(0.5, 0.32, -1.05),
            ] {
                let mut rng = Sampler::new(11, 0, Purpose::Test, 0);
                let hit = |dir: Vec3| {
                    let ray = Ray { origin: from, dir };
                    geometry.intersect(&objects, &ray, f32::INFINITY, &|_| false)
                };
                let (mut sampled, mut met) = (MeanEstimate::new(), MeanEstimate::new());
                for _ in 0..100_000 {
                    let u = rng.next_2d();
                    let sample = light.sample_direct(&objects, from, u, rng.next_1d());
                    let seen = sample.filter(|sample| {
                        hit(sample.wi).is_some_and(|hit| (hit.t / sample.distance - 1.0).abs() < 1e-3)
                    });
                    sampled.add(seen.map_or(0.0, |sample| 1.0 / f64::from(sample.pdf)));
                    let dir = warp::uniform_sphere(rng.next_2d());
                    met.add(f64::from(u8::from(hit(dir).is_some())) * 4.0 * std::f64::consts::PI);
                    if let Some(hit) = hit(dir) {
                        let cos = -hit.ng.dot(dir);
                        assert!(light.radiance_area(cos, &hit.at).max_element() > 0.0, "{name}");
                    }
                }
                suite.same_mean_within(format!("{name} from {from}"), &sampled, &met, 1e-3);
            }
        }
    }
    suite.finish();
}

/// A sheet between two floors, enclosed by a wall, in fog, with a ball of glass on the lower floor and half a pipe next
/// to it.
const SHEET: &str = r#"
[image]
width = 24
height = 24
[render]
passes = 1200
paths = 4000
radius = 0.03
[camera]
origin = [0.0, 0.0, 0.9]
target = [0.0, 0.0, 0.0]
fov = 80.0
[world]
medium = "fog"
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.9, 0.7, 0.5]
phase = { type = "hg", g = 0.4 }
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
[[shapes]]
type = "sphere"
center = [-0.45, -0.6, -0.3]
radius = 0.35
material = "glass"
exterior = "fog"
interior = "fog"
[[shapes]]
type = "rectangle"
transform = [{ scale = 0.4 }, { rotate = { axis = [1, 0, 0], angle = 80 } }, { translate = [0, 0.2, -0.2] }]
emission = { radiance = { checkerboard = [[3, 1, 1], [0, 1, 2]] }, two_sided = true }
[[shapes]]
type = "cylinder"
p0 = [0.5, -0.9, -0.5]
p1 = [0.6, -0.4, -0.4]
radius = 0.15
emission = { radiance = [2, 1, 1], two_sided = true }
"#;

#[test]
fn all_estimators_find_the_light_once() {
    let ways = [[PHOTONS, PHOTONS, PHOTONS], [PATHS, PATHS, PATHS], [PATHS, PATHS, None]];
    found_once(&scene(SHEET), &ways, 480);
}

/// A sheet that emits on both sides equals two sheets back to back, each with half of the power.
#[test]
fn two_sheets_are_as_good() {
    let floor = r#"
[image]
width = 16
height = 16
[render]
passes = 300
[camera]
origin = [0, 0, 4]
target = [0, 0, 0]
fov = 60
[materials.wall]
type = "diffuse"
reflectance = 0.7
[[shapes]]
type = "cube"
flip_normals = true
material = "wall"
transform = [{ scale = [2, 2, 2] }]
[[shapes]]
type = "rectangle"
transform = [{ rotate = { axis = [1, 0, 0], angle = 60 } }]
"#;
    let eye = floor.replace("origin = [0, 0, 4]", "origin = [0, 0, 1.9]");
    let one = scene(&format!("{eye}emission = {{ power = 20, two_sided = true }}\n"));
    let turned = "[[shapes]]\ntype = \"rectangle\"\nflip_normals = true\n\
        transform = [{ rotate = { axis = [1, 0, 0], angle = 60 } }, { translate = [0, 0.000866, -0.0005] }]\n\
        emission = { power = 10 }\n";
    let two = scene(&format!("{eye}emission = {{ power = 10 }}\n{turned}"));
    let mut suite = Suite::new(SIGNIFICANCE);
    suite.same_blocks("sheets", &blocks(&one, 4), &blocks(&two, 4), 4e-3);
    suite.finish();
}
