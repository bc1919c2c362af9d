//! Indices of refraction: a number, or a function of wavelength.

use super::Fault;
use crate::values::*;
use beamfarm_render::world::bsdf::{Index, index_names};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// An index of refraction.
#[derive(Debug)]
pub enum IorRecord {
    /// The same for all wavelengths.
    Number(Number<Positive>),
    /// By wavelength.
    Dispersion(Box<DispersionRecord>),
}

/// A wavelength-dependent index of refraction, given in one of four ways.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DispersionRecord {
    /// A substance by name: acrylic, bk7, diamond, fused silica, polycarbonate, polystyrene, sapphire, sf10, sf11 or
    /// water.
    pub preset: Option<Spanned<String>>,
    /// n = a + b / l², with the wavelength l in micrometres: [a, b].
    pub cauchy: Option<Pair>,
    /// n² - 1 = sum of b l² / (l² - c), with the wavelength l in micrometres: [[b, c], ...].
    pub sellmeier: Option<Vec<Pair>>,
    /// Index at 587.6 nm, helium's d line; together with `abbe`.
    pub nd: Option<Number<Positive>>,
    /// Abbe number, (nd - 1) / (nF - nC); together with `nd`.
    pub abbe: Option<Number<Positive>>,
}

const WAYS: &str = "`preset = \"bk7\"`, `cauchy = [a, b]`, `sellmeier = [[b, c], ...]`, or `nd` and `abbe`";

impl IorRecord {
    /// The index of refraction. `span`: its place.
    pub fn index(&self, span: std::ops::Range<usize>) -> Result<Index, Fault> {
        let record = match self {
            Self::Number(number) => return Ok(Index::Constant(number.0)),
            Self::Dispersion(record) => record,
        };
        let fault = |message: String| Fault::new(span.clone(), message);
        let DispersionRecord {
            preset,
            cauchy,
            sellmeier,
            nd,
            abbe,
        } = &**record;
        let index = match (preset, cauchy, sellmeier, nd, abbe) {
            (Some(name), None, None, None, None) => Index::preset(name.get_ref()).ok_or_else(|| {
                let names: Vec<_> = index_names().map(|name| format!("\"{name}\"")).collect();
                let message = format!("expected one of {}, found \"{}\"", names.join(", "), name.get_ref());
                Fault::new(name.span(), message)
            })?,
            (None, Some(Pair([a, b])), None, None, None) => Index::Cauchy { a: *a, b: *b },
            (None, None, Some(terms), None, None) if !terms.is_empty() => {
                Index::Sellmeier(terms.iter().map(|term| term.0).collect())
            }
            (None, None, None, Some(nd), Some(abbe)) => Index::of_abbe(nd.0, abbe.0),
            _ => return Err(fault(format!("expected one of: {WAYS}"))),
        };
        match index.flaw() {
            None => Ok(index),
            Some(nm) => Err(fault(format!(
                "expected an index of refraction from 0.001 to 1000 at all wavelengths from 380 to 780 nm, found {} at \
                 {nm} nm",
                index.at(nm)
            ))),
        }
    }
}

impl JsonSchema for IorRecord {
    fn inline_schema() -> bool {
        true
    }
    fn schema_name() -> Cow<'static, str> {
        "IorRecord".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [Positive::schema(), generator.subschema_for::<DispersionRecord>()] })
    }
}

impl<'de> Deserialize<'de> for IorRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct IorVisitor;
        impl<'de> Visitor<'de> for IorVisitor {
            type Value = IorRecord;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}, or one of {WAYS} in braces", Positive::EXPECTED)
            }
            fn visit_f64<E: Error>(self, x: f64) -> Result<Self::Value, E> {
                Number::deserialize(x.into_deserializer()).map(IorRecord::Number)
            }
            fn visit_i64<E: Error>(self, x: i64) -> Result<Self::Value, E> {
                self.visit_f64(x as f64)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let record = DispersionRecord::deserialize(MapAccessDeserializer::new(map))?;
                Ok(IorRecord::Dispersion(Box::new(record)))
            }
        }
        deserializer.deserialize_any(IorVisitor)
    }
}
