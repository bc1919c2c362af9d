//! The object at a point of the picture, for picking.

use super::Scene;
use crate::math::Vec2;

/// The first visible surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Index of the object.
    pub object: u32,
    /// Position, render space.
    pub point: [f32; 3],
    /// Distance along the camera's axis, scene units: the focus distance for this point. For a panorama, from the
    /// camera.
    pub depth: f32,
}

impl Scene {
    /// The first visible surface at a point of the picture, from the upper left, 0 to 1, through boundaries of media
    /// and objects hidden from the camera.
    pub fn seen_at(&self, x: f32, y: f32) -> Option<Seen> {
        let camera = &self.description().camera;
        let rules = self.description().rules.as_ref();
        let is_passed =
            |object: u32| self.is_null(object) || rules.is_some_and(|rules| rules.hides(rules.camera, object));
        let image = Vec2::new(x * camera.width as f32, y * camera.height as f32);
        if !camera.sees(image) {
            return None;
        }
        let ray = camera.ray(image, Vec2::splat(0.5));
        let hit = self.meets(&ray, f32::INFINITY, &is_passed)?;
        Some(Seen {
            object: hit.object,
            point: hit.point.to_array(),
            depth: camera.depth(hit.point),
        })
    }
}
