//! Properties: numbers, colours, strings, transforms.

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
    /// `<spectrum value="x"/>`: the same at all wavelengths.
    Uniform(f64),
    /// Values at wavelengths (nm) in rising order.
    Spectrum(Vec<(f64, f64)>),
    /// Steps, the first applied first.
    Transform(Vec<Step>),
}

impl Value {
    /// For messages.
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

/// The value of a property's element.
pub fn parse(tag: &str, attributes: &Attributes) -> Result<Value, String> {
    let vector = matches!(tag, "point" | "vector");
    let known: &[&str] = match tag {
        "point" | "vector" => &["name", "value", "x", "y", "z"],
        "boolean" | "integer" | "float" | "string" | "rgb" => &["name", "value"],
        "spectrum" => &["name", "value", "filename"],
        "translate" | "rotate" | "scale" | "lookat" | "matrix" => {
            return Err(format!("<{tag}> can only stand within a <transform>"));
        }
        _ => return Err(format!("<{tag}> is no element of Mitsuba 3's scene format")),
    };
    only(tag, attributes, known)?;
    if vector {
        return triple(tag, attributes, None).map(Value::Vector);
    }
    if attributes.contains_key("filename") {
        return Err("a <spectrum> from a file is not supported; expected value=\"wavelength:value, ...\"".to_string());
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
        "rgb" => {
            let numbers = numbers(text)?;
            match numbers[..] {
                [grey] => Ok(Value::Rgb([grey; 3])),
                [r, g, b] => Ok(Value::Rgb([r, g, b])),
                _ => Err(format!(
                    "expected one number or three, found \"{text}\" (Mitsuba 3 takes neither #rrggbb nor names of colours)"
                )),
            }
        }
        "spectrum" => spectrum(text),
        _ => Ok(Value::String(text.clone())),
    }
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
    let samples = pairs.into_iter().map(pair).collect::<Result<Vec<_>, String>>()?;
    if samples.len() < 2 {
        return Err("expected at least two pairs of wavelength:value".to_string());
    }
    if samples.windows(2).any(|pair| pair[0].0 >= pair[1].0) {
        return Err("expected wavelengths in rising order".to_string());
    }
    Ok(Value::Spectrum(samples))
}
