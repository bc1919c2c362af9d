//! What `kernels/camera.wgsl` computes: the renderer's own rays, except for their start on a lens.

use super::warp;
use beamfarm_render::math::{Ray, Vec2, Vec3};
use beamfarm_render::world::camera::{Camera, Projection};

/// `camera_ray`.
#[must_use]
pub fn ray(camera: &Camera, image: Vec2, lens: Vec2) -> Ray {
    if camera.aperture == 0.0 {
        return camera.ray(image, lens);
    }
    let pixel = 2.0 * camera.half_width / camera.width as f32;
    let film = Vec3::new(
        (image.x - 0.5 * camera.width as f32) * pixel + camera.shift.x,
        (0.5 * camera.height as f32 - image.y) * pixel + camera.shift.y,
        1.0,
    );
    let on_lens = (warp::concentric_disk(lens) * camera.aperture).extend(0.0);
    let (start, in_focus) = match camera.projection {
        Projection::Perspective => (on_lens, film),
        Projection::Orthographic => (film.truncate().extend(0.0) + on_lens, Vec3::Z),
        Projection::Panoramic(_) => unreachable!("kernels have no panoramas"),
    };
    Ray {
        origin: camera.position + camera.frame.to_world(start),
        dir: (camera.frame)
            .to_world(in_focus * camera.focus_distance - on_lens)
            .normalize(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Groups;
    use crate::kernels::{ARITHMETIC, CAMERA, GROUPS, MATH, Program, VECTORS, WARP, WIDE};
    use crate::testing::{Chance, same, same_layout, tested};
    use crate::world::camera;
    use beamfarm_render::math::Frame;
    use beamfarm_render::world::filter::PixelFilter;

    const CAMERAS: Program = Program {
        name: "cameras",
        texts: &[
            ARITHMETIC,
            GROUPS,
            crate::testing::EACH,
            WIDE,
            MATH,
            WARP,
            VECTORS,
            CAMERA,
            "@group(0) @binding(0) var<storage, read> camera: Camera;
            @group(0) @binding(1) var<storage, read> points: array<vec4f>;
            @group(0) @binding(2) var<storage, read_write> rays: array<vec4f>;
            fn each(i: u32) {
                if (i >= arrayLength(&points)) { return; }
                let ray = camera_ray(camera, points[i].xy, points[i].zw);
                rays[2u * i] = vec4f(ray.origin, 0.0);
                rays[2u * i + 1u] = vec4f(ray.dir, 0.0);
            }",
        ],
    };

    fn cameras() -> Vec<Camera> {
        let mut chance = Chance::new(6);
        let mut camera = |projection: Projection, aperture: f32| Camera {
            projection,
            position: 3.0 * chance.direction(),
            frame: Frame::from_normal(chance.direction()),
            half_width: 0.1 + chance.unit(),
            shift: chance.two(),
            aperture,
            focus_distance: 0.5 + chance.unit(),
            width: 640,
            height: 360,
            filter: PixelFilter::Box,
        };
        let both = [Projection::Perspective, Projection::Orthographic];
        let all = both.map(|projection| [0.0, 0.02, 1.5].map(|aperture| camera(projection, aperture)));
        all.concat()
    }

    fn points() -> Vec<[f32; 4]> {
        let mut chance = Chance::new(7);
        let point = |_| {
            let (image, lens) = (chance.two() * Vec2::new(640.0, 360.0), chance.two());
            [image.x, image.y, lens.x, lens.y]
        };
        (0..50_000).map(point).collect()
    }

    #[test]
    fn rays_of_cameras_have_their_twins_bits() {
        let Some(tested) = tested() else { return };
        let device = &tested.device;
        let points = points();
        let input = device.buffer("points", &points).unwrap();
        let output = device.empty("rays", 32 * points.len() as u64).unwrap();
        let kernel = tested.kernel(&CAMERAS, "main");
        for camera in cameras() {
            let flat = device.buffer("camera", &[camera::Camera::new(&camera, 0)]).unwrap();
            let mut work = device.work();
            let groups = Groups::Count(points.len().div_ceil(64) as u32);
            work.run(&kernel, &[&flat, &input, &output], groups).unwrap();
            work.submit().unwrap();
            let got = device.read::<[[f32; 4]; 2]>(&output, points.len()).unwrap();
            for (point, got) in points.iter().zip(got) {
                let [x, y, u, v] = *point;
                let ray = ray(&camera, Vec2::new(x, y), Vec2::new(u, v));
                assert!(same(&got[0][..3], &ray.origin.to_array()), "{camera:?} {point:?}");
                assert!(same(&got[1][..3], &ray.dir.to_array()), "{camera:?} {point:?}");
            }
        }
    }

    #[test]
    fn twins_are_the_renderers_rays() {
        for camera in cameras() {
            for [x, y, u, v] in points().into_iter().step_by(10) {
                let (image, lens) = (Vec2::new(x, y), Vec2::new(u, v));
                let (twin, own) = (ray(&camera, image, lens), camera.ray(image, lens));
                let room = if camera.aperture == 0.0 { 0.0 } else { 1e-6 };
                assert!(
                    (twin.origin - own.origin).abs().max_element() <= room,
                    "{camera:?} {u} {v}"
                );
                assert!((twin.dir - own.dir).abs().max_element() < 3e-6, "{camera:?} {x} {y}");
            }
        }
    }

    #[test]
    fn cameras_lie_in_memory_as_kernels_have_them() {
        use camera::Camera;
        same_layout!(
            &CAMERAS,
            Camera {
                position,
                width,
                s,
                height,
                t,
                aperture,
                n,
                focus_distance,
                shift,
                pixel,
                medium,
                is_parallel
            }
        );
    }
}
