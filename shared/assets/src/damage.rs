//! Damaged copies of files, for tests.

use beamfarm_render::sampler::{Purpose, Sampler};

/// Feed `read` many damaged copies of good files: bytes changed, pieces cut out, and the end cut off.
pub fn damage(files: &[Vec<u8>], read: impl Fn(&[u8])) {
    for (i, file) in files.iter().enumerate() {
        for copy in 0..2000 {
            let mut sampler = Sampler::new(1, i as u64, Purpose::Test, copy);
            let mut bytes = file.clone();
            let mut below = |n: usize| sampler.next_u32() as usize % n.max(1);
            for _ in 0..=below(4) {
                let at = below(bytes.len());
                let value = [0, 1, b'9', b'-', b' ', b'\n', 0x7f, 0xff, 0x80][below(9)];
                match below(8) {
                    0 => bytes.truncate(at),
                    1 => drop(bytes.drain(at..(at + 1 + below(8)).min(bytes.len()))),
                    2 => bytes.insert(at, value),
                    _ if at < bytes.len() => bytes[at] = value,
                    _ => {}
                }
            }
            read(&bytes);
        }
    }
}
