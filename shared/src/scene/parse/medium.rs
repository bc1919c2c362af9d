//! Media: coefficients, densities, phase functions.

use super::transform::Steps;
use super::{Fault, given, only_takes};
use crate::medium::transmittance::Estimator;
use crate::scene::values::*;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;
use toml::Spanned;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MediumRecord {
    #[serde(rename = "type")]
    pub kind: Spanned<MediumKind>,
    pub sigma_a: Option<Spanned<Color<NonNegative>>>,
    pub sigma_s: Option<Spanned<Color<NonNegative>>>,
    pub sigma_t: Option<Spanned<Color<NonNegative>>>,
    pub albedo: Option<Spanned<AlbedoRecord>>,
    #[serde(default)]
    pub phase: PhaseRecord,
    pub density: Option<Spanned<DensityRecord>>,
    pub scale: Option<Spanned<Number<NonNegative>>>,
    pub transform: Option<Spanned<Steps>>,
    pub transmittance: Option<Spanned<EstimatorRecord>>,
}

impl MediumRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let given = given!(self, density, scale, transform, transmittance);
        only_takes(name, takes, MediumKind::ALL, &given)
    }

    /// The volumes that it names.
    pub fn files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let density = self
            .density
            .as_ref()
            .and_then(|d| d.get_ref().file.as_ref());
        let albedo = match self.albedo.as_ref().map(|a| a.get_ref()) {
            Some(AlbedoRecord::File { file, .. }) => Some(file),
            _ => None,
        };
        density.into_iter().chain(albedo)
    }
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MediumKind {
    Homogeneous,
    Heterogeneous,
}

impl MediumKind {
    /// Fields that every medium takes.
    pub const ALL: &[&str] = &["sigma_a", "sigma_s", "sigma_t", "albedo", "phase"];

    /// As the scene file writes it, and the fields of this kind alone.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Homogeneous => ("homogeneous", &[]),
            Self::Heterogeneous => (
                "heterogeneous",
                &["density", "scale", "transform", "transmittance"],
            ),
        }
    }
}

/// A colour, or a volume file.
#[derive(Clone, Debug)]
pub enum AlbedoRecord {
    Color(Color<Unit>),
    File {
        file: Spanned<String>,
        grid: Option<Spanned<String>>,
    },
}

impl<'de> Deserialize<'de> for AlbedoRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AlbedoVisitor(ColorVisitor<Unit>);
        impl<'de> Visitor<'de> for AlbedoVisitor {
            type Value = AlbedoRecord;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.expecting(f)?;
                f.write_str(", or { file = \"volume\" }")
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
                    file: Spanned<String>,
                    grid: Option<Spanned<String>>,
                }
                let table = Table::deserialize(MapAccessDeserializer::new(map))?;
                Ok(AlbedoRecord::File {
                    file: table.file,
                    grid: table.grid,
                })
            }
        }
        deserializer.deserialize_any(AlbedoVisitor(ColorVisitor(PhantomData)))
    }
}

/// A volume file, or a recipe.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DensityRecord {
    pub file: Option<Spanned<String>>,
    pub grid: Option<Spanned<String>>,
    pub min: Option<Spanned<Vector>>,
    pub max: Option<Spanned<Vector>>,
    pub voxel: Option<Spanned<Number<Positive>>>,
    pub height: Option<Spanned<HeightRecord>>,
    pub blobs: Option<Spanned<Vec<BlobRecord>>>,
    pub noise: Option<Spanned<NoiseRecord>>,
}

impl DensityRecord {
    pub fn check(&self) -> Result<(), Fault> {
        let given = given!(self, grid, min, max, voxel, height, blobs, noise);
        let (takes, message): (&[&str], _) = match self.file {
            Some(_) => (
                &["grid"],
                "a density takes only `grid` beside `file`; `min`, `max` and the rest describe one without a file",
            ),
            None => (
                &["min", "max", "voxel", "height", "blobs", "noise"],
                "it names one of the grids of a `file`, and this density has none",
            ),
        };
        for (field, span) in given {
            if let Some(span) = span
                && !takes.contains(&field)
            {
                return Err(Fault::new(span, message));
            }
        }
        Ok(())
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightRecord {
    pub base: Option<Number<Finite>>,
    pub scale: Number<Positive>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlobRecord {
    pub center: Vector,
    pub radius: Number<Positive>,
    pub density: Option<Number<NonNegative>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseRecord {
    pub size: Spanned<Number<Positive>>,
    pub octaves: Option<Spanned<u32>>,
    pub gain: Option<Number<Unit>>,
    pub contrast: Option<Number<NonNegative>>,
    pub seed: Option<u32>,
}

#[derive(Clone, Copy, Debug)]
pub struct EstimatorRecord(pub Estimator);

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
                    "residual_ratio_tracking" => {
                        Ok(EstimatorRecord(Estimator::ResidualRatioTracking))
                    }
                    _ => Err(E::custom(format_args!(
                        "expected {EXPECTED}, found \"{name}\""
                    ))),
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

/// `"isotropic"`, `{ type = "isotropic" }`, `{ type = "hg", g = 0.7 }` or `{ type = "blend", weight = 0.3, phases = [...] }`.
#[derive(Clone, Copy, Debug, Default)]
pub enum PhaseRecord {
    #[default]
    Isotropic,
    HenyeyGreenstein(Number<MeanCosine>),
    Blend {
        weight: Number<Unit>,
        /// 0 for isotropic ones.
        g: [f64; 2],
    },
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
                    Err(E::custom(format_args!(
                        "expected {EXPECTED}, found \"{name}\""
                    )))
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
                            PhaseRecord::Blend { .. } => Err(serde::de::Error::custom(
                                "a blend of blends is not supported",
                            )),
                        };
                        let g = [single(first)?, single(second)?];
                        Ok(PhaseRecord::Blend { weight, g })
                    }
                    _ => Err(serde::de::Error::custom(format_args!(
                        "expected {EXPECTED}"
                    ))),
                }
            }
        }
        deserializer.deserialize_any(PhaseVisitor)
    }
}
