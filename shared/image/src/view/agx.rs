//! AgX: Troy Sobotka's image formation, as Zijun Eary Zhou, Mark Faderbauer and Sakari Kapanen shaped it for Blender 4
//! (the scripts of AgX_LUT_Gen, "AgX Base sRGB"). Uses its formulas, where Blender has a table of 57 x 57 x 57 colours.
//!
//! In Rec. 2020 (ITU-R BT.2020):
//!
//! 1. Colours outside the gamut come in: with m the least channel below zero and y the luminance, -m is added to all
//!    channels, and they are multiplied by (2 y - m) / (2 y - 2 m).
//! 2. A matrix moves the primaries inwards and turns them: the purer a colour, the more of it goes to the others.
//! 3. Each channel goes through the curve, see [`curve`].
//! 4. The hue is 0.4 of what the curve makes of it and 0.6 of what it was, as in HSV: the middle of the three channels
//!    defines it.
//! 5. Another matrix moves the primaries outwards again.
//!
//! Then, in Rec. 709, colours outside that gamut come in likewise, except that the brighter they are, the more they
//! dim.

use super::{dot, product};

/// Rec. 709 to Rec. 2020, from their primaries and D65.
const TO_REC2020: [[f32; 3]; 3] = [
    [0.627_403_9, 0.329_283_04, 0.043_313_066],
    [0.069_097_29, 0.919_540_4, 0.011_362_316],
    [0.016_391_44, 0.088_013_31, 0.895_595_25],
];
/// Primaries turned by 2.13976149, -1.22827335 and -3.05174246 degrees, and moved from the gamut's border towards white
/// by 0.32965205, 0.28051336 and 0.12475368 of the way.
const INSET: [[f32; 3]; 3] = [
    [0.856_627_16, 0.095_121_24, 0.048_251_6],
    [0.137_318_97, 0.761_242, 0.101_439_04],
    [0.111_898_21, 0.076_799_415, 0.811_302_4],
];
/// From primaries moved towards white by 0.32317438, 0.28325605 and 0.0374326 of the way, to Rec. 709.
const OUTSET: [[f32; 3]; 3] = [
    [1.964_887_4, -0.855_988_5, -0.108_898_91],
    [-0.299_313_35, 1.326_397_9, -0.027_084_592],
    [-0.164_352_73, -0.238_183_96, 1.402_536_7],
];
/// Luminances of the primaries of Rec. 2020 and of Rec. 709, for the CIE 2015 observer.
const LUMINANCE: [f32; 3] = [0.258_923_54, 0.610_498_55, 0.130_577_93];
const LUMINANCE_REC709: [f32; 3] = [0.206_773_79, 0.658_129_8, 0.135_096_42];

/// Stops from middle grey to black and to white.
const BELOW: f32 = 10.0;
const ABOVE: f32 = 6.5;
const MIDDLE: f32 = 0.18;
/// Middle grey's place on the axis of stops, from 0 to 1, and what it becomes; then the curve's slope there.
const PIVOT: [f32; 2] = [BELOW / (BELOW + ABOVE), 0.489_437_1];
const SLOPE: f32 = 2.4;
/// The exponent with which the screen is to decode the curve's values.
const POWER: f32 = 2.4;
/// Scales of the curve's ends: `((slope dx)^-1.5 ((slope dx / dy)^1.5 - 1))^(-2/3)`, with dx and dy from the pivot to
/// the end.
const TOE: f32 = 0.565_675_6;
const SHOULDER: f32 = 0.715_198_3;
/// The curve's share of the hue.
const SKEW: f32 = 0.4;

/// The tone curve of one channel, to [0, 1]. Let t be on a logarithmic axis from 10 stops below middle grey, 0.18, to
/// 6.5 above (of radiance: log2 from -12.47393 to 4.026069). Then
///
/// ```text
/// y = 0.18^(1/2.4) + k r / (1 + r^1.5)^(2/3),    r = 2.4 (t - 10 / 16.5) / k,
/// ```
///
/// where k is negative below middle grey. The result is y^2.4, so that middle grey keeps its value.
pub(crate) fn curve(v: f32) -> f32 {
    let stops = libm::log2f(v.max(0.0) / MIDDLE);
    let t = ((stops + BELOW) / (BELOW + ABOVE)).clamp(0.0, 1.0);
    let k = if t < PIVOT[0] { -TOE } else { SHOULDER };
    let r = (SLOPE * (t - PIVOT[0]) / k).max(0.0);
    let root = libm::cbrtf(1.0 + r * libm::sqrtf(r));
    let y = PIVOT[1] + k * r / (root * root);
    libm::powf(y.clamp(0.0, 1.0), POWER)
}

/// What is shown of finite linear Rec. 709, in the same space; not encoded, and clipped below but not above. `curve`:
/// [`curve`], or an approximation.
pub(crate) fn formed(light: [f32; 3], curve: impl Fn(f32) -> f32) -> [f32; 3] {
    let light = within(product(&TO_REC2020, light), |light| {
        2.0 * dot(LUMINANCE, light) - least(light)
    });
    let before = product(&INSET, light);
    let mut formed = before.map(curve);
    // A rising curve keeps the order of channels.
    let [low, middle, high] = order(before);
    let place = |v: [f32; 3]| {
        let range = v[high] - v[low];
        if range > 0.0 { (v[middle] - v[low]) / range } else { 0.0 }
    };
    if formed[high] > formed[low] {
        let place = place(before) + SKEW * (place(formed) - place(before));
        formed[middle] = formed[low] + place * (formed[high] - formed[low]);
    }
    within(product(&OUTSET, formed), |shown| {
        let luminance = dot(LUMINANCE_REC709, shown);
        let plain = 2.0 * luminance - least(shown);
        let share = libm::powf(luminance.clamp(0.0, 1.0), 0.08);
        plain + share * (luminance - plain)
    })
}

/// Removes negative channels: the same amount is added to all channels, and all are dimmed so that the colour is no
/// brighter than before, by a measure of brightness.
fn within(colour: [f32; 3], brightness: impl Fn([f32; 3]) -> f32) -> [f32; 3] {
    let least = least(colour);
    if least >= 0.0 {
        return colour;
    }
    let raised = colour.map(|v| v - least);
    let (before, now) = (brightness(colour), brightness(raised));
    let scale = if now > 0.0 { (before / now).clamp(0.0, 1.0) } else { 0.0 };
    raised.map(|v| v * scale)
}

fn least([r, g, b]: [f32; 3]) -> f32 {
    r.min(g).min(b)
}

/// The indices of the least, the middle and the largest channel.
fn order(v: [f32; 3]) -> [usize; 3] {
    let mut places = [0, 1, 2];
    places.sort_by(|a, b| v[*a].total_cmp(&v[*b]));
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{View, ViewTransform, srgb};

    fn shown(pixel: [f32; 3]) -> [f32; 3] {
        let view = View {
            transform: ViewTransform::Agx,
            ..View::default()
        };
        view.ready().encoded(pixel).map(|v| 255.0 * v)
    }

    #[test]
    fn matrices_keep_white() {
        for matrix in [TO_REC2020, INSET, OUTSET] {
            for row in matrix {
                assert!((row.iter().sum::<f32>() - 1.0).abs() < 2e-7, "{row:?}");
            }
        }
        for luminance in [LUMINANCE, LUMINANCE_REC709] {
            assert!((luminance.iter().sum::<f32>() - 1.0).abs() < 2e-7);
        }
    }

    #[test]
    fn the_curve_has_its_ends_and_its_middle() {
        let pow = libm::pow;
        for (scale, [dx, dy]) in [
            (TOE, [10.0 / 16.5, pow(0.18, 1.0 / 2.4)]),
            (SHOULDER, [6.5 / 16.5, 1.0 - pow(0.18, 1.0 / 2.4)]),
        ] {
            let expected = pow(pow(2.4 * dx, -1.5) * (pow(2.4 * dx / dy, 1.5) - 1.0), -2.0 / 3.0);
            assert!((f64::from(scale) - expected).abs() < 1e-7, "{scale} {expected}");
        }
        assert!((f64::from(PIVOT[1]) - pow(0.18, 1.0 / 2.4)).abs() < 1e-7);
        assert!((curve(0.18) - 0.18).abs() < 1e-6 && srgb(curve(0.0)) < 1e-6);
        assert!(curve(libm::exp2f(-12.47393)) < 1e-6);
        assert!((curve(libm::exp2f(4.026_07)) - 1.0).abs() < 1e-6 && curve(f32::INFINITY) == curve(1e9));
    }

    /// Values out of 255 from Blender 4.5.15's own AgX: `save_render` of a float image as a 16-bit TIFF. Its table is
    /// not exact.
    #[test]
    fn blender_shows_the_same() {
        let blender = [
            ([0.01, 0.01, 0.01], [18.5, 18.5, 18.5]),
            ([0.18, 0.18, 0.18], [117.6, 117.6, 117.6]),
            ([0.5, 0.5, 0.5], [169.6, 169.6, 169.6]),
            ([1.0, 1.0, 1.0], [196.6, 196.6, 196.6]),
            ([4.0, 4.0, 4.0], [233.0, 233.0, 233.0]),
            ([0.8, 0.45, 0.3], [190.9, 163.7, 148.6]),
            ([0.2, 0.4, 1.0], [136.7, 163.3, 200.6]),
            ([1.0, 0.0, 0.0], [218.8, 57.2, 33.0]),
            ([4.0, 0.0, 0.0], [254.6, 148.3, 134.8]),
            ([0.0, 0.5, 0.0], [62.2, 167.7, 21.1]),
            ([0.0, 8.0, 0.0], [207.2, 246.5, 196.4]),
            ([0.0, 0.0, 4.0], [132.2, 157.9, 247.6]),
            ([0.05, 0.02, 0.3], [53.2, 55.7, 148.2]),
            ([2.0, 1.2, 0.1], [222.6, 196.9, 148.1]),
            ([0.3, 0.5, 0.25], [147.9, 167.5, 138.3]),
            ([8.0, 3.0, 0.5], [251.3, 223.6, 202.4]),
            ([1.0, -0.02, 0.05], [218.2, 54.0, 72.5]),
        ];
        for (pixel, expected) in blender {
            let shown = shown(pixel);
            assert!(
                (0..3).all(|i| (shown[i] - expected[i]).abs() < 2.5),
                "{pixel:?}: {shown:?}, not {expected:?}"
            );
        }
    }

    /// Pure light fades to white, and light outside the gamut comes in.
    #[test]
    fn colours_fade_and_come_in() {
        let spread = |[r, g, b]: [f32; 3]| r.max(g).max(b) - r.min(g).min(b);
        let mut before = f32::INFINITY;
        for stops in 0..8 {
            let now = spread(shown([libm::exp2f(stops as f32), 0.0, 0.0]));
            assert!(now < before, "{stops}: {now}");
            before = now;
        }
        assert!(before < 60.0, "{before}");
        for (outside, largest) in [
            ([1.0, -0.2, -0.05], 0),
            ([-0.3, 1.0, -0.1], 1),
            ([-0.1, -0.2, 1.0], 2),
            ([-0.4, 0.9, 1.2], 2),
        ] {
            let pixel = shown(outside);
            assert!((0..3).all(|i| pixel[i] <= pixel[largest]), "{outside:?}: {pixel:?}");
            assert!(
                (0..3).all(|i| pixel[i] >= 0.0 && pixel[i] <= 255.0),
                "{outside:?}: {pixel:?}"
            );
        }
        assert_eq!(shown([-1.0; 3]), [0.0; 3]);
    }
}
