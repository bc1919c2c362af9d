//! Cylinders: where rays meet them.

use beamfarm_harness::render::scene;
use beamfarm_render::math::{Ray, Vec2, Vec3};
use beamfarm_render::sampler::{Purpose, Sampler};
use beamfarm_render::warp;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::geometry::{Geometry, SurfaceHit};
use glam::{DVec2, DVec3};

fn loaded(shape: &str) -> SceneDescription {
    let text = format!(
        "image = {{ width = 1, height = 1 }}
        camera = {{ origin = [0, 0, 0], target = [0, 0, -1], fov = 60 }}
        [[shapes]]\ntype = \"cylinder\"\n{shape}"
    );
    scene(&text).description().clone()
}

fn hit(scene: &SceneDescription, origin: Vec3, dir: Vec3) -> Option<SurfaceHit> {
    let ray = Ray {
        origin,
        dir: dir.normalize(),
    };
    Geometry::new(&scene.objects).intersect(&scene.objects, &ray, f32::INFINITY, &|_| false)
}

/// Fields; a ray's origin and direction; the distance, normal and UV that Mitsuba 3.9.1 gives.
type Row = (&'static str, [f32; 3], [f32; 3], f32, [f32; 3], [f32; 2]);

#[rustfmt::skip]
const MITSUBA: [Row; 10] = [
    ("", [5.0, 1.0, 0.8], [-0.979693, -0.192791, -0.055083], 4.105352, [0.97802, 0.20853, 0.0], [0.03343, 0.57386]),
    ("", [-3.0, 4.0, 1.5], [0.597022, -0.79603, -0.099504], 6.029926, [0.6, -0.8, 0.0], [0.85242, 0.9]),
    ("p0 = [1, 2, 3]\np1 = [2, 4, 2.5]\nradius = 0.4", [6.5, 4.0, 3.05], [-0.979693, -0.192791, -0.055083], 4.609247,
        [0.88514, -0.37304, 0.27814], [0.02779, 0.6303]),
    ("p0 = [1, 2, 3]\np1 = [2, 4, 2.5]\nradius = 0.4", [-1.5, 7.0, 3.75], [0.59317, -0.781728, -0.192486], 4.658722,
        [-0.79531, 0.48767, 0.36008], [0.63394, 0.58154]),
    ("p0 = [0, 0, 1]\np1 = [0.3, 0.1, -1]\nradius = 0.5", [5.15, 1.05, 0.3], [-0.979404, -0.195881, 0.04897], 4.681636,
        [0.96505, 0.21107, 0.15531], [0.96552, 0.2742]),
    ("p0 = [0, 0, 1]\np1 = [0.3, 0.1, -1]\nradius = 0.5", [-2.85, 4.05, 1.0], [0.597022, -0.79603, -0.099504], 4.501493,
        [-0.45581, 0.88976, -0.02388], [0.67436, 0.218]),
    ("transform = [{ scale = [-1, 1, 1] }]", [-3.0, 4.0, 1.5], [0.597022, -0.79603, -0.099504], 6.029926,
        [0.6, -0.8, 0.0], [0.64758, 0.9]),
    ("transform = [{ scale = [1, 1, -1] }]", [5.0, 1.0, -0.2], [-0.979693, -0.192791, -0.055083], 4.105352,
        [0.97802, 0.20853, 0.0], [0.03343, 0.42614]),
    ("flip_normals = true", [5.0, 1.0, 0.8], [-0.979693, -0.192791, -0.055083], 4.105352,
        [-0.97802, -0.20853, 0.0], [0.03343, 0.57386]),
    ("transform = [{ scale = [2, 2, 5] }]", [-3.0, 4.0, 3.5], [0.597022, -0.79603, -0.099504], 3.014963,
        [-0.6, 0.8, 0.0], [0.35242, 0.64]),
];

#[test]
fn hits_are_those_of_mitsuba() {
    for (fields, origin, dir, t, normal, uv) in MITSUBA {
        let found = hit(&loaded(fields), origin.into(), dir.into()).unwrap();
        assert!((found.t - t).abs() < 1e-5, "{fields}: {found:?}");
        assert!((found.ng - Vec3::from(normal)).length() < 3e-5, "{fields}: {found:?}");
        assert!((found.at.uv - Vec2::from(uv)).length() < 3e-5, "{fields}: {found:?}");
    }
}

/// Distances along a line from `o` to where it meets an endless cylinder, in double precision; and how far it is from
/// missing the cylinder, as the square of a sine.
fn exact(o: DVec3, d: DVec3, radius: f64) -> ([f64; 2], f64) {
    let (o2, d2) = (DVec2::new(o.x, o.y), DVec2::new(d.x, d.y));
    let a = d2.length_squared();
    let middle = -o2.dot(d2) / a;
    let gap = 1.0 - (o2 + d2 * middle).length_squared() / (radius * radius);
    let half = (gap.max(0.0) * radius * radius / a).sqrt();
    ([middle - half, middle + half], gap)
}

/// From near and far, thick and thin: the nearest hit is where double precision puts it, and a ray leaving it meets the
/// far side or nothing, never the same place again.
#[test]
fn hits_are_precise_and_rays_leave() {
    let mut rng = Sampler::new(5, 0, Purpose::Test, 0);
    for (radius, height) in [(1.0, 1.0), (0.001, 1.0), (50.0, 5.0), (0.01, 0.01), (300.0, 700.0)] {
        let scene = loaded(&format!("p0 = [0, 0, 0]\np1 = [0, 0, {height}]\nradius = {radius}"));
        let size = f64::max(radius, height);
        let mut met = [0; 2];
        for far in [0.7, 3.0, 1e3] {
            for _ in 0..3000 {
                let direction = warp::uniform_sphere(rng.next_2d());
                let origin = direction * (far * size) as f32;
                let [x, y] = rng.next_2d().to_array();
                let aim = Vec3::new(
                    (2.0 * x - 1.0) * radius as f32,
                    (2.0 * y - 1.0) * radius as f32,
                    rng.next_1d() * height as f32,
                );
                let dir = (aim - origin).normalize();
                let (o, d) = (origin.as_dvec3(), dir.as_dvec3());
                let (roots, gap) = exact(o, d, radius);
                let height_at = |t: &f64| o.z + d.z * t;
                let expected = roots
                    .into_iter()
                    .find(|t| gap > 0.0 && *t > 0.0 && (0.0..=height).contains(&height_at(t)));
                // Outlines and ends are as sharp as single precision resolves directions.
                let blur = 1e-6 * far * size;
                let at_end = |t: &f64| {
                    let z = height_at(t);
                    z.abs().min((height - z).abs()) < 10.0 * blur
                };
                if gap.abs() < 20.0 * blur / radius || (1.0 - d.z * d.z) < 1e-4 || roots.iter().any(at_end) {
                    continue;
                }
                let found = hit(&scene, origin, dir);
                assert_eq!(found.is_some(), expected.is_some(), "{roots:?} from {origin} to {dir}");
                let (Some(found), Some(expected)) = (found, expected) else {
                    continue;
                };
                let tolerance = blur / gap.sqrt() / (1.0 - d.z * d.z);
                let error = (f64::from(found.t) - expected).abs();
                assert!(error < tolerance, "{} {expected}, off by {error}", found.t);
                let off = found.point.truncate().as_dvec2().length() - radius;
                assert!(off.abs() < 3e-7 * size, "{off} off the surface");
                met[0] += 1;
                // Away from the surface on either side.
                let leaving = warp::cosine_hemisphere(rng.next_2d());
                let leaving = beamfarm_render::math::Frame::from_normal(found.ng).to_world(leaving);
                let outside = found.spawn_ray(leaving);
                assert!(
                    hit(&scene, outside.origin, outside.dir).is_none(),
                    "{found:?} {outside:?}"
                );
                let inside = found.spawn_ray(-leaving);
                let (o, d) = (inside.origin.as_dvec3(), inside.dir.as_dvec3());
                if let Some(again) = hit(&scene, inside.origin, inside.dir) {
                    let chord = 2.0 * radius * f64::from(leaving.dot(found.ng)) / (1.0 - d.z * d.z);
                    assert!(f64::from(again.t) > 0.5 * chord, "{again:?} after {found:?}, {o}");
                    met[1] += 1;
                }
            }
        }
        assert!(met[0] > 300 && met[1] > 0, "{radius} x {height}: {met:?}");
    }
}

/// A ray along the axis passes through.
#[test]
fn rays_along_the_axis_pass() {
    let scene = loaded("");
    for x in [0.0, 0.5, 1.0, 1.5] {
        assert!(hit(&scene, Vec3::new(x, 0.0, -3.0), Vec3::Z).is_none());
    }
}
