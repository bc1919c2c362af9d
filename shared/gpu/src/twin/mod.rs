//! What kernels compute, on a processor: the same bits, except for those of a NaN.
//!
//! | in a kernel        | on a processor     | error                                               |
//! | ------------------ | ------------------ | --------------------------------------------------- |
//! | `quotient`, `root` | `/`, `sqrt`        | rounded to nearest, denormal numbers too            |
//! | `exponential`      | [`math::exp`]      | below 1 ulp                                         |
//! | `exp_neg`          | [`math::exp_neg`]  | relative 2e-7 + 1e-7 x at most; no denormal results |
//! | `ln`               | [`math::ln`]       | below 1 ulp                                         |
//! | `arc_cos`          | [`math::acos`]     | below 1 ulp                                         |
//! | `arc_tan2`         | [`math::atan2`]    | below 1.6 ulp                                       |
//! | `power`            | [`math::powf`]     | below 1 ulp                                         |
//! | `sin_cos`          | [`sin_cos`]        | below 1.6 ulp, for angles of any size               |
//!
//! Surfaces, phase functions and media have the renderer's own bits and are tested against the renderer itself, except
//! where directions are drawn from an angle: those are in [`bsdf`], [`phase`], [`emission`] and [`camera`].
//!
//! `sin_cos` differs from the renderer's, which computes sines with 64-bit floats: few cards have those.
//!
//! [`math::exp`]: beamfarm_render::math::exp
//! [`math::exp_neg`]: beamfarm_render::math::exp_neg
//! [`math::ln`]: beamfarm_render::math::ln
//! [`math::acos`]: beamfarm_render::math::acos
//! [`math::atan2`]: beamfarm_render::math::atan2
//! [`math::powf`]: beamfarm_render::math::powf

pub mod beams;
pub mod bsdf;
pub mod camera;
pub mod emission;
pub mod phase;
pub mod warp;

pub use crate::sine::sin_cos;
