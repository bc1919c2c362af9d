//! A node's values: numbers of several widths, possibly compressed, possibly without the inactive ones.

use super::blosc;
use crate::Flaw;
use crate::volume::bytes::Bytes;
use flate2::{Decompress, FlushDecompress, Status};
use half::f16;

/// A number type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scalar {
    Half,
    Float,
    Double,
}

impl Scalar {
    /// Size in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Float => 4,
            Self::Double => 8,
        }
    }

    /// A number from its bytes; zero if their count is wrong.
    fn decode(self, bytes: &[u8]) -> f32 {
        match (self, bytes) {
            (Self::Half, &[a, b]) => f16::from_le_bytes([a, b]).to_f32(),
            (Self::Float, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            (Self::Double, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32,
            _ => 0.0,
        }
    }

    pub fn read(self, bytes: &mut Bytes, what: &str) -> Result<f32, Flaw> {
        Ok(self.decode(bytes.take(self.size(), what)?))
    }
}

/// One bit per value.
#[derive(Clone, Copy)]
pub struct Mask<'a>(&'a [u8]);

impl<'a> Mask<'a> {
    pub fn read(bytes: &mut Bytes<'a>, count: usize, what: &str) -> Result<Self, Flaw> {
        Ok(Self(bytes.take(count / 8, what)?))
    }

    pub fn contains(&self, i: usize) -> bool {
        self.0.get(i / 8).is_some_and(|byte| byte >> (i % 8) & 1 == 1)
    }

    fn count(&self) -> usize {
        self.0.iter().map(|byte| byte.count_ones() as usize).sum()
    }
}

#[derive(Clone, Copy)]
enum Codec {
    None,
    Zip,
    Blosc,
}

/// Reads the values of a tree's nodes.
pub struct ValueReader {
    /// The tree's number type.
    scalar: Scalar,
    /// Whether numbers are stored as half.
    as_half: bool,
    codec: Codec,
    /// Whether inactive values are omitted if there are at most two distinct ones.
    masked: bool,
    /// The value outside the tree.
    background: f32,
    inflater: Decompress,
    unpacked: Vec<u8>,
    scratch: Vec<u8>,
}

impl ValueReader {
    /// `flags`: the grid's compression flags.
    pub fn new(scalar: Scalar, as_half: bool, flags: u32, background: f32) -> Result<Self, Flaw> {
        const ZIP: u32 = 1;
        const ACTIVE_MASK: u32 = 2;
        const BLOSC: u32 = 4;
        if flags & !(ZIP | ACTIVE_MASK | BLOSC) != 0 {
            return Err(format!(
                "its compression has flags {flags:#x}; expected 1 (zip), 2 (active mask), 4 (Blosc) or their sums"
            )
            .into());
        }
        let codec = match flags {
            _ if flags & BLOSC != 0 => Codec::Blosc,
            _ if flags & ZIP != 0 => Codec::Zip,
            _ => Codec::None,
        };
        Ok(Self {
            scalar,
            as_half,
            codec,
            masked: flags & ACTIVE_MASK != 0,
            background,
            inflater: Decompress::new(true),
            unpacked: Vec::new(),
            scratch: Vec::new(),
        })
    }

    /// Read a node's values, given which are active.
    pub fn read<'a>(&mut self, bytes: &mut Bytes<'a>, active: Mask<'a>, out: &mut [f32]) -> Result<(), Flaw> {
        const WHAT: &str = "a node's values";
        let at = bytes.position();
        // How inactive values are stored. 0: all are the background. 1: all are minus the background. 2: all are one
        // value that follows. 3 to 5: a mask selects between minus the background and the background, between a value
        // and the background, or between two values. 6: every value is stored.
        let kind = bytes.u8(WHAT)?;
        if kind > 6 {
            return Err(format!("the node at byte {at} has inactive values of kind {kind}; expected 0 to 6").into());
        }
        let mut inactive = match kind {
            0 => [self.background; 2],
            _ => [-self.background, self.background],
        };
        if matches!(kind, 2 | 4 | 5) {
            inactive[0] = self.scalar.read(bytes, WHAT)?;
        }
        if kind == 5 {
            inactive[1] = self.scalar.read(bytes, WHAT)?;
        }
        let selected = match kind {
            3..=5 => Mask::read(bytes, out.len(), WHAT)?,
            _ => Mask(&[]),
        };
        let masked = self.masked && kind != 6;
        let count = if masked { active.count() } else { out.len() };
        let number = if self.as_half { Scalar::Half } else { self.scalar };
        // With zero halves there is not even an empty chunk.
        let stored = match self.as_half && count == 0 {
            true => &[],
            false => self.unpack(bytes, count * number.size())?,
        };
        let mut stored = stored.chunks_exact(number.size()).map(|b| number.decode(b));
        for (i, value) in out.iter_mut().enumerate() {
            *value = match !masked || active.contains(i) {
                true => stored.next().unwrap_or_default(),
                false => inactive[usize::from(selected.contains(i))],
            };
        }
        Ok(())
    }

    /// Read a chunk that unpacks to the given size.
    fn unpack<'b, 'a: 'b>(&'b mut self, bytes: &mut Bytes<'a>, size: usize) -> Result<&'b [u8], Flaw> {
        const WHAT: &str = "a node's values";
        if matches!(self.codec, Codec::None) {
            return bytes.take(size, WHAT);
        }
        let at = bytes.position();
        let length = bytes.i64(WHAT)?;
        let flaw = |found: String| Flaw::from(format!("the chunk at byte {at} {found}"));
        let magnitude = usize::try_from(length.unsigned_abs()).unwrap_or(usize::MAX);
        if length <= 0 {
            // A chunk stored uncompressed, since compression would not have made it smaller.
            return match magnitude == size {
                true => bytes.take(size, WHAT),
                false => Err(flaw(format!("holds {magnitude} bytes; expected {size}"))),
            };
        }
        let packed = bytes.take(magnitude, WHAT)?;
        self.unpacked.resize(size, 0);
        match self.codec {
            Codec::Blosc => {
                blosc::decompress(packed, &mut self.unpacked, &mut self.scratch).map_err(flaw)?;
            }
            _ => {
                self.inflater.reset(true);
                let status = self
                    .inflater
                    .decompress(packed, &mut self.unpacked, FlushDecompress::Finish);
                if !matches!(status, Ok(Status::StreamEnd)) || self.inflater.total_out() != size as u64 {
                    return Err(flaw(format!("is not zlib data of {size} bytes")));
                }
            }
        }
        Ok(&self.unpacked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACTIVE: [u8; 64] = [0b0000_0011; 64];
    const SELECTED: [u8; 64] = [0b0000_0110; 64];

    fn read(compression: u32, bytes: &[u8]) -> Result<Vec<f32>, Flaw> {
        let mut values = vec![f32::NAN; 512];
        let mut reader = ValueReader::new(Scalar::Float, false, compression, 3.0)?;
        let mut bytes = Bytes::new(bytes);
        reader.read(&mut bytes, Mask(&ACTIVE), &mut values)?;
        assert_eq!(bytes.left(), 0);
        Ok(values)
    }

    fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
        values.into_iter().flat_map(f32::to_le_bytes).collect()
    }

    /// All kinds of inactive values, also those that need a non-zero background. Of every 8 values, the first two are
    /// active, and the second and third are selected.
    #[test]
    fn inactive_values_are_restored() {
        let stored: Vec<f32> = (0..128).map(|i| i as f32).collect();
        for (kind, given, inactive) in [
            (0, &[][..], [3.0, 3.0]),
            (1, &[], [-3.0, -3.0]),
            (2, &[7.0], [7.0, 7.0]),
            (3, &[], [-3.0, 3.0]),
            (4, &[7.0], [7.0, 3.0]),
            (5, &[7.0, 8.0], [7.0, 8.0]),
        ] {
            let mut bytes = vec![kind];
            bytes.extend(floats(given.iter().copied()));
            bytes.extend(&SELECTED[..if kind >= 3 { 64 } else { 0 }]);
            bytes.extend(floats(stored.iter().copied()));
            let values = read(2, &bytes).unwrap();
            let [unselected, selected] = inactive;
            for (i, eight) in values.chunks(8).enumerate() {
                let (a, b) = (stored[2 * i], stored[2 * i + 1]);
                let rest = [unselected; 5];
                assert_eq!(eight[..3], [a, b, selected], "{kind}");
                assert_eq!(eight[3..], rest, "{kind}");
            }
        }
    }

    #[test]
    fn every_value_is_stored_without_a_mask() {
        let stored: Vec<f32> = (0..512).map(|i| i as f32).collect();
        let mut plain = vec![6];
        plain.extend(floats(stored.iter().copied()));
        let mut chunk = vec![6];
        chunk.extend((-2048i64).to_le_bytes());
        chunk.extend(&plain[1..]);
        for (compression, bytes) in [(0, &plain), (2, &plain), (1, &chunk), (4, &chunk), (7, &chunk)] {
            assert_eq!(read(compression, bytes).unwrap(), stored, "{compression}");
        }
        // A kind without a mask has nothing to restore if inactive values are stored.
        plain[0] = 0;
        assert_eq!(read(0, &plain).unwrap(), stored);
    }

    #[test]
    fn zlib_data_must_have_the_expected_size() {
        let compress = |size: usize| {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
            std::io::Write::write_all(&mut encoder, &vec![0; size]).unwrap();
            let packed = encoder.finish().unwrap();
            let mut bytes = vec![6];
            bytes.extend((packed.len() as i64).to_le_bytes());
            bytes.extend(packed);
            bytes
        };
        assert_eq!(read(1, &compress(2048)).unwrap(), [0.0; 512]);
        // The last one is 1000 times smaller than its unpacked size.
        for size in [0, 2047, 2049, 1 << 22] {
            let flaw = read(1, &compress(size)).unwrap_err();
            assert!(
                flaw.message.contains("is not zlib data of 2048 bytes"),
                "{}",
                flaw.message
            );
        }
    }
}
