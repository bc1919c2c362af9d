//! What covers each pixel, by name: sums over passes with the same bits whoever adds them up, and the ranks that
//! compositors use for masks.
//!
//! In one pass, a pixel holds what its camera ray meets first; in a sum of passes, how often each name was met. The
//! final image follows the Cryptomatte convention (Friedman and Jones 2015; specification 1.2.0): pairs of id and
//! coverage, the largest coverage first, in channels NAME00.R, .G, .B, .A, NAME01.R, ..., with a manifest of names in
//! the header.

use std::cmp::Ordering;

/// How often a pixel's rays met something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The name's [`id_of_name`].
    pub id: u32,
    /// Number of passes, at least one.
    pub passes: u32,
}

/// Every pixel's entries, ascending by id.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matte {
    /// By pixel: where its entries end.
    ends: Vec<u32>,
    entries: Vec<Entry>,
}

/// Pairs of id and coverage per pixel in a final image: three layers of four channels.
pub const RANKS: usize = 6;

/// The id of a pixel that nothing covers. No name has it.
pub const NOTHING: u32 = 0;

/// Most entries of a block's matte: 32 per pixel, or 2^20 if that is more.
fn max_entries(pixels: usize) -> usize {
    pixels.saturating_mul(32).max(1 << 20).min(u32::MAX as usize)
}

impl Matte {
    /// The matte of one pass. `ids`: by pixel, the id of what was met, or [`NOTHING`].
    pub fn leaf(ids: &[u32]) -> Self {
        let mut matte = Self::default();
        for id in ids {
            if *id != NOTHING {
                matte.entries.push(Entry { id: *id, passes: 1 });
            }
            matte.ends.push(matte.entries.len() as u32);
        }
        matte
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.ends.len()
    }

    /// The entries of each pixel.
    pub fn by_pixel(&self) -> impl Iterator<Item = &[Entry]> {
        let mut start = 0;
        self.ends.iter().map(move |end| {
            let entries = &self.entries[start..*end as usize];
            start = *end as usize;
            entries
        })
    }

    /// The sum of two mattes of the same size.
    pub fn joined(&self, other: &Self) -> Self {
        let mut sum = Self {
            ends: Vec::with_capacity(self.ends.len()),
            entries: Vec::with_capacity(self.entries.len().max(other.entries.len())),
        };
        for (mut left, mut right) in self.by_pixel().zip(other.by_pixel()) {
            while let (Some(l), Some(r)) = (left.first(), right.first()) {
                let order = l.id.cmp(&r.id);
                sum.entries.push(match order {
                    Ordering::Less => *l,
                    Ordering::Greater => *r,
                    Ordering::Equal => Entry {
                        id: l.id,
                        passes: l.passes.saturating_add(r.passes),
                    },
                });
                left = &left[usize::from(order.is_le())..];
                right = &right[usize::from(order.is_ge())..];
            }
            sum.entries.extend_from_slice(left);
            sum.entries.extend_from_slice(right);
            sum.ends.push(sum.entries.len() as u32);
        }
        sum
    }

    /// Whether it can be the sum of this many passes over this many pixels.
    pub fn is_sound(&self, pixels: usize, passes: u64) -> bool {
        let sound = |entries: &[Entry]| {
            let sum: u64 = entries.iter().map(|entry| u64::from(entry.passes)).sum();
            let ascending = entries.windows(2).all(|pair| pair[0].id < pair[1].id);
            let named = entries.iter().all(|entry| entry.id != NOTHING && entry.passes > 0);
            ascending && named && sum <= passes
        };
        self.ends.len() == pixels && self.by_pixel().all(sound)
    }

    /// Upper bound of the length of [`Self::to_bytes`].
    pub fn max_bytes(pixels: usize) -> usize {
        4_usize.saturating_mul(pixels).saturating_add(8 * max_entries(pixels))
    }

    /// The number of entries of each pixel, then the entries, little-endian. `None` if there are too many for
    /// [`Self::max_bytes`].
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        if self.entries.len() > max_entries(self.ends.len()) {
            return None;
        }
        let counts = self.by_pixel().map(|entries| entries.len() as u32);
        let entries = self.entries.iter().flat_map(|entry| [entry.id, entry.passes]);
        Some(counts.chain(entries).flat_map(u32::to_le_bytes).collect())
    }

    /// Read what [`Self::to_bytes`] wrote; also returns the number of bytes read. The bytes may be untrusted: check the
    /// result with [`Self::is_sound`].
    pub fn from_bytes(bytes: &[u8], pixels: usize) -> Option<(Self, usize)> {
        let (counts, rest) = bytes.split_at_checked(pixels.checked_mul(4)?)?;
        let mut end = 0_u32;
        let mut ends = Vec::with_capacity(pixels);
        for count in counts.as_chunks().0 {
            end = end.checked_add(u32::from_le_bytes(*count))?;
            ends.push(end);
        }
        if end as usize > max_entries(pixels) {
            return None;
        }
        let entries = rest.get(..8 * end as usize)?;
        let word = |bytes: &[u8; 8], at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
        let entries = entries.as_chunks().0.iter().map(|bytes| Entry {
            id: word(bytes, 0),
            passes: word(bytes, 4),
        });
        let matte = Self {
            ends,
            entries: entries.collect(),
        };
        Some((matte, 4 * pixels + 8 * end as usize))
    }

    /// By pixel, pairs of id and coverage in the mean over this many passes: the largest coverage first, equal ones by
    /// id. Pairs beyond [`RANKS`] are left out; unused ones are zero.
    pub fn ranks(&self, passes: u64) -> impl Iterator<Item = [(u32, f32); RANKS]> {
        self.by_pixel().map(move |entries| {
            let mut sorted = entries.to_vec();
            sorted.sort_by_key(|entry| (u32::MAX - entry.passes, entry.id));
            let mut ranks = [(NOTHING, 0.0); RANKS];
            for (rank, entry) in ranks.iter_mut().zip(sorted) {
                *rank = (entry.id, (f64::from(entry.passes) / passes as f64) as f32);
            }
            ranks
        })
    }

    /// The ids that occur, ascending.
    pub fn ids(&self) -> Vec<u32> {
        let mut ids: Vec<u32> = self.entries.iter().map(|entry| entry.id).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// The id of a name: its 32-bit MurmurHash3, with an exponent that no infinity, NaN or subnormal number has, because
/// images store it as the bits of a float.
pub fn id_of_name(name: &str) -> u32 {
    const EXPONENT: u32 = 0xff << 23;
    let hash = hash_of(name);
    match hash & EXPONENT {
        0 | EXPONENT => hash ^ (1 << 23),
        _ => hash,
    }
}

/// Prefix of the attributes of a layer with this name.
pub(crate) fn key_of_layer(name: &str) -> String {
    let hex = format!("{:08x}", hash_of(name));
    hex[..7].to_owned()
}

fn hash_of(name: &str) -> u32 {
    // Reading from memory does not fail.
    murmur3::murmur3_32(&mut name.as_bytes(), 0).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(id: u32, passes: u32) -> Entry {
        Entry { id, passes }
    }

    /// Names and ids from the manifest example of the specification and from its reference implementation's tests.
    #[test]
    fn ids_are_those_of_the_convention() {
        for (name, id) in [
            ("hello", 0x248b_fa47_u32),
            ("hello, world", 0x149b_bb7f),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(id_of_name(name), id, "{name}");
        }
        assert_eq!(key_of_layer("CryptoObject").len(), 7);
        for i in 0..100_000 {
            let value = f32::from_bits(id_of_name(&format!("thing {i}")));
            assert!(value.is_normal(), "{i}");
        }
    }

    #[test]
    fn sums_do_not_depend_on_their_order_and_survive() {
        let leaves = [[7, 0, 3], [7, 2, 1], [5, 0, 3], [7, 0, 9]].map(|ids| Matte::leaf(&ids));
        let [a, b, c, d] = &leaves;
        let sum = a.joined(b).joined(&c.joined(d));
        assert_eq!(sum, d.joined(&a.joined(c)).joined(b));
        let pixels: Vec<&[Entry]> = sum.by_pixel().collect();
        assert_eq!(pixels[0], [entry(5, 1), entry(7, 3)]);
        assert_eq!(pixels[1], [entry(2, 1)]);
        assert_eq!(pixels[2], [entry(1, 1), entry(3, 2), entry(9, 1)]);
        assert!(sum.is_sound(3, 4) && !sum.is_sound(3, 3) && !sum.is_sound(2, 4));
        assert_eq!(sum.ids(), [1, 2, 3, 5, 7, 9]);
        let ranks: Vec<_> = sum.ranks(4).collect();
        assert_eq!(ranks[2][..4], [(3, 0.5), (1, 0.25), (9, 0.25), (NOTHING, 0.0)]);
        let mut bytes = sum.to_bytes().unwrap();
        assert!(bytes.len() <= Matte::max_bytes(3));
        let length = bytes.len();
        bytes.extend([1, 2, 3]);
        assert_eq!(Matte::from_bytes(&bytes, 3), Some((sum, length)));
        for cut in 0..length {
            assert_eq!(Matte::from_bytes(&bytes[..cut], 3), None);
        }
    }

    #[test]
    fn what_no_passes_can_leave_is_unsound() {
        let of = |entries: &[Entry]| Matte {
            ends: vec![entries.len() as u32],
            entries: entries.to_vec(),
        };
        assert!(of(&[]).is_sound(1, 1));
        assert!(!of(&[entry(2, 1), entry(2, 1)]).is_sound(1, 9));
        assert!(!of(&[entry(3, 1), entry(2, 1)]).is_sound(1, 9));
        assert!(!of(&[entry(NOTHING, 1)]).is_sound(1, 9));
        assert!(!of(&[entry(3, 0)]).is_sound(1, 9));
        let claims_too_much = [u32::MAX.to_le_bytes(), 1_u32.to_le_bytes()].concat();
        assert_eq!(Matte::from_bytes(&claims_too_much, 2), None);
        assert_eq!(Matte::from_bytes(&claims_too_much, usize::MAX), None);
    }
}
