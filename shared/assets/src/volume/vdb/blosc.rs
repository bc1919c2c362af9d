//! Blosc 1 chunks of LZ4 data, as OpenVDB writes them. Format: c-blosc's README_CHUNK_FORMAT.

const HEADER: usize = 16;
/// Flag bits in the header.
const SHUFFLED: u8 = 1;
const COPIED: u8 = 2;
const BIT_SHUFFLED: u8 = 4;
const RESERVED: u8 = 8;
const WHOLE: u8 = 16;
/// A block of multi-byte values may be split into one stream per byte, within these limits.
const MAX_SPLITS: usize = 16;
const MIN_SPLIT: usize = 128;

/// Decompress a chunk of exactly `out.len()` bytes. `scratch` is working space.
pub fn decompress(chunk: &[u8], out: &mut [u8], scratch: &mut Vec<u8>) -> Result<(), String> {
    let Some((header, _)) = chunk.split_first_chunk::<HEADER>() else {
        return Err("is shorter than its header".into());
    };
    let number = |i: usize| u32_at(header, i).unwrap_or_default();
    let [version, _, flags, type_size, ..] = *header;
    let (size, block, compressed) = (number(4), number(8), number(12));
    if version != 2 {
        return Err(format!("has format version {version}; expected 2"));
    }
    if size != out.len() || compressed != chunk.len() {
        return Err(format!(
            "says that it takes {compressed} bytes and holds {size}; expected {} and {}",
            chunk.len(),
            out.len()
        ));
    }
    if out.is_empty() {
        return Ok(());
    }
    if flags & COPIED != 0 {
        let content = &chunk[HEADER..];
        if content.len() != out.len() {
            return Err(format!("holds {} bytes; expected {}", content.len(), out.len()));
        }
        out.copy_from_slice(content);
        return Ok(());
    }
    let codec = flags >> 5;
    if codec != 1 {
        let name = ["BloscLZ", "LZ4", "Snappy", "zlib", "Zstandard"].get(usize::from(codec));
        let name = name.unwrap_or(&"an unknown codec");
        return Err(format!("is compressed by {name}; expected LZ4"));
    }
    let type_size = usize::from(type_size);
    if flags & (BIT_SHUFFLED | RESERVED) != 0 || type_size == 0 || block == 0 {
        return Err(format!(
            "has flags {flags:#x}, {type_size} bytes a value, and blocks of {block} bytes, which are unsupported"
        ));
    }
    for (i, out) in out.chunks_mut(block).enumerate() {
        let mut at = u32_at(chunk, HEADER + 4 * i).ok_or("lacks the offset of a block")?;
        let may_split = flags & WHOLE == 0 && type_size <= MAX_SPLITS;
        let splits = match may_split && out.len() == block && block / type_size >= MIN_SPLIT {
            true => type_size,
            false => 1,
        };
        if out.len() % splits != 0 {
            return Err(format!("has a block of {block} bytes in {splits} parts"));
        }
        scratch.resize(out.len(), 0);
        for part in scratch.chunks_mut(out.len() / splits) {
            let length = u32_at(chunk, at).ok_or("lacks the length of a block")?;
            let data = chunk.get(at + 4..).and_then(|rest| rest.get(..length));
            let data = data.ok_or("ends within a block")?;
            if data.len() == part.len() {
                part.copy_from_slice(data);
            } else {
                let written = lz4_flex::block::decompress_into(data, part);
                if written.ok() != Some(part.len()) {
                    return Err("has a block that is not LZ4 data of its length".into());
                }
            }
            at += 4 + length;
        }
        match flags & SHUFFLED != 0 && type_size > 1 {
            true => unshuffle(scratch, type_size, out),
            false => out.copy_from_slice(scratch),
        }
    }
    Ok(())
}

/// Undo a shuffle: first the first bytes of all values, then the second bytes, and so on, then the bytes of an
/// incomplete value.
fn unshuffle(shuffled: &[u8], type_size: usize, out: &mut [u8]) {
    let values = out.len() / type_size;
    let whole = values * type_size;
    for (byte, plane) in shuffled[..whole].chunks_exact(values.max(1)).enumerate() {
        for (value, source) in out.chunks_exact_mut(type_size).zip(plane) {
            value[byte] = *source;
        }
    }
    out[whole..].copy_from_slice(&shuffled[whole..]);
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let number = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*number)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(name: &str) -> Vec<u8> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/volumes/");
        std::fs::read(format!("{folder}{name}.blosc")).unwrap()
    }

    fn unpack(chunk: &[u8], count: usize) -> Result<Vec<f32>, String> {
        let mut out = vec![0; 4 * count];
        decompress(chunk, &mut out, &mut vec![7; 100])?;
        let (floats, _) = out.as_chunks();
        Ok(floats.iter().copied().map(f32::from_le_bytes).collect())
    }

    /// The values that `write_vdb.cpp` compresses.
    fn values(count: usize) -> Vec<f32> {
        let noise = |i: usize| {
            let h = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let h = (h ^ h >> 31).wrapping_mul(0xd6e8_feb8_6659_fd93);
            ((h ^ h >> 32) >> 40) as f32 / (1 << 24) as f32
        };
        let value = |i| match i < count - 101 {
            true => (i % 37) as f32,
            false => noise(i),
        };
        (0..count).map(value).collect()
    }

    #[test]
    fn chunks_of_c_blosc_are_unpacked() {
        for name in ["whole", "split", "blocks", "unshuffled", "copied"] {
            assert_eq!(unpack(&chunk(name), 701).unwrap(), values(701), "{name}");
        }
        assert_eq!(unpack(&chunk("split_blocks"), 20_001).unwrap(), values(20_001));
        for (name, reason) in [
            ("blosclz", "compressed by BloscLZ; expected LZ4"),
            ("zlib", "compressed by zlib; expected LZ4"),
            ("bits", "flags 0x34"),
        ] {
            let error = unpack(&chunk(name), 701).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
        let error = unpack(&chunk("whole"), 700).unwrap_err();
        assert!(error.contains("holds 2804; expected 523 and 2800"), "{error}");
    }

    #[test]
    fn damage_does_not_panic() {
        for (name, count) in [
            ("whole", 701),
            ("split", 701),
            ("blocks", 701),
            ("copied", 701),
            ("split_blocks", 20_001),
        ] {
            let bytes = chunk(name);
            for length in 0..bytes.len() {
                assert!(unpack(&bytes[..length], count).is_err(), "{name} {length}");
            }
            crate::damage::damage(&[bytes], |bytes| {
                let _ = unpack(bytes, count);
                // And with a matching header.
                if let Some((header, rest)) = bytes.split_first_chunk::<16>() {
                    let mut header = *header;
                    header[0] = 2;
                    header[4..8].copy_from_slice(&(4 * count as u32).to_le_bytes());
                    header[12..].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
                    let _ = unpack(&[&header, rest].concat(), count);
                }
            });
        }
    }
}
