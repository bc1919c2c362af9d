//! Image files as fields name them.

use super::schema::table;
use crate::values::Spanned;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

/// `"file"`, or `{ file = "file", layer = "name" }`.
#[derive(Clone, Debug)]
pub struct ImageFile {
    /// Path, relative to the scene file.
    pub file: Spanned<String>,
    /// Layer of an OpenEXR image.
    pub layer: Option<String>,
}

impl ImageFile {
    /// The place of its path.
    pub fn span(&self) -> Range<usize> {
        self.file.span()
    }
}

impl JsonSchema for ImageFile {
    fn schema_name() -> Cow<'static, str> {
        "ImageFile".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let path = json_schema!({
            "type": "string",
            "description": ".exr, .hdr, .png, .jpg or .bmp, relative to the scene file.",
        });
        let layer = json_schema!({
            "type": "string",
            "description": "Which layer of an OpenEXR image. Default: that without a name, Combined, or the first.",
        });
        let with_layer = table(&["file"], json_schema!({ "file": path, "layer": layer }));
        json_schema!({ "anyOf": [path, with_layer] })
    }
}

/// The record before its place is known.
enum Written {
    File(String),
    Table(Table),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    file: Spanned<String>,
    layer: Option<String>,
}

impl<'de> Deserialize<'de> for Written {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct WrittenVisitor;
        impl<'de> Visitor<'de> for WrittenVisitor {
            type Value = Written;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the path of an image, or { file = \"path\", layer = \"name\" }")
            }
            fn visit_str<E: Error>(self, path: &str) -> Result<Self::Value, E> {
                String::deserialize(path.into_deserializer()).map(Written::File)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                Table::deserialize(MapAccessDeserializer::new(map)).map(Written::Table)
            }
        }
        deserializer.deserialize_any(WrittenVisitor)
    }
}

impl<'de> Deserialize<'de> for ImageFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let written = toml::Spanned::<Written>::deserialize(deserializer)?;
        let place = written.span();
        Ok(match written.into_inner() {
            Written::File(path) => Self {
                file: Spanned::new(place, path),
                layer: None,
            },
            Written::Table(Table { file, layer }) => Self { file, layer },
        })
    }
}
