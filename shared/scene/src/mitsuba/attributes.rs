//! Attributes of an element, and their numbers.

use std::collections::BTreeMap;

/// Attributes by name.
pub type Attributes = BTreeMap<String, String>;

/// Byte offset of the first element with more than `most` attributes. In malformed text the count may be too low up to
/// the malformed place; everything after it is ignored.
pub fn beyond(text: &str, most: usize) -> Option<usize> {
    let bytes = text.as_bytes();
    let after = |from: usize, end: &str| text.get(from..)?.find(end).map(|at| from + at + end.len());
    let mut at = 0;
    while let Some(start) = after(at, "<") {
        let rest = &bytes[start..];
        at = match rest {
            _ if rest.starts_with(b"!--") => after(start + 3, "-->")?,
            _ if rest.starts_with(b"![CDATA[") => after(start, "]]>")?,
            _ if rest.starts_with(b"?") => after(start, "?>")?,
            // Other declarations are not read.
            _ if rest.starts_with(b"!") => return None,
            _ => {
                let mut count = 0;
                let mut place = start;
                loop {
                    match bytes.get(place)? {
                        b'>' => break place + 1,
                        b'=' if count == most => return Some(start - 1),
                        b'=' => count += 1,
                        quote @ (b'"' | b'\'') => {
                            let inner = &bytes[place + 1..];
                            place += 1 + inner.iter().position(|byte| byte == quote)?;
                        }
                        _ => {}
                    }
                    place += 1;
                }
            }
        };
    }
    None
}

/// Refuse attributes that an element does not take.
pub fn only(tag: &str, attributes: &Attributes, known: &[&str]) -> Result<(), String> {
    match attributes.keys().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(format!("<{tag}> does not take the attribute \"{name}\"")),
        None => Ok(()),
    }
}

/// A number as Mitsuba reads it: finite, not hexadecimal, nothing after it.
pub fn number(text: &str) -> Result<f64, String> {
    let text = text.trim();
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("expected a finite number, found \"{text}\"")),
    }
}

/// The words of a list separated by commas or spaces.
pub fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace())
        .filter(|word| !word.is_empty())
}

/// A list of numbers separated by commas or spaces.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    words(text).map(number).collect()
}

/// Three numbers, as x, y, z or in one attribute "value". Without a default, all are required.
pub fn triple(tag: &str, attributes: &Attributes, default: Option<f64>) -> Result<[f64; 3], String> {
    const AXES: [&str; 3] = ["x", "y", "z"];
    if let Some(text) = attributes.get("value") {
        if AXES.iter().any(|axis| attributes.contains_key(*axis)) {
            return Err(format!("<{tag}> takes \"value\", or \"x\", \"y\" and \"z\", not both"));
        }
        return match numbers(text)?[..] {
            [all] => Ok([all; 3]),
            [x, y, z] => Ok([x, y, z]),
            _ => Err(format!("expected one number or three, found \"{text}\"")),
        };
    }
    let mut triple = [default.unwrap_or(0.0); 3];
    for (axis, value) in AXES.iter().zip(&mut triple) {
        match attributes.get(*axis) {
            Some(text) => *value = number(text).map_err(|message| format!("{axis}: {message}"))?,
            None if default.is_none() => {
                return Err(format!(
                    "<{tag}> takes \"value\", or \"x\", \"y\" and \"z\"; \"{axis}\" is missing"
                ));
            }
            None => {}
        }
    }
    Ok(triple)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_counted_by_element() {
        for (text, expected) in [
            ("<a b='1' c='2'/><d e='1'/>", None),
            ("<a/> <b c=\"1\" d='2'\n e = '3' />", Some(5)),
            ("<a b='=====>' c='1'/>", None),
            (
                "<!-- <a b='' c='' d=''> --><?p a=b=c=d?><![CDATA[<a b='' c='' d=''>]]>",
                None,
            ),
            ("<!-- --><a b='' c='' d=''>", Some(8)),
            (
                "<?xml version='1.0' encoding='utf-8' standalone='yes'?><a>a = b = c = d</a>",
                None,
            ),
            ("<!DOCTYPE a><a b='' c='' d=''/>", None),
            ("<a b='", None),
            ("<", None),
            ("<!--", None),
        ] {
            assert_eq!(beyond(text, 2), expected, "{text}");
        }
    }
}
