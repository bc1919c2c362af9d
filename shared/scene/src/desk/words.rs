//! Splits a field's description into unit, help and default.

use serde_json::Value as Json;

/// Units used in descriptions; a longer unit before its prefix.
const UNITS: [&str; 10] = [
    "W/(m^2 sr)",
    "W/m^2",
    "W/sr",
    "W",
    "per scene unit",
    "scene units",
    "degrees",
    "pixels",
    "stops",
    "kelvin",
];

/// `W/sr, of a spot on its axis. Default: 1.` has the unit "W/sr", the help "Of a spot on its axis." and the default 1.
#[derive(Debug, Default, PartialEq)]
pub struct Words {
    pub unit: String,
    pub help: String,
    pub default: Option<Json>,
}

impl Words {
    pub fn of(description: &str) -> Self {
        let (told, default) = match description.split_once("Default: ") {
            Some((told, default)) => (told, simple(default)),
            None => (description, None),
        };
        let mut unit = "";
        let mut sentences: Vec<String> = Vec::new();
        for sentence in told.split_inclusive(". ") {
            let sentence = sentence.trim().trim_end_matches('.');
            let mut parts = Vec::new();
            for part in sentence.split(", ") {
                match beginning(part).filter(|_| unit.is_empty()) {
                    Some(found) => {
                        unit = found;
                        parts.push(part[found.len()..].trim());
                    }
                    None => parts.push(part),
                }
            }
            parts.retain(|part| !part.is_empty());
            sentences.push(capitalised(&parts.join(", ")));
        }
        sentences.retain(|sentence| !sentence.is_empty());
        Self {
            unit: unit.to_owned(),
            help: sentences
                .iter()
                .map(|sentence| format!("{sentence}."))
                .collect::<Vec<_>>()
                .join(" "),
            default,
        }
    }
}

/// The unit at the start of a phrase.
fn beginning(phrase: &str) -> Option<&'static str> {
    UNITS.into_iter().find(|unit| {
        let head = phrase.get(..unit.len());
        let rest = phrase.get(unit.len()..).unwrap_or_default();
        head.is_some_and(|head| head == *unit || (unit.len() > 1 && head.eq_ignore_ascii_case(unit)))
            && (rest.is_empty() || rest.starts_with(' '))
    })
}

/// A lone number, word or boolean, as in `0.5.` or `0, a pinhole.`
fn simple(default: &str) -> Option<Json> {
    let (first, rest) = default.split_once(' ').unwrap_or((default, ""));
    let ends = first.ends_with(['.', ',']) || rest.is_empty();
    let word = first.trim_end_matches(['.', ',']);
    ends.then(|| match (word.parse::<f64>(), word.parse::<bool>()) {
        (Ok(number), _) if number.is_finite() => number.into(),
        (_, Ok(is)) => is.into(),
        _ => word.into(),
    })
}

fn capitalised(sentence: &str) -> String {
    let mut letters = sentence.chars();
    let first = letters.next();
    first.into_iter().flat_map(char::to_uppercase).chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_are_taken_apart() {
        for (description, unit, help, default) in [
            (
                "W, in all directions that it shines to.",
                "W",
                "In all directions that it shines to.",
                None,
            ),
            ("W/(m^2 sr).", "W/(m^2 sr)", "", None),
            ("W/m^2 across the direction.", "W/m^2", "Across the direction.", None),
            (
                "Radius of the lens, scene units. Default: 0, a pinhole.",
                "scene units",
                "Radius of the lens.",
                Some(0.0),
            ),
            (
                "Reflectance, 0 to 1. Default: 0.5 of diffuse bases, 1 of metals.",
                "",
                "Reflectance, 0 to 1.",
                None,
            ),
            (
                "Extinction, per scene unit. Given with `albedo`.",
                "per scene unit",
                "Extinction. Given with `albedo`.",
                None,
            ),
            (
                "Factor on the density. Default: 1.",
                "",
                "Factor on the density.",
                Some(1.0),
            ),
            (
                "Stops, for the PNG only. Default: 0.",
                "stops",
                "For the PNG only.",
                Some(0.0),
            ),
            ("Where it stands.", "", "Where it stands.", None),
        ] {
            let words = Words::of(description);
            let number = words.default.and_then(|default| default.as_f64());
            assert_eq!(
                (&*words.unit, &*words.help, number),
                (unit, help, default),
                "{description}"
            );
        }
    }
}
