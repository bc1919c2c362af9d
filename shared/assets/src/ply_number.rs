//! Numbers of binary PLY files.

use ply_rs_bw::ply::{Encoding, ScalarType};

/// A number type in the file's byte order.
#[derive(Clone)]
pub struct Number {
    /// Its type.
    pub kind: ScalarType,
    /// Whether it is big-endian.
    pub is_big: bool,
}

/// Size of a type, bytes.
pub fn size(kind: &ScalarType) -> usize {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Whether the byte order is big-endian; `None`: the file is text.
pub fn is_big(encoding: &Encoding) -> Option<bool> {
    match encoding {
        Encoding::Ascii => None,
        Encoding::BinaryBigEndian => Some(true),
        Encoding::BinaryLittleEndian => Some(false),
    }
}

/// The first bytes in little-endian order, padded with zeros.
fn first<const N: usize>(bytes: &[u8], is_big: bool) -> [u8; N] {
    let mut own = bytes.first_chunk().copied().unwrap_or([0; N]);
    if is_big {
        own.reverse();
    }
    own
}

impl Number {
    /// The number at the front of `bytes`.
    pub fn float(&self, bytes: &[u8]) -> f64 {
        match self.kind {
            ScalarType::Float => f32::from_le_bytes(first(bytes, self.is_big)).into(),
            ScalarType::Double => f64::from_le_bytes(first(bytes, self.is_big)),
            _ => self.whole(bytes) as f64,
        }
    }

    /// The integer at the front of `bytes`.
    pub fn whole(&self, bytes: &[u8]) -> i64 {
        let is_big = self.is_big;
        match self.kind {
            ScalarType::Char => i8::from_le_bytes(first(bytes, is_big)).into(),
            ScalarType::UChar => u8::from_le_bytes(first(bytes, is_big)).into(),
            ScalarType::Short => i16::from_le_bytes(first(bytes, is_big)).into(),
            ScalarType::UShort => u16::from_le_bytes(first(bytes, is_big)).into(),
            ScalarType::Int => i32::from_le_bytes(first(bytes, is_big)).into(),
            ScalarType::UInt => u32::from_le_bytes(first(bytes, is_big)).into(),
            ScalarType::Float | ScalarType::Double => 0,
        }
    }
}
