//! Colours that may be textures.

use super::ImageFile;
use super::schema::{described, table};
use super::transform::RotateRecord;
use super::words::{Channel, TextureFilter, Wrap};
use crate::values::*;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// A colour, `{ image = "file", ... }`, `{ checkerboard = [colour, colour], ... }` or `{ attribute = "color" }`.
#[derive(Clone, Debug)]
pub enum TextureRecord<R> {
    /// The same everywhere.
    Color(Color<R>),
    Image(ImageTextureRecord),
    Checkerboard {
        colors: [Color<R>; 2],
        uv: Option<UvSteps>,
    },
    /// The colours of a mesh's vertices, times an image, if there is one.
    VertexColors(Option<ImageTextureRecord>),
}

/// What a mesh says of its vertices.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Attribute {
    /// Their colours.
    Color,
}

#[derive(Clone, Debug)]
pub struct ImageTextureRecord {
    pub file: ImageFile,
    pub raw: bool,
    pub filter: TextureFilter,
    pub wrap: Wrap,
    pub channel: Option<Channel>,
    pub uv: Option<UvSteps>,
}

/// A number, or a texture of numbers: `{ image = "file", channel = "g", ... }`.
#[derive(Clone, Debug)]
pub enum ScalarRecord<R> {
    /// The same everywhere.
    Number(Number<R>),
    /// From 0 to 1, by one channel of an image or the luminance.
    Texture(TextureRecord<Unit>),
}

impl<R> ScalarRecord<R> {
    /// Its image, if it has one.
    pub fn image(&self) -> Option<&ImageTextureRecord> {
        match self {
            Self::Number(_) => None,
            Self::Texture(texture) => texture.image(),
        }
    }
}

impl<R: Range> JsonSchema for ScalarRecord<R> {
    fn schema_name() -> Cow<'static, str> {
        "ScalarRecord".into()
    }
    fn schema_id() -> Cow<'static, str> {
        format!("ScalarRecord of {}", R::EXPECTED).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let [image, checkerboard, _] = tables::<Unit>(generator, false);
        json_schema!({ "anyOf": [R::schema(), image, checkerboard] })
    }
}

impl<'de, R: Range> Deserialize<'de> for ScalarRecord<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ScalarVisitor<R>(PhantomData<R>);
        impl<'de, R: Range> Visitor<'de> for ScalarVisitor<R> {
            type Value = ScalarRecord<R>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}, or {{ image = \"file\" }}", R::EXPECTED)
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
                Number::deserialize(x.into_deserializer()).map(ScalarRecord::Number)
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
                self.visit_f64(x as f64)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                match TextureVisitor(ColorVisitor(PhantomData)).visit_map(map)? {
                    TextureRecord::VertexColors(_) => Err(A::Error::custom(
                        "colours of vertices are no number; expected a number or an image",
                    )),
                    texture => Ok(ScalarRecord::Texture(texture)),
                }
            }
        }
        deserializer.deserialize_any(ScalarVisitor(PhantomData))
    }
}

const CHANNEL: &str = "Only this one, as grey. Default: all of them; where a number is wanted, luminance.";

const FILE: &str = "Path of the image, or a table with a layer of an OpenEXR image.";
const ATTRIBUTE: &str = "The colours of the mesh's vertices, which an image is multiplied by.";

/// The schemas of an image, of a checkerboard and of colours of vertices, which images may have beside them.
fn tables<R: Range>(generator: &mut SchemaGenerator, has_attributes: bool) -> [Schema; 3] {
    let uv = generator.subschema_for::<UvSteps>();
    let color = Color::<R>::json_schema(generator);
    let colors = json_schema!({ "type": "array", "items": color, "minItems": 2, "maxItems": 2 });
    let attribute = described(generator.subschema_for::<Attribute>(), ATTRIBUTE);
    let mut image = json_schema!({
        "image": described(generator.subschema_for::<ImageFile>(), FILE),
        "raw": { "type": "boolean", "description": "Take the numbers of a PNG as they are, not as sRGB." },
        "filter": generator.subschema_for::<TextureFilter>(),
        "wrap": generator.subschema_for::<Wrap>(),
        "channel": described(generator.subschema_for::<Channel>(), CHANNEL),
        "uv": uv,
    });
    if has_attributes {
        image.insert("attribute".to_owned(), attribute.clone().to_value());
    }
    [
        table(&["image"], image),
        table(&["checkerboard"], json_schema!({ "checkerboard": colors, "uv": uv })),
        table(&["attribute"], json_schema!({ "attribute": attribute })),
    ]
}

impl<R> TextureRecord<R> {
    /// The file that it names.
    pub fn file(&self) -> Option<&Spanned<String>> {
        self.image().map(|image| &image.file.file)
    }

    /// Its image, if it has one.
    pub fn image(&self) -> Option<&ImageTextureRecord> {
        match self {
            Self::Image(image) | Self::VertexColors(Some(image)) => Some(image),
            Self::Color(_) | Self::Checkerboard { .. } | Self::VertexColors(None) => None,
        }
    }
}

/// A transform of texture coordinates: steps, applied in order.
pub type UvSteps = Spanned<Vec<Spanned<UvStepRecord>>>;

/// One step of it: exactly one of the fields.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("minProperties" = 1, "maxProperties" = 1))]
pub struct UvStepRecord {
    /// So many repetitions.
    pub scale: Option<Factors>,
    /// Around [0, 0, 1].
    pub rotate: Option<RotateRecord>,
    /// By (x, y), z is 0.
    pub translate: Option<Vector>,
    /// Three rows of three.
    pub matrix: Option<Vec<Vec<Number<Finite>>>>,
}

impl<R: Range> JsonSchema for TextureRecord<R> {
    fn schema_name() -> Cow<'static, str> {
        "TextureRecord".into()
    }
    fn schema_id() -> Cow<'static, str> {
        format!("TextureRecord of {}", R::EXPECTED).into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let color = Color::<R>::json_schema(generator);
        let [image, checkerboard, attribute] = tables::<R>(generator, true);
        json_schema!({ "anyOf": [color, image, checkerboard, attribute] })
    }
}

impl<'de, R: Range> Deserialize<'de> for TextureRecord<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TextureVisitor(ColorVisitor(PhantomData)))
    }
}

struct TextureVisitor<R>(ColorVisitor<R>);

impl<'de, R: Range> Visitor<'de> for TextureVisitor<R> {
    type Value = TextureRecord<R>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.expecting(f)?;
        f.write_str(", or { image = \"file\" }, or { checkerboard = [color, color] }")
    }
    fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
        self.0.visit_f64(x).map(TextureRecord::Color)
    }
    fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
        self.0.visit_i64(x).map(TextureRecord::Color)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        self.0.visit_seq(seq).map(TextureRecord::Color)
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields, bound = "R: Range")]
        struct Table<R> {
            image: Option<ImageFile>,
            attribute: Option<Attribute>,
            checkerboard: Option<Vec<Color<R>>>,
            raw: Option<bool>,
            filter: Option<TextureFilter>,
            wrap: Option<Wrap>,
            channel: Option<Channel>,
            uv: Option<UvSteps>,
        }
        let table = Table::<R>::deserialize(MapAccessDeserializer::new(map))?;
        let of_image = [
            table.raw.is_some(),
            table.filter.is_some(),
            table.wrap.is_some(),
            table.channel.is_some(),
        ];
        match (table.image, table.checkerboard, table.attribute) {
            (Some(file), None, attribute) => {
                let image = ImageTextureRecord {
                    file,
                    raw: table.raw.unwrap_or_default(),
                    filter: table.filter.unwrap_or_default(),
                    wrap: table.wrap.unwrap_or_default(),
                    channel: table.channel,
                    uv: table.uv,
                };
                Ok(match attribute {
                    None => TextureRecord::Image(image),
                    Some(Attribute::Color) => TextureRecord::VertexColors(Some(image)),
                })
            }
            (None, None, Some(Attribute::Color)) => {
                if of_image.contains(&true) || table.uv.is_some() {
                    return Err(A::Error::custom(
                        "an `attribute` takes no other field, but for an `image` and its fields",
                    ));
                }
                Ok(TextureRecord::VertexColors(None))
            }
            (None, Some(colors), None) => {
                if of_image.contains(&true) {
                    return Err(A::Error::custom(
                        "a checkerboard takes only `uv`; `raw`, `filter`, `wrap` and `channel` are for an `image`",
                    ));
                }
                let uv = table.uv;
                let colors = <[Color<R>; 2]>::try_from(colors).map_err(|colors| {
                    let count = colors.len();
                    A::Error::custom(format_args!("a checkerboard has 2 colors, found {count}"))
                })?;
                Ok(TextureRecord::Checkerboard { colors, uv })
            }
            _ => Err(A::Error::custom(
                "a texture is given by `image` or by `checkerboard`: one of the two ways",
            )),
        }
    }
}
