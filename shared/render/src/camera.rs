//! The camera.

use crate::filter::PixelFilter;
use crate::math::{Frame, Ray, Vec2, Vec3};
use crate::warp;

/// Perspective camera with a thin lens.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Centre of the lens: the origin of render space, if that is not made for several cameras.
    pub position: Vec3,
    /// `s` to the right of the image, `t` up, `n` forward (so left-handed, unless the image is mirrored).
    pub frame: Frame,
    /// tan of half the horizontal field of view; half the width of the image on the plane at distance 1.
    pub tan_half_fov_x: f32,
    /// The middle of the image on that plane, to the right and up from where `frame.n` meets it.
    pub shift: Vec2,
    /// Lens radius, scene units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance of the plane in focus along the axis, scene units.
    pub focus_distance: f32,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// How pixels weigh the image.
    pub filter: PixelFilter,
}

impl Camera {
    /// The camera that renders this pixel alone, as a `crop` of the image would.
    pub fn pixel(&self, x: u32, y: u32) -> Self {
        let pixel = 2.0 * self.tan_half_fov_x / self.width as f32;
        let off_middle = |at: u32, side: u32| at as f32 + 0.5 - 0.5 * side as f32;
        let offset = Vec2::new(off_middle(x, self.width), -off_middle(y, self.height));
        Self {
            tan_half_fov_x: 0.5 * pixel,
            shift: self.shift + offset * pixel,
            width: 1,
            height: 1,
            ..*self
        }
    }

    /// Where the sample of a pixel is in the image. `u` in [0, 1)^2.
    #[inline]
    pub fn sample(&self, x: u32, y: u32, u: Vec2) -> Vec2 {
        self.filter.sample([x, y], [self.width, self.height], u)
    }

    /// The ray through a point of the image. `image`: in pixels, (0, 0) the top left corner, y down. `lens`: in [0,
    /// 1)^2.
    #[inline]
    pub fn ray(&self, image: Vec2, lens: Vec2) -> Ray {
        let pixel = 2.0 * self.tan_half_fov_x / self.width as f32;
        // On the plane at distance 1; pixels are square.
        let film = Vec3::new(
            (image.x - 0.5 * self.width as f32) * pixel + self.shift.x,
            (0.5 * self.height as f32 - image.y) * pixel + self.shift.y,
            1.0,
        );
        if self.aperture == 0.0 {
            return Ray {
                origin: self.position,
                dir: self.frame.to_world(film).normalize(),
            };
        }
        let on_lens = (warp::concentric_disk(lens) * self.aperture).extend(0.0);
        let in_focus = film * self.focus_distance;
        Ray {
            origin: self.position + self.frame.to_world(on_lens),
            dir: self.frame.to_world(in_focus - on_lens).normalize(),
        }
    }
}
