//! Nodes of texture graphs: their kinds with inputs and outputs, and their tables as records.

use super::super::schema::described;
use super::TextureRecord;
use crate::values::{Finite, Spanned};
use beamfarm_render::world::texture::graph::color::Blend;
use beamfarm_render::world::texture::graph::maths::{Operation, VectorOperation};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::fmt;

/// The type of a value, which decides its conversions: a number fills all three components, a colour becomes a number
/// by its luminance, a vector by its mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    Float,
    Vector,
    Color,
}

/// The value of an input that is not given.
#[derive(Clone, Copy, Debug)]
pub enum Unset {
    Number(f32),
    Vector([f32; 3]),
    /// Coordinates in the object's bounding box.
    Generated,
    /// None: the input is required.
    Never,
}

#[derive(Clone, Copy, Debug)]
pub struct Input {
    pub name: &'static str,
    pub of: Type,
    pub unset: Unset,
}

/// A setting of a node, the same for all points.
#[derive(Clone, Copy, Debug)]
pub enum Choice {
    /// One of these words; the first is the default.
    Words(&'static [&'static str]),
    Flag(bool),
    /// From the first to the second number; the third is the default.
    Count(u32, u32, u32),
    Number(f32),
    /// Rows of numbers.
    Rows,
}

/// A kind of node.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    pub name: &'static str,
    pub inputs: &'static [Input],
    pub choices: &'static [(&'static str, Choice)],
    /// Outputs; the first is the default.
    pub outputs: &'static [(&'static str, Type)],
}

const fn input(name: &'static str, of: Type, unset: Unset) -> Input {
    Input { name, of, unset }
}
const fn float(name: &'static str, unset: f32) -> Input {
    input(name, Type::Float, Unset::Number(unset))
}
const fn color(name: &'static str, unset: f32) -> Input {
    input(name, Type::Color, Unset::Number(unset))
}
const fn vector(name: &'static str, unset: f32) -> Input {
    input(name, Type::Vector, Unset::Number(unset))
}

/// The names in a list of named things.
const fn names<T, const N: usize>(all: &[(&'static str, T)]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut i = 0;
    while i < N {
        names[i] = all[i].0;
        i += 1;
    }
    names
}

const BLENDS: [&str; Blend::ALL.len()] = names(Blend::ALL);
const OPERATIONS: [&str; Operation::ALL.len()] = names(Operation::ALL);
const VECTOR_OPERATIONS: [&str; VectorOperation::ALL.len()] = names(VectorOperation::ALL);

const PLACE: Input = input("vector", Type::Vector, Unset::Generated);
const DIMENSIONS: (&str, Choice) = ("dimensions", Choice::Words(&["3d", "1d", "2d", "4d"]));
const COLOR_AND_VALUE: &[(&str, Type)] = &[("color", Type::Color), ("value", Type::Float)];
const VALUE_AND_COLOR: &[(&str, Type)] = &[("value", Type::Float), ("color", Type::Color)];
const COLOR: &[(&str, Type)] = &[("color", Type::Color)];
const VECTOR: &[(&str, Type)] = &[("vector", Type::Vector)];
const VALUE: &[(&str, Type)] = &[("value", Type::Float)];
const INTERPOLATION: (&str, Choice) = (
    "interpolation",
    Choice::Words(&["linear", "stepped", "smoothstep", "smootherstep"]),
);

/// All kinds of nodes.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "coordinates",
        inputs: &[],
        choices: &[(
            "of",
            Choice::Words(&["generated", "uv", "object", "world", "camera", "normal"]),
        )],
        outputs: VECTOR,
    },
    Kind {
        name: "geometry",
        inputs: &[],
        choices: &[],
        outputs: &[
            ("position", Type::Vector),
            ("normal", Type::Vector),
            ("true_normal", Type::Vector),
            ("incoming", Type::Vector),
            ("backfacing", Type::Float),
        ],
    },
    Kind {
        name: "object_info",
        inputs: &[],
        choices: &[],
        outputs: &[
            ("location", Type::Vector),
            ("random", Type::Float),
            ("index", Type::Float),
        ],
    },
    Kind {
        name: "light_path",
        inputs: &[],
        choices: &[],
        outputs: &[
            ("is_camera", Type::Float),
            ("is_shadow", Type::Float),
            ("is_photon", Type::Float),
        ],
    },
    Kind {
        name: "mapping",
        inputs: &[
            PLACE,
            vector("location", 0.0),
            vector("rotation", 0.0),
            vector("scale", 1.0),
        ],
        choices: &[("type", Choice::Words(&["point", "texture", "vector", "normal"]))],
        outputs: VECTOR,
    },
    Kind {
        name: "transform",
        inputs: &[PLACE],
        choices: &[("matrix", Choice::Rows)],
        outputs: VECTOR,
    },
    Kind {
        name: "noise",
        inputs: &[
            PLACE,
            float("w", 0.0),
            float("detail", 2.0),
            float("roughness", 0.5),
            float("lacunarity", 2.0),
            float("offset", 0.0),
            float("gain", 1.0),
            float("distortion", 0.0),
            float("scale", 5.0),
        ],
        choices: &[
            DIMENSIONS,
            (
                "type",
                Choice::Words(&[
                    "fbm",
                    "multifractal",
                    "hybrid_multifractal",
                    "ridged_multifractal",
                    "hetero_terrain",
                ]),
            ),
            ("normalize", Choice::Flag(true)),
        ],
        outputs: VALUE_AND_COLOR,
    },
    Kind {
        name: "voronoi",
        inputs: &[
            PLACE,
            float("w", 0.0),
            float("detail", 0.0),
            float("roughness", 0.5),
            float("lacunarity", 2.0),
            float("smoothness", 1.0),
            float("exponent", 0.5),
            float("randomness", 1.0),
            float("scale", 5.0),
        ],
        choices: &[
            DIMENSIONS,
            (
                "feature",
                Choice::Words(&["f1", "f2", "smooth_f1", "distance_to_edge", "n_sphere_radius"]),
            ),
            (
                "metric",
                Choice::Words(&["euclidean", "manhattan", "chebychev", "minkowski"]),
            ),
            ("normalize", Choice::Flag(false)),
            ("hash", Choice::Words(&["pcg", "lookup3"])),
        ],
        outputs: &[
            ("distance", Type::Float),
            ("color", Type::Color),
            ("position", Type::Vector),
            ("w", Type::Float),
            ("radius", Type::Float),
        ],
    },
    Kind {
        name: "gradient",
        inputs: &[PLACE],
        choices: &[(
            "type",
            Choice::Words(&[
                "linear",
                "quadratic",
                "easing",
                "diagonal",
                "spherical",
                "quadratic_sphere",
                "radial",
            ]),
        )],
        outputs: VALUE_AND_COLOR,
    },
    Kind {
        name: "magic",
        inputs: &[PLACE, float("scale", 5.0), float("distortion", 1.0)],
        choices: &[("depth", Choice::Count(0, 10, 2))],
        outputs: COLOR_AND_VALUE,
    },
    Kind {
        name: "wave",
        inputs: &[
            PLACE,
            float("scale", 5.0),
            float("distortion", 0.0),
            float("detail", 2.0),
            float("detail_scale", 1.0),
            float("detail_roughness", 0.5),
            float("phase_offset", 0.0),
        ],
        choices: &[
            ("type", Choice::Words(&["bands", "rings"])),
            ("direction", Choice::Words(&["x", "y", "z", "diagonal", "spherical"])),
            ("profile", Choice::Words(&["sine", "saw", "triangle"])),
        ],
        outputs: COLOR_AND_VALUE,
    },
    Kind {
        name: "brick",
        inputs: &[
            PLACE,
            float("scale", 5.0),
            float("mortar_size", 0.02),
            float("mortar_smooth", 0.1),
            float("bias", 0.0),
            float("brick_width", 0.5),
            float("row_height", 0.25),
            color("color1", 0.8),
            color("color2", 0.2),
            color("mortar", 0.0),
        ],
        choices: &[
            ("offset", Choice::Number(0.5)),
            ("offset_frequency", Choice::Count(0, 99, 2)),
            ("squash", Choice::Number(1.0)),
            ("squash_frequency", Choice::Count(0, 99, 2)),
        ],
        outputs: COLOR_AND_VALUE,
    },
    Kind {
        name: "checker",
        inputs: &[PLACE, float("scale", 5.0), color("color1", 0.8), color("color2", 0.2)],
        choices: &[],
        outputs: COLOR_AND_VALUE,
    },
    Kind {
        name: "white_noise",
        inputs: &[PLACE, float("w", 0.0)],
        choices: &[DIMENSIONS],
        outputs: VALUE_AND_COLOR,
    },
    Kind {
        name: "ramp",
        inputs: &[float("factor", 0.5)],
        choices: &[
            ("stops", Choice::Rows),
            ("interpolation", Choice::Words(&["linear", "constant", "ease"])),
        ],
        outputs: &[("color", Type::Color), ("alpha", Type::Float)],
    },
    Kind {
        name: "rgb_curves",
        inputs: &[float("factor", 1.0), input("color", Type::Color, Unset::Never)],
        choices: &[
            ("combined", Choice::Rows),
            ("red", Choice::Rows),
            ("green", Choice::Rows),
            ("blue", Choice::Rows),
        ],
        outputs: COLOR,
    },
    Kind {
        name: "vector_curves",
        inputs: &[float("factor", 1.0), input("vector", Type::Vector, Unset::Never)],
        choices: &[("x", Choice::Rows), ("y", Choice::Rows), ("z", Choice::Rows)],
        outputs: VECTOR,
    },
    Kind {
        name: "float_curve",
        inputs: &[float("factor", 1.0), float("value", 1.0)],
        choices: &[("curve", Choice::Rows)],
        outputs: VALUE,
    },
    Kind {
        name: "mix",
        inputs: &[vector("factor", 0.5), color("a", 0.5), color("b", 0.5)],
        choices: &[
            ("data", Choice::Words(&["color", "float", "vector"])),
            ("blend", Choice::Words(&BLENDS)),
            ("clamp_factor", Choice::Flag(true)),
            ("clamp_result", Choice::Flag(false)),
        ],
        outputs: &[("result", Type::Color)],
    },
    Kind {
        name: "math",
        inputs: &[float("a", 0.5), float("b", 0.5), float("c", 0.0)],
        choices: &[
            ("operation", Choice::Words(&OPERATIONS)),
            ("clamp", Choice::Flag(false)),
        ],
        outputs: VALUE,
    },
    Kind {
        name: "vector_math",
        inputs: &[
            vector("a", 0.0),
            vector("b", 0.0),
            vector("c", 0.0),
            float("scale", 1.0),
        ],
        choices: &[("operation", Choice::Words(&VECTOR_OPERATIONS))],
        outputs: &[("vector", Type::Vector), ("value", Type::Float)],
    },
    Kind {
        name: "map_range",
        inputs: &[
            vector("value", 1.0),
            vector("from_min", 0.0),
            vector("from_max", 1.0),
            vector("to_min", 0.0),
            vector("to_max", 1.0),
            vector("steps", 4.0),
        ],
        choices: &[
            ("data", Choice::Words(&["float", "vector"])),
            INTERPOLATION,
            ("clamp", Choice::Flag(true)),
        ],
        outputs: &[("result", Type::Vector)],
    },
    Kind {
        name: "clamp",
        inputs: &[float("value", 1.0), float("min", 0.0), float("max", 1.0)],
        choices: &[("type", Choice::Words(&["minmax", "range"]))],
        outputs: VALUE,
    },
    Kind {
        name: "separate",
        inputs: &[input("value", Type::Color, Unset::Never)],
        choices: &[("mode", Choice::Words(&["rgb", "hsv", "hsl", "xyz"]))],
        outputs: &[("x", Type::Float), ("y", Type::Float), ("z", Type::Float)],
    },
    Kind {
        name: "combine",
        inputs: &[float("x", 0.0), float("y", 0.0), float("z", 0.0)],
        choices: &[("mode", Choice::Words(&["rgb", "hsv", "hsl", "xyz"]))],
        outputs: &[("result", Type::Color)],
    },
    Kind {
        name: "hue_saturation",
        inputs: &[
            float("hue", 0.5),
            float("saturation", 1.0),
            float("value", 1.0),
            float("factor", 1.0),
            color("color", 0.8),
        ],
        choices: &[],
        outputs: COLOR,
    },
    Kind {
        name: "bright_contrast",
        inputs: &[color("color", 1.0), float("bright", 0.0), float("contrast", 0.0)],
        choices: &[],
        outputs: COLOR,
    },
    Kind {
        name: "gamma",
        inputs: &[color("color", 1.0), float("gamma", 1.0)],
        choices: &[],
        outputs: COLOR,
    },
    Kind {
        name: "invert",
        inputs: &[float("factor", 1.0), color("color", 0.0)],
        choices: &[],
        outputs: COLOR,
    },
    Kind {
        name: "luminance",
        inputs: &[input("color", Type::Color, Unset::Never)],
        choices: &[],
        outputs: VALUE,
    },
    Kind {
        name: "blackbody",
        inputs: &[float("temperature", 6500.0)],
        choices: &[],
        outputs: COLOR,
    },
    Kind {
        name: "fresnel",
        inputs: &[float("ior", 1.5)],
        choices: &[],
        outputs: VALUE,
    },
    Kind {
        name: "layer_weight",
        inputs: &[float("blend", 0.5)],
        choices: &[],
        outputs: &[("fresnel", Type::Float), ("facing", Type::Float)],
    },
    Kind {
        name: "vector_rotate",
        inputs: &[
            PLACE,
            vector("center", 0.0),
            input("axis", Type::Vector, Unset::Vector([0.0, 0.0, 1.0])),
            float("angle", 0.0),
            vector("rotation", 0.0),
        ],
        choices: &[
            ("type", Choice::Words(&["axis_angle", "x", "y", "z", "euler_xyz"])),
            ("invert", Choice::Flag(false)),
        ],
        outputs: VECTOR,
    },
];

impl Kind {
    /// The kind of that name.
    pub fn named(name: &str) -> Option<&'static Self> {
        KINDS.iter().find(|kind| kind.name == name)
    }

    /// The fields that a node's table takes.
    pub fn fields(&self) -> impl Iterator<Item = &'static str> {
        let inputs = self.inputs.iter().map(|input| input.name);
        inputs.chain(self.choices.iter().map(|(name, _)| *name))
    }

    /// Whether any kind of node has such a field.
    pub fn any_has(field: &str) -> bool {
        KINDS.iter().any(|kind| kind.fields().any(|name| name == field))
    }
}

/// A field's value.
#[derive(Clone, Debug)]
pub enum NodeValue {
    Number(f64),
    Flag(bool),
    Word(String),
    List(Vec<NodeValue>),
    Texture(Box<TextureRecord<Finite>>),
}

/// `{ node = "noise", ... }`.
#[derive(Clone, Debug)]
pub struct NodeRecord {
    pub node: Spanned<String>,
    pub output: Option<Spanned<String>>,
    pub fields: Vec<(String, Spanned<NodeValue>)>,
}

impl NodeRecord {
    /// A field's value by name.
    pub fn field(&self, name: &str) -> Option<&Spanned<NodeValue>> {
        self.fields
            .iter()
            .find(|(field, _)| field == name)
            .map(|(_, value)| value)
    }
}

/// `{ texture = "name" }`.
#[derive(Clone, Debug)]
pub struct NamedRecord {
    pub texture: Spanned<String>,
    pub output: Option<Spanned<String>>,
}

impl<'de> Deserialize<'de> for NodeValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ValueVisitor;
        impl<'de> Visitor<'de> for ValueVisitor {
            type Value = NodeValue;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number, three of them in brackets, a word, or a texture")
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
                match (x as f32).is_finite() {
                    true => Ok(NodeValue::Number(x)),
                    false => Err(E::custom(format_args!("expected a finite number, found {x:?}"))),
                }
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
                self.visit_f64(x as f64)
            }
            fn visit_bool<E: Error>(self, is_so: bool) -> Result<Self::Value, E> {
                Ok(NodeValue::Flag(is_so))
            }
            fn visit_str<E: Error>(self, word: &str) -> Result<Self::Value, E> {
                Ok(NodeValue::Word(word.to_owned()))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
                let mut list = Vec::new();
                while let Some(value) = seq.next_element()? {
                    list.push(value);
                }
                Ok(NodeValue::List(list))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let record = TextureRecord::deserialize(MapAccessDeserializer::new(map))?;
                Ok(NodeValue::Texture(Box::new(record)))
            }
        }
        deserializer.deserialize_any(ValueVisitor)
    }
}

/// The schema of a node. The parser checks which fields belong to which kind.
pub struct NodeSchema;

impl JsonSchema for NodeSchema {
    fn schema_name() -> Cow<'static, str> {
        "Node".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let texture = generator.subschema_for::<TextureRecord<Finite>>();
        let names: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
        let mut fields = Map::new();
        let node = json_schema!({ "enum": names, "description": "What it does." });
        fields.insert("node".to_owned(), node.to_value());
        let output = json_schema!({ "type": "string", "description": "Which of its outputs. Default: the first." });
        fields.insert("output".to_owned(), output.to_value());
        for name in KINDS.iter().flat_map(Kind::fields) {
            let takers = KINDS.iter().filter(|kind| kind.fields().any(|field| field == name));
            let takers: Vec<&str> = takers.map(|kind| kind.name).collect();
            let is_input = KINDS
                .iter()
                .any(|kind| kind.inputs.iter().any(|input| input.name == name));
            let mut ways: Vec<Value> = Vec::new();
            if is_input {
                ways.push(texture.clone().to_value());
            }
            for (_, choice) in KINDS
                .iter()
                .flat_map(|kind| kind.choices)
                .filter(|(field, _)| *field == name)
            {
                let way = match choice {
                    Choice::Words(words) => json_schema!({ "enum": words }),
                    Choice::Flag(_) => json_schema!({ "type": "boolean" }),
                    Choice::Count(low, high, _) => json_schema!({ "type": "integer", "minimum": low, "maximum": high }),
                    Choice::Number(_) => json_schema!({ "type": "number" }),
                    Choice::Rows => {
                        json_schema!({ "type": "array", "items": { "type": "array", "items": { "type": "number" } } })
                    }
                };
                let way = way.to_value();
                if !ways.contains(&way) {
                    ways.push(way);
                }
            }
            let about = format!("Of {}.", takers.join(", "));
            fields.insert(
                name.to_owned(),
                described(json_schema!({ "anyOf": ways }), &about).to_value(),
            );
        }
        json_schema!({
            "type": "object",
            "properties": fields,
            "required": ["node"],
            "additionalProperties": false
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        for (i, kind) in KINDS.iter().enumerate() {
            assert!(KINDS[..i].iter().all(|other| other.name != kind.name));
            let fields: Vec<&str> = kind.fields().collect();
            let unique: std::collections::BTreeSet<&str> = fields.iter().copied().collect();
            assert_eq!(unique.len(), fields.len(), "{}", kind.name);
            assert!(!kind.outputs.is_empty());
        }
    }
}
