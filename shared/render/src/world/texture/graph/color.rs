//! Colour mixing and colour spaces, by the rules of Blender's nodes.

use super::maths::power;
use crate::math::Rgb;

/// How two colours are mixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum Blend {
    Mix,
    Add,
    Multiply,
    Subtract,
    Screen,
    Divide,
    Difference,
    Exclusion,
    Darken,
    Lighten,
    Overlay,
    Dodge,
    Burn,
    SoftLight,
    LinearLight,
    Hue,
    Saturation,
    Color,
    Value,
}

impl Blend {
    /// All of them, with their names in files.
    pub const ALL: &'static [(&'static str, Self)] = &[
        ("mix", Self::Mix),
        ("add", Self::Add),
        ("multiply", Self::Multiply),
        ("subtract", Self::Subtract),
        ("screen", Self::Screen),
        ("divide", Self::Divide),
        ("difference", Self::Difference),
        ("exclusion", Self::Exclusion),
        ("darken", Self::Darken),
        ("lighten", Self::Lighten),
        ("overlay", Self::Overlay),
        ("dodge", Self::Dodge),
        ("burn", Self::Burn),
        ("soft_light", Self::SoftLight),
        ("linear_light", Self::LinearLight),
        ("hue", Self::Hue),
        ("saturation", Self::Saturation),
        ("color", Self::Color),
        ("value", Self::Value),
    ];
}

fn each(a: Rgb, b: Rgb, of: impl Fn(f32, f32) -> f32) -> Rgb {
    Rgb::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z))
}

/// `t` of the second, and the rest of the first.
pub fn blended(blend: Blend, t: f32, a: Rgb, b: Rgb) -> Rgb {
    let rest = 1.0 - t;
    let towards = |to: Rgb| a * rest + to * t;
    match blend {
        Blend::Mix => towards(b),
        Blend::Add => a + b * t,
        Blend::Multiply => towards(a * b),
        Blend::Subtract => a - b * t,
        Blend::Screen => Rgb::ONE - (rest + t * (Rgb::ONE - b)) * (Rgb::ONE - a),
        Blend::Divide => each(a, b, |a, b| if b != 0.0 { rest * a + t * a / b } else { a }),
        Blend::Difference => towards((a - b).abs()),
        Blend::Exclusion => towards(a + b - 2.0 * a * b).max(Rgb::ZERO),
        Blend::Darken => towards(a.min(b)),
        Blend::Lighten => towards(a.max(b)),
        Blend::Overlay => each(a, b, |a, b| match a < 0.5 {
            true => a * (rest + 2.0 * t * b),
            false => 1.0 - (rest + 2.0 * t * (1.0 - b)) * (1.0 - a),
        }),
        Blend::Dodge => each(a, b, |a, b| match 1.0 - t * b {
            _ if a == 0.0 => 0.0,
            below if below <= 0.0 => 1.0,
            below => (a / below).min(1.0),
        }),
        Blend::Burn => each(a, b, |a, b| match rest + t * b {
            below if below <= 0.0 => 0.0,
            below => (1.0 - (1.0 - a) / below).clamp(0.0, 1.0),
        }),
        Blend::SoftLight => {
            let screen = Rgb::ONE - (Rgb::ONE - b) * (Rgb::ONE - a);
            towards((Rgb::ONE - a) * b * a + a * screen)
        }
        Blend::LinearLight => a + (2.0 * b - Rgb::ONE) * t,
        Blend::Hue | Blend::Color => {
            let [own, other] = [a, b].map(to_hsv);
            if other.y == 0.0 {
                return a;
            }
            let saturation = if blend == Blend::Hue { own.y } else { other.y };
            towards(from_hsv(Rgb::new(other.x, saturation, own.z)))
        }
        Blend::Saturation => {
            let [own, other] = [a, b].map(to_hsv);
            match own.y {
                0.0 => a,
                _ => from_hsv(Rgb::new(own.x, rest * own.y + t * other.y, own.z)),
            }
        }
        Blend::Value => {
            let [own, other] = [a, b].map(to_hsv);
            from_hsv(Rgb::new(own.x, own.y, rest * own.z + t * other.z))
        }
    }
}

/// A colour space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum Space {
    Rgb,
    Hsv,
    Hsl,
}

/// The hue of a colour, [0, 1), its largest and its smallest channel.
fn hue(c: Rgb) -> (f32, f32, f32) {
    let (high, low) = (c.max_element(), c.min_element());
    let span = high - low;
    if span == 0.0 {
        return (0.0, high, low);
    }
    let turn = if c.x == high {
        (c.y - c.z) / span
    } else if c.y == high {
        2.0 + (c.z - c.x) / span
    } else {
        4.0 + (c.x - c.y) / span
    };
    let turn = turn / 6.0;
    (if turn < 0.0 { turn + 1.0 } else { turn }, high, low)
}

/// Hue, saturation and value of a colour.
pub fn to_hsv(c: Rgb) -> Rgb {
    let (hue, high, low) = hue(c);
    let saturation = if high != 0.0 { (high - low) / high } else { 0.0 };
    let hue = if saturation != 0.0 { hue } else { 0.0 };
    Rgb::new(hue, saturation, high)
}

/// The fully saturated colour of a hue.
fn pure(hue: f32) -> Rgb {
    let h = hue * 6.0;
    let channel = |centre: f32| (h - centre).abs();
    Rgb::new(channel(3.0) - 1.0, 2.0 - channel(2.0), 2.0 - channel(4.0)).clamp(Rgb::ZERO, Rgb::ONE)
}

/// The colour with this hue, saturation and value. Hues outside [0, 1] are not wrapped.
pub fn from_hsv(c: Rgb) -> Rgb {
    ((pure(c.x) - Rgb::ONE) * c.y + Rgb::ONE) * c.z
}

/// Hue, saturation and lightness of a colour.
pub fn to_hsl(c: Rgb) -> Rgb {
    let (hue, high, low) = hue(c);
    let lightness = (0.5 * (high + low)).min(1.0);
    let span = high - low;
    let saturation = match span {
        0.0 => 0.0,
        _ if lightness > 0.5 => span / (2.0 - high - low),
        _ => span / (high + low),
    };
    Rgb::new(hue, saturation, lightness)
}

/// The colour with this hue, saturation and lightness.
pub fn from_hsl(c: Rgb) -> Rgb {
    let chroma = (1.0 - (2.0 * c.z - 1.0).abs()) * c.y;
    (pure(c.x) - 0.5) * chroma + c.z
}

/// Applies a node's Hue, Saturation, Value and Factor to a colour.
pub fn hue_saturation(hue: f32, saturation: f32, value: f32, factor: f32, color: Rgb) -> Rgb {
    let hsv = to_hsv(color);
    let turned = hsv.x + hue + 0.5;
    let made = from_hsv(Rgb::new(
        turned - turned.floor(),
        (hsv.y * saturation).clamp(0.0, 1.0),
        hsv.z * value,
    ));
    (made * factor + color * (1.0 - factor)).max(Rgb::ZERO)
}

/// Raises positive channels to a power.
pub fn gamma(color: Rgb, exponent: f32) -> Rgb {
    color.map(|c| if c > 0.0 { power(c, exponent) } else { c })
}

/// Adjusts brightness and contrast, not below zero.
pub fn bright_contrast(color: Rgb, bright: f32, contrast: f32) -> Rgb {
    (color * (1.0 + contrast) + (bright - 0.5 * contrast)).max(Rgb::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spaces_of_colours_lead_back() {
        for i in 0..1000u32 {
            let c = Rgb::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) / 9.0;
            assert!((from_hsv(to_hsv(c)) - c).abs().max_element() < 1e-5, "{c}");
            assert!((from_hsl(to_hsl(c)) - c).abs().max_element() < 1e-5, "{c}");
        }
    }
}
