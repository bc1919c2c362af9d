//! Reflectance that is one colour or an image.

use crate::math::{Rgb, Vec2};

/// An RGB value per surface point.
#[derive(Clone, Debug)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// An image over the unit square of UV, repeated, bilinear. v runs upwards: the first row is v = 1.
    Image(std::sync::Arc<Image>),
}

/// Linear RGB pixels, row by row from the top left.
#[derive(Clone, Debug)]
pub struct Image {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width * height` pixels.
    pub pixels: Vec<Rgb>,
}

impl Texture {
    /// The value at `uv`.
    pub fn eval(&self, uv: Vec2) -> Rgb {
        match self {
            Self::Constant(c) => *c,
            Self::Image(image) => image.bilinear(uv),
        }
    }
}

impl Image {
    /// Bilinear look-up with repetition; pixel centres at (i + 1/2) / width. Finite pixels give finite values for any finite
    /// `uv`, far from the unit square at the precision that single precision leaves.
    #[inline]
    pub fn bilinear(&self, uv: Vec2) -> Rgb {
        let (x0, x1, fx) = neighbours(uv.x, self.width);
        // Rows count from the top, v from the bottom.
        let (y0, y1, fy) = neighbours(1.0 - (uv.y - uv.y.floor()), self.height);
        let row0 = y0 * self.width as usize;
        let row1 = y1 * self.width as usize;
        let top = self.pixels[row0 + x0] * (1.0 - fx) + self.pixels[row0 + x1] * fx;
        let bottom = self.pixels[row1 + x0] * (1.0 - fx) + self.pixels[row1 + x1] * fx;
        top * (1.0 - fy) + bottom * fy
    }
}

/// The two pixels of a row of `n` whose centres enclose the coordinate `t`, and how far it is from the first to the second.
#[inline]
fn neighbours(t: f32, n: u32) -> (usize, usize, f32) {
    // The fraction may round up to 1, hence `x` is in [-1/2, n - 1/2].
    let x = (t - t.floor()) * n as f32 - 0.5;
    let first = x.floor();
    let fraction = x - first;
    let last = n as usize - 1;
    if first < 0.0 {
        return (last, 0, fraction);
    }
    let first = (first as usize).min(last);
    (first, if first == last { 0 } else { first + 1 }, fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 x 2 pixels, numbered row by row from the top left.
    fn image() -> Image {
        Image {
            width: 3,
            height: 2,
            pixels: (0..6).map(|i| Rgb::splat(i as f32)).collect(),
        }
    }

    #[test]
    fn pixel_centres_give_the_pixels_and_v_runs_upwards() {
        let image = image();
        for y in 0..2 {
            for x in 0..3 {
                let uv = Vec2::new((x as f32 + 0.5) / 3.0, 1.0 - (y as f32 + 0.5) / 2.0);
                for shift in [Vec2::ZERO, Vec2::new(-2.0, 5.0), Vec2::new(7.0, -1.0)] {
                    let value = image.bilinear(uv + shift).x;
                    assert!(
                        (value - (3 * y + x) as f32).abs() < 1e-5,
                        "{x} {y}: {value}"
                    );
                }
            }
        }
    }

    #[test]
    fn between_centres_it_is_linear_and_wraps() {
        let image = image();
        let value = |u, v| image.bilinear(Vec2::new(u, v)).x;
        assert!((value(1.0 / 3.0, 0.75) - 0.5).abs() < 1e-6);
        assert!((value(0.0, 0.75) - 1.0).abs() < 1e-6, "pixels 2 and 0");
        assert!((value(0.5, 0.5) - 2.5).abs() < 1e-6, "pixels 1 and 4");
        assert!((value(0.5, 0.0) - 2.5).abs() < 1e-6, "pixels 4 and 1");
    }

    #[test]
    fn any_finite_coordinate_is_finite() {
        let single = Image {
            width: 1,
            height: 1,
            pixels: vec![Rgb::ONE],
        };
        let values = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            1e-30,
            -1e-30,
            -1e-8,
            0.999_999_94,
            1e7,
            -1e9,
            f32::MAX,
            f32::MIN,
        ];
        for u in values {
            for v in values {
                let value = image().bilinear(Vec2::new(u, v)).x;
                assert!((0.0..=5.0).contains(&value));
                assert_eq!(single.bilinear(Vec2::new(u, v)), Rgb::ONE);
            }
        }
    }
}
