//! Media: coefficients, densities, phase functions.

use super::schema::{by_type, described, table};
use super::transform::Steps;
use super::{DensityRecord, Fault, NamedRecord, VolumeEmissionRecord, given, only_takes};
use crate::values::*;
use beamfarm_render::world::medium::transmittance::Estimator;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// A medium that absorbs and scatters.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = MediumKind::narrow)]
pub struct MediumRecord {
    /// Kind of medium.
    #[serde(rename = "type")]
    pub kind: Spanned<MediumKind>,
    /// Absorption, per scene unit. Given with `sigma_s`.
    pub sigma_a: Option<Spanned<Color<NonNegative>>>,
    /// Scattering, per scene unit. Given with `sigma_a`.
    pub sigma_s: Option<Spanned<Color<NonNegative>>>,
    /// Extinction, per scene unit. Given with `albedo`.
    pub sigma_t: Option<Spanned<Color<NonNegative>>>,
    /// Scattering over extinction, 0 to 1. Given with `sigma_t`.
    pub albedo: Option<Spanned<AlbedoRecord>>,
    /// Phase function. Default: isotropic.
    #[serde(default)]
    pub phase: PhaseRecord,
    /// A volume file or a recipe.
    pub density: Option<Spanned<DensityRecord>>,
    /// Emitted radiance along a ray, W/(m^2 sr) per scene unit. Default: nothing.
    pub emission: Option<Spanned<VolumeEmissionRecord>>,
    /// Factor on the density. Default: 1.
    pub scale: Option<Spanned<Number<NonNegative>>>,
    /// From the space of the density's and emission's grids to world space.
    pub transform: Option<Spanned<Steps>>,
    /// Transmittance estimator. Default: residual_ratio_tracking.
    pub transmittance: Option<Spanned<EstimatorRecord>>,
}

impl MediumRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let given = given!(self, density, scale, transform, transmittance);
        only_takes(name, takes, MediumKind::ALL, &given)?;
        let has_grid = self
            .emission
            .as_ref()
            .is_some_and(|emission| emission.get_ref().has_grid());
        match (&self.transform, self.kind.get_ref()) {
            (Some(transform), MediumKind::Homogeneous) if !has_grid => {
                let message = "it places grids, and this medium has none";
                Err(Fault::new(transform.span(), message))
            }
            _ => Ok(()),
        }
    }

    /// The volume files it names.
    pub fn files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let density = self.density.as_ref().and_then(|d| d.get_ref().file.as_ref());
        let albedo = match self.albedo.as_ref().map(|a| a.get_ref()) {
            Some(AlbedoRecord::File { file, .. }) => Some(file),
            _ => None,
        };
        let emission = self.emission.iter().flat_map(|emission| emission.get_ref().grids());
        let glowing = emission.filter_map(|grid| grid.file.as_ref());
        density.into_iter().chain(albedo).chain(glowing)
    }
}

#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MediumKind {
    /// Constant coefficients.
    Homogeneous,
    /// A varying density.
    Heterogeneous,
}

impl MediumKind {
    /// The schema for each kind of medium.
    fn narrow(schema: &mut Schema) {
        by_type(schema, |kind: Self| [Self::ALL, kind.takes().1].concat());
    }

    /// Fields of every medium.
    pub const ALL: &[&str] = &["sigma_a", "sigma_s", "sigma_t", "albedo", "phase", "emission"];

    /// The name in scene files, and the fields of this kind alone.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Homogeneous => ("homogeneous", &["transform"]),
            Self::Heterogeneous => ("heterogeneous", &["density", "scale", "transform", "transmittance"]),
        }
    }
}

/// A colour, a volume file, or one of `textures`.
#[derive(Clone, Debug)]
pub enum AlbedoRecord {
    Color(Color<Unit>),
    File {
        file: Spanned<String>,
        grid: Option<Spanned<String>>,
    },
    Texture(NamedRecord),
}

impl JsonSchema for AlbedoRecord {
    fn schema_name() -> Cow<'static, str> {
        "AlbedoRecord".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let file = json_schema!({
            "file": { "type": "string", "description": ".vdb or .vol, relative to the scene file." },
            "grid": { "type": "string", "description": "Name of a grid of the file." },
        });
        let texture = json_schema!({
            "texture": { "type": "string", "description": "One of `textures`, in the density's own space." },
            "output": { "type": "string", "description": "Which of its outputs. Default: the first." },
        });
        let tables = [table(&["file"], file), table(&["texture"], texture)];
        json_schema!({ "anyOf": [Color::<Unit>::json_schema(generator), tables[0], tables[1]] })
    }
}

impl<'de> Deserialize<'de> for AlbedoRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AlbedoVisitor(ColorVisitor<Unit>);
        impl<'de> Visitor<'de> for AlbedoVisitor {
            type Value = AlbedoRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.expecting(f)?;
                f.write_str(", or { file = \"volume\" }, or { texture = \"NAME\" }")
            }
            fn visit_f64<E: serde::de::Error>(self, x: f64) -> Result<Self::Value, E> {
                self.0.visit_f64(x).map(AlbedoRecord::Color)
            }
            fn visit_i64<E: serde::de::Error>(self, x: i64) -> Result<Self::Value, E> {
                self.0.visit_i64(x).map(AlbedoRecord::Color)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
                self.0.visit_seq(seq).map(AlbedoRecord::Color)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                #[derive(Deserialize)]
                #[serde(deny_unknown_fields)]
                struct Table {
                    file: Option<Spanned<String>>,
                    grid: Option<Spanned<String>>,
                    texture: Option<Spanned<String>>,
                    output: Option<Spanned<String>>,
                }
                match Table::deserialize(MapAccessDeserializer::new(map))? {
                    Table {
                        file: Some(file),
                        grid,
                        texture: None,
                        output: None,
                    } => Ok(AlbedoRecord::File { file, grid }),
                    Table {
                        file: None,
                        grid: None,
                        texture: Some(texture),
                        output,
                    } => Ok(AlbedoRecord::Texture(NamedRecord { texture, output })),
                    _ => Err(serde::de::Error::custom(
                        "expected `file`, and `grid` beside it, or `texture`, and `output` beside it",
                    )),
                }
            }
        }
        deserializer.deserialize_any(AlbedoVisitor(ColorVisitor(PhantomData)))
    }
}

#[derive(Clone, Copy, Debug)]
pub struct EstimatorRecord(pub Estimator);

impl JsonSchema for EstimatorRecord {
    fn schema_name() -> Cow<'static, str> {
        "EstimatorRecord".into()
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let flights = json_schema!({ "type": "integer", "minimum": 1, "maximum": 65535, "description": "Flights to take the mean of." });
        json_schema!({
            "description": "How transmittance is estimated.",
            "anyOf": [
                { "enum": ["ratio_tracking", "residual_ratio_tracking"] },
                table(&["free_flights"], json_schema!({ "free_flights": flights })),
            ]
        })
    }
}

impl<'de> Deserialize<'de> for EstimatorRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const EXPECTED: &str = "\"ratio_tracking\", \"residual_ratio_tracking\" \
            or { free_flights = number from 1 to 65535 }";

        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            free_flights: i64,
        }
        struct EstimatorVisitor;
        impl<'de> Visitor<'de> for EstimatorVisitor {
            type Value = EstimatorRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(EXPECTED)
            }
            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Self::Value, E> {
                match name {
                    "ratio_tracking" => Ok(EstimatorRecord(Estimator::RatioTracking)),
                    "residual_ratio_tracking" => Ok(EstimatorRecord(Estimator::ResidualRatioTracking)),
                    _ => Err(E::custom(format_args!("expected {EXPECTED}, found \"{name}\""))),
                }
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let table = Table::deserialize(MapAccessDeserializer::new(map))?;
                let flights = table.free_flights;
                match u16::try_from(flights) {
                    Ok(distances @ 1..) => Ok(EstimatorRecord(Estimator::FreeFlight { distances })),
                    _ => Err(serde::de::Error::custom(format_args!(
                        "expected 1 to {} free flights, found {flights}",
                        u16::MAX
                    ))),
                }
            }
        }
        deserializer.deserialize_any(EstimatorVisitor)
    }
}

/// `"isotropic"`, `{ type = "isotropic" }`, `{ type = "hg", g = 0.7 }` or `{ type = "blend", weight = 0.3, phases =
/// [...] }`.
#[derive(Clone, Copy, Debug, Default)]
pub enum PhaseRecord {
    #[default]
    Isotropic,
    HenyeyGreenstein(Number<MeanCosine>),
    Blend {
        weight: Number<Unit>,
        /// Mean cosines; 0 for isotropic parts.
        g: [f64; 2],
    },
}

impl JsonSchema for PhaseRecord {
    fn schema_name() -> Cow<'static, str> {
        "PhaseRecord".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let phase = generator.subschema_for::<Self>();
        let phases = json_schema!({ "type": "array", "items": phase, "minItems": 2, "maxItems": 2 });
        let blend = json_schema!({
            "type": { "const": "blend" },
            "weight": described(Unit::schema(), "Share of the second, 0 to 1."),
            "phases": phases,
        });
        let hg = json_schema!({
            "type": { "const": "hg" },
            "g": described(MeanCosine::schema(), "Mean cosine, -1 to 1: positive is forward."),
        });
        json_schema!({
            "description": "Isotropic, Henyey-Greenstein with the mean cosine g, or a blend: `weight` is that of the second.",
            "anyOf": [
                { "const": "isotropic" },
                table(&["type"], json_schema!({ "type": { "const": "isotropic" } })),
                table(&["type", "g"], hg),
                table(&["type", "weight", "phases"], blend),
            ]
        })
    }
}

impl<'de> Deserialize<'de> for PhaseRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const EXPECTED: &str = "\"isotropic\", { type = \"hg\", g = mean cosine } \
            or { type = \"blend\", weight = share of the second, phases = [first, second] }";

        #[derive(Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Kind {
            Isotropic,
            Hg,
            Blend,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            #[serde(rename = "type")]
            kind: Kind,
            g: Option<Number<MeanCosine>>,
            weight: Option<Number<Unit>>,
            phases: Option<Vec<PhaseRecord>>,
        }
        struct PhaseVisitor;
        impl<'de> Visitor<'de> for PhaseVisitor {
            type Value = PhaseRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(EXPECTED)
            }
            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Self::Value, E> {
                if name == "isotropic" {
                    Ok(PhaseRecord::Isotropic)
                } else {
                    Err(E::custom(format_args!("expected {EXPECTED}, found \"{name}\"")))
                }
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                let table = Table::deserialize(MapAccessDeserializer::new(map))?;
                let given = (table.g, table.weight, table.phases.as_deref());
                match (table.kind, given) {
                    (Kind::Isotropic, (None, None, None)) => Ok(PhaseRecord::Isotropic),
                    (Kind::Hg, (Some(g), None, None)) => Ok(PhaseRecord::HenyeyGreenstein(g)),
                    (Kind::Blend, (None, Some(weight), Some([first, second]))) => {
                        let single = |phase: &PhaseRecord| match phase {
                            PhaseRecord::Isotropic => Ok(0.0),
                            PhaseRecord::HenyeyGreenstein(g) => Ok(g.0),
                            PhaseRecord::Blend { .. } => {
                                Err(serde::de::Error::custom("a blend of blends is not supported"))
                            }
                        };
                        let g = [single(first)?, single(second)?];
                        Ok(PhaseRecord::Blend { weight, g })
                    }
                    _ => Err(serde::de::Error::custom(format_args!("expected {EXPECTED}"))),
                }
            }
        }
        deserializer.deserialize_any(PhaseVisitor)
    }
}
