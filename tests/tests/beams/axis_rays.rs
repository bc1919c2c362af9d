//! Rays parallel to an axis, with zeros of either sign.

use beamfarm_harness::render::scene;
use beamfarm_render::math::{Ray, Vec3};
use beamfarm_render::world::geometry::Geometry;

#[test]
fn rays_along_axes_leave_a_cube() {
    let scene = scene(
        r#"
[image]
width = 4
height = 4
[camera]
origin = [0, 0, 0]
target = [0, 0, 1]
up = [0, 1, 0]
fov = 40
[[shapes]]
type = "cube"
[[shapes]]
type = "cube"
transform = [{ scale = 2.0 }]
[[shapes]]
type = "sphere"
radius = 3.0
"#,
    );
    let objects = &scene.description().objects;
    let geometry = Geometry::new(objects);
    for axis in 0..3 {
        for (sign, zero) in [(1.0, 0.0), (1.0, -0.0), (-1.0, 0.0), (-1.0, -0.0)] {
            let mut dir = Vec3::splat(zero);
            dir[axis] = sign;
            for (start, expected) in [(0.1, 0.9), (1.1, 0.9)] {
                let mut origin = Vec3::new(0.3, -0.2, 0.1);
                origin[axis] = start * sign;
                let ray = Ray { origin, dir };
                let hit = geometry.intersect(objects, &ray, f32::INFINITY, &|_| false);
                let t = hit.map(|hit| hit.t);
                assert!(t.is_some_and(|t| (t - expected).abs() < 1e-5), "{origin} {dir}: {t:?}");
            }
        }
    }
}
