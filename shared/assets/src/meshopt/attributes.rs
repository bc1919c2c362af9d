//! Elements coded by byte differences, mode 0.

use super::Input;
use crate::Flaw;

/// Elements per group.
const GROUP: usize = 16;
/// The most bytes and the most elements of a block.
const BLOCK_BYTES: usize = 8192;
const BLOCK: usize = 256;

/// How differences become elements, per four bytes of an element.
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Words,
    /// Rotated by that many bits.
    Xor(u32),
}

impl Channel {
    fn of(mode: u8) -> Result<Self, Flaw> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, turn) => Ok(Self::Xor(u32::from(turn))),
            _ => Err(format!("it has a channel of the mode {mode}, which is not known").into()),
        }
    }

    /// The four bytes after `last`.
    fn next(self, last: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|i| {
                let d = delta[i];
                last[i].wrapping_add((d >> 1) ^ (d & 1).wrapping_neg())
            }),
            Self::Words => {
                let word = |b: [u8; 4], i: usize| u16::from_le_bytes([b[2 * i], b[2 * i + 1]]);
                let next = |i: usize| {
                    let d = word(delta, i);
                    word(last, i).wrapping_add((d >> 1) ^ (d & 1).wrapping_neg())
                };
                let [a, b] = [next(0), next(1)].map(u16::to_le_bytes);
                [a[0], a[1], b[0], b[1]]
            }
            Self::Xor(turn) => {
                let turned = u32::from_le_bytes(delta).rotate_right(turn);
                (turned ^ u32::from_le_bytes(last)).to_le_bytes()
            }
        }
    }
}

pub fn decode(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Flaw> {
    let is_new = match bytes.first() {
        Some(0xa0) => false,
        Some(0xa1) => true,
        _ => return Err("its packed elements begin with neither 0xa0 nor 0xa1".into()),
    };
    let channels = stride / 4;
    let (tail, least) = if is_new { (stride + channels, 24) } else { (stride, 32) };
    let end = bytes.len().checked_sub(tail.max(least)).filter(|end| *end > 0);
    let mut input = Input(&bytes[1..end.ok_or("its packed bytes end early")?]);
    let (base, modes) = bytes[bytes.len() - tail..].split_at(stride);
    let modes = match is_new {
        true => modes
            .iter()
            .map(|mode| Channel::of(*mode))
            .collect::<Result<Vec<_>, _>>()?,
        false => vec![Channel::Bytes; channels],
    };
    let most = ((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK);
    let mut last = base.to_vec();
    let mut deltas = vec![0; stride * BLOCK];
    let mut elements = Vec::new();
    let mut left = count;
    while left > 0 {
        let block = left.min(most);
        left -= block;
        let control = if is_new { input.take(channels)? } else { &[] };
        for (i, plane) in deltas.chunks_exact_mut(BLOCK).enumerate() {
            let mode = control.get(i / 4).map(|byte| (byte >> (2 * (i % 4))) & 3);
            read_plane(&mut input, mode, block, plane)?;
        }
        for i in 0..block {
            for (c, channel) in modes.iter().enumerate() {
                let delta = std::array::from_fn(|b| deltas[(4 * c + b) * BLOCK + i]);
                if let Some(last) = last[4 * c..].first_chunk_mut() {
                    *last = channel.next(*last, delta);
                }
            }
            elements.extend_from_slice(&last);
        }
    }
    input.end()?;
    Ok(elements)
}

/// The differences of one byte of `block` elements. `mode`: in version 1.
fn read_plane(input: &mut Input<'_>, mode: Option<u8>, block: usize, plane: &mut [u8]) -> Result<(), Flaw> {
    let widths = match mode {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => {
            plane.fill(0);
            return Ok(());
        }
        Some(_) => {
            plane[..block].copy_from_slice(input.take(block)?);
            return Ok(());
        }
    };
    let groups = block.div_ceil(GROUP);
    let header = input.take(groups.div_ceil(4))?;
    for (g, group) in plane.chunks_exact_mut(GROUP).take(groups).enumerate() {
        let width = widths[usize::from((header[g / 4] >> (2 * (g % 4))) & 3)];
        read_group(input, width, group)?;
    }
    Ok(())
}

/// Differences of `width` bits; those with all bits set are stored as bytes that follow.
fn read_group(input: &mut Input<'_>, width: usize, group: &mut [u8]) -> Result<(), Flaw> {
    match width {
        0 => group.fill(0),
        8 => group.copy_from_slice(input.take(GROUP)?),
        _ => {
            let packed = input.take(GROUP * width / 8)?;
            let (in_byte, all) = (8 / width, (1 << width) - 1);
            for (i, delta) in group.iter_mut().enumerate() {
                let place = match width {
                    1 => i % in_byte,
                    _ => in_byte - 1 - i % in_byte,
                };
                let bits = (packed[i / in_byte] >> (place * width)) & all;
                *delta = if bits == all { input.byte()? } else { bits };
            }
        }
    }
    Ok(())
}
