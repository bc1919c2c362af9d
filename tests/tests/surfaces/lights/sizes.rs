//! Spots that are balls and suns with an angular size: their photons bring what their samples bring, and what an
//! integral says.

use crate::surfaces::lights::setup::{
    BOUNDS, PATHS, PHOTONS, RADIANCE, SAMPLES, SIGNIFICANCE, found_once, of_ball, spot, wide_sun,
};
use beamfarm_harness::quadrature::Rect;
use beamfarm_harness::render::{Blocks, average, blocks, blur, scene};
use beamfarm_harness::{Chi2, MeanEstimate, Suite};
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Frame, PI, Vec2, Vec3};
use beamfarm_render::plan::RenderPlan;
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::light::{EmissionSample, EmissionUniforms, Light, Ramp};
use glam::DVec3;
use std::f64::consts::TAU;

const AXIS: Vec3 = Vec3::new(-0.4, -0.7, 0.3);

fn emit(light: &Light, rng: &mut Sampler) -> EmissionSample {
    light.sample_emission(&[], &BOUNDS, EmissionUniforms::draw(rng))
}

/// Across each direction the ball is an even disc, wherever its photons start; a sun's directions are even in its cone.
#[test]
fn photons_start_where_their_densities_say() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let test = Chi2 {
        depth: 7,
        ..Chi2::default()
    };
    let (center, radius) = (Vec3::new(0.5, 1.0, -2.0), 0.3);
    let even = 1.0 / (PI * radius * radius);
    let side = f64::from(radius);
    let square = Rect {
        x: (-side, side),
        y: (-side, side),
    };
    for (beam_width, cutoff) in [(10.0, 25.0), (60.0, 170.0)] {
        let light = of_ball(spot(center, AXIS, beam_width, cutoff), radius, Ramp::Linear);
        let across = |rng: &mut Sampler| {
            let start = emit(&light, rng);
            assert!((start.pdf_pos / even - 1.0).abs() < 1e-5);
            Some(Frame::from_normal(start.dir).to_local(start.origin - center).truncate())
        };
        let pdf = |p: Vec2| if p.length() <= radius { even } else { 0.0 };
        suite.chi2(format!("spot of {cutoff}"), &test.plane(square, across, pdf));
    }
    for angle in [0.5f32, 30.0, 150.0] {
        let light = wide_sun(AXIS, angle);
        let (axis, cos) = (AXIS.normalize(), libm::cos(0.5 * f64::from(angle).to_radians()));
        let even = (1.0 / (TAU * (1.0 - cos))) as f32;
        let draw = |rng: &mut Sampler| {
            let start = emit(&light, rng);
            assert!((start.pdf_dir / even - 1.0).abs() < 1e-3, "{angle}: {}", start.pdf_dir);
            Some(start.dir)
        };
        // From the chord, which stays precise at small angles.
        let chord = 2.0 * libm::sin(0.25 * f64::from(angle).to_radians());
        let pdf = |dir: Vec3| match (dir - axis).as_dvec3().length() < chord {
            true => even,
            false => 0.0,
        };
        suite.chi2(format!("sun of {angle}"), &test.sphere(axis, draw, pdf));
    }
    suite.finish();
}

/// On squares across the light's direction, far from a spot, close to it, and through it.
#[test]
fn photons_bring_what_light_samples_bring() {
    const SIDE: usize = 4;
    let mut suite = Suite::new(SIGNIFICANCE);
    let at = Vec3::new(1.0, -2.0, 0.5);
    let down = Vec3::new(0.2, -1.0, -0.1);
    let balls = [(15.0f32, 40.0f32, 0.4f32), (1.0, 3.0, 0.4), (70.0, 150.0, 0.4)];
    let mut lights: Vec<(String, Light, f32, f32)> = Vec::new();
    for (beam_width, cutoff, radius) in balls {
        for ramp in [Ramp::Linear, Ramp::Smooth] {
            for (height, half) in [(3.0, 2.0), (0.45, 0.6), (0.1, 0.5), (-0.2, 0.5)] {
                let light = of_ball(spot(at, down, beam_width, cutoff), radius, ramp);
                lights.push((
                    format!("{ramp:?} spot of {cutoff}, {height} below"),
                    light,
                    height,
                    half,
                ));
            }
        }
    }
    for angle in [1.0, 40.0, 120.0] {
        lights.push((format!("sun of {angle}"), wide_sun(down, angle), 1.0, 2.0));
    }
    for (name, light, height, half) in lights {
        let to_bin = |p: Vec2| {
            let cell = (p / half + 1.0) * (0.5 * SIDE as f32);
            let inside = cell.min_element() >= 0.0 && cell.max_element() < SIDE as f32;
            inside.then(|| cell.y as usize * SIDE + cell.x as usize)
        };
        let mut means = [[MeanEstimate::new(); SIDE * SIDE]; 2];
        let mut rng = Sampler::new(3, 0, Purpose::Test, 0);
        for _ in 0..SAMPLES {
            let start = emit(&light, &mut rng);
            let t = (at.y - height - start.origin.y) / start.dir.y;
            let landed = (start.origin + start.dir * t - at) * Vec3::new(1.0, 0.0, 1.0);
            let lands = start.dir.y < 0.0 && t > 0.0;
            let photon = (
                lands.then(|| to_bin(Vec2::new(landed.x, landed.z))).flatten(),
                start.power.x,
            );
            let p = (2.0 * rng.next_2d() - 1.0) * half;
            let from = at + Vec3::new(p.x, -height, p.y);
            let sample = light.sample_direct(&[], from, rng.next_2d(), rng.next_1d());
            let flux = sample.map_or(0.0, |s| s.weight.x * s.wi.y.max(0.0) * 4.0 * half * half);
            for (means, (bin, flux)) in means.iter_mut().zip([photon, (to_bin(p), flux)]) {
                for (i, mean) in means.iter_mut().enumerate() {
                    mean.add(if bin == Some(i) { f64::from(flux) } else { 0.0 });
                }
            }
        }
        let [photons, samples] = &means;
        let mut lit = 0.0;
        for (i, (a, b)) in photons.iter().zip(samples).enumerate() {
            lit += b.mean();
            // Where too few hit for means to be normal, only the sum of all is tested.
            if a.mean() > 1e-3 * f64::from(RADIANCE.x) {
                suite.same_mean(format!("{name}, square {i}"), a, b);
            }
        }
        assert!(lit > 0.0, "{name}");
    }
    suite.finish();
}

/// A sun's irradiance across its direction is the given one, whatever its angle; a spot's is that of a point, where the
/// whole ball shines.
#[test]
fn irradiance_does_not_depend_on_the_size() {
    let mut suite = Suite::new(SIGNIFICANCE);
    let irradiance = |light: &Light, from: Vec3, normal: Vec3| -> MeanEstimate {
        let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
        let mut draw = || {
            let sample = light.sample_direct(&[], from, rng.next_2d(), rng.next_1d())?;
            Some(f64::from(sample.weight.x * sample.wi.dot(normal).max(0.0)))
        };
        (0..SAMPLES).map(|_| draw().unwrap_or(0.0)).collect()
    };
    for angle in [0.0, 0.5, 30.0, 100.0, 170.0] {
        let mean = irradiance(&wide_sun(AXIS, angle), Vec3::ZERO, -AXIS.normalize());
        suite.mean_within(format!("sun of {angle}"), &mean, f64::from(RADIANCE.x), 1e-5);
    }
    let axis = AXIS.normalize();
    for (radius, cutoff) in [(1e-12, 40.0), (0.02, 40.0), (0.4, 60.0), (0.02, 0.4)] {
        // The whole ball shines with full intensity there.
        let light = of_ball(spot(axis * -2.0, AXIS, 0.9 * cutoff, cutoff), radius, Ramp::Linear);
        let sine = 0.5 * radius;
        let is_all_lit = sine < libm::sinf(0.9 * cutoff.to_radians());
        if is_all_lit {
            let mean = irradiance(&light, Vec3::ZERO, -axis);
            let expected = f64::from(RADIANCE.x) / 4.0;
            suite.mean_within(format!("spot of {cutoff}, radius {radius}"), &mean, expected, 1e-5);
        }
    }
    suite.finish();
}

/// A floor lit from the side at 45 degrees, past the edge of a black card, seen from above.
fn behind_an_edge(light: &str) -> String {
    format!(
        r#"
[image]
width = 16
height = 2
[render]
passes = 400
paths = 4
[camera]
origin = [0.0, 5.0, 0.0]
target = [0.0, 0.0, 0.0]
up = [0, 0, -1]
projection = "orthographic"
view_width = 1.6
[materials.floor]
type = "diffuse"
reflectance = 0.5
[materials.black]
type = "diffuse"
reflectance = 0.0
two_sided = true
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = 50 }}]
material = "floor"
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = [20, 1, 20] }}, {{ translate = [21, 1, 0] }}]
material = "black"
{light}
"#
    )
}

/// Directions even in a cone, and the solid angle of each.
fn cone(axis: DVec3, cos_max: f64) -> impl Iterator<Item = (DVec3, f64)> {
    const N: usize = 48;
    let side = axis.any_orthonormal_vector();
    let other = axis.cross(side);
    (0..N * N).map(move |i| {
        let cos = 1.0 - (1.0 - cos_max) * ((i / N) as f64 + 0.5) / N as f64;
        let (sin, phi) = ((1.0 - cos * cos).sqrt(), TAU * ((i % N) as f64 + 0.5) / N as f64);
        let dir = axis * cos + (side * libm::cos(phi) + other * libm::sin(phi)) * sin;
        (dir, TAU * (1.0 - cos_max) / (N * N) as f64)
    })
}

/// The penumbra in pictures, against the integral over the part of the light that the card does not hide. Significance
/// 1e-2.
#[test]
fn shadows_have_the_penumbra_of_the_light() {
    let mut suite = Suite::new(1e-2);
    let towards = DVec3::new(1.0, 1.0, 0.0).normalize();
    let half = 8f64.to_radians();
    let sun = format!(
        "[[lights]]\ntype = \"directional\"\ndirection = [-1, -1, 0]\nirradiance = 3.0\nangle = {}\n",
        2.0 * half.to_degrees()
    );
    let (at, radius) = (DVec3::new(3.0, 3.0, 0.0), 0.5);
    let lamp = format!(
        "[[lights]]\ntype = \"spot\"\nposition = [3, 3, 0]\ntarget = [0, 0, 0]\nintensity = 3.0\nradius = {radius}\n\
        cutoff_angle = 40\nbeam_width = 35\n"
    );
    type Radiance = dyn Fn(DVec3) -> (DVec3, f64, f64);
    let of_sun = move |_: DVec3| {
        let sine = libm::sin(half);
        (towards, libm::cos(half), 3.0 / (0.5 * TAU * sine * sine))
    };
    let of_lamp = move |p: DVec3| {
        let offset = at - p;
        let sine = radius / offset.length();
        (
            offset.normalize(),
            (1.0 - sine * sine).sqrt(),
            3.0 / (0.5 * TAU * radius * radius),
        )
    };
    let cases: [(&str, String, Box<Radiance>); 2] = [("sun", sun, Box::new(of_sun)), ("spot", lamp, Box::new(of_lamp))];
    for (what, light, view) in cases {
        let means = blocks(&scene(&behind_an_edge(&light)), 2);
        let mut shades = 0;
        for (i, block) in means.blocks.iter().enumerate() {
            let (n, mut expected, mut unhidden) = (12, 0.0, 0.0);
            for j in 0..n * n {
                let x = -0.8 + 0.2 * (i as f64 + ((j % n) as f64 + 0.5) / n as f64);
                let z = 0.1 * (2.0 * ((j / n) as f64 + 0.5) / n as f64 - 1.0);
                let (axis, cos_max, radiance) = view(DVec3::new(x, 0.0, z));
                for (wi, solid_angle) in cone(axis, cos_max) {
                    // Where the line to the light reaches the height of the card, whose edge is at x = 1.
                    let passes = x + wi.x / wi.y < 1.0;
                    let arriving = radiance * solid_angle * wi.y / (n * n) as f64;
                    unhidden += arriving;
                    expected += if passes { arriving } else { 0.0 };
                }
            }
            let share: f64 = expected / unhidden;
            shades += usize::from((0.05..0.95).contains(&share));
            let radiance = expected * 0.5 / (0.5 * TAU);
            // The quadrature's error is below this.
            suite.mean_within(format!("{what}, block {i}: {share:.3} lit"), &block[0], radiance, 4e-3);
        }
        assert!(shades > 1, "{what}: {shades}");
    }
    suite.finish();
}

/// A ball of glass over a floor that is lit through it, seen from above, in fog or not.
fn under_glass(passes: u32, more: &str) -> String {
    format!(
        r#"
[image]
width = 12
height = 12
[render]
passes = {passes}
paths = 12000
radius = 0.04
[camera]
origin = [0.0, 1.0, 2.5]
target = [0.2, 0.0, 0.0]
fov = 45
[materials.floor]
type = "diffuse"
reflectance = 0.5
two_sided = true
[materials.glass]
type = "dielectric"
ior = 1.5
[materials.air]
type = "null"
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "rectangle"
transform = [{{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}, {{ scale = 4 }}]
material = "floor"
[[shapes]]
type = "sphere"
center = [0.0, 0.6, 0.0]
radius = 0.4
material = "glass"
{more}
"#
    )
}

const FOG: &str = r#"
[media.fog]
type = "homogeneous"
sigma_a = 0.05
sigma_s = 0.4
[[shapes]]
type = "cube"
material = "air"
interior = "fog"
transform = [{ scale = [1.5, 1.4, 1.5] }, { translate = [0, 1.45, 0] }]
"#;

/// A spot that shines to all sides is a ball of that power, which camera paths hit. Through glass, where its samples do
/// not reach, photons bring its light; also in fog. Significance 1e-2.
#[test]
fn photons_bring_it_through_glass() {
    let mut suite = Suite::new(1e-2);
    let light = "[[lights]]\ntype = \"spot\"\nposition = [-1, 2, 0]\ntarget = [0, 0, 0]\npower = 40\nradius = 0.2\n\
        cutoff_angle = 179.99\nbeam_width = 179.98\n";
    let ball = "[[shapes]]\ntype = \"sphere\"\ncenter = [-1, 2, 0]\nradius = 0.2\nmaterial = \"air\"\n\
        emission = { power = 40 }\n";
    for (what, fog) in [("clear", ""), ("fog", FOG)] {
        let [spot, ball] = [light, ball].map(|light| {
            // Lamps in the same surroundings: the ball in the fog is open to it.
            let light = match (fog, light.contains("shapes")) {
                ("", _) | (_, false) => light.to_owned(),
                (_, true) => format!("{light}exterior = \"fog\"\ninterior = \"fog\"\n"),
            };
            blocks(&scene(&under_glass(400, &format!("{fog}{light}"))), 4)
        });
        suite.same_blocks(what, &spot, &ball, 1e-2);
        assert!(spot.noise(&ball) < 0.015 * blur(), "{what}: {}", spot.noise(&ball));
        let without =
            under_glass(400, &format!("{fog}{light}")).replace("material = \"glass\"", "material = \"black\"");
        let [all, without] = [&spot, &blocks(&scene(&without), 4)].map(|picture| picture.whole[0].mean());
        assert!(without < 0.9 * all, "{what}: {without} of {all} without the glass");
    }
    suite.finish();
}

/// A sun with an angular size is the mean of parallel ones with random directions in it, also through glass.
#[test]
fn a_wide_sun_is_the_mean_of_parallel_ones() {
    let mut suite = Suite::new(1e-2);
    let half = 5f64.to_radians();
    let sun = |dir: DVec3, irradiance: f64, angle: f64| {
        format!(
            "[[lights]]\ntype = \"directional\"\ndirection = {:?}\nirradiance = {irradiance}\nangle = {angle}\n",
            dir.to_array()
        )
    };
    let axis = DVec3::new(0.4, -1.0, 0.1).normalize();
    let wide = blocks(&scene(&under_glass(400, &sun(axis, 3.0, 2.0 * half.to_degrees()))), 4);
    let (cos_max, mut rng) = (libm::cos(half), Sampler::new(4, 0, Purpose::Test, 0));
    let parallel = (0..200).map(|i| {
        let frame = Frame::from_normal(axis.as_vec3());
        let dir = frame.to_world(beamfarm_render::warp::uniform_cone(rng.next_2d(), cos_max as f32));
        let text = under_glass(1, &sun(dir.as_dvec3(), 3.0 * 2.0 / (1.0 + cos_max), 0.0));
        let scene = scene(&text);
        let mut settings = scene.description().defaults.job_settings();
        settings.seed = 100 + i;
        render_pass(&scene, &RenderPlan::new(&scene, settings), 0)
            .expect("a pass")
            .film
    });
    let parallel = Blocks::new(parallel, 4);
    // Kernels of a first pass blur more than those of later ones.
    suite.same_blocks("sun", &wide, &parallel, 3e-2);
    suite.finish();
}

/// Surfaces, fog and gloss by light samples, photons and beams, against the path tracer.
const HALL: &str = r#"
[image]
width = 24
height = 24
[render]
passes = 1200
paths = 4000
radius = 0.03
[camera]
origin = [0.0, 0.2, 0.9]
target = [0.0, 0.0, 0.0]
fov = 80.0
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.9, 0.7, 0.5]
phase = { type = "hg", g = 0.4 }
[materials.wall]
type = "diffuse"
reflectance = [0.7, 0.6, 0.5]
two_sided = true
[materials.gloss]
type = "rough_conductor"
eta = 1.5
k = 7.0
alpha = 0.3
[materials.air]
type = "null"
[[shapes]]
type = "cube"
material = "air"
interior = "fog"
transform = [{ scale = [1.2, 0.99, 1.2] }]
[[shapes]]
type = "rectangle"
transform = [{ rotate = { axis = [1, 0, 0], angle = -90 } }, { scale = 1.5 }, { translate = [0, -1, 0] }]
material = "wall"
[[shapes]]
type = "rectangle"
transform = [{ scale = [1.5, 1, 1] }, { translate = [0, 0, -1.3] }]
material = "wall"
[[shapes]]
type = "sphere"
center = [0.4, -0.6, -0.3]
radius = 0.3
material = "gloss"
"#;

#[test]
fn all_estimators_find_the_light_once() {
    let spot = "[[lights]]\nname = \"spot\"\ntype = \"spot\"\nposition = [-0.5, 0.5, -0.2]\ntarget = [0.3, -0.6, -0.4]\n\
        intensity = 2.0\nradius = 0.15\ncutoff_angle = 45\nfalloff = \"smooth\"\n";
    let sun = "[[lights]]\nname = \"sun\"\ntype = \"directional\"\ndirection = [-0.3, -1, -0.2]\nirradiance = 1.0\n\
        angle = 20\n";
    let ways = [[PHOTONS, PHOTONS, PHOTONS], [PATHS, PATHS, PATHS], [PATHS, PATHS, None]];
    found_once(&scene(&format!("{HALL}{spot}{sun}")), &ways, 480);
}

/// Cameras do not see them.
#[test]
fn cameras_do_not_see_them() {
    let view = "image = { width = 4, height = 4 }\nrender = { passes = 2 }\n\
        camera = { origin = [0, 0, 3], target = [0, 0, 0], fov = 40 }\n";
    let lights = "[[lights]]\ntype = \"spot\"\nposition = [0, 0, 0]\ntarget = [0, 0, 1]\npower = 10\nradius = 0.5\n\
        [[lights]]\ntype = \"directional\"\ndirection = [0, 0, 1]\nirradiance = 1\nangle = 60\n";
    let seen = average(&scene(&format!("{view}{lights}")));
    assert!(seen.beauty.pixels.iter().flatten().all(|value| *value == 0.0));
}
