//! Emission of media.

use super::{DensityRecord, Fault};
use crate::values::*;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// A colour, or a table.
#[derive(Debug)]
pub enum VolumeEmissionRecord {
    /// Constant emission.
    Color(Color<NonNegative>),
    /// Emission with varying factors.
    Table(Box<GlowRecord>),
}

/// A medium's emission: the product of everything given.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlowRecord {
    /// W/(m^2 sr) per scene unit; with a temperature, the share of a black body's radiance per scene unit. Default: 1.
    pub color: Option<Color<NonNegative>>,
    /// Factor on the colour. Default: 1.
    pub scale: Option<Number<NonNegative>>,
    /// A varying factor: "density", a volume file or a recipe.
    pub field: Option<Spanned<FieldRecord>>,
    /// Kelvin, temperature of a black body: a number, "density", a volume file or a recipe.
    pub temperature: Option<Spanned<TemperatureRecord>>,
    /// Kelvin per unit of temperature. Default: 1.
    pub kelvin: Option<Spanned<Number<NonNegative>>>,
}

/// A grid.
#[derive(Debug)]
pub enum FieldRecord {
    /// The medium's own density.
    Density,
    /// Another grid.
    Grid(Box<DensityRecord>),
}

/// A temperature.
#[derive(Debug)]
pub enum TemperatureRecord {
    /// A constant.
    Number(Number<NonNegative>),
    /// By a grid.
    Field(FieldRecord),
}

impl VolumeEmissionRecord {
    /// The grids' records, the density's included.
    fn fields(&self) -> impl Iterator<Item = &FieldRecord> {
        let table = match self {
            Self::Color(_) => None,
            Self::Table(table) => Some(table),
        };
        let field = table.and_then(|table| Some(table.field.as_ref()?.get_ref()));
        let temperature = table.and_then(|table| match table.temperature.as_ref()?.get_ref() {
            TemperatureRecord::Number(_) => None,
            TemperatureRecord::Field(field) => Some(field),
        });
        field.into_iter().chain(temperature)
    }

    /// Its grids.
    pub fn grids(&self) -> impl Iterator<Item = &DensityRecord> {
        self.fields().filter_map(|field| match field {
            FieldRecord::Density => None,
            FieldRecord::Grid(grid) => Some(&**grid),
        })
    }

    /// Whether it has a grid of its own.
    pub fn has_grid(&self) -> bool {
        self.grids().next().is_some()
    }

    pub fn check(&self) -> Result<(), Fault> {
        self.grids().try_for_each(DensityRecord::check)?;
        match self {
            Self::Table(table) => match (&table.kelvin, &table.temperature) {
                (Some(kelvin), None) => {
                    let message = "it multiplies the temperature, and there is none";
                    Err(Fault::new(kelvin.span(), message))
                }
                _ => Ok(()),
            },
            Self::Color(_) => Ok(()),
        }
    }
}

impl JsonSchema for VolumeEmissionRecord {
    fn schema_name() -> Cow<'static, str> {
        "VolumeEmissionRecord".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = generator.subschema_for::<GlowRecord>();
        json_schema!({ "anyOf": [Color::<NonNegative>::json_schema(generator), table] })
    }
}

impl JsonSchema for FieldRecord {
    fn schema_name() -> Cow<'static, str> {
        "FieldRecord".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let grid = generator.subschema_for::<DensityRecord>();
        json_schema!({ "anyOf": [{ "const": "density" }, grid] })
    }
}

impl JsonSchema for TemperatureRecord {
    fn schema_name() -> Cow<'static, str> {
        "TemperatureRecord".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let field = generator.subschema_for::<FieldRecord>();
        json_schema!({ "anyOf": [NonNegative::schema(), field] })
    }
}

impl<'de> Deserialize<'de> for VolumeEmissionRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct EmissionVisitor(ColorVisitor<NonNegative>);
        impl<'de> Visitor<'de> for EmissionVisitor {
            type Value = VolumeEmissionRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.expecting(f)?;
                f.write_str(", or { color = ..., scale = ..., field = ..., temperature = ..., kelvin = ... }")
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
                self.0.visit_f64(x).map(VolumeEmissionRecord::Color)
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
                self.0.visit_i64(x).map(VolumeEmissionRecord::Color)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                self.0.visit_seq(seq).map(VolumeEmissionRecord::Color)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let table = GlowRecord::deserialize(MapAccessDeserializer::new(map))?;
                Ok(VolumeEmissionRecord::Table(Box::new(table)))
            }
        }
        deserializer.deserialize_any(EmissionVisitor(ColorVisitor(PhantomData)))
    }
}

/// The expected text for a grid.
const FIELD: &str = "\"density\", { file = \"volume\" } or a recipe like those of densities";

struct FieldVisitor;

impl<'de> Visitor<'de> for FieldVisitor {
    type Value = FieldRecord;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(FIELD)
    }
    fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
        match name {
            "density" => Ok(FieldRecord::Density),
            _ => Err(E::custom(format_args!("expected {FIELD}, found \"{name}\""))),
        }
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let grid = DensityRecord::deserialize(MapAccessDeserializer::new(map))?;
        Ok(FieldRecord::Grid(Box::new(grid)))
    }
}

impl<'de> Deserialize<'de> for FieldRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FieldVisitor)
    }
}

impl<'de> Deserialize<'de> for TemperatureRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TemperatureVisitor;
        impl<'de> Visitor<'de> for TemperatureVisitor {
            type Value = TemperatureRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a number of kelvin that is not negative, {FIELD}")
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
                Number::<NonNegative>::deserialize(serde::de::value::F64Deserializer::new(x))
                    .map(TemperatureRecord::Number)
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
                self.visit_f64(x as f64)
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
                FieldVisitor.visit_str(name).map(TemperatureRecord::Field)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                FieldVisitor.visit_map(map).map(TemperatureRecord::Field)
            }
        }
        deserializer.deserialize_any(TemperatureVisitor)
    }
}
