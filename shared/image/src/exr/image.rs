//! Final images on disk.

use super::cryptomatte::{self, Names};
use super::header::{ENGINE, attributes, sort_attributes, text};
use super::read::meta_data;
use crate::atomic;
use crate::error::ImageError;
use crate::film::Film;
use crate::input;
use crate::job::{EngineKind, JobSettings, ReferenceSettings, SceneHash, Techniques};
use crate::layer::{self, LayerCounts, MatteKind};
use crate::matte::Matte;
use crate::merge::Average;
use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Compression, LineOrder};
use exr::meta::header::LayerAttributes;
use exr::prelude::Vec2;
use std::borrow::Cow;
use std::io::{BufReader, Cursor};
use std::path::Path;

/// A final image's metadata, apart from its number of passes and its error, and what it contains.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageMeta {
    /// The scene.
    pub scene: SceneHash,
    /// The scene's file as FOLDER/FILE: enough to tell files of equal names apart, and no more about the machine.
    pub scene_file: Option<String>,
    /// What made the image.
    pub maker: Maker,
    /// Time since the job started. The only attribute that differs between runs.
    pub render_seconds: f64,
    /// Version of the program.
    pub version: String,
    /// Names of the average's layers.
    pub layers: Vec<layer::Layer>,
    /// Whether the standard error is written as well.
    pub standard_error: bool,
    /// Whether photons that missed all targets were dropped. The image is then biased, and an attribute says so.
    pub drops_photons: bool,
    /// Names of what mattes may have met.
    pub names: Names,
    /// Depth where there is no surface; `None`: infinite.
    pub empty_depth: Option<f32>,
}

impl ImageMeta {
    /// Identifies the passes of an image: BLAKE3, in hexadecimal, of everything that they depend on and of their range.
    /// Images of the same set have the same beauty.
    pub fn pass_set(&self, settings: &JobSettings, average: &Average) -> String {
        let mut fields = vec![
            self.version.clone(),
            self.scene.to_string(),
            average.beauty.width.to_string(),
            average.beauty.height.to_string(),
            settings.seed.to_string(),
            settings.alpha.to_string(),
            settings.schedule.to_string(),
            settings.paths_per_pass.to_string(),
            settings.reference_paths.to_string(),
            format!("0..{}", average.passes),
        ];
        fields.extend(settings.budget.map(|budget| budget.to_string()));
        fields.extend((settings.techniques != Techniques::default()).then(|| settings.techniques.to_string()));
        fields.extend((settings.engine != EngineKind::Cpu).then(|| settings.engine.identity()));
        blake3::hash(fields.join("\n").as_bytes()).to_string()
    }
}

/// What makes an image, with the settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Maker {
    /// Passes of photon beams.
    Passes(JobSettings),
    /// Samples of the reference integrator.
    Reference(ReferenceSettings),
}

/// Write the final image: R, G, B hold the mean radiance; on request, stderr.R, .G, .B hold its standard error; then
/// the layers. float32, lossless ZIP.
///
/// Apart from the attribute `beamfarmRenderSeconds`, equal averages of equal jobs give files with equal bytes.
pub fn write_image(path: &Path, average: &Average, meta: &ImageMeta) -> Result<(), ImageError> {
    atomic::write_file(path, &encode_image(average, meta)?)
}

/// The bytes of the file that [`write_image`] writes.
pub fn encode_image(average: &Average, meta: &ImageMeta) -> Result<Vec<u8>, ImageError> {
    let beauty = &average.beauty;
    let size = Vec2(beauty.width as usize, beauty.height as usize);
    let channels = channels(average, meta, size)?;
    encode(size, &meta.version, own_attributes(average, meta)?, channels)
}

/// The bytes of an EXR of float channels, with lossless ZIP. Equal arguments give equal bytes. `version`: of the
/// program.
pub(super) fn encode(
    size: Vec2<usize>,
    version: &str,
    own: Vec<(impl AsRef<str>, AttributeValue)>,
    channels: AnyChannels<FlatSamples>,
) -> Result<Vec<u8>, ImageError> {
    let layer_attributes = LayerAttributes {
        software_name: exr::prelude::Text::new_or_none(format!("beamfarm {version}")),
        other: attributes(own),
        ..LayerAttributes::default()
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        line_order: LineOrder::Increasing,
        ..Encoding::UNCOMPRESSED
    };
    let image = Image::from_layer(Layer::new(size, layer_attributes, encoding, channels));
    let mut bytes = Vec::new();
    let written = image.write().non_parallel().to_buffered(Cursor::new(&mut bytes));
    written.map_err(|error| ImageError::Encode {
        field: "EXR image",
        message: error.to_string(),
    })?;
    sort_attributes(&mut bytes)?;
    Ok(bytes)
}

/// The films of an average as channels, in EXR's order.
fn channels(average: &Average, meta: &ImageMeta, size: Vec2<usize>) -> Result<AnyChannels<FlatSamples>, ImageError> {
    let mut films = vec![("", &average.beauty)];
    if meta.standard_error {
        films.push(("stderr.", &average.standard_error));
    }
    let counts = LayerCounts {
        films: average.layers.len(),
        mattes: average.mattes.len(),
    };
    let bad_size = |film: &Film| film.pixels.len() != size.area();
    let mut all = average.layers.iter().chain(films.iter().map(|(_, film)| *film));
    if size.area() == 0 || all.any(bad_size) || LayerCounts::of(&meta.layers) != counts {
        return Err(ImageError::Encode {
            field: "size",
            message: format!("{} x {} pixels, {counts}", size.0, size.1),
        });
    }
    let mut channels = Vec::new();
    let mut add = |name: String, samples| channels.push(AnyChannel::new(name.as_str(), FlatSamples::F32(samples)));
    for (prefix, film) in films {
        for (c, name) in ["R", "G", "B"].iter().enumerate() {
            let samples = film.pixels.iter().map(|pixel| pixel[c]).collect();
            add(format!("{prefix}{name}"), samples);
        }
    }
    for (layer, film) in meta.layers.iter().zip(&average.layers) {
        for (name, samples) in layer.in_image(film, meta.empty_depth.unwrap_or(f32::INFINITY)) {
            add(name, samples);
        }
    }
    for (kind, matte) in mattes(average, meta) {
        for (name, samples) in cryptomatte::channels(kind, matte, average.passes) {
            add(name, samples);
        }
    }
    Ok(AnyChannels::sort(channels.into_iter().collect()))
}

const SCENE_FILE: &str = "beamfarmSceneFile";

/// An average's mattes, with their kinds.
fn mattes<'a>(average: &'a Average, meta: &ImageMeta) -> impl Iterator<Item = (MatteKind, &'a Matte)> {
    let kinds = meta.layers.iter().filter_map(layer::Layer::matte);
    kinds.zip(&average.mattes)
}

/// An attribute of the image, by its name.
type Attribute = (Cow<'static, str>, AttributeValue);

/// The image's attributes.
fn own_attributes(average: &Average, meta: &ImageMeta) -> Result<Vec<Attribute>, ImageError> {
    let mut own = vec![
        ("beamfarmScene".into(), text("scene", &meta.scene.to_string())?),
        (
            "beamfarmRelativeError".into(),
            AttributeValue::F64(average.relative_standard_error()),
        ),
        ("beamfarmRenderSeconds".into(), AttributeValue::F64(meta.render_seconds)),
        ("beamfarmVersion".into(), text("version", &meta.version)?),
    ];
    if let Some(file) = &meta.scene_file {
        own.push((SCENE_FILE.into(), text("scene file", file)?));
    }
    own.extend(match meta.maker {
        Maker::Passes(settings) => attributes_of_passes(&settings, average, meta)?,
        Maker::Reference(settings) => attributes_of_reference(&settings, average)?,
    });
    if meta.drops_photons {
        let what = "photons that missed all targets were dropped: targeting = \"reject\"";
        own.push(("beamfarmBiased".into(), text("bias", what)?));
    }
    for (kind, matte) in mattes(average, meta) {
        let attributes = cryptomatte::attributes(kind, matte, &meta.names)?;
        own.extend(attributes.into_iter().map(|(name, value)| (name.into(), value)));
    }
    Ok(own)
}

fn attributes_of_passes(
    settings: &JobSettings,
    average: &Average,
    meta: &ImageMeta,
) -> Result<Vec<Attribute>, ImageError> {
    let mut own = vec![
        ("beamfarmPasses".into(), number(average.passes)?),
        ("beamfarmFirstPass".into(), number(0)?),
        ("beamfarmLastPass".into(), number(average.passes.saturating_sub(1))?),
        (
            "beamfarmPassSet".into(),
            text("pass set", &meta.pass_set(settings, average))?,
        ),
        ("beamfarmSeed".into(), number(settings.seed)?),
        ("beamfarmAlpha".into(), AttributeValue::F64(settings.alpha)),
        (
            "beamfarmSchedule".into(),
            text("schedule", &settings.schedule.to_string())?,
        ),
        ("beamfarmPathsPerPass".into(), number(settings.paths_per_pass.into())?),
        (
            "beamfarmReferencePaths".into(),
            number(settings.reference_paths.into())?,
        ),
    ];
    if let Some(budget) = settings.budget {
        own.push(("beamfarmBudget".into(), text("budget", &budget.to_string())?));
    }
    let techniques = settings.techniques.to_string();
    if !techniques.is_empty() {
        own.push(("beamfarmFinders".into(), text("techniques", &techniques)?));
    }
    own.push((ENGINE.into(), text("engine", &settings.engine.identity())?));
    Ok(own)
}

fn attributes_of_reference(settings: &ReferenceSettings, average: &Average) -> Result<Vec<Attribute>, ImageError> {
    let mut own = vec![
        ("beamfarmSamples".into(), number(average.passes)?),
        ("beamfarmSeed".into(), number(settings.seed)?),
    ];
    if let Some(depth) = settings.max_depth {
        own.push(("beamfarmMaxDepth".into(), number(depth.into())?));
    }
    Ok(own)
}

/// What an image written by [`write_image`] says about its origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Whether it was made from samples of the reference integrator, not from passes.
    pub of_samples: bool,
    /// [`ImageMeta::scene_file`].
    pub scene_file: Option<String>,
}

/// What an image written by [`write_image`] says about its passes.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeOf {
    /// Hash of the scene's bundle, as text.
    pub scene: String,
    /// Number of passes.
    pub passes: u64,
    /// The job's seed.
    pub seed: u64,
    /// [`JobSettings::alpha`].
    pub alpha: f64,
    /// Photon paths per pass.
    pub paths_per_pass: u64,
    /// The budget in words, if there was one.
    pub budget: Option<String>,
    /// [`EngineKind::identity`] of the engine that rendered them; `cpu` for images from before processors had an
    /// identity.
    pub engine: String,
    /// Estimated relative standard error.
    pub relative_error: f64,
    /// Time taken, seconds.
    pub seconds: f64,
    /// Version of the program.
    pub version: String,
    /// Names of the image's channels.
    pub channels: Vec<String>,
}

/// The headers of the image at `path`, without reading the rest.
fn headers(path: &Path) -> Option<MetaData> {
    let mut file = BufReader::new(input::open(path).ok()?);
    meta_data(&mut file, false).ok()
}

impl Provenance {
    /// Reads the image at `path`. `None` if there is no such image.
    pub fn read(path: &Path) -> Option<Self> {
        let meta = headers(path)?;
        let attributes = &meta.headers.first()?.own_attributes.other;
        let find = |name: &str| attributes.get(&exr::prelude::Text::from(name));
        find("beamfarmScene")?;
        let scene_file = match find(SCENE_FILE) {
            Some(AttributeValue::Text(file)) => Some(file.to_string()),
            _ => None,
        };
        Some(Self {
            of_samples: find("beamfarmSamples").is_some(),
            scene_file,
        })
    }
}

impl MadeOf {
    /// Reads the image at `path`. `None` if there is no such image, or it is not made from passes.
    pub fn read(path: &Path) -> Option<Self> {
        let meta = headers(path)?;
        let attributes = &meta.headers.first()?.own_attributes.other;
        let find = |name: &str| attributes.get(&exr::prelude::Text::from(name));
        let text = |name: &str| match find(name) {
            Some(AttributeValue::Text(text)) => Some(text.to_string()),
            _ => None,
        };
        let float = |name: &str| match find(name) {
            Some(AttributeValue::F64(number)) => Some(*number),
            _ => None,
        };
        let number = |name: &str| text(name)?.parse::<u64>().ok();
        let channels = meta.headers.iter().flat_map(|header| &header.channels.list);
        Some(Self {
            scene: text("beamfarmScene")?,
            passes: number("beamfarmPasses")?,
            seed: number("beamfarmSeed")?,
            alpha: float("beamfarmAlpha")?,
            paths_per_pass: number("beamfarmPathsPerPass")?,
            budget: text("beamfarmBudget"),
            engine: text(ENGINE).unwrap_or_else(|| EngineKind::Cpu.to_string()),
            relative_error: float("beamfarmRelativeError")?,
            seconds: float("beamfarmRenderSeconds")?,
            version: text("beamfarmVersion")?,
            channels: channels.map(|channel| channel.name.to_string()).collect(),
        })
    }
}

fn number(n: u64) -> Result<AttributeValue, ImageError> {
    text("number", &n.to_string())
}

#[cfg(test)]
mod tests;
