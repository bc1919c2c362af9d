//! The camera.

use crate::math::{Frame, Ray, Vec2, Vec3};

/// Perspective camera with a thin lens. Its position is the origin of render space up to rounding.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Centre of the lens.
    pub position: Vec3,
    /// `s` to the right of the image, `t` up, `n` forward.
    pub frame: Frame,
    /// tan of half the horizontal field of view.
    pub tan_half_fov_x: f32,
    /// Lens radius, scene units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance of the plane in focus along the axis, scene units.
    pub focus_distance: f32,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Camera {
    /// The ray through a point of the image. `image`: in pixels, (0, 0) the top left corner, y down. `lens`: in [0, 1)^2.
    pub fn ray(&self, image: Vec2, lens: Vec2) -> Ray {
        let _ = (image, lens);
        unimplemented!()
    }
}
