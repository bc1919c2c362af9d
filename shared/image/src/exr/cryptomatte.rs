//! Mattes in a final image, by the Cryptomatte convention: see [`crate::matte`].

use crate::error::ImageError;
use crate::layer::MatteKind;
use crate::matte::{self, Matte, RANKS};
use exr::meta::attribute::AttributeValue;
use std::collections::BTreeMap;

/// Names of everything that mattes distinguish.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Names of objects.
    pub objects: Vec<String>,
    /// Names of materials.
    pub materials: Vec<String>,
}

/// The channels for the mean over this many passes, by rank, with their values.
pub(super) fn channels(kind: MatteKind, matte: &Matte, passes: u64) -> Vec<(String, Vec<f32>)> {
    let ranks: Vec<_> = matte.ranks(passes).collect();
    let mut channels = Vec::new();
    for rank in 0..RANKS {
        let name = |channel: usize| format!("{}{:02}.{}", kind.name(), rank / 2, ["R", "G", "B", "A"][channel]);
        let values = |value: &dyn Fn(&(u32, f32)) -> f32| ranks.iter().map(|of| value(&of[rank])).collect();
        channels.push((name(rank % 2 * 2), values(&|(id, _)| f32::from_bits(*id))));
        channels.push((name(rank % 2 * 2 + 1), values(&|(_, coverage)| *coverage)));
    }
    channels
}

/// A matte's attributes: its name, how ids are made, and the names that occur in it.
pub(super) fn attributes(
    kind: MatteKind,
    matte: &Matte,
    names: &Names,
) -> Result<Vec<(String, AttributeValue)>, ImageError> {
    let list = match kind {
        MatteKind::Objects => &names.objects,
        MatteKind::Materials => &names.materials,
    };
    let met = matte.ids();
    let names: BTreeMap<&str, String> = list
        .iter()
        .map(|name| (&**name, matte::id_of_name(name)))
        .filter(|(_, id)| met.binary_search(id).is_ok())
        .map(|(name, id)| (name, format!("{id:08x}")))
        .collect();
    let failed = |error: serde_json::Error| ImageError::Encode {
        field: "manifest",
        message: error.to_string(),
    };
    let manifest = serde_json::to_string(&names).map_err(failed)?;
    // EXR text is bytes; JSON can escape any character in ASCII.
    let mut plain = String::new();
    for c in manifest.chars() {
        match c.is_ascii() {
            true => plain.push(c),
            false => plain.extend(c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}"))),
        }
    }
    let key = matte::key_of_layer(kind.name());
    let attribute = |name: &str, value: &str| {
        let value = AttributeValue::Text(exr::prelude::Text::from(value));
        (format!("cryptomatte/{key}/{name}"), value)
    };
    Ok(vec![
        attribute("name", kind.name()),
        attribute("hash", "MurmurHash3_32"),
        attribute("conversion", "uint32_to_float32"),
        attribute("manifest", &plain),
    ])
}
