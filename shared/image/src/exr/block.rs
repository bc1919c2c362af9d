//! Block images: the sum of an aligned block of passes as an uncompressed OpenEXR file. Workers send them to the
//! coordinator, and the coordinator stores them on disk.
//!
//! Blocks arrive by the thousand, from untrusted machines. So the reader accepts exactly the bytes that
//! [`encode_block`] writes: it picks the few attributes that vary out of the header, writes the header that follows
//! from them, and compares. No decoder ever follows a size or an offset that came over the network. Any EXR reader can
//! open the files: mattes and the sums for a block's bias stand after the last row, where no reader looks.

use super::header::{self, ENGINE, attributes, float_channels, text};
use crate::bias::RadiusSums;
use crate::error::ImageError;
use crate::film::Film;
use crate::job::{Block, EngineKind, SceneHash};
use crate::layer::{Layer, LayerCounts};
use crate::matte::Matte;
use crate::merge::Node;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, Compression, LineOrder};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};

/// A block image's metadata.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMeta {
    /// The scene.
    pub scene: SceneHash,
    /// The block of passes.
    pub block: Block,
    /// The job's seed.
    pub seed: u64,
    /// The job's alpha.
    pub alpha: f64,
    /// Radius scale of the block's first pass.
    pub radius_scale: f64,
    /// Version of the program.
    pub version: String,
    /// The engine that rendered the passes.
    pub engine: EngineKind,
}

const SCENE: &str = "beamfarmScene";
const FIRST_PASS: &str = "beamfarmFirstPass";
const LEVEL: &str = "beamfarmLevel";
const SEED: &str = "beamfarmSeed";
const ALPHA: &str = "beamfarmAlpha";
const RADIUS_SCALE: &str = "beamfarmRadiusScale";
const VERSION: &str = "beamfarmVersion";

/// No schedule comes near these bounds. Within them, sums of the scales' powers from -1 to 4 are finite.
const RADIUS_SCALES: std::ops::RangeInclusive<f64> = 1e-50..=1e50;

/// Row number and byte count before each row.
const ROW_PREFIX: usize = 8;

/// A channel, and where its values are stored.
struct Channel {
    name: String,
    /// 0: the sum; 1: the squared differences; from 2 on: the layers.
    film: usize,
    /// Index among a pixel's three values.
    component: usize,
}

/// The channels of a block image in the order of their names, as EXR requires.
fn channels(block: Block, layers: &[Layer]) -> Vec<Channel> {
    let mut channels = Vec::new();
    let mut add = |film: usize, prefix: &str, names: &[&str]| {
        channels.extend(names.iter().enumerate().map(|(component, name)| Channel {
            name: format!("{prefix}{name}"),
            film,
            component,
        }));
    };
    add(0, "", &["R", "G", "B"]);
    if block.level > 0 {
        add(1, "variance.", &["R", "G", "B"]);
    }
    for (i, layer) in layers.iter().enumerate() {
        add(2 + i, &format!("{layer}."), layer.channels());
    }
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    channels
}

fn row_bytes(width: u32, channels: &[Channel]) -> usize {
    4 * width as usize * channels.len()
}

/// Size of the radius sums after the last row. Only blocks of several passes have them; for one pass they follow from
/// the image.
fn radius_sum_bytes(width: u32, height: u32, block: Block) -> usize {
    match block.level {
        0 => 0,
        _ => RadiusSums::byte_count(width, height),
    }
}

/// Upper bound of a block image's size in bytes, for limits on messages. Take the image size from the job, not from a
/// message.
pub fn encoded_size(width: u32, height: u32, layers: &[Layer]) -> usize {
    let block = Block { level: 1, index: 0 };
    let channels = channels(block, layers);
    let names: usize = channels.iter().map(|channel| channel.name.len() + 17).sum();
    let row = ROW_PREFIX + 8 + row_bytes(width, &channels);
    (height as usize)
        .saturating_mul(row)
        .saturating_add(2048 + names)
        .saturating_add(radius_sum_bytes(width, height, block))
        .saturating_add(LayerCounts::of(layers).mattes * Matte::max_bytes(width as usize * height as usize))
}

/// Encodes a block as an OpenEXR file: float32, uncompressed, the exact bits.
///
/// Channels R, G, B hold the sum of the block's passes. For more than one pass, variance.R, .G, .B hold the sum of
/// squared differences of neighbours. The others hold the sums of the layers. A block of more than one pass must have
/// its [`RadiusSums`]. Equal arguments give equal bytes.
pub fn encode_block(node: &Node, meta: &BlockMeta, layers: &[Layer]) -> Result<Vec<u8>, ImageError> {
    if node.block != meta.block {
        return Err(ImageError::Encode {
            field: "block",
            message: format!("metadata says {}, the image holds {}", meta.block, node.block),
        });
    }
    let (width, height) = (node.sum.width, node.sum.height);
    node.check(width, height, LayerCounts::of(layers))?;
    let channels = channels(meta.block, layers);
    let mut bytes = encode_header(width, height, meta, &channels)?;
    let row_bytes = row_bytes(width, &channels);
    bytes.reserve_exact(height as usize * (ROW_PREFIX + row_bytes));
    let films: Vec<&Film> = [&node.sum, &node.squared_difference]
        .into_iter()
        .chain(&node.layers)
        .collect();
    for y in 0..height as usize {
        bytes.extend_from_slice(&(y as u32).to_le_bytes());
        bytes.extend_from_slice(&(row_bytes as u32).to_le_bytes());
        let row = y * width as usize..(y + 1) * width as usize;
        for channel in &channels {
            let pixels = &films[channel.film].pixels[row.clone()];
            let samples = pixels.iter().map(|pixel| pixel[channel.component]);
            bytes.extend(samples.flat_map(f32::to_le_bytes));
        }
    }
    for matte in &node.mattes {
        bytes.extend(matte.to_bytes().ok_or(ImageError::Encode {
            field: "block",
            message: "more objects or materials in its pixels than a block can hold".into(),
        })?);
    }
    if meta.block.level > 0 {
        let sums = node.radius_sums.as_ref().ok_or(ImageError::Encode {
            field: "block",
            message: "the radius scales of its passes are not known".into(),
        })?;
        bytes.extend(sums.to_bytes());
    }
    Ok(bytes)
}

/// The header and the table of row offsets.
fn encode_header(width: u32, height: u32, meta: &BlockMeta, channels: &[Channel]) -> Result<Vec<u8>, ImageError> {
    let fits = |n: u32| n > 0 && n <= 1 << 20;
    if !fits(width) || !fits(height) {
        return Err(ImageError::Encode {
            field: "size",
            message: format!("{width} x {height} pixels; expected 1 to 2^20 each way"),
        });
    }
    let size = (width as usize, height as usize);
    let mut own = vec![
        (SCENE, text(SCENE, &meta.scene.to_string())?),
        (FIRST_PASS, text(FIRST_PASS, &meta.block.start().to_string())?),
        (LEVEL, AttributeValue::I32(meta.block.level as i32)),
        (SEED, text(SEED, &meta.seed.to_string())?),
        (ALPHA, AttributeValue::F64(meta.alpha)),
        (RADIUS_SCALE, AttributeValue::F64(meta.radius_scale)),
        (VERSION, text(VERSION, &meta.version)?),
    ];
    if meta.engine != EngineKind::Cpu {
        own.push((ENGINE, text(ENGINE, &meta.engine.identity())?));
    }
    let own_attributes = LayerAttributes {
        other: attributes(own),
        ..LayerAttributes::default()
    };
    let header = Header {
        channels: float_channels(channels.iter().map(|channel| channel.name.as_str())),
        compression: Compression::Uncompressed,
        blocks: BlockDescription::ScanLines,
        line_order: LineOrder::Increasing,
        layer_size: size.into(),
        deep: false,
        deep_data_version: None,
        chunk_count: height as usize,
        max_samples_per_pixel: None,
        shared_attributes: ImageAttributes::with_size(size),
        own_attributes,
    };
    let mut bytes = header::encode(&header)?;
    let first_row = bytes.len() + 8 * height as usize;
    let stride = ROW_PREFIX + row_bytes(width, channels);
    for y in 0..height as usize {
        bytes.extend_from_slice(&((first_row + y * stride) as u64).to_le_bytes());
    }
    Ok(bytes)
}

/// Read what [`encode_block`] wrote, for images of this size and these layers. The bytes may be untrusted.
///
/// Refuses everything else: another size, other channels or types, compression, unknown attributes, missing or extra
/// bytes, and values that [`Node::check`] refuses. The caller must compare the metadata with those of the job.
pub fn decode_block(bytes: &[u8], width: u32, height: u32, layers: &[Layer]) -> Result<(Node, BlockMeta), ImageError> {
    let limit = encoded_size(width, height, layers);
    if bytes.len() > limit {
        return Err(ImageError::Block {
            field: "size",
            message: format!("{} bytes; expected at most {limit}", bytes.len()),
        });
    }
    let meta = decode_meta(bytes)?;
    let channels = channels(meta.block, layers);
    let expected = encode_header(width, height, &meta, &channels)?;
    let Some(rest) = bytes.strip_prefix(&expected[..]) else {
        return Err(ImageError::Block {
            field: "header",
            message: format!(
                "not that of an uncompressed float image of {width} x {height} pixels and {} layers, {}",
                layers.len(),
                meta.block
            ),
        });
    };
    let row_bytes = row_bytes(width, &channels);
    let stride = ROW_PREFIX + row_bytes;
    let row_total = height as usize * stride;
    let wrong_size = |expected: usize| ImageError::Block {
        field: "size",
        message: format!("{} bytes behind the header; expected {expected}", rest.len()),
    };
    let counts = LayerCounts::of(layers);
    let sum_bytes = radius_sum_bytes(width, height, meta.block);
    let Some((rows, mut sums)) = rest.split_at_checked(row_total) else {
        return Err(wrong_size(row_total + sum_bytes));
    };
    let mut mattes = Vec::new();
    for _ in 0..counts.mattes {
        let read = Matte::from_bytes(sums, width as usize * height as usize);
        let (matte, length) = read.ok_or(ImageError::Block {
            field: "mattes",
            message: "shorter than their numbers of entries say, or too many of these".into(),
        })?;
        mattes.push(matte);
        sums = &sums[length..];
    }
    if sums.len() != sum_bytes {
        return Err(wrong_size(rest.len() - sums.len() + sum_bytes));
    }

    let mut films = vec![Film::new(width, height); 2 + counts.films];
    for (y, row) in rows.chunks_exact(stride).enumerate() {
        let (prefix, samples) = row.split_at(ROW_PREFIX);
        if prefix[..4] != (y as u32).to_le_bytes() || prefix[4..] != (row_bytes as u32).to_le_bytes() {
            return Err(ImageError::Block {
                field: "rows",
                message: format!("row {y} is not where it is expected"),
            });
        }
        for (channel, samples) in channels.iter().zip(samples.chunks_exact(4 * width as usize)) {
            let start = y * width as usize;
            let pixels = &mut films[channel.film].pixels[start..start + width as usize];
            for (pixel, sample) in pixels.iter_mut().zip(samples.as_chunks().0) {
                pixel[channel.component] = f32::from_le_bytes(*sample);
            }
        }
    }
    let layers = films.split_off(2);
    let [sum, squared_difference] = films.try_into().map_err(|_| ImageError::Block {
        field: "channels",
        message: "none".into(),
    })?;
    let radius_sums = match meta.block.level {
        0 => Some(RadiusSums::leaf(&sum, meta.radius_scale)),
        _ => RadiusSums::from_bytes(sums),
    };
    let node = Node {
        block: meta.block,
        sum,
        squared_difference,
        layers,
        mattes,
        radius_sums,
    };
    node.check(width, height, counts)?;
    Ok((node, meta))
}

/// Reads the attributes that vary. The comparison with the expected header checks the rest.
fn decode_meta(bytes: &[u8]) -> Result<BlockMeta, ImageError> {
    let attributes = header::walk_block(bytes).map_err(|message| ImageError::Block {
        field: "header",
        message,
    })?;
    let find = |field: &'static str, kind: &str| {
        let named = |a: &&header::Attribute| a.name == field.as_bytes() && a.kind == kind.as_bytes();
        let found = attributes.iter().find(named);
        found.map(|a| a.value).ok_or(ImageError::Block {
            field,
            message: format!("missing; expected a {kind}"),
        })
    };
    let bad = |field: &'static str, expected: &str| ImageError::Block {
        field,
        message: format!("expected {expected}"),
    };
    let string = |field: &'static str| {
        let value = find(field, "string")?;
        let ascii = value.is_ascii() && (1..=255).contains(&value.len());
        let text = std::str::from_utf8(value).ok().filter(|_| ascii);
        text.ok_or_else(|| bad(field, "1 to 255 characters of ASCII"))
    };
    let integer = |field: &'static str| {
        let text = string(field)?;
        text.parse::<u64>().map_err(|_| bad(field, "an integer of 64 bits"))
    };
    let double = |field: &'static str| {
        let value = find(field, "double")?.try_into().map(f64::from_le_bytes);
        value
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| bad(field, "a finite number"))
    };

    let engine = match attributes.iter().any(|a| a.name == ENGINE.as_bytes()) {
        true => {
            EngineKind::identified(string(ENGINE)?).map_err(|message| ImageError::Block { field: ENGINE, message })?
        }
        false => EngineKind::Cpu,
    };
    let level = find(LEVEL, "int")?.try_into().map(u32::from_le_bytes);
    let first_pass = integer(FIRST_PASS)?;
    let block = level
        .ok()
        .and_then(|level| Block::new(level, first_pass.checked_shr(level)?))
        .filter(|block| block.start() == first_pass)
        .ok_or_else(|| bad(LEVEL, "an aligned block of passes"))?;
    Ok(BlockMeta {
        scene: string(SCENE)?
            .parse()
            .map_err(|_| bad(SCENE, "64 hexadecimal digits"))?,
        block,
        seed: integer(SEED)?,
        alpha: double(ALPHA)?,
        radius_scale: Some(double(RADIUS_SCALE)?)
            .filter(|scale| RADIUS_SCALES.contains(scale))
            .ok_or_else(|| bad(RADIUS_SCALE, "a scale between 1e-50 and 1e50"))?,
        version: string(VERSION)?.to_owned(),
        engine,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::image::FlatSamples;

    fn film(width: u32, height: u32, salt: u32) -> Film {
        let mut film = Film::new(width, height);
        for (i, value) in film.pixels.iter_mut().flatten().enumerate() {
            let bits = (i as u32 + 1).wrapping_mul(0x9e37_79b9) ^ salt.wrapping_mul(0x85eb_ca6b);
            // All signs and mantissas, with exponents around one.
            *value = f32::from_bits(bits & 0x80ff_ffff | 0x3f00_0000);
        }
        film
    }

    const RADIUS_SCALE_OF_TESTS: f64 = 0.1 + 0.2;

    fn layers() -> [Layer; 2] {
        [Layer::Targets, Layer::Albedo]
    }

    fn node(level: u32) -> Node {
        let leaf = |i: u64| {
            let mut targets = film(5, 4, 100 + i as u32);
            targets.pixels.iter_mut().for_each(|p| *p = [p[0], 0.0, 0.0]);
            let layers = vec![targets, film(5, 4, 200 + i as u32)];
            let leaf = Node::leaf(12 + i, film(5, 4, i as u32)).with_layers(layers);
            leaf.with_radius_scale(RADIUS_SCALE_OF_TESTS)
        };
        match level {
            0 => leaf(0),
            1 => Node::join(leaf(0), leaf(1)).unwrap(),
            _ => {
                let right = Node::join(leaf(2), leaf(3)).unwrap();
                Node::join(node(1), right).unwrap()
            }
        }
    }

    fn meta(block: Block) -> BlockMeta {
        BlockMeta {
            scene: SceneHash(std::array::from_fn(|i| i as u8)),
            block,
            seed: u64::MAX - 1,
            alpha: 2.0 / 3.0,
            radius_scale: RADIUS_SCALE_OF_TESTS,
            version: "0.1.0".into(),
            engine: EngineKind::Cpu,
        }
    }

    fn encoded(level: u32) -> Vec<u8> {
        let node = node(level);
        encode_block(&node, &meta(node.block), &layers()).unwrap()
    }

    #[test]
    fn every_bit_survives() {
        for level in 0..3 {
            let mut node = node(level);
            node.sum.pixels[0] = [-0.0, f32::from_bits(1), f32::MIN_POSITIVE];
            let meta = meta(node.block);
            let bytes = encode_block(&node, &meta, &layers()).unwrap();
            assert!(bytes.len() <= encoded_size(5, 4, &layers()));
            let (decoded, decoded_meta) = decode_block(&bytes, 5, 4, &layers()).unwrap();
            assert_eq!(decoded_meta, meta);
            assert_eq!(decoded.block, node.block);
            let bits = |film: &Film| film.pixels.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&decoded.sum), bits(&node.sum));
            assert_eq!(bits(&decoded.squared_difference), bits(&node.squared_difference));
            assert_eq!(decoded.layers, node.layers);
            assert!(decoded.radius_sums.is_some());
            if level > 0 {
                assert_eq!(decoded.radius_sums, node.radius_sums);
            }
            assert_eq!(encode_block(&decoded, &decoded_meta, &layers()).unwrap(), bytes);
        }
    }

    /// A block names the engine that rendered it; blocks from processors have the same bytes as before.
    #[test]
    fn a_block_of_another_engine_says_so() {
        let node = node(1);
        let of_gpu = BlockMeta {
            engine: EngineKind::Gpu,
            ..meta(node.block)
        };
        let bytes = encode_block(&node, &of_gpu, &layers()).unwrap();
        assert_eq!(decode_block(&bytes, 5, 4, &layers()).unwrap().1, of_gpu);
        let find = |bytes: &[u8], text: &str| bytes.windows(text.len()).position(|found| found == text.as_bytes());
        assert_eq!(find(&encoded(1), ENGINE), None);
        let identity = EngineKind::Gpu.identity();
        let at = find(&bytes, &identity).unwrap();
        for other in ["gpu 0", "cpu 0", "tpu 1"] {
            let mut changed = bytes.clone();
            changed[at..at + other.len()].copy_from_slice(other.as_bytes());
            let error = decode_block(&changed, 5, 4, &layers()).unwrap_err().to_string();
            assert!(
                error.contains(&format!(
                    "the engine is {other:?}; expected {} or {identity}",
                    EngineKind::Cpu.identity()
                )),
                "{error}"
            );
        }
    }

    /// All but the header is written by hand, so an independent reader must find the same.
    #[test]
    fn other_readers_agree() {
        let node = node(2);
        let bytes = encode_block(&node, &meta(node.block), &layers()).unwrap();
        let reader = exr::image::read::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels();
        let reader = exr::prelude::ReadLayers::all_attributes(exr::prelude::ReadChannels::first_valid_layer(reader));
        let image = reader.pedantic().from_buffered(std::io::Cursor::new(&bytes)).unwrap();
        let mut names = Vec::new();
        for channel in &image.layer_data.channel_data.list {
            let name = channel.name.to_string();
            let (prefix, colour) = name.split_at(name.len() - 1);
            let film = match prefix {
                "" => &node.sum,
                "variance." => &node.squared_difference,
                "targets." => &node.layers[0],
                _ => &node.layers[1],
            };
            let c = "RGB".find(colour).unwrap_or(0);
            let expected = film.pixels.iter().map(|pixel| pixel[c]).collect();
            assert_eq!(channel.sample_data, FlatSamples::F32(expected), "{name}");
            names.push(name);
        }
        #[rustfmt::skip]
        let expected = ["B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "targets.Y", "variance.B", "variance.G", "variance.R"];
        assert_eq!(names, expected);
        let seed = &image.layer_data.attributes.other[&exr::prelude::Text::from(SEED)];
        assert_eq!(*seed, AttributeValue::Text("18446744073709551614".into()));
    }

    /// Whichever byte changes, the block is refused or has other values; it never claims more than it is.
    #[test]
    fn a_changed_byte_is_noticed_outside_of_values() {
        let bytes = encoded(1);
        let (node, meta) = decode_block(&bytes, 5, 4, &layers()).unwrap();
        let pixels =
            4 * (ROW_PREFIX + row_bytes(5, &channels(node.block, &layers()))) + radius_sum_bytes(5, 4, node.block);
        for i in 0..bytes.len() {
            for flip in [1, 0x80, 0xff] {
                let mut changed = bytes.clone();
                changed[i] ^= flip;
                let in_header = i < bytes.len() - pixels;
                if let Ok((other, other_meta)) = decode_block(&changed, 5, 4, &layers()) {
                    assert!(
                        in_header == (other_meta != meta) && in_header == (other == node),
                        "byte {i}"
                    );
                    assert_eq!(encode_block(&other, &other_meta, &layers()).unwrap(), changed);
                }
            }
        }
    }

    #[test]
    fn a_cut_or_grown_file_is_refused() {
        let bytes = encoded(1);
        for len in 0..bytes.len() {
            assert!(decode_block(&bytes[..len], 5, 4, &layers()).is_err(), "{len} bytes");
        }
        let grown = [&bytes[..], &[0]].concat();
        assert!(decode_block(&grown, 5, 4, &layers()).is_err());
        assert!(decode_block(&vec![0; 1 << 20], 5, 4, &layers()).is_err());
    }

    #[test]
    fn another_size_is_refused() {
        let bytes = encoded(0);
        for (width, height) in [(4, 5), (5, 3), (5, 5), (10, 2), (0, 0), (0, 4), (u32::MAX, 1)] {
            let error = decode_block(&bytes, width, height, &layers()).unwrap_err().to_string();
            assert!(error.contains("header") || error.contains("size"), "{error}");
        }
    }

    #[test]
    fn values_that_are_not_finite_are_refused() {
        let bytes = encoded(0);
        let pixels = 4 * (ROW_PREFIX + row_bytes(5, &channels(Block::leaf(0), &layers())));
        // Row 2, channel G, column 3.
        let at = bytes.len() - pixels + 2 * (ROW_PREFIX + 140) + ROW_PREFIX + 20 + 4 * 3;
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            let mut changed = bytes.clone();
            changed[at..at + 4].copy_from_slice(&bad.to_le_bytes());
            let error = decode_block(&changed, 5, 4, &layers()).unwrap_err().to_string();
            assert_eq!(
                error,
                "pass 12: 1 values are NaN, infinite or out of range, first at x = 3, y = 2"
            );
        }
    }

    #[test]
    fn metadata_of_another_block_are_refused() {
        let error = encode_block(&node(0), &meta(Block::leaf(13)), &layers()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "cannot encode block: metadata says pass 13, the image holds pass 12"
        );
    }
}
