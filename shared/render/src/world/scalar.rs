//! Numbers over a surface: constant, or those of a texture.

use crate::world::texture::{Texture, TexturePoint};

/// A number per surface point.
#[derive(Clone, Debug)]
pub struct Scalar {
    texture: Texture,
    range: [f32; 2],
}

impl Scalar {
    /// The same everywhere.
    pub const fn constant(value: f32) -> Self {
        Self {
            texture: Texture::Constant(crate::math::Rgb::splat(value)),
            range: [value; 2],
        }
    }

    /// The red channel of a texture; of greys, their value.
    pub fn of(texture: Texture) -> Self {
        let range = texture.range_of_red();
        Self { texture, range }
    }

    /// The number at a point.
    #[inline]
    pub fn eval(&self, at: &TexturePoint) -> f32 {
        self.texture.eval(at).x
    }

    /// What it is looked up in.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Between which numbers all of them are.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// It is zero everywhere.
    pub fn is_zero(&self) -> bool {
        self.range == [0.0; 2]
    }

    /// Whether it varies over the surface.
    pub fn varies(&self) -> bool {
        !matches!(self.texture, Texture::Constant(_))
    }
}
