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
    /// Bilinear look-up with repetition; pixel centres at (i + 1/2) / width.
    pub fn bilinear(&self, uv: Vec2) -> Rgb {
        let _ = uv;
        unimplemented!()
    }
}
