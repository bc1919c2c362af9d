//! Colours and numbers that may be textures.

mod node;

use super::ImageFile;
use super::schema::{described, table};
use super::transform::RotateRecord;
use super::words::{Channel, TextureFilter, Wrap};
use crate::values::*;
use node::NodeSchema;
pub use node::{Choice, KINDS, Kind, NamedRecord, NodeRecord, NodeValue, Type, Unset};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
use std::ops::Range as Span;

/// A colour, `{ image = "file", ... }`, `{ checkerboard = [colour, colour], ... }`, `{ attribute = "color" }`, or a
/// graph node: `{ node = "noise", ... }` or `{ texture = "name" }`.
#[derive(Clone, Debug)]
pub enum TextureRecord<R> {
    /// A constant.
    Color(Color<R>),
    Image(ImageTextureRecord),
    Checkerboard {
        colors: [Color<R>; 2],
        uv: Option<UvSteps>,
    },
    /// Vertex colours of a mesh, times an image if given.
    VertexColors(Option<ImageTextureRecord>),
    /// A graph node.
    Node(NodeRecord),
    /// One of the scene's textures.
    Named(NamedRecord),
}

/// Vertex attributes of a mesh.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Attribute {
    /// Vertex colours.
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
    /// Where to look it up, instead of the surface's coordinates.
    pub vector: Option<Box<Spanned<NodeValue>>>,
}

/// A number, or a texture of numbers: `{ image = "file", channel = "g", ... }`.
#[derive(Clone, Debug)]
pub enum ScalarRecord<R> {
    /// A constant.
    Number(Number<R>),
    /// In [0, 1], from one channel of an image or from the luminance.
    Texture(TextureRecord<Unit>),
}

impl<R> ScalarRecord<R> {
    /// The images it uses.
    pub fn images(&self) -> Vec<&ImageTextureRecord> {
        match self {
            Self::Number(_) => Vec::new(),
            Self::Texture(texture) => texture.images(),
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
        let [node, named] = graphs(generator);
        json_schema!({ "anyOf": [R::schema(), image, checkerboard, node, named] })
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
const VECTOR: &str =
    "Where it is looked up, in place of the surface's own coordinates; (0, 0) is the bottom left corner.";
const ATTRIBUTE: &str = "The colours of the mesh's vertices, which an image is multiplied by.";

/// The schemas of images, checkerboards and vertex colours, which may be combined with an image.
fn tables<R: Range>(generator: &mut SchemaGenerator, has_attributes: bool) -> [Schema; 3] {
    let uv = generator.subschema_for::<UvSteps>();
    let vector = described(generator.subschema_for::<TextureRecord<Finite>>(), VECTOR);
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
        "vector": vector,
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

/// The schemas of graphs: an inline node, or one of the scene's textures.
fn graphs(generator: &mut SchemaGenerator) -> [Schema; 2] {
    let name = json_schema!({ "type": "string", "description": "One of `textures`." });
    let output = json_schema!({ "type": "string", "description": "Which of its outputs. Default: the first." });
    [
        generator.subschema_for::<NodeSchema>(),
        table(&["texture"], json_schema!({ "texture": name, "output": output })),
    ]
}

impl<R> TextureRecord<R> {
    /// Whether it is a graph.
    pub fn is_graph(&self) -> bool {
        match self {
            Self::Node(_) | Self::Named(_) => true,
            Self::Image(image) | Self::VertexColors(Some(image)) => image.vector.is_some(),
            Self::Color(_) | Self::Checkerboard { .. } | Self::VertexColors(None) => false,
        }
    }

    /// Where a graph is in the file.
    pub fn place(&self) -> Option<Span<usize>> {
        match self {
            Self::Node(node) => Some(node.node.span()),
            Self::Named(named) => Some(named.texture.span()),
            Self::Image(image) | Self::VertexColors(Some(image)) => Some(image.file.file.span()),
            Self::Color(_) | Self::Checkerboard { .. } | Self::VertexColors(None) => None,
        }
    }

    /// Its images, and those of nodes written inline.
    pub fn images(&self) -> Vec<&ImageTextureRecord> {
        match self {
            Self::Image(image) | Self::VertexColors(Some(image)) => image.images(),
            Self::Node(node) => node
                .fields
                .iter()
                .flat_map(|(_, value)| value.get_ref().images())
                .collect(),
            Self::Color(_) | Self::Checkerboard { .. } | Self::VertexColors(None) | Self::Named(_) => Vec::new(),
        }
    }
}

impl ImageTextureRecord {
    fn images(&self) -> Vec<&Self> {
        let inner = self.vector.iter().flat_map(|vector| vector.get_ref().images());
        [self].into_iter().chain(inner).collect()
    }
}

impl NodeValue {
    fn images(&self) -> Vec<&ImageTextureRecord> {
        match self {
            Self::Texture(texture) => texture.images(),
            Self::Number(_) | Self::Flag(_) | Self::Word(_) | Self::List(_) => Vec::new(),
        }
    }
}

/// A transform of texture coordinates: steps, applied in order.
pub type UvSteps = Spanned<Vec<Spanned<UvStepRecord>>>;

/// One step of a UV transform: exactly one of the fields.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("minProperties" = 1, "maxProperties" = 1))]
pub struct UvStepRecord {
    /// Number of repetitions.
    pub scale: Option<Factors>,
    /// Rotation around [0, 0, 1].
    pub rotate: Option<RotateRecord>,
    /// Translation by (x, y); z is 0.
    pub translate: Option<Vector>,
    /// A matrix of three rows of three.
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
        let [node, named] = graphs(generator);
        json_schema!({ "anyOf": [color, image, checkerboard, attribute, node, named] })
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
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut table = Table::<R>::default();
        while let Some(key) = map.next_key::<Key>()? {
            table.take(key, &mut map)?;
        }
        table.record()
    }
}

/// A field's name in an image, checkerboard, attribute or node.
enum Key {
    Known(&'static str),
    OfNode(String),
}

const FIELDS: &[&str] = &[
    "image",
    "attribute",
    "checkerboard",
    "raw",
    "filter",
    "wrap",
    "channel",
    "uv",
    "vector",
    "node",
    "texture",
    "output",
];

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct KeyVisitor;
        impl Visitor<'_> for KeyVisitor {
            type Value = Key;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a field of a texture")
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Key, E> {
                match FIELDS.iter().find(|field| **field == name) {
                    Some(known) => Ok(Key::Known(known)),
                    None if Kind::any_has(name) => Ok(Key::OfNode(name.to_owned())),
                    None => Err(E::unknown_field(name, &FIELDS[..8])),
                }
            }
        }
        deserializer.deserialize_identifier(KeyVisitor)
    }
}

/// All the fields a texture's table may have.
struct Table<R> {
    image: Option<ImageFile>,
    attribute: Option<Attribute>,
    checkerboard: Option<Vec<Color<R>>>,
    raw: Option<bool>,
    filter: Option<TextureFilter>,
    wrap: Option<Wrap>,
    channel: Option<Channel>,
    uv: Option<UvSteps>,
    node: Option<Spanned<String>>,
    texture: Option<Spanned<String>>,
    output: Option<Spanned<String>>,
    /// A node's fields; an image has `vector` alone.
    fields: Vec<(String, Spanned<NodeValue>)>,
}

impl<R> Default for Table<R> {
    fn default() -> Self {
        Self {
            image: None,
            attribute: None,
            checkerboard: None,
            raw: None,
            filter: None,
            wrap: None,
            channel: None,
            uv: None,
            node: None,
            texture: None,
            output: None,
            fields: Vec::new(),
        }
    }
}

impl<R: Range> Table<R> {
    fn take<'de, A: MapAccess<'de>>(&mut self, key: Key, map: &mut A) -> Result<(), A::Error> {
        match key {
            Key::Known("image") => self.image = Some(map.next_value()?),
            Key::Known("attribute") => self.attribute = Some(map.next_value()?),
            Key::Known("checkerboard") => self.checkerboard = Some(map.next_value()?),
            Key::Known("raw") => self.raw = Some(map.next_value()?),
            Key::Known("filter") => self.filter = Some(map.next_value()?),
            Key::Known("wrap") => self.wrap = Some(map.next_value()?),
            Key::Known("channel") => self.channel = Some(map.next_value()?),
            Key::Known("uv") => self.uv = Some(map.next_value()?),
            Key::Known("node") => self.node = Some(map.next_value()?),
            Key::Known("texture") => self.texture = Some(map.next_value()?),
            Key::Known("output") => self.output = Some(map.next_value()?),
            Key::Known(name) => self.fields.push((name.to_owned(), map.next_value()?)),
            Key::OfNode(name) => self.fields.push((name, map.next_value()?)),
        }
        Ok(())
    }

    fn record<E: Error>(self) -> Result<TextureRecord<R>, E> {
        let of_image = [
            self.raw.is_some(),
            self.filter.is_some(),
            self.wrap.is_some(),
            self.channel.is_some(),
        ];
        let has_image_fields = of_image.contains(&true) || self.uv.is_some();
        let is_graph = self.node.is_some() || self.texture.is_some();
        if is_graph && (self.image.is_some() || self.checkerboard.is_some() || self.attribute.is_some()) {
            return Err(E::custom(
                "a texture is one of `node`, `texture`, `image`, `checkerboard` and `attribute`",
            ));
        }
        if is_graph && has_image_fields {
            return Err(E::custom(
                "a node takes no fields of images; `raw`, `filter`, `wrap`, `channel` and `uv` are for an `image`",
            ));
        }
        match (self.node, self.texture) {
            (Some(_), Some(_)) => return Err(E::custom("a texture is a `node` or one of the `texture`s, not both")),
            (Some(node), None) => {
                return Ok(TextureRecord::Node(NodeRecord {
                    node,
                    output: self.output,
                    fields: self.fields,
                }));
            }
            (None, Some(texture)) => {
                if let Some((name, _)) = self.fields.first() {
                    return Err(E::custom(format_args!(
                        "`{name}` is a field of nodes; beside `texture` only `output` may stand"
                    )));
                }
                return Ok(TextureRecord::Named(NamedRecord {
                    texture,
                    output: self.output,
                }));
            }
            (None, None) => {}
        }
        let mut vector = None;
        for (name, value) in self.fields {
            if name != "vector" || self.image.is_none() {
                return Err(E::custom(format_args!(
                    "`{name}` is a field of nodes; expected `node` beside it"
                )));
            }
            vector = Some(Box::new(value));
        }
        if self.output.is_some() {
            return Err(E::custom(
                "`output` is a field of nodes; expected `node` or `texture` beside it",
            ));
        }
        if vector.is_some() && self.uv.is_some() {
            return Err(E::custom("an image is looked up by `uv` or by `vector`, not both"));
        }
        match (self.image, self.checkerboard, self.attribute) {
            (Some(file), None, attribute) => {
                let image = ImageTextureRecord {
                    file,
                    raw: self.raw.unwrap_or_default(),
                    filter: self.filter.unwrap_or_default(),
                    wrap: self.wrap.unwrap_or_default(),
                    channel: self.channel,
                    uv: self.uv,
                    vector,
                };
                Ok(match attribute {
                    None => TextureRecord::Image(image),
                    Some(Attribute::Color) => TextureRecord::VertexColors(Some(image)),
                })
            }
            (None, None, Some(Attribute::Color)) => {
                if has_image_fields {
                    return Err(E::custom(
                        "an `attribute` takes no other field, but for an `image` and its fields",
                    ));
                }
                Ok(TextureRecord::VertexColors(None))
            }
            (None, Some(colors), None) => {
                if of_image.contains(&true) {
                    return Err(E::custom(
                        "a checkerboard takes only `uv`; `raw`, `filter`, `wrap` and `channel` are for an `image`",
                    ));
                }
                let uv = self.uv;
                let colors = <[Color<R>; 2]>::try_from(colors).map_err(|colors| {
                    let count = colors.len();
                    E::custom(format_args!("a checkerboard has 2 colors, found {count}"))
                })?;
                Ok(TextureRecord::Checkerboard { colors, uv })
            }
            _ => Err(E::custom(
                "a texture is given by `image` or by `checkerboard`: one of the two ways",
            )),
        }
    }
}
