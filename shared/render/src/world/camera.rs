//! The camera.

use crate::math::{Frame, Ray, Vec2, Vec3};
use crate::warp;
use crate::world::filter::PixelFilter;
use crate::world::panorama::{Mapping, Panorama};

/// The arrangement of a camera's rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// They meet in one point.
    Perspective,
    /// They are parallel: an object's image size does not depend on its distance.
    Orthographic,
    /// They meet in one point, and the film is no plane.
    Panoramic(Panorama),
}

/// A camera with a thin lens; a panoramic one is a pinhole.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// How the world is projected.
    pub projection: Projection,
    /// Centre of the lens, or of the plane that parallel rays start on. It is the origin of render space, unless that
    /// is made for several cameras.
    pub position: Vec3,
    /// `s` to the right of the image, `t` up, `n` forward (so left-handed, unless the image is mirrored).
    pub frame: Frame,
    /// Half the width of the image. With parallel rays in scene units; with perspective on the plane at distance 1, the
    /// tan of half the horizontal field of view; for a panorama on its film, in radians for most.
    pub half_width: f32,
    /// Centre of the image on that plane, right and up from where `frame.n` meets it.
    pub shift: Vec2,
    /// Lens radius, scene units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance of the plane in focus along the axis, scene units.
    pub focus_distance: f32,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Reconstruction filter of the pixels.
    pub filter: PixelFilter,
}

impl Camera {
    /// The camera that renders this pixel alone, as a `crop` of the image would.
    pub fn pixel(&self, x: u32, y: u32) -> Self {
        let pixel = 2.0 * self.half_width / self.width as f32;
        let off_middle = |at: u32, side: u32| at as f32 + 0.5 - 0.5 * side as f32;
        let offset = Vec2::new(off_middle(x, self.width), -off_middle(y, self.height) * self.row());
        Self {
            half_width: 0.5 * pixel,
            shift: self.shift + offset * pixel,
            width: 1,
            height: 1,
            ..*self
        }
    }

    /// Height of a pixel over its width.
    pub(crate) fn row(&self) -> f32 {
        match self.projection {
            Projection::Perspective | Projection::Orthographic => 1.0,
            Projection::Panoramic(panorama) => panorama.row,
        }
    }

    /// The same picture with this many pixels. It spans as much from left to right, and more rows show more above and
    /// below; an equirectangular image also spans as much from top to bottom.
    pub fn resize(&mut self, width: u32, height: u32) {
        if let Projection::Panoramic(panorama) = &mut self.projection
            && panorama.mapping == Mapping::Equirectangular
        {
            let sides = [self.height, self.width, width, height].map(|side| side as f32);
            panorama.row *= (sides[0] / sides[1]) * (sides[2] / sides[3]);
        }
        (self.width, self.height) = (width, height);
    }

    /// Where the sample of a pixel is in the image. `u` in [0, 1)^2.
    #[inline]
    pub fn sample(&self, x: u32, y: u32, u: Vec2) -> Vec2 {
        self.filter.sample([x, y], [self.width, self.height], u)
    }

    /// Whether a point of the image, in pixels, has a ray: parts of a fisheye image lie outside its circle.
    #[inline]
    pub fn sees(&self, image: Vec2) -> bool {
        match &self.projection {
            Projection::Perspective | Projection::Orthographic => true,
            Projection::Panoramic(panorama) => panorama.sees(self.film(image, panorama)),
        }
    }

    /// A point of the image on the film of a panorama.
    #[inline]
    fn film(&self, image: Vec2, panorama: &Panorama) -> Vec2 {
        let pixel = 2.0 * self.half_width / self.width as f32;
        Vec2::new(
            (image.x - 0.5 * self.width as f32) * pixel + self.shift.x,
            (0.5 * self.height as f32 - image.y) * (pixel * panorama.row) + self.shift.y,
        )
    }

    /// The depth that a depth layer records for a point, scene units: along the axis, or for a panorama the distance.
    #[inline]
    pub fn depth(&self, point: Vec3) -> f32 {
        let offset = point - self.position;
        match self.projection {
            Projection::Perspective | Projection::Orthographic => offset.dot(self.frame.n),
            Projection::Panoramic(_) => offset.length(),
        }
    }

    /// The rays through the middles of `side` x `side` equal parts of the image and the middle of the lens, row by row;
    /// parts outside a fisheye's circle have none.
    pub fn rays_over_image(&self, side: usize) -> impl Iterator<Item = Ray> {
        (0..side * side).filter_map(move |i| {
            let at = Vec2::new((i % side) as f32, (i / side) as f32) + 0.5;
            let image = at / side as f32 * Vec2::new(self.width as f32, self.height as f32);
            self.sees(image).then(|| self.ray(image, Vec2::splat(0.5)))
        })
    }

    /// The ray through a visible point of the image. `image`: in pixels, (0, 0) the top left corner, y down. `lens`: in
    /// [0, 1)^2.
    #[inline]
    pub fn ray(&self, image: Vec2, lens: Vec2) -> Ray {
        let pixel = 2.0 * self.half_width / self.width as f32;
        // On the image's plane; pixels are square.
        let film = Vec3::new(
            (image.x - 0.5 * self.width as f32) * pixel + self.shift.x,
            (0.5 * self.height as f32 - image.y) * pixel + self.shift.y,
            1.0,
        );
        match &self.projection {
            Projection::Perspective => {}
            Projection::Orthographic => return self.parallel_ray(film, lens),
            Projection::Panoramic(panorama) => {
                let dir = panorama.direction(self.film(image, panorama));
                return Ray {
                    origin: self.position,
                    dir: self.frame.to_world(dir).normalize(),
                };
            }
        }
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
    /// The ray of an orthographic camera through a point of the image. Each point has its own lens, as in Cycles.
    fn parallel_ray(&self, film: Vec3, lens: Vec2) -> Ray {
        let on_film = film.truncate().extend(0.0);
        if self.aperture == 0.0 {
            return Ray {
                origin: self.position + self.frame.to_world(on_film),
                dir: self.frame.n,
            };
        }
        let on_lens = (warp::concentric_disk(lens) * self.aperture).extend(0.0);
        Ray {
            origin: self.position + self.frame.to_world(on_film + on_lens),
            dir: self.frame.to_world(Vec3::Z * self.focus_distance - on_lens).normalize(),
        }
    }

    /// Whether a box reaches to where parallel rays may start. Rays that meet in one point start there or next to it on
    /// the lens, where a single medium is assumed.
    pub(crate) fn film_meets(&self, (min, max): (Vec3, Vec3)) -> bool {
        if self.projection != Projection::Orthographic {
            return false;
        }
        let half_height = self.half_width * (self.height as f32 / self.width as f32);
        let (middle, half) = (0.5 * (min + max) - self.position, 0.5 * (max - min));
        let sides = [
            (self.frame.s, self.shift.x, self.half_width + self.aperture),
            (self.frame.t, self.shift.y, half_height + self.aperture),
            (self.frame.n, 0.0, 0.0),
        ];
        sides.into_iter().all(|(axis, at, reach)| {
            let room = 1e-5 * (middle.length() + half.length() + self.position.length());
            (middle.dot(axis) - at).abs() <= half.dot(axis.abs()) + reach + room
        })
    }
}
