//! Checkpoints: the sum of the passes in one file, with a checksum that shows whether it is intact.
//!
//! A header (magic, format, length of the rest, BLAKE3 of the rest), then the rest; all numbers little-endian.

use super::Description;
use crate::farm::Snapshot;
use beamfarm_image::bias::RadiusSums;
use beamfarm_image::film::Film;
use beamfarm_image::job::{Block, PassStats};
use beamfarm_image::layer::LayerCounts;
use beamfarm_image::matte::Matte;
use beamfarm_image::merge::{Errors, Node, PERCENTILES, TreeSum};
use std::io::{self, Read, Seek, SeekFrom, Write};

const MAGIC: [u8; 8] = *b"BEAMSUM\n";
const FORMAT: u32 = 3;
const HEADER: usize = 8 + 4 + 8 + 32;
/// Bytes that are read or written at a time.
const BUFFER: usize = 1 << 16;
/// Enough for all boundaries below 2^53 passes.
const MAX_TESTED: u32 = 128;
/// The most nodes of a sum: more gaps than any job has.
const MAX_NODES: u32 = 1 << 24;

/// The state of a job.
#[derive(Clone, Debug)]
pub struct Checkpoint {
    /// The checkpoints of a job are numbered.
    pub number: u64,
    /// The sum of the passes that are done.
    pub sum: TreeSum,
    /// Prefixes that were tested, with their errors.
    pub tested: Vec<(u64, Errors)>,
    /// Statistics of the passes.
    pub stats: PassStats,
    /// Time spent on the job, seconds.
    pub seconds: f64,
    /// Length of the ledger file in bytes up to which the sum follows its lines. The sum may or may not include later
    /// ones.
    pub ledger: u64,
}

/// The dimensions of a job's sum, and the job that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Numbers of layers.
    pub layers: LayerCounts,
    /// First pass.
    pub first_pass: u64,
    /// Digest of the job's description.
    pub digest: [u8; 32],
}

impl Shape {
    /// The shape of a described job.
    pub(super) fn of(description: &Description) -> Self {
        Self {
            width: description.width,
            height: description.height,
            layers: LayerCounts::of_names(&description.layers),
            first_pass: description.first_pass,
            digest: description.digest(),
        }
    }

    /// The sum of no passes.
    pub fn empty_sum(&self) -> TreeSum {
        let sum = TreeSum::new(self.width, self.height).with_layers(self.layers);
        match self.first_pass {
            0 => sum.with_fence(0),
            first_pass => sum.with_first_pass(first_pass),
        }
    }
}

/// Why a file is not a checkpoint of the job.
#[derive(Debug, thiserror::Error)]
pub enum Damage {
    /// It cannot be read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It does not contain what was written.
    #[error("{0}")]
    Content(String),
}

fn damaged<T>(what: impl Into<String>) -> Result<T, Damage> {
    Err(Damage::Content(what.into()))
}

/// Passes bytes on and hashes them.
struct Hashing<W> {
    inner: W,
    hasher: blake3::Hasher,
    length: u64,
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        self.length += written as u64;
        Ok(written)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl Checkpoint {
    /// A checkpoint without passes.
    pub fn new(shape: &Shape) -> Self {
        Self {
            number: 0,
            sum: shape.empty_sum(),
            tested: Vec::new(),
            stats: PassStats::default(),
            seconds: 0.0,
            ledger: 0,
        }
    }

    /// A checkpoint of a snapshot. `ledger`: length of the ledger file in bytes. Its number is set when it is saved.
    pub fn of(snapshot: Snapshot, ledger: u64) -> Self {
        let Snapshot {
            sum,
            tested,
            stats,
            seconds,
        } = snapshot;
        Self {
            number: 0,
            sum,
            tested,
            stats,
            seconds,
            ledger,
        }
    }

    /// Write the whole file. Needs little memory.
    pub fn write(&self, digest: &[u8; 32], mut file: impl Write + Seek) -> io::Result<()> {
        file.write_all(&[0; HEADER])?;
        let hashing = Hashing {
            inner: &mut file,
            hasher: blake3::Hasher::new(),
            length: 0,
        };
        let mut out = io::BufWriter::with_capacity(BUFFER, hashing);
        self.write_content(digest, &mut out)?;
        out.flush()?;
        let Hashing { hasher, length, .. } = out.get_ref();
        let mut header = Vec::with_capacity(HEADER);
        header.extend(MAGIC);
        header.extend(FORMAT.to_le_bytes());
        header.extend(length.to_le_bytes());
        header.extend(hasher.finalize().as_bytes());
        drop(out);
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&header)?;
        file.flush()
    }

    fn write_content(&self, digest: &[u8; 32], out: &mut impl Write) -> io::Result<()> {
        let Self { sum, stats, .. } = self;
        out.write_all(digest)?;
        for number in [
            self.number,
            stats.paths,
            stats.beams,
            stats.beam_bytes,
            stats.surface_photons,
            stats.beam_evaluations,
            stats.non_finite,
            sum.fence().unwrap_or(0),
            self.ledger,
        ] {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&self.seconds.to_le_bytes())?;
        out.write_all(&(self.tested.len() as u32).to_le_bytes())?;
        for (passes, errors) in &self.tested {
            out.write_all(&passes.to_le_bytes())?;
            for error in [errors.image].iter().chain(&errors.percentiles) {
                out.write_all(&error.to_le_bytes())?;
            }
        }
        out.write_all(&(sum.nodes().count() as u32).to_le_bytes())?;
        for node in sum.nodes() {
            out.write_all(&node.block.level.to_le_bytes())?;
            out.write_all(&node.block.index.to_le_bytes())?;
            write_film(&node.sum, out)?;
            if node.block.level > 0 {
                write_film(&node.squared_difference, out)?;
            }
            for layer in &node.layers {
                write_film(layer, out)?;
            }
            for matte in &node.mattes {
                let bytes = matte
                    .to_bytes()
                    .ok_or_else(|| io::Error::other("too many objects or materials in its pixels"))?;
                out.write_all(&(bytes.len() as u64).to_le_bytes())?;
                out.write_all(&bytes)?;
            }
            match &node.radius_sums {
                None => out.write_all(&[0])?,
                Some(sums) => {
                    out.write_all(&[1])?;
                    out.write_all(&sums.to_bytes())?;
                }
            }
        }
        Ok(())
    }

    /// Read a file that [`Self::write`] wrote, for a job of this shape. Any changed byte is detected.
    pub fn read(shape: &Shape, mut file: impl Read + Seek) -> Result<Self, Damage> {
        let size = file.seek(SeekFrom::End(0))?;
        if size < HEADER as u64 {
            return damaged(format!("{size} bytes, which is too short"));
        }
        file.seek(SeekFrom::Start(0))?;
        let mut input = Input(io::BufReader::with_capacity(BUFFER, &mut file));
        if input.array()? != MAGIC {
            return damaged("not a checkpoint");
        }
        match input.u32()? {
            FORMAT => {}
            other => {
                return damaged(format!(
                    "format {other}, of another version of beamfarm; expected {FORMAT}"
                ));
            }
        }
        let (length, expected) = (input.u64()?, size - HEADER as u64);
        if length != expected {
            return damaged(format!("{expected} bytes of content; expected {length}"));
        }
        let hash: [u8; 32] = input.array()?;
        let mut hasher = blake3::Hasher::new();
        let mut buffer = [0; BUFFER];
        loop {
            match input.0.read(&mut buffer)? {
                0 => break,
                read => hasher.update(&buffer[..read]),
            };
        }
        if hasher.finalize() != blake3::Hash::from_bytes(hash) {
            return damaged("the checksum is wrong");
        }
        input.0.seek(SeekFrom::Start(HEADER as u64))?;
        Self::read_content(shape, length, input)
    }

    fn read_content<R: Read>(shape: &Shape, length: u64, mut input: Input<R>) -> Result<Self, Damage> {
        if input.array()? != shape.digest {
            return damaged("it belongs to another job");
        }
        let number = input.u64()?;
        let stats = PassStats {
            paths: input.u64()?,
            beams: input.u64()?,
            beam_bytes: input.u64()?,
            surface_photons: input.u64()?,
            beam_evaluations: input.u64()?,
            non_finite: input.u64()?,
        };
        let fence = input.u64()?;
        let ledger = input.u64()?;
        let seconds = input.f64()?;
        let tested = input.u32()?;
        if tested > MAX_TESTED {
            return damaged(format!("{tested} tested prefixes"));
        }
        let mut boundaries = Vec::new();
        for _ in 0..tested {
            let passes = input.u64()?;
            let mut errors = Errors::UNKNOWN;
            errors.image = input.f64()?;
            for error in &mut errors.percentiles {
                *error = input.f64()?;
            }
            boundaries.push((passes, errors));
        }
        let mut sum = shape.empty_sum();
        if fence > 0 {
            sum = sum.with_fence(fence);
        }
        let nodes = input.u32()?;
        if nodes > MAX_NODES {
            return damaged(format!("{nodes} nodes"));
        }
        // Check before memory is allocated.
        let pixels = u64::from(shape.width) * u64::from(shape.height);
        if nodes > 0 && pixels.saturating_mul(12) > length {
            return damaged(format!("{length} bytes of content, which is less than an image"));
        }
        debug_assert_eq!(PERCENTILES, 100);
        for _ in 0..nodes {
            let node = input.node(shape)?;
            if node.block.start() < shape.first_pass {
                return damaged(format!("{} is before the first", node.block));
            }
            if let Err(error) = sum.insert(node) {
                return damaged(error.to_string());
            }
        }
        if input.0.read(&mut [0])? != 0 {
            return damaged("more behind its end");
        }
        Ok(Self {
            number,
            sum,
            tested: boundaries,
            stats,
            seconds,
            ledger,
        })
    }
}

fn write_film(film: &Film, out: &mut impl Write) -> io::Result<()> {
    let mut buffer = Vec::with_capacity(BUFFER);
    for pixels in film.pixels.chunks(BUFFER / 12) {
        buffer.clear();
        buffer.extend(pixels.iter().flatten().flat_map(|value| value.to_le_bytes()));
        out.write_all(&buffer)?;
    }
    Ok(())
}

struct Input<R>(R);

impl<R: Read> Input<R> {
    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.0.read_exact(&mut bytes)?;
        Ok(bytes)
    }
    fn u32(&mut self) -> io::Result<u32> {
        self.array().map(u32::from_le_bytes)
    }
    fn u64(&mut self) -> io::Result<u64> {
        self.array().map(u64::from_le_bytes)
    }
    fn f64(&mut self) -> io::Result<f64> {
        self.array().map(f64::from_le_bytes)
    }

    fn film(&mut self, shape: &Shape) -> io::Result<Film> {
        let mut film = Film::new(shape.width, shape.height);
        let mut buffer = [0; BUFFER / 12 * 12];
        for pixels in film.pixels.chunks_mut(BUFFER / 12) {
            let bytes = &mut buffer[..12 * pixels.len()];
            self.0.read_exact(bytes)?;
            let values = pixels.iter_mut().flatten();
            for (value, bytes) in values.zip(bytes.as_chunks().0) {
                *value = f32::from_le_bytes(*bytes);
            }
        }
        Ok(film)
    }

    fn matte(&mut self, shape: &Shape) -> Result<Matte, Damage> {
        let pixels = shape.width as usize * shape.height as usize;
        let length = self.u64()?;
        if length > Matte::max_bytes(pixels) as u64 {
            return damaged(format!("a matte of {length} bytes"));
        }
        let mut bytes = vec![0; length as usize];
        self.0.read_exact(&mut bytes)?;
        match Matte::from_bytes(&bytes, pixels) {
            Some((matte, read)) if read == bytes.len() => Ok(matte),
            _ => damaged("a matte that says more than it holds"),
        }
    }

    fn node(&mut self, shape: &Shape) -> Result<Node, Damage> {
        let (level, index) = (self.u32()?, self.u64()?);
        let Some(block) = Block::new(level, index) else {
            return damaged(format!("block {index} of level {level}"));
        };
        let sum = self.film(shape)?;
        let squared_difference = match level {
            0 => Film::new(shape.width, shape.height),
            _ => self.film(shape)?,
        };
        let layers = (0..shape.layers.films).map(|_| self.film(shape));
        let layers = layers.collect::<io::Result<_>>()?;
        let mattes = (0..shape.layers.mattes).map(|_| self.matte(shape));
        let mattes = mattes.collect::<Result<_, _>>()?;
        let radius_sums = match self.array()? {
            [0] => None,
            _ => {
                let mut bytes = vec![0; RadiusSums::byte_count(shape.width, shape.height)];
                self.0.read_exact(&mut bytes)?;
                RadiusSums::from_bytes(&bytes)
            }
        };
        Ok(Node {
            block,
            sum,
            squared_difference,
            layers,
            mattes,
            radius_sums,
        })
    }
}

#[cfg(test)]
pub(super) mod tests;
