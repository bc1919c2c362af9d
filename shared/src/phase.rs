//! Phase functions: 1/sr, integrating to 1 over the sphere.

/// A phase function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// 1/(4 pi) in every direction.
    Isotropic,
    /// Henyey-Greenstein; `g` in (-1, 1) is the mean cosine between the old and the new direction of travel.
    HenyeyGreenstein {
        /// Mean cosine.
        g: f32,
    },
}
