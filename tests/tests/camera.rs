//! The camera's rays: field of view, orientation, lens.

use beamfarm_shared::camera::Camera;
use beamfarm_shared::math::{Frame, Vec2, Vec3};
use beamfarm_shared::sampler::{Purpose, Sampler};
use beamfarm_tests::quadrature::Rect;
use beamfarm_tests::{Chi2, Suite};

fn camera(aperture: f32) -> Camera {
    let forward = Vec3::new(0.3, -0.2, -1.0).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    Camera {
        position: Vec3::new(0.1, 0.2, 0.3),
        frame: Frame {
            s: right,
            t: right.cross(forward),
            n: forward,
        },
        tan_half_fov_x: 0.5,
        aperture,
        focus_distance: 2.5,
        width: 40,
        height: 20,
    }
}

#[test]
fn image_spans_the_field_of_view_with_square_pixels() {
    let camera = camera(0.0);
    // tan of the angles to the right and up.
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

/// All rays of an image point meet in one point of the plane in focus, the one that a pinhole sees there.
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
            let t =
                (camera.focus_distance - offset.dot(camera.frame.n)) / ray.dir.dot(camera.frame.n);
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
