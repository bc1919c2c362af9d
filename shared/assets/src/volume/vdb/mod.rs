//! OpenVDB files, archives of grids of which one is read. Format: OpenVDB's `io`, `tree` and `math` sources.

mod blosc;
mod map;
mod tree;
mod values;

use super::Flaw;
use super::bytes::Bytes;
use beamfarm_render::world::medium::bricks::RawDensity;
use glam::{DAffine3, IVec3};
use std::ops::RangeInclusive;
use tree::Storage;
use values::Scalar;

/// From the first version with node masks to the last known one.
const VERSIONS: RangeInclusive<u32> = 222..=225;
/// The most grids listed in an error message.
const LISTED: usize = 20;

/// Read the grid of that name, or else the grid `density`, or else the only float grid.
pub fn read(bytes: &[u8], grid: Option<&str>) -> Result<RawDensity, Flaw> {
    let mut bytes = Bytes::new(bytes);
    let grids = grids(&mut bytes)?;
    let chosen = choose(&grids, grid)?;
    density(bytes, &grids, chosen).map_err(|flaw| Flaw {
        message: format!("the grid {:?}: {}", chosen.name, flaw.message),
        ..flaw
    })
}

/// A grid's description in the archive.
struct Grid<'a> {
    /// Display name; if several grids share a name, with a number in brackets.
    name: String,
    /// Unique name in the file.
    unique: &'a [u8],
    /// The tree's type.
    kind: String,
    /// Unique name of the grid whose tree it shares; empty if it has its own.
    parent: &'a [u8],
    /// Offset of its compression, metadata, transform and topology.
    header: u64,
    /// Offset of its leaves' values.
    blocks: u64,
}

impl Grid<'_> {
    /// The tree's number type, and whether it is stored as half; `None` if it is not real-valued.
    fn scalar(&self) -> Option<(Scalar, bool)> {
        let (kind, as_half) = match self.kind.strip_suffix("_HalfFloat") {
            Some(kind) => (kind, true),
            None => (&*self.kind, false),
        };
        let scalar = match kind {
            "Tree_float_5_4_3" => Scalar::Float,
            "Tree_double_5_4_3" => Scalar::Double,
            "Tree_half_5_4_3" => Scalar::Half,
            _ => return None,
        };
        Some((scalar, as_half))
    }

    fn plain_name(&self) -> &[u8] {
        self.unique.split(|b| *b == SEPARATOR).next().unwrap_or_default()
    }
}

/// Separates a name and its number where several grids share a name.
const SEPARATOR: u8 = 0x1e;

/// Read the archive's header and all grid descriptions.
fn grids<'a>(bytes: &mut Bytes<'a>) -> Result<Vec<Grid<'a>>, Flaw> {
    const WHAT: &str = "the file's header";
    if bytes.take(8, WHAT)? != b" BDV\0\0\0\0" {
        return Err("not an OpenVDB file: it does not begin with \" BDV\" and four zeros".into());
    }
    let version = bytes.u32(WHAT)?;
    if !VERSIONS.contains(&version) {
        return Err(format!(
            "version {version} of the OpenVDB format is unsupported; expected {} to {}",
            VERSIONS.start(),
            VERSIONS.end()
        )
        .into());
    }
    // The version of the library that wrote it.
    bytes.take(8, WHAT)?;
    if bytes.u8(WHAT)? == 0 {
        return Err("it was written as a stream, without offsets of its grids, which is unsupported".into());
    }
    // A UUID.
    bytes.take(36, WHAT)?;
    metadata(bytes)?;
    let least = 3 * 4 + 3 * 8;
    let count = bytes.count(least, "grids")?;
    let mut grids = Vec::new();
    for _ in 0..count {
        const WHAT: &str = "the description of a grid";
        let unique = bytes.counted(WHAT)?;
        let kind = String::from_utf8_lossy(bytes.counted(WHAT)?).into_owned();
        let parent = bytes.counted(WHAT)?;
        let (header, blocks, end) = (bytes.u64(WHAT)?, bytes.u64(WHAT)?, bytes.u64(WHAT)?);
        let name = String::from_utf8_lossy(unique);
        let name = match name.split_once(char::from(SEPARATOR)) {
            Some((name, number)) => format!("{name}[{number}]"),
            None => name.into_owned(),
        };
        let begin = bytes.position();
        bytes.seek(end, &format!("the end of the grid {name:?}"))?;
        if bytes.position() < begin {
            return Err(
                format!("the grid {name:?} is said to end at byte {end}, before its begin at byte {begin}").into(),
            );
        }
        grids.push(Grid {
            name,
            unique,
            kind,
            parent,
            header,
            blocks,
        });
    }
    Ok(grids)
}

fn choose<'g, 'a>(grids: &'g [Grid<'a>], name: Option<&str>) -> Result<&'g Grid<'a>, Flaw> {
    let exact = grids.iter().find(|g| Some(&*g.name) == name);
    let wanted = name.unwrap_or("density");
    let mut named = grids.iter().filter(|g| g.plain_name() == wanted.as_bytes());
    let mut real = grids.iter().filter(|g| g.scalar().is_some());
    let reason = match (exact, named.next(), named.next(), real.next(), real.next()) {
        (Some(grid), ..) | (_, Some(grid), None, ..) => return Ok(grid),
        (_, Some(_), Some(_), ..) => format!("it has several grids {wanted:?}"),
        (_, None, _, Some(grid), None) if name.is_none() => return Ok(grid),
        (_, None, _, None, _) if name.is_none() => "it has no grid of floats".to_string(),
        (_, None, ..) if name.is_none() => {
            format!("it has no grid {wanted:?}, but several that could be meant; name one")
        }
        _ => format!("it has no grid {wanted:?}"),
    };
    let mut list: Vec<_> = grids
        .iter()
        .take(LISTED)
        .map(|g| format!("{:?} of type {}", g.name, g.kind))
        .collect();
    match grids.len() {
        0 => list.push("none".into()),
        n if n > LISTED => list.push(format!("{} more", n - LISTED)),
        _ => {}
    }
    Err(format!("{reason}. Its grids: {}", list.join(", ")).into())
}

fn density(bytes: Bytes, grids: &[Grid], grid: &Grid) -> Result<RawDensity, Flaw> {
    let unsupported = |g: &Grid| {
        Flaw::from(format!(
            "its type is {}; expected Tree_float_5_4_3, Tree_double_5_4_3 or Tree_half_5_4_3",
            g.kind
        ))
    };
    if grid.scalar().is_none() {
        return Err(unsupported(grid));
    }
    let (header, mut topology) = Header::read(bytes, grid)?;
    if header.class == b"level set" {
        return Err("it is a level set, distances from a surface; expected a fog volume, densities".into());
    }
    let (mut owner, mut owner_header) = (grid, header);
    if !grid.parent.is_empty() {
        let parent = grids.iter().find(|g| g.unique == grid.parent && g.parent.is_empty());
        owner = parent.ok_or_else(|| {
            let parent = String::from_utf8_lossy(grid.parent);
            format!("the grid {parent:?}, whose tree it shares, has no tree or is not there")
        })?;
        let to_object = owner_header.to_object;
        (owner_header, topology) = Header::read(bytes, owner)?;
        owner_header.to_object = to_object;
    }
    let (scalar, as_half) = owner.scalar().ok_or_else(|| unsupported(owner))?;
    let storage = Storage {
        scalar,
        as_half: owner_header.as_half.unwrap_or(as_half),
        compression: owner_header.compression,
        blocks: owner.blocks,
    };
    let cores = tree::read(&mut topology, &storage)?;
    let brick = |key: &[i32; 3]| IVec3::from(*key);
    let low = cores.keys().map(brick).reduce(IVec3::min);
    let high = cores.keys().map(brick).reduce(IVec3::max);
    let (Some(low), Some(high)) = (low, high) else {
        return Err("it is empty".into());
    };
    // One extra sample on every side, so that the density falls off to the background.
    let samples = [low * 8 - 1, (high + 1) * 8];
    Ok(RawDensity {
        cores,
        samples,
        domain: samples.map(|s| s.as_dvec3()),
        to_object: owner_header.to_object,
    })
}

/// The part before a grid's tree.
struct Header<'a> {
    compression: u32,
    class: &'a [u8],
    as_half: Option<bool>,
    to_object: DAffine3,
}

impl<'a> Header<'a> {
    /// Read the header; also returns the rest.
    fn read(mut bytes: Bytes<'a>, grid: &Grid) -> Result<(Self, Bytes<'a>), Flaw> {
        bytes.seek(grid.header, "its header")?;
        let compression = bytes.u32("its compression")?;
        let Metadata { class, as_half } = metadata(&mut bytes)?;
        let to_object = map::read(&mut bytes)?;
        Ok((
            Self {
                compression,
                class,
                as_half,
                to_object,
            },
            bytes,
        ))
    }
}

/// The relevant metadata.
#[derive(Default)]
struct Metadata<'a> {
    class: &'a [u8],
    as_half: Option<bool>,
}

fn metadata<'a>(bytes: &mut Bytes<'a>) -> Result<Metadata<'a>, Flaw> {
    const WHAT: &str = "the metadata";
    let count = bytes.count(3 * 4, "metadata")?;
    let mut metadata = Metadata::default();
    for _ in 0..count {
        let name = bytes.counted(WHAT)?;
        let kind = bytes.counted(WHAT)?;
        let value = bytes.counted(WHAT)?;
        match (name, kind) {
            (b"class", b"string") => metadata.class = value,
            (b"is_saved_as_half_float", b"bool") => metadata.as_half = Some(value != [0]),
            _ => {}
        }
    }
    Ok(metadata)
}
