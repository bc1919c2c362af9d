//! The scene file's records: its TOML as serde reads it, names not yet resolved.

use super::values::*;
use crate::job::ScheduleKind;
use crate::medium::transmittance::Estimator;
use serde::de::{MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range as Span;
use toml::Spanned;

/// A whole scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    pub image: ImageRecord,
    #[serde(default)]
    pub render: RenderRecord,
    #[serde(default)]
    pub world: WorldRecord,
    pub camera: CameraRecord,
    #[serde(default)]
    pub media: BTreeMap<Spanned<String>, MediumRecord>,
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    #[serde(default)]
    pub shapes: Vec<ShapeRecord>,
    #[serde(default)]
    pub lights: Vec<LightRecord>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageRecord {
    pub width: Spanned<u32>,
    pub height: Spanned<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderRecord {
    pub passes: Option<Spanned<u64>>,
    pub paths: Option<Spanned<u32>>,
    pub alpha: Option<Number<OpenUnit>>,
    pub schedule: Option<ScheduleKind>,
    pub seed: Option<u64>,
    pub exposure: Option<Number<Finite>>,
    pub radius: Option<Number<Positive>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldRecord {
    pub medium: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraRecord {
    pub origin: Vector,
    pub target: Spanned<Vector>,
    pub up: Option<Spanned<Vector>>,
    pub fov: Spanned<Number<Degrees>>,
    #[serde(default)]
    pub fov_axis: FovAxis,
    pub aperture: Option<Number<NonNegative>>,
    pub focus_distance: Option<Number<Positive>>,
    pub medium: Option<Spanned<String>>,
}

/// The side of the image that the field of view spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FovAxis {
    #[default]
    X,
    Y,
    Smaller,
    Larger,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MediumRecord {
    #[serde(rename = "type")]
    pub kind: Spanned<MediumKind>,
    pub sigma_a: Option<Spanned<Color<NonNegative>>>,
    pub sigma_s: Option<Spanned<Color<NonNegative>>>,
    pub sigma_t: Option<Spanned<Color<NonNegative>>>,
    pub albedo: Option<Spanned<Color<Unit>>>,
    #[serde(default)]
    pub phase: PhaseRecord,
    pub density: Option<Spanned<DensityRecord>>,
    pub scale: Option<Spanned<Number<NonNegative>>>,
    pub transform: Option<Spanned<Steps>>,
    pub transmittance: Option<Spanned<EstimatorRecord>>,
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

/// `"ratio_tracking"`, `"residual_ratio_tracking"` or `{ free_flights = n }`.
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

/// `"isotropic"`, `{ type = "isotropic" }` or `{ type = "hg", g = 0.7 }`.
#[derive(Clone, Copy, Debug, Default)]
pub enum PhaseRecord {
    #[default]
    Isotropic,
    HenyeyGreenstein(Number<MeanCosine>),
}

impl<'de> Deserialize<'de> for PhaseRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        const EXPECTED: &str = "\"isotropic\" or { type = \"hg\", g = mean cosine }";

        #[derive(Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Kind {
            Isotropic,
            Hg,
        }
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            #[serde(rename = "type")]
            kind: Kind,
            g: Option<Number<MeanCosine>>,
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
                match (table.kind, table.g) {
                    (Kind::Isotropic, None) => Ok(PhaseRecord::Isotropic),
                    (Kind::Hg, Some(g)) => Ok(PhaseRecord::HenyeyGreenstein(g)),
                    _ => Err(serde::de::Error::custom(format_args!(
                        "expected {EXPECTED}"
                    ))),
                }
            }
        }
        deserializer.deserialize_any(PhaseVisitor)
    }
}

/// Fields of all kinds of materials; [`MaterialRecord::given`] and the kind say which may stand together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialRecord {
    #[serde(rename = "type")]
    pub kind: Spanned<MaterialType>,
    pub reflectance: Option<Spanned<ColorOrImage<Unit>>>,
    pub two_sided: Option<Spanned<bool>>,
    pub ior: Option<Spanned<Number<Positive>>>,
    pub exterior_ior: Option<Spanned<Number<Positive>>>,
    pub alpha: Option<Spanned<Number<Roughness>>>,
    pub eta: Option<Spanned<Color<NonNegative>>>,
    pub k: Option<Spanned<Color<NonNegative>>>,
    pub preset: Option<Spanned<String>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MaterialType {
    Diffuse,
    Dielectric,
    Conductor,
    Mirror,
    RoughConductor,
    RoughDielectric,
    Null,
}

impl MaterialType {
    /// As the scene file writes it, and the fields that it takes beside `type`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Diffuse => ("diffuse", &["reflectance", "two_sided"]),
            Self::Mirror => ("mirror", &["reflectance", "two_sided"]),
            Self::Dielectric => ("dielectric", &["ior", "exterior_ior"]),
            Self::RoughDielectric => ("rough_dielectric", &["ior", "exterior_ior", "alpha"]),
            Self::Conductor => (
                "conductor",
                &["eta", "k", "preset", "reflectance", "two_sided"],
            ),
            Self::RoughConductor => (
                "rough_conductor",
                &["alpha", "eta", "k", "preset", "reflectance", "two_sided"],
            ),
            Self::Null => ("null", &[]),
        }
    }
}

/// Fields of all kinds of shapes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeRecord {
    pub name: Option<String>,
    #[serde(rename = "type")]
    pub kind: Spanned<ShapeType>,
    pub center: Option<Spanned<Vector>>,
    pub radius: Option<Spanned<Number<Positive>>>,
    pub file: Option<Spanned<String>>,
    pub face_normals: Option<Spanned<bool>>,
    pub flip_normals: Option<Spanned<bool>>,
    pub material: Option<Spanned<String>>,
    pub interior: Option<Spanned<String>>,
    pub exterior: Option<Spanned<String>>,
    pub emission: Option<Spanned<EmissionRecord>>,
    pub transform: Option<Spanned<Steps>>,
    pub shape: Option<Spanned<Box<ShapeRecord>>>,
    pub transforms: Option<Spanned<Vec<Spanned<Steps>>>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeType {
    Sphere,
    Rectangle,
    Cube,
    Disc,
    Mesh,
    Instances,
}

impl ShapeType {
    /// Fields that every shape takes, but `instances`, whose shape has its own.
    pub const SURFACE: &[&str] = &[
        "material",
        "interior",
        "exterior",
        "emission",
        "transform",
        "flip_normals",
    ];

    /// As the scene file writes it, and the fields of this kind alone.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Sphere => ("sphere", &["center", "radius"]),
            Self::Rectangle => ("rectangle", &[]),
            Self::Cube => ("cube", &[]),
            Self::Disc => ("disc", &[]),
            Self::Mesh => ("mesh", &["file", "face_normals"]),
            Self::Instances => ("instances", &["shape", "transforms"]),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmissionRecord {
    pub radiance: Option<Color<NonNegative>>,
    pub power: Option<Color<NonNegative>>,
}

/// A transform: a list of steps, applied in order.
#[derive(Debug)]
pub struct Steps(pub Vec<Spanned<StepRecord>>);

impl<'de> Deserialize<'de> for Steps {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct StepsVisitor;
        impl<'de> Visitor<'de> for StepsVisitor {
            type Value = Steps;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of steps such as [{ scale = 2.0 }, { translate = [0, 1, 0] }]")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Steps, A::Error> {
                let mut steps = Vec::new();
                while let Some(step) = seq.next_element()? {
                    steps.push(step);
                }
                Ok(Steps(steps))
            }
        }
        deserializer.deserialize_any(StepsVisitor)
    }
}

/// One step of a transform: exactly one of the fields.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepRecord {
    pub scale: Option<Factors>,
    pub rotate: Option<RotateRecord>,
    pub translate: Option<Vector>,
    pub matrix: Option<[[Number<Finite>; 4]; 4]>,
    pub look_at: Option<LookAtRecord>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotateRecord {
    pub axis: Vector,
    pub angle: Number<Finite>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookAtRecord {
    pub origin: Vector,
    pub target: Vector,
    pub up: Option<Vector>,
}

/// Fields of all kinds of lights.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightRecord {
    pub name: Option<String>,
    #[serde(rename = "type")]
    pub kind: Spanned<LightType>,
    pub position: Option<Spanned<Vector>>,
    pub target: Option<Spanned<Vector>>,
    pub direction: Option<Spanned<Vector>>,
    pub intensity: Option<Spanned<Color<NonNegative>>>,
    pub power: Option<Spanned<Color<NonNegative>>>,
    pub irradiance: Option<Spanned<Color<NonNegative>>>,
    pub radiance: Option<Spanned<Color<NonNegative>>>,
    pub cutoff_angle: Option<Spanned<Number<Degrees>>>,
    pub beam_width: Option<Spanned<Number<NonNegative>>>,
    pub image: Option<Spanned<String>>,
    pub scale: Option<Spanned<Color<NonNegative>>>,
    pub rotate_y: Option<Spanned<Number<Finite>>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightType {
    Point,
    Spot,
    Directional,
    Environment,
}

impl LightType {
    /// As the scene file writes it, and the fields that it takes beside `type` and `name`.
    pub fn takes(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Point => ("point", &["position", "intensity", "power"]),
            Self::Spot => (
                "spot",
                &[
                    "position",
                    "target",
                    "intensity",
                    "power",
                    "cutoff_angle",
                    "beam_width",
                ],
            ),
            Self::Directional => ("directional", &["direction", "irradiance"]),
            Self::Environment => ("environment", &["radiance", "image", "scale", "rotate_y"]),
        }
    }
}

/// Something wrong at a place of the scene file.
#[derive(Debug)]
pub struct Fault {
    pub span: Option<Span<usize>>,
    pub message: String,
}

impl Fault {
    pub fn new(span: Span<usize>, message: impl Into<String>) -> Self {
        Self {
            span: Some(span),
            message: message.into(),
        }
    }
}

impl From<toml::de::Error> for Fault {
    fn from(error: toml::de::Error) -> Self {
        let mut message = error.message().replace('\n', ", ");
        for (rust, word) in [
            ("expected u32", "expected a whole number"),
            ("expected i64", "expected a whole number"),
            ("expected u64", "expected a whole number"),
            ("expected a boolean", "expected true or false"),
        ] {
            message = message.replace(rust, word);
        }
        Self {
            span: error.span(),
            message,
        }
    }
}

/// The fields of a record that the file gives, with their places.
macro_rules! given {
    ($record:ident, $($field:ident),*) => {
        [$((stringify!($field), $record.$field.as_ref().map(|f| f.span()))),*]
    };
}

fn only_takes(
    name: &str,
    takes: &[&str],
    common: &[&str],
    given: &[(&str, Option<Span<usize>>)],
) -> Result<(), Fault> {
    for (field, span) in given {
        if let Some(span) = span
            && !takes.contains(field)
            && !common.contains(field)
        {
            let expected = match [takes, common].concat() {
                fields if fields.is_empty() => "it takes none".to_string(),
                fields => format!("expected one of {}", fields.join(", ")),
            };
            let message = format!("\"{name}\" does not take this field; {expected}");
            return Err(Fault::new(span.clone(), message));
        }
    }
    Ok(())
}

impl MaterialRecord {
    fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let given = given!(
            self,
            reflectance,
            two_sided,
            ior,
            exterior_ior,
            alpha,
            eta,
            k,
            preset
        );
        only_takes(name, takes, &[], &given)
    }
}

impl MediumRecord {
    fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let given = given!(self, density, scale, transform, transmittance);
        only_takes(name, takes, MediumKind::ALL, &given)
    }
}

impl DensityRecord {
    fn check(&self) -> Result<(), Fault> {
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

impl ShapeRecord {
    fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        let common = match self.kind.get_ref() {
            ShapeType::Instances => &[],
            _ => ShapeType::SURFACE,
        };
        #[rustfmt::skip]
        let given = given!(self, center, radius, file, face_normals, flip_normals, material, interior, exterior,
            emission, transform, shape, transforms);
        only_takes(name, takes, common, &given)?;
        match &self.shape {
            Some(shape) if shape.get_ref().kind.get_ref() == &ShapeType::Instances => {
                Err(Fault::new(
                    shape.get_ref().kind.span(),
                    "instances of instances are not supported; expected the type of one shape",
                ))
            }
            Some(shape) => shape.get_ref().check(),
            None => Ok(()),
        }
    }
}

impl LightRecord {
    fn check(&self) -> Result<(), Fault> {
        let (name, takes) = self.kind.get_ref().takes();
        #[rustfmt::skip]
        let given = given!(self, position, target, direction, intensity, power, irradiance, radiance, cutoff_angle,
            beam_width, image, scale, rotate_y);
        only_takes(name, takes, &[], &given)
    }
}

impl SceneRecord {
    /// Read a scene file's text.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        let record: Self = toml::from_str(text)?;
        record
            .materials
            .values()
            .try_for_each(MaterialRecord::check)?;
        for medium in record.media.values() {
            medium.check()?;
            if let Some(density) = &medium.density {
                density.get_ref().check()?;
            }
        }
        record.shapes.iter().try_for_each(ShapeRecord::check)?;
        record.lights.iter().try_for_each(LightRecord::check)?;
        Ok(record)
    }

    /// Paths of the files that the scene names, with where it does.
    pub fn assets(&self) -> Vec<&Spanned<String>> {
        let textures =
            self.materials
                .values()
                .filter_map(|m| match m.reflectance.as_ref()?.get_ref() {
                    ColorOrImage::Image(path) => Some(path),
                    ColorOrImage::Color(_) => None,
                });
        let meshes = self.shapes.iter().filter_map(|s| match &s.shape {
            Some(inner) => inner.get_ref().file.as_ref(),
            None => s.file.as_ref(),
        });
        let images = self.lights.iter().filter_map(|l| l.image.as_ref());
        let densities = self.media.values().filter_map(|m| m.density.as_ref());
        let volumes = densities.filter_map(|d| d.get_ref().file.as_ref());
        textures
            .chain(meshes)
            .chain(images)
            .chain(volumes)
            .collect()
    }
}
