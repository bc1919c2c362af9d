//! Numbers over a surface: constant, or from a texture.

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

    /// The red channel of a texture; for greys, their value.
    pub fn of(texture: Texture) -> Self {
        let range = texture.range_of_red();
        Self { texture, range }
    }

    /// The number at a point.
    #[inline]
    pub fn eval(&self, at: &TexturePoint) -> f32 {
        self.texture.eval(at).x
    }

    /// The texture behind it.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Bounds of all its values.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// Whether it is zero everywhere.
    pub fn is_zero(&self) -> bool {
        self.range == [0.0; 2]
    }

    /// Whether it varies over the surface.
    pub fn varies(&self) -> bool {
        !matches!(self.texture, Texture::Constant(_))
    }
}
