//! Light from every kind of source, scattered once in thin fog, against numerical integration.

use beamfarm_harness::Suite;
use beamfarm_harness::render::{blocks, blur, scene_with};
use beamfarm_harness::z_test::two_sided;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Fog so thin that light scattered twice is below 1e-3 of light scattered once.
const SIGMA_S: [f64; 3] = [1e-4, 5e-5, 2e-4];
const SIGMA_A: [f64; 3] = [0.1, 0.3, 0.0];
const SIZE: usize = 4;
const BLOCK: usize = 2;
/// Half the side of the cube of fog.
const HALF: f64 = 3.0;
/// The position of a wall across the cube.
const WALL: f64 = -2.5;

/// A round luminaire: 683, 341.5 and 0 cd at 0, 40 and 80 degrees.
const LAMP: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 6.83 3 1 1 2 0 0 0\n1 1 10\n0 40 80\n0\n100 50 0\n";

/// Light that arrives at a point from one direction of a sum.
struct Arriving {
    /// Unit, towards the light.
    wi: DVec3,
    /// Distance through fog.
    distance: f64,
    /// Irradiance across `wi`, the same for red, green and blue.
    irradiance: f64,
}

struct Case {
    name: &'static str,
    toml: String,
    arriving: Box<dyn Fn(DVec3) -> Vec<Arriving>>,
}

fn from_point(at: DVec3, x: DVec3, intensity: f64) -> Arriving {
    let offset = at - x;
    let distance = offset.length();
    Arriving {
        wi: offset / distance,
        distance,
        irradiance: intensity / (distance * distance),
    }
}

/// Distance to the cube's surface.
fn way_out(x: DVec3, dir: DVec3) -> f64 {
    let wall = |axis: usize| (HALF.copysign(dir[axis]) - x[axis]) / dir[axis];
    (0..3).map(wall).fold(f64::INFINITY, f64::min)
}

fn sphere(center: DVec3, radius: f64, radiance: f64, x: DVec3) -> Vec<Arriving> {
    let offset = center - x;
    let (d, axis) = (offset.length(), offset.normalize());
    let side = axis.any_orthonormal_vector();
    let other = axis.cross(side);
    let cos_max = (1.0 - (radius / d) * (radius / d)).sqrt();
    let n = 8;
    let mut all = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let cos = 1.0 - (1.0 - cos_max) * (i as f64 + 0.5) / n as f64;
            let sin = (1.0 - cos * cos).sqrt();
            let (s, c) = libm::sincos(TAU * (j as f64 + 0.5) / n as f64);
            let wi = axis * cos + side * (sin * c) + other * (sin * s);
            let root = (radius * radius - d * d * sin * sin).max(0.0).sqrt();
            all.push(Arriving {
                wi,
                distance: d * cos - root,
                irradiance: radiance * TAU * (1.0 - cos_max) / (n * n) as f64,
            });
        }
    }
    all
}

/// Light from a ball seen from outside, whose `radiance` depends on direction. Along each chord it starts where photons
/// do that are even across the ball: the position is distributed as the sine of an even angle.
fn see_through(center: DVec3, radius: f64, radiance: &dyn Fn(DVec3) -> f64, x: DVec3) -> Vec<Arriving> {
    let n = 4;
    let chords = sphere(center, radius, 1.0, x);
    let along = chords.iter().flat_map(|chord| {
        let half = (center - x).dot(chord.wi) - chord.distance;
        (0..n).map(move |i| Arriving {
            wi: chord.wi,
            distance: chord.distance + half * (1.0 + libm::sin(PI * ((f64::from(i) + 0.5) / f64::from(n) - 0.5))),
            irradiance: chord.irradiance / f64::from(n) * radiance(-chord.wi),
        })
    });
    along.filter(|arriving| arriving.irradiance > 0.0).collect()
}

/// A square of half side `half` around `center` that shines downwards and is black from above.
fn panel(center: DVec3, half: f64, radiance: f64, x: DVec3) -> Vec<Arriving> {
    let n = 24;
    let mut all = Vec::new();
    for i in 0..n * n {
        let at = DVec2::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5) / n as f64 * 2.0 - 1.0;
        let p = center + DVec3::new(at.x, 0.0, at.y) * half;
        let cos = (p - x).normalize().y;
        if cos > 0.0 {
            let area = 4.0 * half * half / (n * n) as f64;
            all.push(from_point(p, x, radiance * area * cos));
        }
    }
    all
}

fn cases() -> Vec<Case> {
    let spot_at = DVec3::new(-1.2, 0.9, 0.4);
    let spot_axis = DVec3::new(1.3, -0.8, -0.6).normalize();
    let laser_at = DVec3::new(-1.6, -0.4, 0.6);
    let laser_axis = DVec3::new(1.5, 0.4, -0.9).normalize();
    let sun = DVec3::new(0.3, -1.0, -0.5).normalize();
    let point = DVec3::new(0.4, 1.7, -0.8);
    let ball = DVec3::new(-0.3, 1.9, 0.3);
    let sun_below = DVec3::new(0.02, 1.0, -0.03).normalize();
    let near = DVec3::new(0.1, 0.95, 0.2);
    vec![
        Case {
            name: "point",
            toml: format!(
                "[[lights]]\ntype = \"point\"\nposition = {:?}\nintensity = 2.0\n",
                point.to_array()
            ),
            arriving: Box::new(move |x| vec![from_point(point, x, 2.0)]),
        },
        Case {
            name: "spot",
            toml: format!(
                "[[lights]]\ntype = \"spot\"\nposition = {:?}\ntarget = {:?}\nintensity = 2.0\ncutoff_angle = 25.0\nbeam_width = 10.0\n",
                spot_at.to_array(),
                (spot_at + spot_axis).to_array()
            ),
            arriving: Box::new(move |x| {
                let angle = (x - spot_at).normalize().dot(spot_axis).clamp(-1.0, 1.0);
                let angle = libm::acos(angle).to_degrees();
                let falloff = ((25.0 - angle) / 15.0).clamp(0.0, 1.0);
                vec![from_point(spot_at, x, 2.0 * falloff)]
            }),
        },
        Case {
            name: "spot of a ball",
            toml: format!(
                "[[lights]]\ntype = \"spot\"\nposition = {:?}\ntarget = {:?}\nintensity = 2.0\nradius = 0.25\n\
                cutoff_angle = 50.0\nbeam_width = 10.0\nfalloff = \"smooth\"\n",
                spot_at.to_array(),
                (spot_at + spot_axis).to_array()
            ),
            arriving: Box::new(move |x| {
                let [wide, full] = [50f64, 10.0].map(|degrees| libm::cos(degrees.to_radians()));
                let radiance = move |dir: DVec3| {
                    let share = ((dir.dot(spot_axis) - wide) / (full - wide)).clamp(0.0, 1.0);
                    2.0 / (PI * 0.25 * 0.25) * share * share * (3.0 - 2.0 * share)
                };
                see_through(spot_at, 0.25, &radiance, x)
            }),
        },
        Case {
            name: "laser",
            toml: format!(
                "[[lights]]\ntype = \"laser\"\nposition = {:?}\ntarget = {:?}\nradius = 0.5\npower = {}\n",
                laser_at.to_array(),
                (laser_at + laser_axis).to_array(),
                2.0 * PI * 0.25,
            ),
            arriving: Box::new(move |x| {
                let offset = x - laser_at;
                let is_in = offset.cross(laser_axis).length() < 0.5 && offset.dot(laser_axis) > 0.0;
                let arriving = Arriving {
                    wi: -laser_axis,
                    distance: offset.dot(laser_axis),
                    irradiance: 2.0,
                };
                is_in.then_some(arriving).into_iter().collect()
            }),
        },
        Case {
            name: "laser with a Gaussian profile",
            toml: format!(
                "[[lights]]\ntype = \"laser\"\nposition = {:?}\ndirection = {:?}\nradius = 0.6\nirradiance = 3.0\n\
                profile = \"gaussian\"\n",
                laser_at.to_array(),
                laser_axis.to_array(),
            ),
            arriving: Box::new(move |x| {
                let offset = x - laser_at;
                let across2 = offset.cross(laser_axis).length_squared() / 0.36;
                let is_in = across2 < 9.0 && offset.dot(laser_axis) > 0.0;
                let arriving = Arriving {
                    wi: -laser_axis,
                    distance: offset.dot(laser_axis),
                    irradiance: 3.0 * libm::exp(-2.0 * across2),
                };
                is_in.then_some(arriving).into_iter().collect()
            }),
        },
        Case {
            name: "lamp by a table",
            toml: format!(
                "[[lights]]\ntype = \"point\"\nposition = {:?}\ntarget = {:?}\nies = \"lamp.ies\"\nscale = 2\n",
                spot_at.to_array(),
                (spot_at + spot_axis).to_array()
            ),
            arriving: Box::new(move |x| {
                let angle = (x - spot_at).normalize().dot(spot_axis).clamp(-1.0, 1.0);
                let share = (1.0 - libm::acos(angle).to_degrees() / 80.0).max(0.0);
                vec![from_point(spot_at, x, 2.0 * share)]
            }),
        },
        Case {
            name: "sun with an angle",
            toml: format!(
                "[[lights]]\ntype = \"directional\"\ndirection = {:?}\nirradiance = 2.0\nangle = 30.0\n",
                sun.to_array()
            ),
            arriving: Box::new(move |x| {
                // Of a ball that fills the cone.
                let sine = libm::sin(15f64.to_radians());
                let mut all = sphere(x - sun, sine, 2.0 / (PI * sine * sine), x);
                all.iter_mut()
                    .for_each(|arriving| arriving.distance = way_out(x, arriving.wi));
                all
            }),
        },
        Case {
            name: "directional",
            toml: format!(
                "[[lights]]\ntype = \"directional\"\ndirection = {:?}\nirradiance = 2.0\n",
                sun.to_array()
            ),
            arriving: Box::new(move |x| {
                vec![Arriving {
                    wi: -sun,
                    distance: way_out(x, -sun),
                    irradiance: 2.0,
                }]
            }),
        },
        Case {
            name: "environment",
            toml: "[[lights]]\ntype = \"environment\"\nradiance = 0.5\n".into(),
            arriving: Box::new(|x| {
                let n = 32;
                let dir = |i: usize| {
                    let z = ((i / n) as f64 + 0.5) / n as f64 * 2.0 - 1.0;
                    let (s, c) = libm::sincos(TAU * ((i % n) as f64 + 0.5) / n as f64);
                    let r = (1.0 - z * z).sqrt();
                    DVec3::new(r * c, r * s, z)
                };
                let arriving = |wi| Arriving {
                    wi,
                    distance: way_out(x, wi),
                    irradiance: 0.5 * 4.0 * PI / (n * n) as f64,
                };
                let reaches = |wi: &DVec3| wi.z >= 0.0 || (WALL - x.z) / wi.z > way_out(x, *wi);
                (0..n * n).map(dir).filter(reaches).map(arriving).collect()
            }),
        },
        Case {
            name: "sphere",
            toml: format!(
                "[[shapes]]\ntype = \"sphere\"\ncenter = {:?}\nradius = 0.3\nmaterial = \"black\"\nemission = {{ radiance = 3.0 }}\n",
                ball.to_array()
            ),
            arriving: Box::new(move |x| sphere(ball, 0.3, 3.0, x)),
        },
        Case {
            name: "near panel",
            toml: format!(
                "[[shapes]]\ntype = \"rectangle\"\nmaterial = \"black\"\nemission = {{ radiance = 1.0 }}\n\
                transform = [{{ scale = 0.5 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = {:?} }}]\n",
                near.to_array()
            ),
            arriving: Box::new(move |x| panel(near, 0.5, 1.0, x)),
        },
        Case {
            name: "panel with a spread",
            toml: format!(
                "[[shapes]]\ntype = \"rectangle\"\nmaterial = \"black\"\n\
                emission = {{ power = {}, spread = 140 }}\n\
                transform = [{{ scale = 0.5 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = {:?} }}]\n",
                PI,
                near.to_array()
            ),
            arriving: Box::new(move |x| {
                let half = 70f64.to_radians();
                let mut all = panel(near, 0.5, 1.0, x);
                for arriving in &mut all {
                    let angle = libm::acos(arriving.wi.y);
                    let share = (libm::tan(half) - libm::tan(angle)) / (libm::tan(half) - half);
                    arriving.irradiance *= share.max(0.0);
                }
                all
            }),
        },
        Case {
            name: "point and panel and sun",
            toml: format!(
                "[[lights]]\ntype = \"point\"\nposition = {:?}\nintensity = 0.5\n\
                [[shapes]]\ntype = \"rectangle\"\nmaterial = \"black\"\nemission = {{ radiance = 1.0 }}\n\
                transform = [{{ scale = 0.5 }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = {:?} }}]\n\
                [[lights]]\ntype = \"directional\"\ndirection = {:?}\nirradiance = 0.3\n",
                point.to_array(),
                near.to_array(),
                sun_below.to_array(),
            ),
            arriving: Box::new(move |x| {
                let mut all = panel(near, 0.5, 1.0, x);
                // The panel blocks the point light for points in its shadow; the sun comes from below.
                let to = point - x;
                let at = x + to * ((near.y - x.y) / to.y);
                let off = (at - near).abs();
                if x.y > near.y || off.x > 0.5 || off.z > 0.5 {
                    all.push(from_point(point, x, 0.5));
                }
                all.push(Arriving {
                    wi: -sun_below,
                    distance: way_out(x, -sun_below),
                    irradiance: 0.3,
                });
                all
            }),
        },
    ]
}

fn text(lights: &str, g: f64) -> String {
    format!(
        r#"
[image]
width = {SIZE}
height = {SIZE}
[render]
passes = 2500
paths = 4
seed = 12
[camera]
origin = [0.0, 0.0, 2.0]
target = [0.0, 0.0, 0.0]
fov = 40.0
[media.fog]
type = "homogeneous"
sigma_a = {SIGMA_A:?}
sigma_s = {SIGMA_S:?}
phase = {{ type = "hg", g = {g} }}
[materials.boundary]
type = "null"
[[shapes]]
type = "cube"
material = "boundary"
interior = "fog"
transform = [ {{ scale = {HALF} }} ]
# What ends all camera rays.
[materials.black]
type = "diffuse"
reflectance = 0.0
[[shapes]]
type = "rectangle"
material = "black"
transform = [ {{ scale = {HALF} }}, {{ translate = [0.0, 0.0, {WALL}] }} ]
{lights}
"#
    )
}

/// Asymmetries of the phase functions.
const ASYMMETRIES: [f64; 3] = [0.0, 0.7, -0.4];

/// Radiance through a pixel, by asymmetry.
fn pixel(case: &Case, x: usize, y: usize) -> [DVec3; 3] {
    let origin = DVec3::new(0.0, 0.0, 2.0);
    let tan = libm::tan(20f64.to_radians());
    let mut sums = [DVec3::ZERO; 3];
    // A laser's beam has sharp edges.
    let (sub, n) = match case.name.starts_with("laser") {
        true => (12, 300),
        false => (2, 100),
    };
    for i in 0..sub * sub {
        let within = DVec2::new((i % sub) as f64 + 0.5, (i / sub) as f64 + 0.5) / sub as f64;
        let p = (DVec2::new(x as f64, y as f64) + within) / SIZE as f64 * 2.0 - 1.0;
        let dir = DVec3::new(p.x * tan, -p.y * tan, -1.0).normalize();
        let length = (WALL - origin.z) / dir.z;
        for k in 0..n {
            let t = length * (k as f64 + 0.5) / n as f64;
            for light in (case.arriving)(origin + dir * t) {
                let mut scattered = DVec3::ZERO;
                for c in 0..3 {
                    let sigma_t = SIGMA_A[c] + SIGMA_S[c];
                    let tr = libm::exp(-sigma_t * (t + light.distance));
                    scattered[c] = SIGMA_S[c] * tr * light.irradiance * length / n as f64;
                }
                for (sum, g) in sums.iter_mut().zip(ASYMMETRIES) {
                    let q = 1.0 + g * g - 2.0 * g * light.wi.dot(dir);
                    *sum += scattered * ((1.0 - g * g) / (4.0 * PI * q * q.sqrt()));
                }
            }
        }
    }
    sums.map(|sum| sum / (sub * sub) as f64)
}

/// Significance 1e-2 for all cases together.
#[test]
fn light_of_every_kind_scattered_once_is_the_integral() {
    let mut suite = Suite::new(1e-2);
    let columns = SIZE / BLOCK;
    for case in cases() {
        let expected = |i: usize| {
            let mut expected = [DVec3::ZERO; 3];
            for j in 0..BLOCK * BLOCK {
                let x = i % columns * BLOCK + j % BLOCK;
                let y = i / columns * BLOCK + j / BLOCK;
                for (sum, value) in expected.iter_mut().zip(pixel(&case, x, y)) {
                    *sum += value / (BLOCK * BLOCK) as f64;
                }
            }
            expected
        };
        let expected: Vec<_> = (0..columns * columns).map(expected).collect();
        for (number, g) in ASYMMETRIES.into_iter().enumerate() {
            let means = blocks(
                &scene_with(&text(&case.toml, g), &[("lamp.ies", LAMP.as_bytes())]),
                BLOCK,
            );
            assert_eq!(means.blocks.len(), expected.len());
            for (i, (block, expected)) in means.blocks.iter().zip(&expected).enumerate() {
                let expected = expected[number];
                for c in 0..3 {
                    let name = format!("{}, g = {g}, block {i}, channel {c}", case.name);
                    // Light scattered twice and the quadrature add another, independent error of 2e-3.
                    let off = (block[c].mean() - expected[c]).abs();
                    let error = block[c].std_error().hypot(2e-3 * expected[c]);
                    suite.p_value(format!("{name}: {off:e} off, error {error:e}"), two_sided(off / error));
                    // No rare bright samples, which the mean would hide.
                    let error = block[c].std_error() / expected[c];
                    assert!(error < 0.03 * blur(), "{}, g = {g}: {error}", case.name);
                }
            }
        }
    }
    suite.finish();
}
