//! Cameras with a curved film: directions over a sphere, laid out by a mapping.
//!
//! Points of the film are angles in radians or tangents, from its centre to the right and up. The camera's axes are x
//! to the right, y up and z forward.

use crate::math::{PI, Vec2, Vec3, atan2, sin, sin_cos};

/// How directions map to an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Longitude to the right, latitude up.
    Equirectangular,
    /// Longitude to the right; up the tangent of the latitude, as on an unrolled cylinder of radius 1.
    Cylindrical,
    /// The distance from the centre is the angle to the axis.
    Equidistant,
    /// The distance from the centre is twice the sine of half the angle to the axis: areas are proportional to solid
    /// angles.
    Equisolid,
}

/// The view of a panoramic camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Panorama {
    /// How directions map to the image.
    pub mapping: Mapping,
    /// Height of a pixel over its width, on the film.
    pub row: f32,
    /// Distance from the centre of the film beyond which a fisheye sees nothing.
    pub circle: f32,
}

impl Mapping {
    /// Film distance from the centre of a fisheye, for a direction at this angle to the axis, radians.
    pub fn distance(self, angle: f64) -> f64 {
        match self {
            Self::Equisolid => 2.0 * libm::sin(0.5 * angle),
            Self::Equirectangular | Self::Cylindrical | Self::Equidistant => angle,
        }
    }

    /// Whether the film wraps around from its right edge to its left, after 2 pi.
    pub fn goes_round(self) -> bool {
        matches!(self, Self::Equirectangular | Self::Cylindrical)
    }
}

impl Panorama {
    /// Whether a point of the film has a direction.
    #[inline]
    pub fn sees(&self, film: Vec2) -> bool {
        match self.mapping {
            Mapping::Equirectangular => film.y.abs() <= 0.5 * PI,
            Mapping::Cylindrical => true,
            Mapping::Equidistant => film.length() <= self.circle.min(PI),
            Mapping::Equisolid => film.length() <= self.circle.min(2.0),
        }
    }

    /// The unit direction at a point of the film; an arbitrary one if the point has none.
    #[inline]
    pub fn direction(&self, film: Vec2) -> Vec3 {
        match self.mapping {
            Mapping::Equirectangular => {
                let (sin_lon, cos_lon) = sin_cos(film.x);
                let (sin_lat, cos_lat) = sin_cos(film.y.clamp(-0.5 * PI, 0.5 * PI));
                Vec3::new(sin_lon * cos_lat, sin_lat, cos_lon * cos_lat).normalize()
            }
            Mapping::Cylindrical => {
                let (sin_lon, cos_lon) = sin_cos(film.x);
                Vec3::new(sin_lon, film.y, cos_lon).normalize()
            }
            Mapping::Equidistant => {
                let distance = film.length();
                let (sin, cos) = sin_cos(distance.min(PI));
                around_axis(film, distance, sin, cos)
            }
            Mapping::Equisolid => {
                // r / 2 is the sine of half the angle.
                let distance = film.length();
                let half2 = (0.25 * distance * distance).min(1.0);
                let sin = 2.0 * (half2 * (1.0 - half2)).sqrt();
                around_axis(film, distance, sin, 1.0 - 2.0 * half2)
            }
        }
    }

    /// The point of the film for a direction of any length.
    pub fn film(&self, dir: Vec3) -> Vec2 {
        let round = |distance: f32| {
            let across = dir.truncate();
            let length = across.length();
            // A fisheye's circle is one direction straight behind.
            let to = if length > 0.0 { across / length } else { Vec2::X };
            to * distance
        };
        let angle = || atan2(dir.truncate().length(), dir.z);
        match self.mapping {
            Mapping::Equirectangular => {
                let level = Vec2::new(dir.x, dir.z).length();
                Vec2::new(atan2(dir.x, dir.z), atan2(dir.y, level))
            }
            Mapping::Cylindrical => {
                // Straight up, the latitude's tangent is kept finite.
                let level = Vec2::new(dir.x, dir.z).length().max(1e-6 * dir.y.abs());
                Vec2::new(atan2(dir.x, dir.z), dir.y / level.max(f32::MIN_POSITIVE))
            }
            Mapping::Equidistant => round(angle()),
            Mapping::Equisolid => round(2.0 * sin(0.5 * angle())),
        }
    }
}

fn around_axis(film: Vec2, distance: f32, sin: f32, cos: f32) -> Vec3 {
    match distance > 0.0 {
        true => (film * (sin / distance)).extend(cos).normalize(),
        false => Vec3::Z,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Frame;
    use crate::world::camera::{Camera, Projection};
    use crate::world::filter::PixelFilter;
    use glam::{DVec2, DVec3};
    use std::f64::consts;

    const ALL: [Mapping; 4] = [
        Mapping::Equirectangular,
        Mapping::Cylindrical,
        Mapping::Equidistant,
        Mapping::Equisolid,
    ];

    /// The whole sphere, except the cylinder's ends; pixels are not square.
    fn camera(mapping: Mapping) -> Camera {
        let (width, height) = (40, 30);
        let [across, up] = match mapping {
            Mapping::Equirectangular => [PI, 0.5 * PI],
            Mapping::Cylindrical => [PI, 3.0],
            Mapping::Equidistant => [PI, PI],
            Mapping::Equisolid => [2.0, 2.0],
        };
        let panorama = Panorama {
            mapping,
            row: up / across * (width as f32 / height as f32),
            circle: across,
        };
        let n = Vec3::new(0.3, -0.5, 0.8).normalize();
        let s = n.any_orthonormal_vector();
        Camera {
            projection: Projection::Panoramic(panorama),
            position: Vec3::new(1.0, 2.0, 3.0),
            frame: Frame { s, t: s.cross(n), n },
            half_width: across,
            shift: Vec2::ZERO,
            aperture: 0.0,
            focus_distance: 1.0,
            width,
            height,
            filter: PixelFilter::Box,
        }
    }

    /// From the formulas in angles, in double precision.
    fn expected(mapping: Mapping, film: DVec2) -> DVec3 {
        let of_angles = |lon: f64, lat: f64| {
            DVec3::new(
                libm::sin(lon) * libm::cos(lat),
                libm::sin(lat),
                libm::cos(lon) * libm::cos(lat),
            )
        };
        let of_axis = |angle: f64| {
            let turn = libm::atan2(film.y, film.x);
            DVec3::new(
                libm::sin(angle) * libm::cos(turn),
                libm::sin(angle) * libm::sin(turn),
                libm::cos(angle),
            )
        };
        match mapping {
            Mapping::Equirectangular => of_angles(film.x, film.y),
            Mapping::Cylindrical => of_angles(film.x, libm::atan(film.y)),
            Mapping::Equidistant => of_axis(film.length()),
            Mapping::Equisolid => of_axis(2.0 * libm::asin(0.5 * film.length())),
        }
    }

    #[test]
    fn rays_go_where_the_mapping_says_and_lie_where_they_came_from() {
        for mapping in ALL {
            let camera = camera(mapping);
            let Projection::Panoramic(panorama) = camera.projection else {
                unreachable!()
            };
            let mut seen = 0;
            for i in 0..4000 {
                let u = Vec2::new((i % 80) as f32 + 0.3, (i / 80) as f32 + 0.6);
                let image = u * Vec2::new(0.5, 0.6);
                let half = Vec2::new(0.5 * camera.width as f32, 0.5 * camera.height as f32);
                let pixel = 2.0 * camera.half_width / camera.width as f32;
                let film = (image - half) * Vec2::new(pixel, -pixel * panorama.row);
                assert_eq!(camera.sees(image), panorama.sees(film), "{mapping:?} {image}");
                if !panorama.sees(film) {
                    continue;
                }
                seen += 1;
                let ray = camera.ray(image, Vec2::ZERO);
                let local = Vec3::new(
                    camera.frame.s.dot(ray.dir),
                    camera.frame.t.dot(ray.dir),
                    camera.frame.n.dot(ray.dir),
                );
                let off = local.as_dvec3() - expected(mapping, film.as_dvec2());
                assert!(
                    off.length() < 1e-6 * (1.0 + 1.0 / f64::from(1.0 + local.z).max(1e-3).sqrt())
                        && ray.origin == camera.position,
                    "{mapping:?} {image} {off}"
                );
                let back = camera.image_of(ray.at(5.0)).unwrap();
                // Near the sphere's poles and behind a fisheye, a direction determines its film position poorly.
                let room = match mapping {
                    Mapping::Equirectangular => 1e-4 / (1.0 - local.y.abs()).max(1e-5).sqrt(),
                    Mapping::Cylindrical => 1e-4,
                    Mapping::Equidistant | Mapping::Equisolid => 1e-4 / (1.0 + local.z).max(1e-5).sqrt(),
                };
                assert!(
                    (back - image).length() < room.max(1e-4) * 4.0,
                    "{mapping:?} {image} {back}"
                );
            }
            let share = seen as f64 / 4000.0;
            let whole = if mapping.goes_round() { 1.0 } else { consts::FRAC_PI_4 };
            assert!((share - whole).abs() < 0.02, "{mapping:?} {share}");
        }
    }

    /// The solid angle of pixels, from the corners of small cells of rays, matches the mapping's closed form; the
    /// pixels of a whole sphere add up to 4 pi, and those of an equisolid fisheye are equal.
    #[test]
    fn pixels_have_the_solid_angles_of_the_mapping() {
        for mapping in ALL {
            let camera = camera(mapping);
            let Projection::Panoramic(panorama) = camera.projection else {
                unreachable!()
            };
            const SUB: u32 = 8;
            let pixel = f64::from(2.0 * camera.half_width) / f64::from(camera.width);
            let area = pixel * pixel * f64::from(panorama.row);
            let mut sum = 0.0;
            for y in 0..camera.height * SUB {
                for x in 0..camera.width * SUB {
                    let corner = |dx: u32, dy: u32| Vec2::new((x + dx) as f32, (y + dy) as f32) / SUB as f32;
                    let corners = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
                    if !corners.iter().all(|at| camera.sees(*at)) {
                        continue;
                    }
                    let [a, b, c, d] = corners.map(|at| camera.ray(at, Vec2::ZERO).dir.as_dvec3());
                    let found = 0.5 * (b - a).cross(c - a).length() + 0.5 * (b - d).cross(c - d).length();
                    sum += found;
                    let middle = camera.ray(0.5 * (corners[0] + corners[3]), Vec2::ZERO).dir;
                    let local = Vec3::new(
                        camera.frame.s.dot(middle),
                        camera.frame.t.dot(middle),
                        camera.frame.n.dot(middle),
                    );
                    let (y, z) = (f64::from(local.y), f64::from(local.z));
                    let per_area = match mapping {
                        // cos(latitude), and cos^3 of it.
                        Mapping::Equirectangular => (1.0 - y * y).sqrt(),
                        Mapping::Cylindrical => libm::pow(1.0 - y * y, 1.5),
                        // sin(t) / t.
                        Mapping::Equidistant => (1.0 - z * z).sqrt() / libm::acos(z),
                        Mapping::Equisolid => 1.0,
                    };
                    let expected = area * per_area / f64::from(SUB * SUB);
                    // Near a fisheye's edge, which is one direction, cells are not planar.
                    let is_edge = !mapping.goes_round() && z < -0.5;
                    assert!(
                        is_edge || (found - expected).abs() < 0.02 * expected + 2e-5,
                        "{mapping:?} {x} {y}: {found} {expected}"
                    );
                }
            }
            let whole = match mapping {
                // Beyond the tangent 3: 1 - sin(atan 3) of each half.
                Mapping::Cylindrical => 4.0 * consts::PI * 3.0 / f64::sqrt(10.0),
                _ => 4.0 * consts::PI,
            };
            // The fisheyes' edge consists of cells.
            let room = if mapping.goes_round() { 2e-3 } else { 3e-2 };
            assert!((sum / whole - 1.0).abs() < room, "{mapping:?}: {sum} {whole}");
        }
    }

    /// A crop of an image, and one of its pixels, see what the image sees there; a smaller image sees all of it.
    #[test]
    fn parts_and_smaller_images_see_the_same() {
        for mapping in ALL {
            let whole = camera(mapping);
            let one = whole.pixel(7, 21);
            let (a, b) = (
                one.ray(Vec2::new(0.25, 0.75), Vec2::ZERO),
                whole.ray(Vec2::new(7.25, 21.75), Vec2::ZERO),
            );
            assert!((a.dir - b.dir).length() < 1e-5, "{mapping:?} {a:?} {b:?}");
            let mut small = whole;
            small.resize(17, 11);
            let share = Vec2::new(0.3, 0.4);
            let at = |camera: &Camera| share * Vec2::new(camera.width as f32, camera.height as f32);
            let (a, b) = (small.ray(at(&small), Vec2::ZERO), whole.ray(at(&whole), Vec2::ZERO));
            let is_whole = mapping == Mapping::Equirectangular;
            assert!(!is_whole || (a.dir - b.dir).length() < 1e-5, "{mapping:?} {a:?} {b:?}");
        }
    }
}
