//! Final images on disk, and images to compare them with.

use super::header::{attributes, sort_attributes, text};
use crate::atomic;
use crate::error::ImageError;
use crate::film::Film;
use crate::job::{Finders, JobSettings, ReferenceSettings, SceneHash};
use crate::layer::{self, LayerCounts, MatteKind};
use crate::matte::{self, RANKS};
use crate::merge::{Average, Node};
use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::attribute::{AttributeValue, Compression, LineOrder};
use exr::meta::header::LayerAttributes;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, Vec2};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What a final image says about itself, beside its number of passes and its error, and what it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageMeta {
    /// The scene.
    pub scene: SceneHash,
    /// The scene's file as FOLDER/FILE, which tells files of equal names apart and no more of a machine.
    pub scene_file: Option<String>,
    /// What made it.
    pub maker: Maker,
    /// Time since the job started. The one attribute that differs between runs.
    pub render_seconds: f64,
    /// Version of the program.
    pub version: String,
    /// Names of the average's layers.
    pub layers: Vec<layer::Layer>,
    /// Whether the standard error is written as well.
    pub standard_error: bool,
    /// Whether photons that missed all targets were dropped: the image is biased, and says so.
    pub drops_photons: bool,
    /// What mattes may have met.
    pub names: Names,
}

/// Names of all that mattes tell apart.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Of objects.
    pub objects: Vec<String>,
    /// Of materials.
    pub materials: Vec<String>,
}

impl ImageMeta {
    /// Names the passes of an image: BLAKE3, in hexadecimal, of all that they depend on and of their range. Images of
    /// the same set have the same beauty.
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
        fields.extend((settings.finders != Finders::default()).then(|| settings.finders.to_string()));
        blake3::hash(fields.join("\n").as_bytes()).to_string()
    }
}

/// What makes an image, with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Maker {
    /// Passes of photon beams.
    Passes(JobSettings),
    /// Samples of the reference integrator.
    Reference(ReferenceSettings),
}

/// Write the final image: R, G, B the mean radiance; when asked for, stderr.R, .G, .B its standard error, and the
/// layers; float32, lossless ZIP.
///
/// Apart from the attribute `beamfarmRenderSeconds` the file is the same bytes whenever the average and the job are.
pub fn write_image(path: &Path, average: &Average, meta: &ImageMeta) -> Result<(), ImageError> {
    atomic::write_file(path, &encode_image(average, meta)?)
}

/// The bytes of that file.
pub fn encode_image(average: &Average, meta: &ImageMeta) -> Result<Vec<u8>, ImageError> {
    let beauty = &average.beauty;
    let size = Vec2(beauty.width as usize, beauty.height as usize);
    let channels = channels(average, meta, size)?;
    let layer_attributes = LayerAttributes {
        software_name: exr::prelude::Text::new_or_none(format!("beamfarm {}", meta.version)),
        other: attributes(own_attributes(average, meta)?),
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
        for (name, samples) in layer.in_image(film) {
            add(name, samples);
        }
    }
    for (kind, matte) in mattes(average, meta) {
        let ranks: Vec<_> = matte.ranks(average.passes).collect();
        for rank in 0..RANKS {
            let name = |channel: usize| format!("{}{:02}.{}", type_name(kind), rank / 2, ["R", "G", "B", "A"][channel]);
            let values = |value: &dyn Fn(&(u32, f32)) -> f32| ranks.iter().map(|of| value(&of[rank])).collect();
            add(name(rank % 2 * 2), values(&|(id, _)| f32::from_bits(*id)));
            add(name(rank % 2 * 2 + 1), values(&|(_, coverage)| *coverage));
        }
    }
    Ok(AnyChannels::sort(channels.into_iter().collect()))
}

const SCENE_FILE: &str = "beamfarmSceneFile";

/// The mattes of an average, and what they tell apart.
fn mattes<'a>(average: &'a Average, meta: &ImageMeta) -> impl Iterator<Item = (MatteKind, &'a matte::Matte)> {
    let kinds = meta.layers.iter().filter_map(layer::Layer::matte);
    kinds.zip(&average.mattes)
}

/// What Cryptomatte calls it.
fn type_name(kind: MatteKind) -> &'static str {
    match kind {
        MatteKind::Objects => "CryptoObject",
        MatteKind::Materials => "CryptoMaterial",
    }
}

/// The attributes of a matte: its name, how ids are made, and those names that are met somewhere.
fn attributes_of_matte(kind: MatteKind, matte: &matte::Matte, names: &Names) -> Result<Vec<Attribute>, ImageError> {
    let list = match kind {
        MatteKind::Objects => &names.objects,
        MatteKind::Materials => &names.materials,
    };
    let met = matte.ids();
    let names: BTreeMap<&str, String> = list
        .iter()
        .map(|name| (&**name, matte::id_of_name(name)))
        .filter(|(_, id)| met.binary_search(id).is_ok())
        .map(|(name, id)| (name, format!("{id:08x}")))
        .collect();
    let failed = |error: serde_json::Error| ImageError::Encode {
        field: "manifest",
        message: error.to_string(),
    };
    let manifest = serde_json::to_string(&names).map_err(failed)?;
    // EXR's text is bytes; JSON can say any character by ASCII.
    let mut plain = String::new();
    for c in manifest.chars() {
        match c.is_ascii() {
            true => plain.push(c),
            false => plain.extend(c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}"))),
        }
    }
    let key = matte::key_of_layer(type_name(kind));
    let attribute = |name: &str, value: &str| {
        let value = AttributeValue::Text(exr::prelude::Text::from(value));
        (format!("cryptomatte/{key}/{name}").into(), value)
    };
    Ok(vec![
        attribute("name", type_name(kind)),
        attribute("hash", "MurmurHash3_32"),
        attribute("conversion", "uint32_to_float32"),
        attribute("manifest", &plain),
    ])
}

/// An attribute of the image, by its name.
type Attribute = (Cow<'static, str>, AttributeValue);

/// What the image says about itself.
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
        own.extend(attributes_of_matte(kind, matte, &meta.names)?);
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
    let finders = settings.finders.to_string();
    if !finders.is_empty() {
        own.push(("beamfarmFinders".into(), text("finders", &finders)?));
    }
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

/// What an image that [`write_image`] wrote says of where it comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Provenance {
    /// Whether it is made of samples of the reference integrator, and not of passes.
    pub of_samples: bool,
    /// [`ImageMeta::scene_file`].
    pub scene_file: Option<String>,
}

impl Provenance {
    /// Of the image at `path`. `None` where there is none.
    pub fn read(path: &Path) -> Option<Self> {
        let meta = exr::meta::MetaData::read_from_file(path, false).ok()?;
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

fn number(n: u64) -> Result<AttributeValue, ImageError> {
    text("number", &n.to_string())
}

/// Read the channels R, G, B, half or float, of the first layer that has them.
pub fn read_rgb(path: &Path) -> Result<Film, ImageError> {
    let bytes = std::fs::read(path).map_err(|source| ImageError::Io {
        path: path.to_owned(),
        source,
    })?;
    decode_rgb(&bytes).map_err(|message| ImageError::File {
        path: path.to_owned(),
        message,
    })
}

/// Read the standard error of an image that [`write_image`] wrote, if it has one: the channels stderr.R, .G, .B.
pub fn read_standard_error(path: &Path) -> Result<Option<Film>, ImageError> {
    let bytes = std::fs::read(path).map_err(|source| ImageError::Io {
        path: path.to_owned(),
        source,
    })?;
    let failed = |message| ImageError::File {
        path: path.to_owned(),
        message,
    };
    check_claims(&bytes, false).map_err(failed)?;
    let names = ["stderr.R", "stderr.G", "stderr.B"];
    let meta = exr::meta::MetaData::read_from_buffered(&bytes[..], false).map_err(|error| failed(error.to_string()))?;
    let has_all = meta.headers.iter().any(|header| {
        let channels = &header.channels.list;
        let has = |name: &&str| channels.iter().any(|channel| channel.name.eq(name));
        names.iter().all(has)
    });
    match has_all {
        true => without_panic(|| decode_trusting(&bytes, names))
            .map(Some)
            .map_err(failed),
        false => Ok(None),
    }
}

/// Pixels of the largest image that is read.
const MAX_PIXELS: usize = 1 << 27;
/// Decoded bytes per byte of the file at most. Deflate reaches 1032; the other methods of EXR stay below it.
const MAX_EXPANSION: usize = 2048;

/// Whether a file that need not be trusted can hold the pixels that it claims, in a form whose decoder is safe to run.
pub fn check_claims(bytes: &[u8], pedantic: bool) -> Result<(), String> {
    let meta = exr::meta::MetaData::read_from_buffered(bytes, pedantic).map_err(|error| error.to_string())?;
    let mut claimed = 0usize;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        let pixels = width.checked_mul(height).filter(|n| *n <= MAX_PIXELS);
        let Some(pixels) = pixels else {
            return Err(format!("{width} x {height} pixels; expected at most {MAX_PIXELS}"));
        };
        // The DWA decoder of exr 1.74 allocates what a chunk says it needs; a broken one would end the process.
        if matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
            return Err("DWA compression; expected none, RLE, ZIP, PIZ, PXR24 or B44".into());
        }
        claimed = claimed.saturating_add(pixels.saturating_mul(header.channels.bytes_per_pixel));
    }
    match claimed > bytes.len().saturating_mul(MAX_EXPANSION) {
        true => Err("the file is too short for the pixels that its header claims".into()),
        false => Ok(()),
    }
}

/// Run a decoder of the `exr` crate. The B44 decoder of exr 1.74 subtracts below zero in a broken file, which is a
/// panic where overflow is checked.
pub fn without_panic<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    let read = catch_unwind(AssertUnwindSafe(decode));
    read.unwrap_or_else(|_| Err("not a sound OpenEXR file".into()))
}

/// [`read_rgb`] from memory; the error says what is wrong with the bytes. They need not be trusted.
pub fn decode_rgb(bytes: &[u8]) -> Result<Film, String> {
    check_claims(bytes, false)?;
    without_panic(|| decode_trusting(bytes, ["R", "G", "B"]))
}

fn decode_trusting(bytes: &[u8], channels: [&str; 3]) -> Result<Film, String> {
    let create = |size: Vec2<usize>, _: &_| Film::new(size.0 as u32, size.1 as u32);
    let set = |film: &mut Film, at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
        let i = at.1 * film.width as usize + at.0;
        if let Some(pixel) = film.pixels.get_mut(i) {
            *pixel = [r, g, b];
        }
    };
    let reader = exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels();
    let reader = reader
        .required(channels[0])
        .required(channels[1])
        .required(channels[2])
        .collect_pixels(create, set);
    let reader = reader.first_valid_layer().all_attributes().non_parallel();
    let image = reader
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| error.to_string())?;
    Ok(image.layer_data.channel_data.pixels)
}

/// BLAKE3, in hexadecimal, of width, height and the pixels' bits, all little-endian. Equal for equal pictures, whatever
/// file they are in.
pub fn pixel_hash(film: &Film) -> String {
    let mut hasher = blake3::Hasher::new();
    add_to_hash(film, &mut hasher);
    hasher.finalize().to_string()
}

/// BLAKE3 of all that a block adds to an image, in the same form: its sum, its layers, and for more than one pass its
/// squared differences and [`RadiusSums`](crate::bias::RadiusSums) as well, which for one pass follow from the rest.
///
/// For one pass without layers, that is the [`pixel_hash`].
pub fn node_hash(node: &Node) -> [u8; 32] {
    node_hashes(node).1
}

/// [`pixel_hash`] of the sum, and [`node_hash`]: the first is on the way to the second.
pub fn node_hashes(node: &Node) -> (String, [u8; 32]) {
    let mut hasher = blake3::Hasher::new();
    add_to_hash(&node.sum, &mut hasher);
    let pixels = hasher.finalize().to_string();
    for layer in &node.layers {
        add_to_hash(layer, &mut hasher);
    }
    for matte in &node.mattes {
        for entries in matte.by_pixel() {
            hasher.update(&(entries.len() as u32).to_le_bytes());
            for entry in entries {
                hasher.update(&entry.id.to_le_bytes());
                hasher.update(&entry.passes.to_le_bytes());
            }
        }
    }
    if node.block.level > 0 {
        add_to_hash(&node.squared_difference, &mut hasher);
        if let Some(sums) = &node.radius_sums {
            hasher.update(&sums.to_bytes());
        }
    }
    (pixels, *hasher.finalize().as_bytes())
}

const HASHED_AT_ONCE: usize = 1 << 16;

fn add_to_hash(film: &Film, hasher: &mut blake3::Hasher) {
    hasher.update(&film.width.to_le_bytes());
    hasher.update(&film.height.to_le_bytes());
    // Many at a time: the hash is quickest over large pieces.
    let mut bytes = Vec::new();
    for values in film.pixels.as_flattened().chunks(HASHED_AT_ONCE) {
        bytes.clear();
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        hasher.update(&bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::ScheduleKind;
    use crate::merge::TreeSum;

    fn average() -> Average {
        let mut sum = TreeSum::new(7, 5).with_layers(2);
        for pass in 0..3u32 {
            let mut film = Film::new(7, 5);
            for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
                *value = 1.0 / (i as u32 * 7 + pass * 3 + 1) as f32;
            }
            let layers = vec![film.clone(), film.clone()];
            let leaf = Node::leaf(pass.into(), film).with_layers(layers);
            sum.insert(leaf).unwrap();
        }
        sum.average().unwrap()
    }

    fn meta() -> ImageMeta {
        ImageMeta {
            scene: SceneHash([0xab; 32]),
            scene_file: Some("fog/scene.toml".into()),
            maker: Maker::Passes(JobSettings {
                seed: u64::MAX,
                alpha: 2.0 / 3.0,
                schedule: ScheduleKind::Beam,
                budget: None,
                paths_per_pass: 1000,
                reference_paths: 500,
                finders: Finders::default(),
            }),
            render_seconds: 1.5,
            version: "0.1.0".into(),
            layers: vec![layer::Layer::Depth, layer::Layer::Normal],
            standard_error: true,
            drops_photons: false,
            names: Names::default(),
        }
    }

    #[test]
    fn every_bit_survives() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.exr");
        let average = average();
        write_image(&path, &average, &meta()).unwrap();
        let film = read_rgb(&path).unwrap();
        assert_eq!(pixel_hash(&film), pixel_hash(&average.beauty));
        let error = read_standard_error(&path).unwrap().unwrap();
        assert_eq!(pixel_hash(&error), pixel_hash(&average.standard_error));
        let without = ImageMeta {
            standard_error: false,
            ..meta()
        };
        let plain = folder.path().join("plain.exr");
        write_image(&plain, &average, &without).unwrap();
        assert_eq!(read_standard_error(&plain).unwrap(), None);

        let image = exr::image::read::read_first_flat_layer_from_file(&path).unwrap();
        let channels = &image.layer_data.channel_data.list;
        let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
        #[rustfmt::skip]
        let expected =
            ["B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z", "stderr.B", "stderr.G", "stderr.R"];
        assert_eq!(names, expected);
        let red: Vec<f32> = average.standard_error.pixels.iter().map(|pixel| pixel[0]).collect();
        assert_eq!(channels[9].sample_data, FlatSamples::F32(red));
        let depth = average.layers[0].pixels.iter().map(layer::distance);
        assert_eq!(channels[3].sample_data, FlatSamples::F32(depth.collect()));

        let attributes = &image.layer_data.attributes;
        assert_eq!(attributes.software_name, Some("beamfarm 0.1.0".into()));
        let Maker::Passes(settings) = meta().maker else {
            panic!("not of passes");
        };
        let pass_set = meta().pass_set(&settings, &average);
        assert_eq!(pass_set.len(), 64);
        let other = JobSettings { seed: 0, ..settings };
        assert_ne!(meta().pass_set(&other, &average), pass_set);
        let mut longer = average.clone();
        longer.passes += 1;
        assert_ne!(meta().pass_set(&settings, &longer), pass_set);
        let expected = [
            ("beamfarmAlpha", AttributeValue::F64(2.0 / 3.0)),
            ("beamfarmFirstPass", AttributeValue::Text("0".into())),
            ("beamfarmLastPass", AttributeValue::Text("2".into())),
            ("beamfarmPassSet", AttributeValue::Text(pass_set.as_str().into())),
            ("beamfarmPasses", AttributeValue::Text("3".into())),
            ("beamfarmPathsPerPass", AttributeValue::Text("1000".into())),
            ("beamfarmReferencePaths", AttributeValue::Text("500".into())),
            (
                "beamfarmRelativeError",
                AttributeValue::F64(average.relative_standard_error()),
            ),
            ("beamfarmRenderSeconds", AttributeValue::F64(1.5)),
            ("beamfarmScene", AttributeValue::Text("ab".repeat(32).as_str().into())),
            ("beamfarmSceneFile", AttributeValue::Text("fog/scene.toml".into())),
            ("beamfarmSchedule", AttributeValue::Text("beam".into())),
            ("beamfarmSeed", AttributeValue::Text("18446744073709551615".into())),
            ("beamfarmVersion", AttributeValue::Text("0.1.0".into())),
        ];
        assert_eq!(attributes.other.len(), expected.len());
        for (name, value) in expected {
            assert_eq!(attributes.other[&exr::prelude::Text::from(name)], value, "{name}");
        }
    }

    #[test]
    fn reference_images_say_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.exr");
        let settings = ReferenceSettings {
            seed: 7,
            max_depth: Some(12),
        };
        let meta = ImageMeta {
            maker: Maker::Reference(settings),
            ..meta()
        };
        write_image(&path, &average(), &meta).unwrap();
        let image = exr::image::read::read_first_flat_layer_from_file(&path).unwrap();
        let attributes = &image.layer_data.attributes.other;
        for (name, value) in [
            ("beamfarmSamples", "3"),
            ("beamfarmSeed", "7"),
            ("beamfarmMaxDepth", "12"),
        ] {
            let attribute = &attributes[&exr::prelude::Text::from(name)];
            assert_eq!(*attribute, AttributeValue::Text(value.into()), "{name}");
        }
        assert!(!attributes.contains_key(&exr::prelude::Text::from("beamfarmAlpha")));
        let says = |of_samples: bool, scene_file: Option<String>| Provenance { of_samples, scene_file };
        assert_eq!(Provenance::read(&path), Some(says(true, meta.scene_file.clone())));
        let meta = ImageMeta {
            scene_file: None,
            ..self::meta()
        };
        write_image(&path, &average(), &meta).unwrap();
        assert_eq!(Provenance::read(&path), Some(says(false, None)));
        assert_eq!(Provenance::read(&folder.path().join("none.exr")), None);
    }

    #[test]
    fn biased_images_say_so() {
        let attributes = |drops_photons: bool| {
            let meta = ImageMeta {
                drops_photons,
                ..meta()
            };
            let bytes = encode_image(&average(), &meta).unwrap();
            let header = exr::meta::MetaData::read_from_buffered(&bytes[..], true).unwrap();
            header.headers[0].own_attributes.other.clone()
        };
        let name = exr::prelude::Text::from("beamfarmBiased");
        assert_eq!(attributes(false).get(&name), None);
        match &attributes(true)[&name] {
            AttributeValue::Text(text) => assert!(text.to_string().contains("\"reject\"")),
            other => panic!("{other:?}"),
        }
    }

    /// As a compositor reads them: pairs of id and coverage by rank, and what the ids are called.
    #[test]
    fn mattes_are_those_of_the_convention() {
        let names = Names {
            objects: ["ball", "wall \"b\"", "Würfel", "unseen"].map(String::from).to_vec(),
            materials: Vec::new(),
        };
        let [ball, wall, cube] = [0, 1, 2].map(|i| matte::id_of_name(&names.objects[i]));
        let mut sum = TreeSum::new(3, 1).with_layers(LayerCounts { films: 0, mattes: 1 });
        for (pass, ids) in [[ball, wall, 0], [wall, wall, 0], [wall, cube, 0], [cube, cube, ball]]
            .iter()
            .enumerate()
        {
            let leaf = Node::leaf(pass as u64, Film::new(3, 1));
            sum.insert(leaf.with_mattes(vec![matte::Matte::leaf(ids)])).unwrap();
        }
        let meta = ImageMeta {
            layers: vec![layer::Layer::Objects],
            standard_error: false,
            names,
            ..meta()
        };
        let bytes = encode_image(&sum.average().unwrap(), &meta).unwrap();
        assert!(encode_image(&sum.average().unwrap(), &meta).unwrap() == bytes);
        let reader = exr::image::read::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels();
        let image = reader
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(&bytes))
            .unwrap();
        let channel = |name: &str| {
            let mut list = image.layer_data.channel_data.list.iter();
            let found = list.find(|channel| channel.name.to_string() == name).unwrap();
            found.sample_data.values_as_f32().collect::<Vec<f32>>()
        };
        let ids = |name: &str| channel(name).iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
        let first = if wall < cube { wall } else { cube };
        assert_eq!(ids("CryptoObject00.R"), [wall, first, ball]);
        assert_eq!(channel("CryptoObject00.G"), [0.5, 0.5, 0.25]);
        let second = if ball < cube { ball } else { cube };
        assert_eq!(
            ids("CryptoObject00.B"),
            [second, if first == wall { cube } else { wall }, 0]
        );
        assert_eq!(channel("CryptoObject00.A"), [0.25, 0.5, 0.0]);
        assert_eq!(channel("CryptoObject01.G"), [0.25, 0.0, 0.0]);
        assert_eq!(channel("CryptoObject02.A"), [0.0; 3]);
        let attributes = &image.layer_data.attributes.other;
        let says = |name: &str| match &attributes[&exr::prelude::Text::from(&*format!("cryptomatte/3ae39a5/{name}"))] {
            AttributeValue::Text(text) => text.to_string(),
            other => panic!("{other:?}"),
        };
        assert_eq!(says("name"), "CryptoObject");
        assert_eq!(
            (says("hash"), says("conversion")),
            ("MurmurHash3_32".into(), "uint32_to_float32".into())
        );
        let manifest = says("manifest");
        assert!(manifest.is_ascii(), "{manifest}");
        let manifest: BTreeMap<String, String> = serde_json::from_str(&manifest).unwrap();
        let id = |name: &str| u32::from_str_radix(&manifest[name], 16).unwrap();
        assert_eq!(
            (manifest.len(), id("ball"), id("Würfel"), id("wall \"b\"")),
            (3, ball, cube, wall)
        );
    }

    /// The `exr` crate keeps attributes in a hash map, whose order differs each time.
    #[test]
    fn equal_images_are_equal_files() {
        let first = encode_image(&average(), &meta()).unwrap();
        for _ in 0..20 {
            assert!(encode_image(&average(), &meta()).unwrap() == first);
        }
        let later = ImageMeta {
            render_seconds: 99.0,
            ..meta()
        };
        let second = encode_image(&average(), &later).unwrap();
        let differing = first.iter().zip(&second).filter(|(a, b)| a != b).count();
        assert!(first.len() == second.len() && differing <= 8);
    }

    #[test]
    fn metadata_that_exr_cannot_hold_are_refused() {
        let odd = ImageMeta {
            version: "0.1.0 \u{3b2}".into(),
            ..meta()
        };
        let error = encode_image(&average(), &odd).unwrap_err();
        assert_eq!(
            error.to_string(),
            "cannot encode version: `0.1.0 β` is not 1 to 255 characters of ASCII"
        );
    }

    #[test]
    fn half_floats_and_other_channels_are_read() {
        use exr::prelude::f16;
        let pixels = |at: Vec2<usize>| {
            let half = f16::from_f32(at.0 as f32 + 0.5);
            (half, half, at.1 as f32, f16::ZERO, 7u32)
        };
        let channels = exr::image::SpecificChannels::build()
            .with_channel("R")
            .with_channel("G")
            .with_channel("B")
            .with_channel("A")
            .with_channel("id")
            .with_pixel_fn(pixels);
        let image = Image::from_channels((3, 2), channels);
        let mut bytes = Vec::new();
        image
            .write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        let film = decode_rgb(&bytes).unwrap();
        assert_eq!((film.width, film.height), (3, 2));
        assert_eq!(film.pixels[5], [2.5, 2.5, 1.0]);
    }

    #[test]
    fn a_file_without_colour_is_refused() {
        let channels = exr::image::SpecificChannels::build()
            .with_channel("Z")
            .with_pixel_fn(|_| (1.0f32,));
        let mut bytes = Vec::new();
        let image = Image::from_channels((3, 2), channels);
        image
            .write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        assert!(decode_rgb(&bytes).is_err());
        assert!(decode_rgb(b"\x89PNG").is_err());
        let missing = read_rgb(Path::new("does-not-exist.exr")).unwrap_err();
        assert!(missing.to_string().starts_with("does-not-exist.exr: "));
    }

    #[test]
    fn dwa_is_refused_before_its_decoder_runs() {
        let channels = exr::image::SpecificChannels::rgb(|_| (0.5f32, 0.5f32, 0.5f32));
        let encoding = Encoding {
            compression: Compression::DWAA(None),
            ..Encoding::SMALL_LOSSLESS
        };
        let layer = Layer::new((3usize, 2usize), LayerAttributes::default(), encoding, channels);
        let mut bytes = Vec::new();
        let image = Image::from_layer(layer);
        image
            .write()
            .non_parallel()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        let error = decode_rgb(&bytes).unwrap_err();
        assert!(error.starts_with("DWA"), "{error}");
    }

    /// Any damage gives an image or an error.
    #[test]
    fn damaged_files_do_no_harm() {
        let bytes = encode_image(&average(), &meta()).unwrap();
        for len in 0..bytes.len() {
            let _ = decode_rgb(&bytes[..len]);
        }
        for i in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0xff] {
                let mut damaged = bytes.clone();
                damaged[i] = value;
                let _ = decode_rgb(&damaged);
            }
        }
    }

    #[test]
    fn node_hash_is_of_all_that_a_block_adds() {
        let film = |value: f32| Film {
            pixels: vec![[value, 1.0, 2.0]; 6],
            ..Film::new(2, 3)
        };
        let leaf = |pass: u64, value: f32| {
            let leaf = Node::leaf(pass, film(value));
            leaf.with_radius_scale(1.0 / (pass + 1) as f64)
        };
        let (pixels, hash) = node_hashes(&leaf(5, 3.0));
        assert_eq!(pixels, pixel_hash(&film(3.0)));
        assert_eq!(blake3::Hash::from_bytes(hash).to_string(), pixels);
        let layered = leaf(5, 3.0).with_layers(vec![film(4.0)]);
        assert_eq!(node_hashes(&layered).0, pixels);
        assert_ne!(node_hash(&layered), hash);

        let pair = |left, right| Node::join(leaf(4, left), leaf(5, right)).unwrap();
        let known = pair(3.0, 5.0);
        assert_eq!(node_hash(&known), node_hash(&pair(3.0, 5.0)));
        // The same sum of other passes.
        let other = pair(2.0, 6.0);
        assert_eq!(known.sum, other.sum);
        assert_eq!(node_hashes(&known).0, node_hashes(&other).0);
        assert_ne!(node_hash(&known), node_hash(&other));
        let mut radii = known.clone();
        radii.radius_sums = other.radius_sums;
        assert_ne!(node_hash(&known), node_hash(&radii));
    }

    #[test]
    fn pixel_hash_tells_pictures_apart() {
        let mut film = Film::new(2, 3);
        let black = pixel_hash(&film);
        assert_eq!(black.len(), 64);
        assert_ne!(black, pixel_hash(&Film::new(3, 2)));
        film.pixels[0][0] = -0.0;
        assert_ne!(black, pixel_hash(&film));
        // By definition: BLAKE3 of the words' bytes.
        let bytes = [2u32, 3, 1 << 31].into_iter().chain([0; 17]).flat_map(u32::to_le_bytes);
        assert_eq!(pixel_hash(&film), blake3::hash(&bytes.collect::<Vec<u8>>()).to_string());
    }
}
