//! What is known of a surface before light meets it.

use crate::world::texture::Texture;

/// Lobes of less roughness are followed: hardly a photon is seen in them, and light sampling hardly hits them.
pub(super) const FOLLOWED_BELOW: f32 = 0.1;

/// Roughness of gloss.
const GLOSS: std::ops::RangeInclusive<f32> = 0.02..=0.5;

bitflags::bitflags! {
    /// Properties of a surface: of a [`Material`](super::Material) what may hold somewhere on it, of a
    /// [`Bsdf`](super::Bsdf) what holds at a hit. A blend has those of either part, where nothing else is said.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct BsdfFlags: u32 {
        /// Scatters in discrete directions alone: camera paths go on through it. Of a blend, both parts do.
        const SPECULAR = 1;
        /// Scatters some light in discrete directions.
        const DELTA = 1 << 1;
        /// Has a lobe of microfacets.
        const ROUGH = 1 << 2;
        /// Has a lobe of roughness 0.02 to 0.5: wide enough for photons to be seen in it, and far from diffuse.
        const GLOSSY = 1 << 3;
        /// All that it scatters is a lobe of roughness below 0.1: paths follow it as they follow mirrors.
        const FOLLOWED = 1 << 4;
        /// A lobe that paths follow stands beside a wide one: see [`super::Bsdf::narrow_and_wide`].
        const NARROW_LOBE = 1 << 5;
        /// Scatters light that paths do not follow.
        const WIDE = 1 << 6;
        /// Light may be reflected and refracted by it, go through a pane, or come out diffusely on the other side.
        const REFRACTS = 1 << 7;
        /// Rays may go straight through as if it were not there.
        const PASSABLE = 1 << 8;
        /// Nothing but the boundary of a medium. No blend is.
        const NULL = 1 << 9;
        /// Two media may meet at it: light passes between its inside and its outside, and nowhere beside it.
        const BOUNDS_MEDIA = 1 << 10;
        /// Bends light of each wavelength by another angle.
        const DISPERSES = 1 << 11;
        /// Varies with texture coordinates.
        const READS_UV = 1 << 12;
        /// Varies with the colours of vertices.
        const READS_COLORS = 1 << 13;
        /// Varies with where on an object a point is.
        const READS_PLACE = 1 << 14;
        /// Between two media of different indices of refraction: bends what goes through.
        const BENDS = 1 << 15;
        /// On something thinner than any kernel, as hairs are: paths follow all that it scatters, and no photon is left
        /// there nor looked up.
        const THIN = 1 << 16;
        /// Depends on how directions lie to a tangent of the surface, most often that along its u.
        const ALONG_U = 1 << 17;
        /// A coat over it has another normal than what lies below: those of bumps and normal maps belong to the lobes,
        /// and the frame is around that of the shape.
        const FACES_TWO_WAYS = 1 << 18;
        /// Light comes out on the other side, bent or not.
        const TRANSMITS = Self::REFRACTS.bits() | Self::PASSABLE.bits();
        /// Varies over the surface.
        const VARIES = Self::READS_UV.bits() | Self::READS_COLORS.bits() | Self::READS_PLACE.bits();
    }
}

impl BsdfFlags {
    /// Of what scatters in discrete directions alone.
    pub(super) const SMOOTH: Self = Self::SPECULAR.union(Self::DELTA);

    /// These, if something holds.
    #[inline(always)]
    pub(super) fn when(self, holds: bool) -> Self {
        if holds { self } else { Self::empty() }
    }

    /// Of one lobe with roughness from `low` to `high`, with nothing beside it.
    #[inline(always)]
    pub(super) fn of_lobe([low, high]: [f32; 2]) -> Self {
        Self::of_roughness([low, high])
            | Self::FOLLOWED.when(low < FOLLOWED_BELOW)
            | Self::WIDE.when(high >= FOLLOWED_BELOW)
    }

    /// Of such a lobe beside a diffuse one.
    #[inline(always)]
    pub(super) fn of_coat([low, high]: [f32; 2]) -> Self {
        Self::of_roughness([low, high]) | Self::WIDE | Self::NARROW_LOBE.when(low < FOLLOWED_BELOW)
    }

    #[inline(always)]
    fn of_roughness([low, high]: [f32; 2]) -> Self {
        Self::ROUGH | Self::GLOSSY.when(low <= *GLOSS.end() && high >= *GLOSS.start())
    }

    /// The same on something thin.
    pub(super) fn thinned(self) -> Self {
        let thin = Self::THIN | Self::FOLLOWED.when(!self.contains(Self::SPECULAR));
        (self - (Self::WIDE | Self::NARROW_LOBE | Self::GLOSSY)) | thin
    }

    /// Of textures that a surface looks up.
    pub(super) fn reading<const N: usize>(textures: [&Texture; N]) -> Self {
        textures.iter().fold(Self::empty(), |flags, texture| {
            flags
                | Self::READS_UV.when(texture.reads_uv())
                | Self::READS_COLORS.when(texture.reads_colors())
                | Self::READS_PLACE.when(texture.reads_place())
        })
    }

    /// Of a blend of surfaces with these and with others.
    pub(super) fn blended(self, other: Self) -> Self {
        // Where one part lets light pass that is no boundary, the blend is none.
        let lets_pass =
            [self, other].map(|part| part.intersects(Self::TRANSMITS) && !part.contains(Self::BOUNDS_MEDIA));
        ((self | other) - (Self::SPECULAR | Self::NULL) - Self::BOUNDS_MEDIA.when(lets_pass.contains(&true)))
            | (self & other & Self::SPECULAR)
    }
}
