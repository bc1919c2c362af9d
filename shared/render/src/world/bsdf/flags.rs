//! What is known of a surface before light meets it.

use crate::world::texture::Texture;

/// Paths follow lobes of lower roughness: few photons land in them, and light sampling rarely hits them.
pub(super) const FOLLOWED_BELOW: f32 = 0.1;

/// Roughness range of gloss.
const GLOSS: std::ops::RangeInclusive<f32> = 0.02..=0.5;

bitflags::bitflags! {
    /// Properties of a surface: for a [`Material`](super::Material) what may hold somewhere on it, for a
    /// [`Bsdf`](super::Bsdf) what holds at a hit. A blend has those of either part, unless noted otherwise.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct BsdfFlags: u32 {
        /// Scatters in discrete directions only: camera paths continue through it. A blend needs this of both parts.
        const SPECULAR = 1;
        /// Scatters some light in discrete directions.
        const DELTA = 1 << 1;
        /// Has a lobe of microfacets.
        const ROUGH = 1 << 2;
        /// Has a lobe of roughness 0.02 to 0.5: wide enough to see photons in it, and far from diffuse.
        const GLOSSY = 1 << 3;
        /// Scatters only into a lobe of roughness below 0.1: paths follow it as they follow mirrors.
        const FOLLOWED = 1 << 4;
        /// Has a lobe that paths follow together with a wide one: see [`super::Bsdf::narrow_and_wide`].
        const NARROW_LOBE = 1 << 5;
        /// Scatters light that paths do not follow.
        const WIDE = 1 << 6;
        /// May both reflect and refract light, let it through a pane, or send it out diffusely on the other side.
        const REFRACTS = 1 << 7;
        /// Rays may go straight through as if it were not there.
        const PASSABLE = 1 << 8;
        /// Only the boundary of a medium. No blend is.
        const NULL = 1 << 9;
        /// Two media may meet at it: light passes between its inside and its outside, and nowhere else.
        const BOUNDS_MEDIA = 1 << 10;
        /// Refracts each wavelength by a different angle.
        const DISPERSES = 1 << 11;
        /// Varies with texture coordinates.
        const READS_UV = 1 << 12;
        /// Varies with the colours of vertices.
        const READS_COLORS = 1 << 13;
        /// Varies with the position on the object.
        const READS_PLACE = 1 << 14;
        /// Lies between two media of different indices of refraction and refracts what it transmits.
        const BENDS = 1 << 15;
        /// Thinner than any kernel, as hairs are: paths follow everything that it scatters; photons are neither stored
        /// nor looked up there.
        const THIN = 1 << 16;
        /// Depends on how directions lie relative to a tangent of the surface, usually along its u.
        const ALONG_U = 1 << 17;
        /// Has a coat with a normal other than the layer below. Bump and normal maps then belong to the lobes, and the
        /// frame is around the shape's normal.
        const FACES_TWO_WAYS = 1 << 18;
        /// Lets light out on the other side, refracted or not.
        const TRANSMITS = Self::REFRACTS.bits() | Self::PASSABLE.bits();
        /// Varies over the surface.
        const VARIES = Self::READS_UV.bits() | Self::READS_COLORS.bits() | Self::READS_PLACE.bits();
    }
}

impl BsdfFlags {
    /// Flags of a surface that scatters in discrete directions only.
    pub(super) const SMOOTH: Self = Self::SPECULAR.union(Self::DELTA);

    /// These flags if the condition holds, otherwise none.
    #[inline(always)]
    pub(super) fn when(self, holds: bool) -> Self {
        if holds { self } else { Self::empty() }
    }

    /// Flags of a single lobe with roughness from `low` to `high`.
    #[inline(always)]
    pub(super) fn of_lobe([low, high]: [f32; 2]) -> Self {
        Self::of_roughness([low, high])
            | Self::FOLLOWED.when(low < FOLLOWED_BELOW)
            | Self::WIDE.when(high >= FOLLOWED_BELOW)
    }

    /// Flags of such a lobe over a diffuse one.
    #[inline(always)]
    pub(super) fn of_coat([low, high]: [f32; 2]) -> Self {
        Self::of_roughness([low, high]) | Self::WIDE | Self::NARROW_LOBE.when(low < FOLLOWED_BELOW)
    }

    #[inline(always)]
    fn of_roughness([low, high]: [f32; 2]) -> Self {
        Self::ROUGH | Self::GLOSSY.when(low <= *GLOSS.end() && high >= *GLOSS.start())
    }

    /// The same flags on something thin.
    pub(super) fn thinned(self) -> Self {
        let thin = Self::THIN | Self::FOLLOWED.when(!self.contains(Self::SPECULAR));
        (self - (Self::WIDE | Self::NARROW_LOBE | Self::GLOSSY)) | thin
    }

    /// Flags of the textures that a surface looks up.
    pub(super) fn reading<const N: usize>(textures: [&Texture; N]) -> Self {
        textures.iter().fold(Self::empty(), |flags, texture| {
            flags
                | Self::READS_UV.when(texture.reads_uv())
                | Self::READS_COLORS.when(texture.reads_colors())
                | Self::READS_PLACE.when(texture.reads_place())
        })
    }

    /// Flags of a blend of two surfaces.
    pub(super) fn blended(self, other: Self) -> Self {
        // Where one part lets light pass and is no boundary, the blend is none.
        let lets_pass =
            [self, other].map(|part| part.intersects(Self::TRANSMITS) && !part.contains(Self::BOUNDS_MEDIA));
        ((self | other) - (Self::SPECULAR | Self::NULL) - Self::BOUNDS_MEDIA.when(lets_pass.contains(&true)))
            | (self & other & Self::SPECULAR)
    }
}
