//! How linear radiance becomes what a screen shows, for PNG and JPEG alike. EXRs are not affected.
//!
//! A pixel is multiplied by 2^exposure, its white is balanced ([`white`]), a curve maps it to \[0, 1\], and the sRGB
//! transfer function encodes it.

pub(crate) mod agx;
pub mod white;

use serde::{Deserialize, Serialize};
use white::NEUTRAL;

/// Exposed radiance beyond this counts as infinite; sums of it stay finite.
const MOST: f32 = 1e30;

/// The curve from exposed radiance to what the screen shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ViewTransform {
    /// Each channel unchanged, clipped to \[0, 1\].
    #[default]
    Standard,
    /// Each channel through a film curve that rolls off highlights: Hable 2010.
    Filmic,
    /// AgX by Troy Sobotka, as in Blender: bright, saturated colours fade to white.
    Agx,
}

impl ViewTransform {
    /// The transform of this name, as in scene files and addresses.
    pub fn named(name: &str) -> Option<Self> {
        let all = [Self::Standard, Self::Filmic, Self::Agx];
        all.into_iter().find(|transform| transform.name() == name)
    }

    /// The transform's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Filmic => "filmic",
            Self::Agx => "agx",
        }
    }
}

/// How a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The curve.
    pub transform: ViewTransform,
    /// Stops: 1 doubles the brightness.
    pub exposure: f32,
    /// Temperature of the light that should look white, kelvin. [`white::NEUTRAL`] changes nothing.
    pub white_balance: f32,
}

impl Default for View {
    fn default() -> Self {
        Self {
            transform: ViewTransform::Standard,
            exposure: 0.0,
            white_balance: NEUTRAL,
        }
    }
}

impl View {
    /// The standard view with this exposure, in stops.
    pub fn exposed(exposure: f32) -> Self {
        Self {
            exposure,
            ..Self::default()
        }
    }

    /// Computes what all pixels share.
    pub(crate) fn ready(self) -> Ready {
        Ready {
            transform: self.transform,
            scale: libm::exp2f(self.exposure),
            balance: white::balance(self.white_balance),
        }
    }
}

/// A [`View`] prepared for pixels.
pub(crate) struct Ready {
    pub transform: ViewTransform,
    scale: f32,
    balance: Option<[[f32; 3]; 3]>,
}

impl Ready {
    /// The light of a pixel, exposed and balanced. Without white balance, no channel affects another.
    pub fn light(&self, pixel: [f32; 3]) -> [f32; 3] {
        let exposed = pixel.map(|v| v * self.scale);
        match &self.balance {
            None => exposed,
            Some(balance) => product(balance, exposed.map(finite)),
        }
    }

    /// What the screen gets for a pixel, three numbers from 0 to 1. Where a single channel is NaN it may stay NaN,
    /// which shows as black.
    pub fn encoded(&self, pixel: [f32; 3]) -> [f32; 3] {
        let light = self.light(pixel);
        match self.transform {
            ViewTransform::Standard => light.map(srgb),
            ViewTransform::Filmic => light.map(|v| srgb(filmic(v))),
            ViewTransform::Agx => agx::formed(light.map(finite), agx::curve).map(srgb),
        }
    }
}

/// Zero for NaN, and the largest value for infinity.
pub(crate) fn finite(v: f32) -> f32 {
    if v.is_nan() { 0.0 } else { v.clamp(-MOST, MOST) }
}

fn product(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| dot(row, v))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The sRGB transfer function (IEC 61966-2-1) of a value clamped to [0, 1]; NaN is black.
pub(crate) fn srgb(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * libm::powf(v, 1.0 / 2.4) - 0.055
    }
}

/// Hable 2010, "Uncharted 2: HDR Lighting", GDC: a shoulder that rolls off highlights, and a toe, as film has. With
///
/// ```text
/// h(x) = (x (a x + c b) + d e) / (x (a x + b) + d f) - e / f,
/// ```
///
/// this is h(2 x) / h(11.2), and 1 from x = 5.6 on. NaN is black.
pub(crate) fn filmic(exposed: f32) -> f32 {
    const BIAS: f32 = 2.0;
    const WHITE: f32 = 11.2;
    // Strength of the shoulder; strength and angle of the line; strength, numerator and denominator of the toe.
    let [a, b, c, d, e, f] = [0.15, 0.5, 0.1, 0.2, 0.02, 0.3];
    let h = |x: f32| (x * (a * x + c * b) + d * e) / (x * (a * x + b) + d * f) - e / f;
    let x = BIAS * exposed;
    if x > 0.0 { h(x.min(WHITE)) / h(WHITE) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(transform: ViewTransform) -> View {
        View {
            transform,
            ..View::default()
        }
    }

    const ALL: [ViewTransform; 3] = [ViewTransform::Standard, ViewTransform::Filmic, ViewTransform::Agx];

    /// Values from IEC 61966-2-1.
    #[test]
    fn the_transfer_function_is_srgb() {
        let published = [
            (0.0, 0.0),
            (0.002, 0.02584),
            (0.18, 0.461_356),
            (0.5, 0.735_357),
            (1.0, 1.0),
        ];
        for (linear, encoded) in published {
            assert!((srgb(linear) - encoded).abs() < 2e-6, "{linear}: {}", srgb(linear));
        }
    }

    #[test]
    fn the_standard_view_is_the_transfer_function_to_the_bit() {
        let ready = View::exposed(0.7).ready();
        let pixel = [0.02, 0.5, 3.0];
        assert_eq!(ready.encoded(pixel), pixel.map(|v| srgb(v * libm::exp2f(0.7))));
        // A NaN channel leaves the others alone.
        let [red, green, blue] = ready.encoded([f32::NAN, 0.5, f32::INFINITY]);
        assert!(red.is_nan() && green == srgb(0.5 * libm::exp2f(0.7)) && blue == srgb(1.0));
    }

    /// Values of the formula in double precision.
    #[test]
    fn film_rolls_off() {
        for (exposed, expected) in [(0.0, 0.0), (0.18, 0.128_338), (1.0, 0.492_919), (5.6, 1.0)] {
            let found = filmic(exposed);
            assert!((found - expected).abs() < 1e-5, "{exposed}: {found}");
        }
        for black in [f32::NAN, -1.0, f32::NEG_INFINITY] {
            assert!(filmic(black).abs() < 1e-6, "{black}");
        }
        assert!((filmic(f32::INFINITY) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn curves_rise_from_black_to_white() {
        for transform in ALL {
            let ready = view(transform).ready();
            let grey = |v: f32| ready.encoded([v; 3]);
            assert!(grey(0.0).iter().all(|v| v.abs() < 1e-6), "{transform:?}");
            assert!(grey(64.0).iter().all(|v| (v - 1.0).abs() < 1e-6), "{transform:?}");
            let mut before = grey(0.0);
            for i in 0..2600 {
                let exposed = 1e-4 * libm::exp2f(i as f32 / 150.0);
                let now = grey(exposed);
                // Where a screen's steps are 4e-3.
                assert!(
                    (0..3).all(|c| now[c] >= before[c] - 1e-6),
                    "{transform:?} {exposed}: {now:?}"
                );
                assert!(now[0] - before[0] < 5e-3, "{transform:?} {exposed}: {now:?}");
                assert!(
                    (now[0] - now[1]).abs() < 2e-6 && (now[0] - now[2]).abs() < 2e-6,
                    "{now:?}"
                );
                before = now;
            }
        }
    }

    /// Light beyond the gamut, infinite light, and none at all.
    #[test]
    fn all_light_can_be_shown() {
        let values = [
            0.0,
            -0.0,
            1e-40,
            0.3,
            -0.3,
            7.0,
            -7.0,
            f32::MAX,
            f32::MIN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
        ];
        for transform in ALL {
            for white_balance in [f32::NAN, -1.0, 0.0, 1500.0, 4500.0, 6500.0, 25_000.0, f32::INFINITY] {
                for exposure in [-40.0, 0.0, 40.0, f32::INFINITY] {
                    let ready = View {
                        transform,
                        exposure,
                        white_balance,
                    }
                    .ready();
                    for i in 0..values.len().pow(3) {
                        let pixel = [i, i / values.len(), i / values.len() / values.len()].map(|i| i % values.len());
                        let pixel = pixel.map(|i| values[i]);
                        let shown = ready.encoded(pixel);
                        let fits =
                            |v: f32| (0.0..=1.0).contains(&v) || (v.is_nan() && transform == ViewTransform::Standard);
                        assert!(shown.into_iter().all(fits), "{transform:?} {pixel:?}: {shown:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn names_are_read_back() {
        for transform in ALL {
            assert_eq!(ViewTransform::named(transform.name()), Some(transform));
        }
        assert_eq!(ViewTransform::named("AgX"), None);
    }
}
