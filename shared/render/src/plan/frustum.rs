//! Where camera paths may find beams: a beam that no path can come near need not be stored.
//!
//! Camera paths gather beams up to their first vertex. As long as nothing turns them, that is within the camera's rays:
//! in front of the lens, and between four planes. Take such a plane through the middle of the lens and an edge of the
//! image, with the unit normal n, a lens of radius a, and the plane of focus at distance F. The points x + s (f - x) of
//! a ray through x on the lens and f on the plane of focus are at
//!
//! ```text
//! (1 - s) n.x + s n.f >= -|1 - s| a >= -a - (a / F) z,    z = s F their depth,
//! ```
//!
//! so that (n + (a / F) forward).p + a >= 0 for all of their points p. For parallel rays, the planes go through the
//! edges of the image where it stands, which is h within it. A ray through q of the image and x of its lens has the
//! points q + (1 - s) x + z forward: then (n + (a / F) forward).p + a + h >= 0.

use crate::math::Vec3;
use crate::world::Scene;
use crate::world::camera::Projection;

/// Half-spaces that hold all camera segments along which beams are gathered.
#[derive(Clone, Debug)]
pub struct Frustum {
    planes: [Plane; 5],
}

/// The half-space of points p with normal.p + offset >= 0.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// Unit normal, pointing inside.
    normal: Vec3,
    offset: f32,
}

/// Room for rounding of coordinates, of the offsets by which rays leave surfaces, and of the planes; far more than
/// needed.
const MARGIN: f32 = 1e-4;

impl Frustum {
    /// None if camera paths may be anywhere: something that the camera may see turns them, or the camera is panoramic.
    pub fn of(scene: &Scene) -> Option<Self> {
        let view = Self::of_camera(scene)?;
        let objects = scene.objects().iter().zip(&scene.boxes);
        let mut turning = objects.filter(|(object, _)| {
            let material = &scene.description().materials[object.material as usize];
            material.turns_paths()
        });
        let is_seen = turning.any(|(_, &(min, max))| {
            // The ball around the object.
            let (middle, radius) = (0.5 * (min + max), 0.5 * (max - min).length());
            view.meets([middle, middle], radius)
        });
        (!is_seen).then_some(view)
    }

    fn of_camera(scene: &Scene) -> Option<Self> {
        let camera = &scene.description().camera;
        let (half_x, shift) = (camera.half_width, camera.shift);
        let half_y = half_x * (camera.height as f32 / camera.width as f32);
        // Normals, and how far to each side the image reaches.
        let edges = [
            (Vec3::X, half_x - shift.x),
            (Vec3::NEG_X, half_x + shift.x),
            (Vec3::Y, half_y - shift.y),
            (Vec3::NEG_Y, half_y + shift.y),
        ];
        let is_parallel = match camera.projection {
            Projection::Perspective => false,
            Projection::Orthographic => true,
            Projection::Panoramic(_) => return None,
        };
        let edges = edges.map(|(normal, reach)| match is_parallel {
            false => (normal + Vec3::Z * reach, 0.0),
            true => (normal, reach),
        });
        let lens = camera.aperture;
        let spread = match lens > 0.0 {
            true => lens / camera.focus_distance,
            false => 0.0,
        };
        let room = MARGIN * (scene.bounds().radius + camera.position.length());
        let [left, right, bottom, top] = edges;
        let planes = [left, right, bottom, top, (Vec3::Z, 0.0)].map(|(edge, reach)| {
            let tilted = edge.normalize() + Vec3::Z * spread;
            let length = tilted.length();
            let normal = camera.frame.to_world(tilted / length);
            Plane {
                normal,
                offset: (lens + reach) / length - normal.dot(camera.position) + room + MARGIN * reach.abs(),
            }
        });
        Some(Self { planes })
    }

    /// The planes' unit normals, pointing inside, and their offsets. For points inside, the product with a normal plus
    /// its offset is at least zero.
    pub fn planes(&self) -> [(Vec3, f32); 5] {
        self.planes.map(|plane| (plane.normal, plane.offset))
    }

    /// Whether a camera segment may come within a radius of the straight line between two points. False is certain.
    pub fn meets(&self, ends: [Vec3; 2], radius: f32) -> bool {
        self.planes.iter().all(|plane| {
            let is_behind = |p: Vec3| {
                let room = radius + MARGIN * p.abs().element_sum();
                plane.normal.dot(p) + plane.offset < -room
            };
            // NaN coordinates are behind no plane.
            !ends.iter().all(|end| is_behind(*end))
        })
    }
}
