//! Finds the colour channels of an OpenEXR image. Layers are given by channel names within a part, or by separate
//! parts.

use crate::Flaw;
use ::exr::meta::header::Header;

/// The colour channels of a part, by number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Colour {
    /// Red, green and blue; all three may be the same channel.
    Rgb([usize; 3]),
    /// Luminance, and red and blue over it.
    Chroma { y: usize, ry: usize, by: usize },
}

/// Channels that form an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Empty if neither part nor channels are named.
    pub name: String,
    /// The part's index in the file.
    pub part: usize,
    pub colour: Colour,
    /// Whether its channels are called `R`, `G` and `B` without a prefix.
    is_plain: bool,
    /// Whether it is used only on request: one channel, which may be a depth.
    is_asked_for: bool,
}

/// The names of a part and of its channels.
pub struct Part {
    pub name: String,
    pub channels: Vec<String>,
}

impl Part {
    pub fn new(header: &Header) -> Self {
        let name = header.own_attributes.layer_name.as_ref();
        Self {
            name: name.map(ToString::to_string).unwrap_or_default(),
            channels: header.channels.list.iter().map(|c| c.name.to_string()).collect(),
        }
    }
}

/// All layers of a file, from its parts and channels.
pub fn layers(parts: &[Part]) -> Vec<Layer> {
    let mut layers: Vec<Layer> = Vec::new();
    for (part, Part { name, channels }) in parts.iter().enumerate() {
        let split = |channel: &String| match channel.rsplit_once('.') {
            Some((prefix, last)) => (prefix.to_owned(), last.to_ascii_uppercase()),
            None => (String::new(), channel.to_ascii_uppercase()),
        };
        let channels: Vec<(String, String)> = channels.iter().map(split).collect();
        let mut prefixes: Vec<&String> = Vec::new();
        for (prefix, _) in &channels {
            if !prefixes.contains(&prefix) {
                prefixes.push(prefix);
            }
        }
        for prefix in prefixes {
            let find = |wanted: &str| channels.iter().position(|(p, last)| p == prefix && last == wanted);
            let mut own = (0..channels.len()).filter(|i| channels[*i].0 == *prefix);
            let (colour, is_asked_for) = match [find("R"), find("G"), find("B"), find("Y"), find("RY"), find("BY")] {
                [Some(r), Some(g), Some(b), ..] => (Colour::Rgb([r, g, b]), false),
                [None, None, None, Some(y), Some(ry), Some(by)] => (Colour::Chroma { y, ry, by }, false),
                [None, None, None, Some(y), ..] => (Colour::Rgb([y; 3]), false),
                _ => match [own.next(), own.next()] {
                    [Some(only), None] => (Colour::Rgb([only; 3]), true),
                    _ => continue,
                },
            };
            let is_within = prefix == name || prefix.strip_prefix(&**name).is_some_and(|rest| rest.starts_with('.'));
            let name = match (name.is_empty(), prefix.is_empty()) {
                (true, _) => prefix.clone(),
                (false, true) => name.clone(),
                (false, false) if is_within => prefix.clone(),
                (false, false) => format!("{name}.{prefix}"),
            };
            layers.push(Layer {
                name,
                part,
                colour,
                is_plain: prefix.is_empty(),
                is_asked_for,
            });
        }
    }
    layers
}

/// The layer of this name. Without a name: the one whose channels have no prefix, Blender's "Combined", or the first.
/// If there are several, a note says which was taken.
pub fn choose<'l>(layers: &'l [Layer], wanted: Option<&str>) -> Result<(&'l Layer, Option<String>), Flaw> {
    let names = |layers: &mut dyn Iterator<Item = &Layer>| {
        const MOST: usize = 12;
        let all: Vec<String> = layers.map(|layer| format!("{:?}", layer.name)).collect();
        match all.len() {
            0..=MOST => all.join(", "),
            count => format!("{} and {} others", all[..MOST].join(", "), count - MOST),
        }
    };
    if let Some(wanted) = wanted {
        let found = layers.iter().find(|layer| layer.name == wanted);
        let found = found.ok_or_else(|| match layers.is_empty() {
            true => format!("there is no layer {wanted:?}, and no other with the channels R, G and B, or Y"),
            false => format!("there is no layer {wanted:?}; there are {}", names(&mut layers.iter())),
        })?;
        return Ok((found, None));
    }
    let colours: Vec<&Layer> = layers.iter().filter(|layer| !layer.is_asked_for).collect();
    let is_combined = |layer: &&&Layer| layer.name.rsplit('.').next() == Some("Combined");
    let plain = colours.iter().find(|layer| layer.is_plain);
    let chosen = plain.or_else(|| colours.iter().find(is_combined)).or(colours.first());
    let Some(chosen) = chosen else {
        return Err(match layers.is_empty() {
            true => "no layer has the channels R, G and B, or Y".into(),
            false => format!(
                "no layer has the channels R, G and B, or Y; `layer` may name one of a single channel: {}",
                names(&mut layers.iter())
            )
            .into(),
        });
    };
    let note = (colours.len() > 1).then(|| {
        let others = names(&mut colours.iter().copied().filter(|layer| layer != chosen));
        let chosen = match chosen.name.as_str() {
            "" => "that without a name".to_owned(),
            name => format!("{name:?}"),
        };
        let count = colours.len();
        format!("it has {count} layers with colours, of which {chosen} is taken; `layer` may name another: {others}")
    });
    Ok((chosen, note))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(parts: &[(&str, &[&str])]) -> Vec<Part> {
        let part = |(name, channels): &(&str, &[&str])| Part {
            name: (*name).to_owned(),
            channels: channels.iter().map(|name| (*name).to_owned()).collect(),
        };
        parts.iter().map(part).collect()
    }

    fn chosen(of: &[(&str, &[&str])], wanted: Option<&str>) -> Result<(String, usize, Option<String>), String> {
        let all = layers(&parts(of));
        let chosen = choose(&all, wanted).map_err(|flaw| flaw.message);
        chosen.map(|(layer, note)| (layer.name.clone(), layer.part, note))
    }

    #[test]
    fn the_layer_without_a_name_goes_before_combined_and_that_before_the_first() {
        let named = ["A.B", "A.G", "A.R"];
        let combined = ["A.B", "A.G", "A.R", "V.Combined.B", "V.Combined.G", "V.Combined.R"];
        let plain = ["A.B", "A.G", "A.R", "B", "G", "R", "Z"];
        assert_eq!(chosen(&[("", &named)], None).unwrap(), ("A".into(), 0, None));
        let (name, _, note) = chosen(&[("", &combined)], None).unwrap();
        assert_eq!(name, "V.Combined");
        let said = "it has 2 layers with colours, of which \"V.Combined\" is taken; `layer` may name another: \"A\"";
        assert_eq!(note.as_deref(), Some(said));
        let (name, _, note) = chosen(&[("", &plain)], None).unwrap();
        assert_eq!(name, "");
        assert!(note.unwrap().contains("of which that without a name is taken"));
        let (name, part, _) = chosen(&[("a", &named), ("b", &["B", "G", "R"])], None).unwrap();
        assert_eq!((name.as_str(), part), ("b", 1));
    }

    #[test]
    fn layers_are_found_by_the_names_of_parts_and_channels() {
        let of: &[(&str, &[&str])] = &[
            ("beauty", &["B", "G", "R"]),
            ("View.Mist", &["View.Mist.Z"]),
            ("left", &["lamp.b", "lamp.g", "lamp.r"]),
        ];
        for (wanted, part) in [("beauty", 0), ("View.Mist", 1), ("left.lamp", 2)] {
            let found = chosen(of, Some(wanted)).unwrap();
            assert_eq!(found, (wanted.to_owned(), part, None));
        }
        let said = chosen(of, Some("lamp")).unwrap_err();
        assert_eq!(
            said,
            "there is no layer \"lamp\"; there are \"beauty\", \"View.Mist\", \"left.lamp\""
        );
        assert!(
            chosen(&[("", &["U", "V"])], Some("a"))
                .unwrap_err()
                .contains("no other")
        );
    }

    #[test]
    fn depth_is_no_colour() {
        let said = chosen(&[("", &["V.Depth.Z"])], None).unwrap_err();
        assert!(
            said.starts_with("no layer has the channels R, G and B, or Y; `layer` may"),
            "{said}"
        );
        assert_eq!(
            chosen(&[("", &["U", "V"])], None).unwrap_err(),
            "no layer has the channels R, G and B, or Y"
        );
    }

    #[test]
    fn luminance_and_chroma_are_known() {
        let all = layers(&parts(&[("", &["BY", "RY", "Y"])]));
        assert_eq!(all[0].colour, Colour::Chroma { y: 2, ry: 1, by: 0 });
        let all = layers(&parts(&[("", &["A", "Y"])]));
        assert_eq!(all[0].colour, Colour::Rgb([1; 3]));
    }
}
