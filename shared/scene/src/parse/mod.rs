//! The records of a scene file, as serde reads its TOML. Names are not yet resolved.

mod camera;
mod density;
mod gltf;
mod image_file;
mod ior;
mod light;
mod material;
mod medium;
mod rule;
mod schema;
mod shape;
mod texture;
mod transform;
mod volume_emission;
mod words;

pub use camera::*;
pub use density::*;
pub use gltf::*;
pub use image_file::ImageFile;
pub use light::*;
pub use material::*;
pub use medium::*;
pub use rule::*;
pub use schema::{json_schema, json_schema_with_keys};
pub use shape::*;
pub use texture::*;
pub use transform::*;
pub use volume_emission::*;
pub use words::*;

pub use super::source::Fault;
use super::time::{AnimationRecord, Clock, Moving, When};
use super::values::*;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range as Span;
use toml::de::{DeTable, Deserializer};

/// A whole scene file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    /// The image.
    pub image: ImageRecord,
    /// Defaults of the job; the command line overrides them.
    #[serde(default)]
    pub render: RenderRecord,
    /// Frames and shutter of a moving scene. Read by the clock before anything else.
    pub animation: Option<AnimationRecord>,
    /// Seconds from frame 0 to this moment, in a scene with frames.
    #[serde(skip)]
    pub seconds: Option<f64>,
    /// The surroundings.
    #[serde(default)]
    pub world: WorldRecord,
    /// The camera.
    pub camera: Spanned<CameraRecord>,
    /// Media by name.
    #[serde(default)]
    pub media: BTreeMap<Spanned<String>, MediumRecord>,
    /// Textures by name: graph nodes for use by materials and other things.
    #[serde(default)]
    pub textures: BTreeMap<Spanned<String>, Spanned<TextureRecord<Finite>>>,
    /// Materials by name.
    #[serde(default)]
    pub materials: BTreeMap<Spanned<String>, MaterialRecord>,
    /// Surfaces.
    #[serde(default)]
    pub shapes: Vec<ShapeRecord>,
    /// Lights that are not surfaces.
    #[serde(default)]
    pub lights: Vec<LightRecord>,
    /// glTF files.
    #[serde(default)]
    pub gltf: Vec<GltfRecord>,
    /// Names for sets of shapes and lights, for use in rules.
    #[serde(default)]
    pub groups: BTreeMap<Spanned<String>, Names>,
    /// Rules on what rays do not see.
    #[serde(default)]
    pub rules: Vec<RuleRecord>,
}

/// Job defaults.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderRecord {
    /// Number of passes. Default: 64.
    #[schemars(range(min = 1, max = 9007199254740992_u64))]
    pub passes: Option<Spanned<u64>>,
    /// Photon paths per pass. Default: the number that a pilot finds best.
    #[schemars(range(min = 1))]
    pub paths: Option<Spanned<u32>>,
    /// Larger values keep radii large for longer: less noise, more blur. Default: 2/3.
    pub alpha: Option<Number<OpenUnit>>,
    /// How often radii shrink. Default: pass.
    pub schedule: Option<ScheduleKind>,
    /// Seed of all random numbers. Default: 0.
    pub seed: Option<u64>,
    /// Stops, for the PNG only. Default: 0.
    pub exposure: Option<Number<Finite>>,
    /// Kelvin, colour temperature that looks white in the PNG. Default: 6500.
    pub white_balance: Option<Number<Kelvin>>,
    /// Tone curve of the PNG. Default: standard.
    pub view: Option<ViewTransform>,
    /// Value of the layer `depth` where there is nothing. Default: infinity.
    pub empty_depth: Option<Number<Finite>>,
    /// Base radius of all beams and surface photons, scene units, instead of photon differentials.
    pub radius: Option<Number<Positive>>,
    /// Whether photons are aimed at what the camera sees. Default: auto.
    pub targeting: Option<Targeting>,
    /// Technique for light scattered by media: photon beams or camera paths. Default: what a pilot finds best.
    pub media: Option<Technique>,
    /// Technique for light scattered by surfaces. Default: photons where caustics need them anyway.
    pub surfaces: Option<Technique>,
    /// Technique for caustics of lights that are large enough for camera paths. Default: what a pilot finds best.
    pub caustics: Option<Technique>,
    /// What renders the passes: processors, or a Vulkan device, whose passes differ in their bits. Default: cpu.
    pub engine: Option<Engine>,
}

/// The surroundings.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldRecord {
    /// The medium outside all objects. Default: none, vacuum.
    pub medium: Option<Spanned<String>>,
}

/// A scene file at a moment.
#[derive(Debug)]
pub struct Snapshot {
    /// The file's contents, with the values of that moment.
    pub record: SceneRecord,
    /// The times given in the file.
    pub clock: Clock,
    /// Whether anything changes while the shutter is open.
    pub blurs: bool,
    /// Where in the file something moves, whether the shutter is open or not.
    pub moving: Vec<Span<usize>>,
    /// Times, in order, whose files are all that passes need.
    pub times_of_files: Vec<f64>,
}

impl Snapshot {
    /// Whether something moves within a part of the file.
    pub fn moves_in(&self, part: &Span<usize>) -> bool {
        let mut places = self.moving.iter();
        places.any(|place| part.start <= place.start && place.end <= part.end)
    }
}

impl SceneRecord {
    /// Read a scene file's text; moving things are where they are in the middle of the exposure.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        Self::snapshot(text, When::Middle).map(|snapshot| snapshot.record)
    }

    /// Read a scene file's text as it is at a moment.
    pub fn snapshot(text: &str, when: When) -> Result<Snapshot, Fault> {
        let root = DeTable::parse(text)?;
        let clock = Clock::of(root.get_ref())?;
        let moving = Moving::of(root.get_ref(), text, &clock, clock.time(when))?;
        let mut record = Self::checked(Deserializer::from(moving.put(root)?))?;
        record.seconds = clock.seconds(when);
        Ok(Snapshot {
            record,
            blurs: moving.blurs(),
            moving: moving.places(),
            times_of_files: moving.times_of_files(&clock),
            clock,
        })
    }

    fn checked(text: Deserializer<'_>) -> Result<Self, Fault> {
        let record = Self::deserialize(text)?;
        record.materials.values().try_for_each(MaterialRecord::check)?;
        for medium in record.media.values() {
            medium.check()?;
            if let Some(density) = &medium.density {
                density.get_ref().check()?;
            }
            if let Some(emission) = &medium.emission {
                emission.get_ref().check()?;
            }
        }
        record.camera.get_ref().check()?;
        record.shapes.iter().try_for_each(ShapeRecord::check)?;
        record.lights.iter().try_for_each(LightRecord::check)?;
        record.rules.iter().try_for_each(RuleRecord::check)?;
        Ok(record)
    }

    /// Paths of the files the scene names, with their places.
    pub fn assets(&self) -> Vec<&Spanned<String>> {
        let textures = self.materials.values().flat_map(MaterialRecord::files);
        let meshes = self.shapes.iter().flat_map(|s| {
            let s = s.shape.as_ref().map_or(s, |inner| inner.get_ref());
            let toward = s.toward.as_ref().map(|toward| &toward.get_ref().file);
            s.file.iter().chain(toward)
        });
        let heights = self.shapes.iter().filter_map(|s| {
            let s = s.shape.as_ref().map_or(s, |inner| inner.get_ref());
            Some(s.displacement.as_ref()?.get_ref().height.images())
        });
        let glowing = self.shapes.iter().filter_map(|s| {
            let emission = s.emission.as_ref()?.get_ref();
            Some(emission.radiance.as_ref()?.images())
        });
        let named = self.textures.values().map(|texture| texture.get_ref().images());
        let around = (self.lights.iter().flat_map(|light| &light.texture)).map(|texture| texture.get_ref().images());
        let glowing = glowing
            .chain(named)
            .chain(around)
            .chain(heights)
            .flatten()
            .map(|image| &image.file.file);
        let images = self.lights.iter().filter_map(|l| Some(&l.image.as_ref()?.file));
        let tables = self.lights.iter().filter_map(|l| l.ies.as_ref());
        let volumes = self.media.values().flat_map(MediumRecord::files);
        textures
            .chain(meshes)
            .chain(glowing)
            .chain(images)
            .chain(tables)
            .chain(volumes)
            .chain(self.gltf_files())
            .collect()
    }

    /// Paths of the .obj files whose .mtl files are read.
    pub fn obj_files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let shapes = self.shapes.iter().filter(|shape| shape.reads_mtl());
        shapes.filter_map(|shape| shape.file.as_ref())
    }

    /// Paths of the glTF files the scene names; these name other files.
    pub fn gltf_files(&self) -> impl Iterator<Item = &Spanned<String>> {
        let camera = self.camera.get_ref().gltf.as_ref();
        self.gltf.iter().map(|record| &record.file).chain(camera)
    }
}

/// The given fields of a record, with their places.
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
