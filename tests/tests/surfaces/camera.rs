//! The camera's rays: field of view, orientation, lens.

use beamfarm_harness::quadrature::Rect;
use beamfarm_harness::render::{plan_of, scene};
use beamfarm_harness::{Chi2, MeanEstimate, Suite};
use beamfarm_image::film::Film;
use beamfarm_render::cpu::pass::render_pass;
use beamfarm_render::math::{Frame, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::world::camera::{Camera, Projection};
use beamfarm_render::world::filter::PixelFilter;

fn camera(aperture: f32) -> Camera {
    let forward = Vec3::new(0.3, -0.2, -1.0).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    Camera {
        projection: Projection::Perspective,
        position: Vec3::new(0.1, 0.2, 0.3),
        frame: Frame {
            s: right,
            t: right.cross(forward),
            n: forward,
        },
        half_width: 0.5,
        shift: Vec2::ZERO,
        aperture,
        focus_distance: 2.5,
        width: 40,
        height: 20,
        filter: PixelFilter::Box,
    }
}

#[test]
fn image_spans_the_field_of_view_with_square_pixels() {
    let camera = camera(0.0);
    // Tangents of the angles to the right and up.
    for (x, y, right, up) in [
        (20.0, 10.0, 0.0, 0.0),
        (40.0, 10.0, 0.5, 0.0),
        (0.0, 10.0, -0.5, 0.0),
        (20.0, 0.0, 0.0, 0.25),
        (20.0, 20.0, 0.0, -0.25),
        (30.0, 15.0, 0.25, -0.125),
    ] {
        let ray = camera.ray(Vec2::new(x, y), Vec2::new(0.1, 0.9));
        assert_eq!(ray.origin, camera.position);
        assert!((ray.dir.length() - 1.0).abs() < 1e-6);
        let local = camera.frame.to_local(ray.dir);
        assert!((local.x / local.z - right).abs() < 1e-6);
        assert!((local.y / local.z - up).abs() < 1e-6);
    }
}

/// All rays of an image point meet in one point of the focal plane, the one that a pinhole sees there.
#[test]
fn points_in_focus_are_sharp() {
    let camera = camera(0.4);
    let pinhole = Camera {
        aperture: 0.0,
        ..camera
    };
    let mut rng = Sampler::new(1, 0, Purpose::Test, 0);
    for _ in 0..200 {
        let image = rng.next_2d() * Vec2::new(40.0, 20.0);
        let straight = pinhole.ray(image, Vec2::ZERO);
        let sharp = straight.at(camera.focus_distance / straight.dir.dot(camera.frame.n));
        for _ in 0..10 {
            let ray = camera.ray(image, rng.next_2d());
            let offset = ray.origin - camera.position;
            assert!(offset.dot(camera.frame.n).abs() < 1e-6 && offset.length() <= 0.4 + 1e-6);
            let t = (camera.focus_distance - offset.dot(camera.frame.n)) / ray.dir.dot(camera.frame.n);
            assert!((ray.at(t) - sharp).length() < 1e-5);
        }
    }
}

#[test]
fn lens_is_sampled_uniformly() {
    let camera = camera(0.4);
    let test = Chi2 {
        depth: 8,
        ..Chi2::default()
    };
    let domain = Rect {
        x: (-0.4, 0.4),
        y: (-0.4, 0.4),
    };
    let result = test.plane(
        domain,
        |rng| {
            let ray = camera.ray(Vec2::new(7.0, 13.0), rng.next_2d());
            let local = camera.frame.to_local(ray.origin - camera.position);
            Some(local.truncate())
        },
        |p| {
            if p.length() <= 0.4 {
                1.0 / (std::f32::consts::PI * 0.16)
            } else {
                0.0
            }
        },
    );
    let mut suite = Suite::new(0.01);
    suite.chi2("lens", &result);
    suite.finish();
}

fn loaded(text: &str) -> Camera {
    scene(text).description().camera
}

/// Where a ray meets the plane z = -1; the camera is at the origin.
fn on_plane(camera: &Camera, image: Vec2) -> Vec2 {
    let dir = camera.ray(image, Vec2::ZERO).dir;
    dir.truncate() / -dir.z
}

/// Mitsuba 3.9.1: where rays through a corner, the middle and the opposite corner of the image meet the plane at
/// distance 1, over tan 30 degrees. A film of 40 x 20 pixels, a field of view of 60 degrees.
#[test]
fn windows_and_principal_points_are_those_of_mitsuba() {
    for (image, camera, expected) in [
        ("", "", [(-1.0, 0.5), (0.0, 0.0), (1.0, -0.5)]),
        ("", "principal_point = [0.1, 0]", [(-0.8, 0.5), (0.2, 0.0), (1.2, -0.5)]),
        (
            "",
            "principal_point = [0, 0.1]",
            [(-1.0, 0.4), (0.0, -0.1), (1.0, -0.6)],
        ),
        (
            "",
            "principal_point = [0.1, 0.2], fov_axis = \"y\"",
            [(-1.6, 0.6), (0.4, -0.4), (2.4, -1.4)],
        ),
        ("", "flip_x = true", [(1.0, 0.5), (0.0, 0.0), (-1.0, -0.5)]),
        (
            "",
            "flip_x = true, principal_point = [0.1, 0]",
            [(0.8, 0.5), (-0.2, 0.0), (-1.2, -0.5)],
        ),
        (
            "crop = { x = 10, y = 5, width = 20, height = 10 }",
            "principal_point = [0.1, 0.2]",
            [(-0.3, 0.05), (0.2, -0.2), (0.7, -0.45)],
        ),
        (
            "crop = { x = 10, y = 5, width = 5, height = 10 }",
            "",
            [(-0.5, 0.25), (-0.375, 0.0), (-0.25, -0.25)],
        ),
        (
            "crop = { x = 10, y = 5, width = 5, height = 10 }",
            "fov_axis = \"smaller\"",
            [(-1.0, 0.5), (-0.75, 0.0), (-0.5, -0.5)],
        ),
    ] {
        let text = format!(
            "image = {{ width = 40, height = 20, {image} }}
            camera = {{ origin = [0, 0, 0], target = [0, 0, -1], fov = 60, {camera} }}"
        );
        let camera = loaded(&text.replace(", }", " }"));
        let size = Vec2::new(camera.width as f32, camera.height as f32);
        let tan = libm::tanf((30.0f32).to_radians());
        for (at, (x, y)) in [0.0, 0.5, 1.0].into_iter().zip(expected) {
            let found = on_plane(&camera, size * at) / tan;
            assert!((found - Vec2::new(x, y)).length() < 1e-5, "{text} at {at}: {found}");
        }
    }
}

/// Mitsuba 3.9.1: a window of 7 x 5 pixels of a rectangle of radiance 1, whose edges lie within pixels, with five
/// reconstruction filters; 131072 samples per pixel. Mitsuba's Gaussian is a fit that is off by up to 8e-4 of its
/// height.
#[rustfmt::skip]
const MITSUBA: [(&str, [[f64; 7]; 5]); 5] = [
    ("\"box\"", [
        [0.0, 0.0, 0.0637, 1.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0637, 1.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0637, 1.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0483, 0.7575, 0.7575, 0.7575, 0.7575],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]),
    ("\"tent\"", [
        [0.0, 0.0, 0.1589, 0.9048, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.1589, 0.9048, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.1589, 0.9048, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.1151, 0.6554, 0.7244, 0.7243, 0.7244],
        [0.0, 0.0, 0.0060, 0.0343, 0.0379, 0.0379, 0.0379],
    ]),
    ("{ type = \"tent\", radius = 1.6 }", [
        [0.0, 0.0052, 0.2645, 0.7903, 0.9998, 1.0, 1.0],
        [0.0, 0.0052, 0.2645, 0.7903, 0.9998, 1.0, 1.0],
        [0.0, 0.0051, 0.2585, 0.7722, 0.9769, 0.9771, 0.9771],
        [0.0, 0.0034, 0.1718, 0.5131, 0.6491, 0.6493, 0.6493],
        [0.0, 0.0010, 0.0497, 0.1486, 0.1880, 0.1881, 0.1881],
    ]),
    ("\"gaussian\"", [
        [0.0, 0.0019, 0.1913, 0.8706, 0.9993, 1.0, 1.0],
        [0.0, 0.0019, 0.1913, 0.8707, 0.9993, 1.0, 1.0],
        [0.0, 0.0018, 0.1902, 0.8660, 0.9940, 0.9946, 0.9945],
        [0.0, 0.0013, 0.1335, 0.6075, 0.6973, 0.6978, 0.6978],
        [0.0, 0.0002, 0.0156, 0.0708, 0.0813, 0.0813, 0.0814],
    ]),
    ("{ type = \"gaussian\", stddev = 0.9 }", [
        [0.0045, 0.0577, 0.3147, 0.7353, 0.9595, 0.9982, 1.0],
        [0.0045, 0.0574, 0.3132, 0.7313, 0.9545, 0.9929, 0.9945],
        [0.0041, 0.0532, 0.2901, 0.6775, 0.8842, 0.9199, 0.9215],
        [0.0029, 0.0371, 0.2024, 0.4727, 0.6169, 0.6420, 0.6433],
        [0.0013, 0.0166, 0.0905, 0.2114, 0.2759, 0.2871, 0.2877],
    ]),
];

#[test]
fn filters_are_those_of_mitsuba_at_the_border_too() {
    for (filter, expected) in MITSUBA {
        let camera = loaded(&format!(
            "image = {{ width = 14, height = 10, filter = {filter}, crop = {{ x = 3, y = 2, width = 7, height = 5 }} }}
            camera = {{ origin = [0, 0, 0], target = [0, 0, -1], fov = 60, flip_x = true, principal_point = [0.05, -0.1] }}"
        ));
        // Filter and rectangle are products of functions of x and of y.
        const STEPS: u32 = 4000;
        let size = [camera.width, camera.height];
        let pictures = [0, 1].map(|axis| {
            let mut sum = vec![0.0; (size[0] * size[1]) as usize];
            for i in 0..STEPS {
                // Along the other axis, a low-discrepancy sequence.
                let mut u = Vec2::splat((i as f32 + 0.5) / STEPS as f32);
                u[1 - axis] = (f64::from(i) * 0.618_033_988_75).fract() as f32;
                let at = |x, y| camera.sample(x, y, u);
                let mut film = Film::new(size[0], size[1]);
                for (k, pixel) in (0..).zip(&mut film.pixels) {
                    let at = on_plane(&camera, at(k % size[0], k / size[0]));
                    pixel[0] = f32::from((at - Vec2::new(-0.97, 1.02))[axis].abs() < 1.0);
                }
                if camera.filter.spreads() {
                    camera.filter.reconstruct([&mut film], u);
                }
                for (sum, pixel) in sum.iter_mut().zip(&film.pixels) {
                    *sum += f64::from(pixel[0]) / f64::from(STEPS);
                }
            }
            sum
        });
        let tolerance = match camera.filter {
            PixelFilter::Gaussian { .. } => 2e-3,
            _ => 5e-4,
        };
        for (y, row) in (0..).zip(expected) {
            for (x, expected) in (0..).zip(row) {
                let at = (y * size[0] + x) as usize;
                let found = pictures[0][at] * pictures[1][at];
                assert!(
                    (found - expected).abs() < tolerance,
                    "{filter} at {x} {y}: {found}, not {expected}"
                );
            }
        }
    }
}

/// Narrow filters by their densities, at the image's border and away from it.
#[test]
fn filters_are_sampled_in_proportion_to_their_values() {
    let mut suite = Suite::new(0.01);
    let tent = |x: f32| (1.0 - 2.0 * x.abs()).max(0.0);
    let gaussian = |x: f32| (libm::expf(-8.0 * x * x) - libm::expf(-8.0)).max(0.0);
    for (name, filter, value) in [
        ("tent", PixelFilter::Tent { radius: 0.5 }, &tent as &dyn Fn(f32) -> f32),
        ("gaussian", PixelFilter::Gaussian { stddev: 0.25 }, &gaussian),
    ] {
        for pixel in [[0, 0], [1, 4], [4, 4]] {
            let size = [9, 5];
            let integral = |pixel: u32, size: u32| {
                let step = size as f32 / 20_000.0;
                let at = |i: u32| value((i as f32 + 0.5) * step - pixel as f32 - 0.5);
                (0..20_000).map(|i| f64::from(at(i) * step)).sum::<f64>() as f32
            };
            let total = integral(pixel[0], size[0]) * integral(pixel[1], size[1]);
            let domain = Rect {
                x: (0.0, 9.0),
                y: (0.0, 5.0),
            };
            suite.chi2(
                format!("{name} at {pixel:?}"),
                &Chi2::default().plane(
                    domain,
                    |s: &mut Sampler| Some(filter.sample(pixel, size, s.next_2d())),
                    |p: Vec2| {
                        let d = p - Vec2::new(pixel[0] as f32, pixel[1] as f32) - 0.5;
                        value(d.x) * value(d.y) / total
                    },
                ),
            );
        }
    }
    suite.finish();
}

/// Fog, edges and a spot; `image` and `seed` are filled in.
const FOGGY: &str = r#"
image = { IMAGE }
render = { passes = 300, paths = 400, seed = SEED }
world = { medium = "fog" }
camera = { origin = [0, 0.4, 2.5], target = [0, 0, 0], fov = 50, principal_point = [0.04, -0.03] }
[media.fog]
type = "homogeneous"
sigma_a = 0.1
sigma_s = [0.4, 0.3, 0.2]
[materials.glass]
type = "dielectric"
ior = 1.5
[[shapes]]
type = "cube"
flip_normals = true
transform = [{ scale = 3.0 }]
[[shapes]]
type = "sphere"
radius = 0.3
material = "glass"
[[shapes]]
type = "cylinder"
p0 = [0.5, -0.5, 0.1]
p1 = [0.4, 0.3, -0.2]
radius = 0.15
emission = { power = [3, 2, 1] }
[[lights]]
type = "spot"
position = [-1.0, 1.5, 0.5]
target = [0.0, 0.0, 0.0]
intensity = 10.0
"#;

/// With beams and everything else: the pixels of a window under a wide tent are means of a picture eight times as fine,
/// weighted by the part of the tent within the window.
#[test]
fn a_window_under_a_tent_is_the_weighted_picture() {
    const FINE: usize = 8;
    let (radius, x0, y0, width, height) = (1.5, 3, 2, 6, 5);
    let passes = |image: &str, seed: &str| {
        let scene = scene(&FOGGY.replace("IMAGE", image).replace("SEED", seed));
        let plan = plan_of(&scene);
        (0..scene.description().defaults.passes)
            .map(|pass_index| render_pass(&scene, &plan, pass_index).expect("a pass").film)
            .collect::<Vec<_>>()
    };
    let tents = passes(
        "width = 12, height = 9, filter = { type = \"tent\", radius = 1.5 }, crop = { x = 3, y = 2, width = 6, height = 5 }",
        "1",
    );
    let fine = passes("width = 96, height = 72", "2");
    // By fine pixel along one axis of the window.
    let weights = |pixel: usize, size: usize| -> Vec<f64> {
        let value = |i: usize| {
            let x = (i as f64 + 0.5) / FINE as f64 - pixel as f64 - 0.5;
            (1.0 - x.abs() / radius).max(0.0)
        };
        let total: f64 = (0..size * FINE).map(value).sum();
        (0..size * FINE).map(|i| value(i) / total).collect()
    };
    // 1e-3 of the value for edges within fine pixels.
    let mut suite = Suite::new(1e-3);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (across, down) = (weights(x, width), weights(y, height));
        let tent: MeanEstimate = tents
            .iter()
            .map(|film| f64::from(film.pixels[y * width + x][0]))
            .collect();
        let weighted: MeanEstimate = fine
            .iter()
            .map(|film| {
                let row = |j: usize| &film.pixels[(y0 * FINE + j) * film.width as usize + x0 * FINE..];
                let sum = |(j, weight): (usize, &f64)| {
                    let pixels = row(j).iter().zip(&across);
                    weight * pixels.map(|(p, w)| f64::from(p[0]) * w).sum::<f64>()
                };
                down.iter().enumerate().map(sum).sum::<f64>()
            })
            .collect();
        suite.same_mean_within(format!("{x} {y}"), &tent, &weighted, 1e-3);
    }
    suite.finish();
}
