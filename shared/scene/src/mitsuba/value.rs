//! Property values: numbers, colours, strings, transforms.

use super::attributes::{Attributes, number, numbers, only, triple, words};
use super::transform::Step;

/// A property's value.
#[derive(Clone, Debug)]
pub enum Value {
    Boolean(bool),
    Integer(i64),
    Float(f64),
    String(String),
    /// A point or a vector.
    Vector([f64; 3]),
    Rgb([f64; 3]),
    /// `<spectrum value="x"/>`: constant over all wavelengths.
    Uniform(f64),
    /// Values at ascending wavelengths (nm).
    Spectrum(Vec<(f64, f64)>),
    /// Steps in order of application.
    Transform(Vec<Step>),
}

impl Value {
    /// The type's name in messages.
    pub fn describe(&self) -> &'static str {
        match self {
            Self::Boolean(_) => "a <boolean>",
            Self::Integer(_) => "an <integer>",
            Self::Float(_) => "a <float>",
            Self::String(_) => "a <string>",
            Self::Vector(_) => "a <point> or <vector>",
            Self::Rgb(_) => "an <rgb>",
            Self::Uniform(_) | Self::Spectrum(_) => "a <spectrum>",
            Self::Transform(_) => "a <transform>",
        }
    }
}

/// The value of a property element. `old`: the file is of a version before 2, which accepts more.
pub fn parse(tag: &str, attributes: &Attributes, old: bool) -> Result<Value, String> {
    let vector = matches!(tag, "point" | "vector");
    let known: &[&str] = match tag {
        "point" | "vector" => &["name", "value", "x", "y", "z"],
        "rgb" | "srgb" | "spectrum" if old => &["name", "value", "intent"],
        "blackbody" if old => &["name", "temperature", "scale"],
        "boolean" | "integer" | "float" | "string" | "rgb" => &["name", "value"],
        "spectrum" => &["name", "value"],
        "translate" | "rotate" | "scale" | "lookat" | "matrix" => {
            return Err(format!("<{tag}> can only stand within a <transform>"));
        }
        _ => return Err(format!("<{tag}> is no element of Mitsuba 3's scene format")),
    };
    only(tag, attributes, known)?;
    if vector {
        return triple(tag, attributes, None).map(Value::Vector);
    }
    if tag == "blackbody" {
        return blackbody(attributes);
    }
    let text = attributes
        .get("value")
        .ok_or_else(|| format!("<{tag}> lacks the attribute \"value\""))?;
    match tag {
        "boolean" if text.eq_ignore_ascii_case("true") => Ok(Value::Boolean(true)),
        "boolean" if text.eq_ignore_ascii_case("false") => Ok(Value::Boolean(false)),
        "boolean" => Err(format!("expected \"true\" or \"false\", found \"{text}\"")),
        "integer" => match text.trim().parse() {
            Ok(number) => Ok(Value::Integer(number)),
            Err(_) => Err(format!("expected a whole number, found \"{text}\"")),
        },
        "float" => number(text).map(Value::Float),
        "rgb" | "srgb" if old && text.trim().starts_with('#') => hexadecimal(text.trim(), tag == "srgb"),
        "srgb" => match rgb(text)? {
            Value::Rgb(color) => Ok(Value::Rgb(color.map(decode))),
            other => Ok(other),
        },
        "spectrum" if old && !text.contains(':') && words(text).count() == 3 => rgb(text),
        "rgb" => rgb(text),
        "spectrum" => spectrum(text),
        _ => Ok(Value::String(text.clone())),
    }
}

fn rgb(text: &str) -> Result<Value, String> {
    let numbers = numbers(text)?;
    match numbers[..] {
        [grey] => Ok(Value::Rgb([grey; 3])),
        [r, g, b] => Ok(Value::Rgb([r, g, b])),
        _ => Err(format!(
            "expected one number or three, found \"{text}\" (Mitsuba 3 takes neither #rrggbb nor names of colours)"
        )),
    }
}

/// `#rrggbb`, linear or sRGB.
fn hexadecimal(text: &str, srgb: bool) -> Result<Value, String> {
    let digits = text.trim_start_matches('#');
    match u32::from_str_radix(digits, 16) {
        Ok(number) if digits.len() == 6 => {
            let channels = [number >> 16, number >> 8 & 255, number & 255].map(|c| f64::from(c) / 255.0);
            Ok(Value::Rgb(if srgb { channels.map(decode) } else { channels }))
        }
        _ => Err(format!("expected a colour as #rrggbb, found \"{text}\"")),
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from encoded to linear.
fn decode(c: f64) -> f64 {
    match c <= 0.04045 {
        true => c / 12.92,
        false => libm::pow((c + 0.055) / 1.055, 2.4),
    }
}

/// A black body's radiance in W/(m^2 sr nm), as in format 0.x: by temperature in kelvin, times a scale.
fn blackbody(attributes: &Attributes) -> Result<Value, String> {
    let text = attributes
        .get("temperature")
        .ok_or("<blackbody> lacks the attribute \"temperature\"")?;
    let kelvin = number(text.trim().trim_end_matches(['K', 'k']))?;
    let scale = attributes.get("scale").map_or(Ok(1.0), |text| number(text))?;
    if kelvin <= 0.0 {
        return Err(format!("expected a temperature above 0, found {kelvin}"));
    }
    Ok(Value::Spectrum(planck(kelvin, scale)))
}

/// Planck's law in W/(m^2 sr nm) from 360 nm to 830 nm.
pub fn planck(kelvin: f64, scale: f64) -> Vec<(f64, f64)> {
    /// 2 h c^2 in W m^2 / sr, h c / k in m K (CODATA 2018).
    const FIRST: f64 = 1.191_042_972_397_188e-16;
    const SECOND: f64 = 1.438_776_877_503_933e-2;
    let radiance = |nm: f64| {
        let metres = nm * 1e-9;
        let fifth = metres * metres * metres * metres * metres;
        // Per metre of wavelength; 1e-9 converts to nanometres.
        1e-9 * FIRST / (fifth * libm::expm1(SECOND / (metres * kelvin)))
    };
    let wavelengths = (0..=94).map(|i| 360.0 + 5.0 * f64::from(i));
    wavelengths.map(|nm| (nm, scale * radiance(nm))).collect()
}

/// A wavelength and a value per line; # starts a comment.
pub fn spectrum_table(text: &str) -> Result<Value, String> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let mut samples = Vec::new();
    for (i, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        match numbers(line)?[..] {
            [wavelength, value, ..] => samples.push((wavelength, value)),
            _ => return Err(format!("line {}: expected a wavelength and a value", i + 1)),
        }
    }
    rising(samples)
}

fn spectrum(text: &str) -> Result<Value, String> {
    let pairs: Vec<&str> = words(text).collect();
    if let [one] = pairs[..]
        && !one.contains(':')
    {
        return number(one).map(Value::Uniform);
    }
    let pair = |word: &str| -> Result<(f64, f64), String> {
        let (wavelength, value) = word
            .split_once(':')
            .ok_or_else(|| format!("expected one number, or a list of wavelength:value, found \"{word}\""))?;
        Ok((number(wavelength)?, number(value)?))
    };
    rising(pairs.into_iter().map(pair).collect::<Result<Vec<_>, String>>()?)
}

fn rising(samples: Vec<(f64, f64)>) -> Result<Value, String> {
    if samples.len() < 2 {
        return Err("expected at least two pairs of wavelength:value".to_string());
    }
    if samples.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
        return Err("expected wavelengths in rising order".to_string());
    }
    Ok(Value::Spectrum(samples))
}
