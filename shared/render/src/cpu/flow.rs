//! Motion vectors: how what the camera sees moves in the image.

use crate::math::{PI, Ray, Vec2, Vec3};
use crate::world::camera::{Camera, Projection};
use crate::world::geometry::{Mesh, Placement, Shape, SurfaceHit};
use crate::world::{Motion, Scene};
use std::sync::Arc;

/// Frames between the two moments that a vector compares: few enough for a straight line, many enough for single
/// precision.
const STEP: f64 = 1.0 / 64.0;

/// The scene of a pass a moment later, or earlier.
pub(crate) struct Flow {
    then: Scene,
    /// How much later, frames; negative: earlier.
    frames: f32,
}

impl Flow {
    /// From the scene as a pass sees it at `time`, frames. The error says why the other moment cannot be made.
    pub(crate) fn new(now: &Scene, motion: &Motion, time: f64) -> Result<Self, String> {
        let [open, close] = motion.shutter();
        // Frame files cover only the time while the shutter is open.
        let is_late = time + STEP > close && time - STEP >= open;
        let step = if is_late { -STEP } else { STEP };
        let at = time + step;
        let then = motion
            .at(at)
            .map_err(|why| format!("vectors of motion, at {at} frames: {why}"))?;
        Ok(Self {
            then: Scene::new_like(now, then),
            frames: step as f32,
        })
    }

    /// How what a camera ray meets moves, in pixels per frame, to the right and up. Infinitely distant things move as
    /// the camera turns.
    pub(crate) fn along(&self, scene: &Scene, ray: &Ray, hit: Option<&SurfaceHit>) -> Vec2 {
        let (here, there) = (&scene.description().camera, &self.then.description().camera);
        let ends = match hit {
            None => here.vanishing(ray.dir).zip(there.vanishing(ray.dir)),
            Some(hit) => {
                let [one, other] = [scene, &self.then].map(|scene| scene.objects().get(hit.object as usize));
                let (Some(one), Some(other)) = (one, other) else {
                    return Vec2::ZERO;
                };
                let moved = carried(&one.shape, &other.shape, hit).unwrap_or(hit.point);
                here.image_of(hit.point).zip(there.image_of(moved))
            }
        };
        ends.map_or(Vec2::ZERO, |(from, to)| {
            here.the_short_way(to - from) * Vec2::new(1.0, -1.0) / self.frames
        })
    }
}

/// Where a point of a shape lies in another shape of the same kind. None: the kinds differ.
fn carried(shape: &Shape, other: &Shape, hit: &SurfaceHit) -> Option<Vec3> {
    let placed = |from: &Placement, to: &Placement| {
        let own = from.object_from_render.transform_point3(hit.point);
        to.render_from_object.transform_point3(own)
    };
    match (shape, other) {
        (
            Shape::Mesh { mesh, placement },
            Shape::Mesh {
                mesh: there,
                placement: to,
            },
        ) => {
            if Arc::ptr_eq(mesh, there) {
                return Some(placed(placement, to));
            }
            let own = placement.object_from_render.transform_point3(hit.point);
            let weights = weights(corners(mesh, hit.primitive)?, own);
            let [a, b, c] = corners(there, hit.primitive)?;
            let point = a * weights[0] + b * weights[1] + c * weights[2];
            Some(to.render_from_object.transform_point3(point))
        }
        (Shape::Sphere { placement, .. }, Shape::Sphere { placement: to, .. })
        | (Shape::Disc { placement, .. }, Shape::Disc { placement: to, .. })
        | (Shape::Cylinder { placement, .. }, Shape::Cylinder { placement: to, .. }) => Some(placed(placement, to)),
        (
            Shape::Strands { strands, placement },
            Shape::Strands {
                strands: there,
                placement: to,
            },
        ) => Arc::ptr_eq(strands, there).then(|| placed(placement, to)),
        (
            Shape::Mesh { .. }
            | Shape::Sphere { .. }
            | Shape::Disc { .. }
            | Shape::Cylinder { .. }
            | Shape::Strands { .. },
            _,
        ) => None,
    }
}

fn corners(mesh: &Mesh, triangle: u32) -> Option<[Vec3; 3]> {
    let corners = mesh.triangles.get(triangle as usize)?;
    Some(corners.map(|vertex| mesh.positions[vertex as usize]))
}

/// Barycentric coordinates of a point in the plane of a triangle. A triangle without area gives its first corner.
fn weights([a, b, c]: [Vec3; 3], point: Vec3) -> [f32; 3] {
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    if area == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let part = |from: Vec3, to: Vec3| (to - from).cross(point - from).dot(normal) / area;
    let (of_b, of_c) = (part(c, a), part(a, b));
    [1.0 - of_b - of_c, of_b, of_c]
}

impl Camera {
    /// Where a point is in the image, ignoring the lens. None: behind the camera.
    pub(crate) fn image_of(&self, point: Vec3) -> Option<Vec2> {
        let local = self.frame.to_local(point - self.position);
        match self.projection {
            Projection::Orthographic => Some(self.pixels(local.truncate())),
            Projection::Perspective => (local.z > 0.0).then(|| self.pixels(local.truncate() / local.z)),
            Projection::Panoramic(panorama) => Some(self.pixels(panorama.film(local))),
        }
    }

    /// Where an infinitely distant point in a direction is in the image. None: behind the camera, or nowhere.
    fn vanishing(&self, dir: Vec3) -> Option<Vec2> {
        let local = self.frame.to_local(dir);
        match self.projection {
            Projection::Orthographic => None,
            Projection::Perspective => (local.z > 0.0).then(|| self.pixels(local.truncate() / local.z)),
            Projection::Panoramic(panorama) => Some(self.pixels(panorama.film(local))),
        }
    }

    /// A displacement in the image, pixels. In a panorama that goes all around, across its edge if that is shorter.
    fn the_short_way(&self, way: Vec2) -> Vec2 {
        match self.projection {
            Projection::Panoramic(panorama) if panorama.mapping.goes_round() => {
                let round = PI / self.half_width * self.width as f32;
                Vec2::new(way.x - round * (way.x / round).round(), way.y)
            }
            Projection::Perspective | Projection::Orthographic | Projection::Panoramic(_) => way,
        }
    }

    /// A point of the image's plane in pixels, y down.
    fn pixels(&self, film: Vec2) -> Vec2 {
        let at = (film - self.shift) * (self.width as f32 / (2.0 * self.half_width));
        Vec2::new(
            0.5 * self.width as f32 + at.x,
            0.5 * self.height as f32 - at.y / self.row(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Frame;
    use crate::world::filter::PixelFilter;
    use crate::world::panorama::{Mapping, Panorama};

    /// What crosses the edge of an all-around panorama has not moved through the whole image.
    #[test]
    fn ways_in_panoramas_are_the_short_ones() {
        let panorama = Panorama {
            mapping: Mapping::Equirectangular,
            row: 1.0,
            circle: PI,
        };
        let whole = Camera {
            projection: Projection::Panoramic(panorama),
            position: Vec3::ZERO,
            frame: Frame {
                s: Vec3::X,
                t: Vec3::Y,
                n: Vec3::Z,
            },
            half_width: PI,
            shift: Vec2::ZERO,
            aperture: 0.0,
            focus_distance: 1.0,
            width: 64,
            height: 32,
            filter: PixelFilter::Box,
        };
        let way = |camera: &Camera, from: Vec3, to: Vec3| {
            let ends = [from, to].map(|point| camera.image_of(point).expect("it sees all around"));
            camera.the_short_way(ends[1] - ends[0])
        };
        let behind = [Vec3::new(0.1, 0.0, -1.0), Vec3::new(-0.1, 0.0, -1.0)];
        let pixels = 2.0 * crate::math::atan2(0.1, 1.0) * 64.0 / (2.0 * PI);
        assert!((way(&whole, behind[0], behind[1]) - Vec2::new(pixels, 0.0)).length() < 1e-4);
        assert!((way(&whole, behind[1], behind[0]) + Vec2::new(pixels, 0.0)).length() < 1e-4);
        // A part of the panorama has as many pixels per turn.
        let half = Camera {
            half_width: 0.5 * PI,
            width: 32,
            ..whole
        };
        assert!((way(&half, behind[0], behind[1]) - Vec2::new(pixels, 0.0)).length() < 1e-4);
        let ahead = [Vec3::new(0.1, 0.0, 1.0), Vec3::new(-0.1, 0.0, 1.0)];
        assert!((way(&whole, ahead[0], ahead[1]) + Vec2::new(pixels, 0.0)).length() < 1e-4);
        // A cylinder sees nothing straight up, but the result is still finite.
        let cylinder = Camera {
            projection: Projection::Panoramic(Panorama {
                mapping: Mapping::Cylindrical,
                ..panorama
            }),
            ..whole
        };
        assert!(way(&cylinder, ahead[0], Vec3::Y).is_finite());
        assert!(way(&cylinder, ahead[0], Vec3::ZERO).is_finite());
    }
}
