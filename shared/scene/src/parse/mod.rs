//! The scene file's records: its TOML as serde reads it, names not yet resolved.

mod camera;
mod gltf;
mod light;
mod material;
mod medium;
mod rule;
mod schema;
mod shape;
mod texture;
mod transform;
mod words;

pub use camera::*;
pub use gltf::*;
pub use light::*;
pub use material::*;
pub use medium::*;
pub use rule::*;
pub use schema::json_schema;
pub use shape::*;
pub use texture::*;
pub use transform::*;
pub use words::*;

use super::values::*;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range as Span;

/// A whole scene file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    /// The picture.
    pub image: ImageRecord,
    /// Defaults of the job; the command line overrides them.
    #[serde(default)]
    pub render: RenderRecord,
    /// What is around everything.
    #[serde(default)]
    pub world: WorldRecord,
    /// The camera.
    pub camera: Spanned<CameraRecord>,
    /// Media by name.
    #[serde(default)]
    pub media: BTreeMap<Spanned<String>, MediumRecord>,
    /// Materials by name.
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    /// Surfaces.
    #[serde(default)]
    pub shapes: Vec<ShapeRecord>,
    /// Lights that are no surfaces.
    #[serde(default)]
    pub lights: Vec<LightRecord>,
    /// glTF files.
    #[serde(default)]
    pub gltf: Vec<GltfRecord>,
    /// Names for several shapes and lights together, for rules.
    #[serde(default)]
    pub groups: BTreeMap<Spanned<String>, Names>,
    /// What rays do not see.
    #[serde(default)]
    pub rules: Vec<RuleRecord>,
}

/// Defaults of the job.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderRecord {
    /// Passes. Default: 64.
    #[schemars(range(min = 1, max = 9007199254740992_u64))]
    pub passes: Option<Spanned<u64>>,
    /// Photon paths that a pass emits. Default: as many as a pilot finds best.
    #[schemars(range(min = 1))]
    pub paths: Option<Spanned<u32>>,
    /// Larger keeps radii large for longer: less noise, more blur. Default: 2/3.
    pub alpha: Option<Number<OpenUnit>>,
    /// When radii shrink. Default: pass.
    pub schedule: Option<ScheduleKind>,
    /// Seed of all random numbers. Default: 0.
    pub seed: Option<u64>,
    /// Stops, for the PNG only. Default: 0.
    pub exposure: Option<Number<Finite>>,
    /// What layer `depth` holds where nothing is. Default: infinity.
    pub empty_depth: Option<Number<Finite>>,
    /// One base radius of all beams and surface photons, scene units, in place of photon differentials.
    pub radius: Option<Number<Positive>>,
    /// When photons are aimed at what the camera sees. Default: auto.
    pub targeting: Option<Targeting>,
    /// What finds light that media have scattered: beams of photons, or camera paths. Default: what a pilot finds best.
    pub media: Option<Finder>,
    /// What finds light that surfaces have scattered. Default: photons where caustics need them anyway.
    pub surfaces: Option<Finder>,
    /// What finds light that comes by way of specular surfaces from lights that are large enough for camera paths.
    /// Default: what a pilot finds best.
    pub caustics: Option<Finder>,
}

/// What is around everything.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldRecord {
    /// The medium outside of every object. Default: none, vacuum.
    pub medium: Option<Spanned<String>>,
}

impl SceneRecord {
    /// Read a scene file's text.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        let record: Self = toml::from_str(text)?;
        record.materials.values().try_for_each(MaterialRecord::check)?;
        for medium in record.media.values() {
            medium.check()?;
            if let Some(density) = &medium.density {
                density.get_ref().check()?;
            }
        }
        record.camera.get_ref().check()?;
        record.shapes.iter().try_for_each(ShapeRecord::check)?;
        record.lights.iter().try_for_each(LightRecord::check)?;
        record.rules.iter().try_for_each(RuleRecord::check)?;
        Ok(record)
    }

    /// Paths of the files that the scene names, with where it does.
    pub fn assets(&self) -> Vec<&Spanned<String>> {
        let textures = self.materials.values().flat_map(MaterialRecord::files);
        let meshes = self.shapes.iter().filter_map(|s| match &s.shape {
            Some(inner) => inner.get_ref().file.as_ref(),
            None => s.file.as_ref(),
        });
        let glowing = self.shapes.iter().filter_map(|s| {
            let emission = s.emission.as_ref()?.get_ref();
            emission.radiance.as_ref()?.file()
        });
        let images = self.lights.iter().filter_map(|l| l.image.as_ref());
        let volumes = self.media.values().flat_map(MediumRecord::files);
        textures
            .chain(meshes)
            .chain(glowing)
            .chain(images)
            .chain(volumes)
            .chain(self.gltf_files())
            .collect()
    }

    /// Paths of the glTF files that the scene names, which name others.
    pub fn gltf_files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let camera = self.camera.get_ref().gltf.as_ref();
        self.gltf.iter().map(|record| &record.file).chain(camera)
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
            message: with_nearest(message),
        }
    }
}

/// Of a field that there is not: the one that was probably meant, in place of all that there are.
fn with_nearest(message: String) -> String {
    let nearest = || {
        let mut names = message.strip_prefix("unknown field `")?.split('`').step_by(2);
        let given = names.next()?;
        let distance = |name: &&str| strsim::damerau_levenshtein(given, name);
        let nearest = names.filter(|name| !name.is_empty()).min_by_key(distance)?;
        (distance(&nearest) <= (given.len() / 3).max(1))
            .then(|| format!("unknown field `{given}`; did you mean `{nearest}`?"))
    };
    nearest().unwrap_or(message)
}

/// The fields of a record that the file gives, with their places.
macro_rules! given {
    ($record:ident, $($field:ident),*) => {
        [$((stringify!($field), $record.$field.as_ref().map(|f| f.span()))),*]
    };
}
use given;

fn only_takes(name: &str, takes: &[&str], common: &[&str], given: &[(&str, Option<Span<usize>>)]) -> Result<(), Fault> {
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
