//! Stable sorts by keys of one word or two.

use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::{SORT, SORT_WIDE};
use crate::scan::Scan;
use crate::self_test::Together;
use crate::sizes::{Sizing, TILE};

/// Sorts pairs, which are counted on the device: eight steps of four key bits.
pub struct Sort {
    tiles: Sizing,
    /// Number of digit counts to sum.
    digits_of_tiles: Sizing,
    histogram: Kernel,
    scatter: Kernel,
    scan: Scan,
    digits: Buffer,
    other: Buffer,
    steps: Vec<Buffer>,
}

impl Sort {
    /// For at most this many pairs.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most: u32) -> Result<Self> {
        let on = on.into();
        let digits = 16 * most.div_ceil(TILE).max(1);
        let steps = (0..8u32).map(|i| on.device.buffer("step", &[4 * i]));
        Ok(Self {
            tiles: Sizing::new(on, "tiles")?,
            digits_of_tiles: Sizing::new(on, "digits_of_tiles")?,
            histogram: on.kernel(&SORT, "histogram"),
            scatter: on.kernel(&SORT, "scatter"),
            scan: Scan::new(on, digits)?,
            digits: on.empty("digits", 4 * u64::from(digits))?,
            other: on.empty("half sorted pairs", 8 * u64::from(most))?,
            steps: steps.collect::<Result<_>>()?,
        })
    }

    /// Sorts pairs of words by the first; equal ones stay in order. `count`'s first word is how many they are.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, count: &Buffer, pairs: &Buffer) -> Result<()> {
        self.count(work, count)?;
        self.sort(work, pairs)
    }

    /// Work that depends on the count only.
    fn count(&self, work: &mut Work, count: &Buffer) -> Result<()> {
        self.tiles.run(work, count)?;
        self.digits_of_tiles.run(work, &self.tiles.sizes)?;
        self.scan.count(work, &self.digits_of_tiles.sizes)
    }

    fn sort(&self, work: &mut Work, pairs: &Buffer) -> Result<()> {
        let sizes = &self.tiles.sizes;
        let mut places = [pairs, &self.other];
        for step in &self.steps {
            let [from, to] = places;
            let groups = Groups::From(sizes);
            work.run(&self.histogram, &[sizes, step, from, &self.digits], groups)?;
            self.scan.sum(work, &self.digits)?;
            work.run(&self.scatter, &[sizes, step, from, &self.digits, to], groups)?;
            places.swap(0, 1);
        }
        Ok(())
    }
}

/// Sorts by two-word keys.
pub struct WideSort {
    sort: Sort,
    threads: Sizing,
    low: Kernel,
    high: Kernel,
}

impl WideSort {
    /// For at most this many keys.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most: u32) -> Result<Self> {
        let on = on.into();
        Ok(Self {
            sort: Sort::new(on, most)?,
            threads: Sizing::new(on, "threads")?,
            low: on.kernel(&SORT_WIDE, "low_words"),
            high: on.kernel(&SORT_WIDE, "high_words"),
        })
    }

    /// Writes pairs whose second words are the keys' numbers in sorted order. Keys are pairs of words, the low one
    /// first; equal ones stay in order. `count`'s first word is how many they are.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, count: &Buffer, keys: &Buffer, pairs: &Buffer) -> Result<()> {
        self.threads.run(work, count)?;
        self.sort.count(work, count)?;
        let sizes = &self.threads.sizes;
        for words in [&self.low, &self.high] {
            work.run(words, &[sizes, keys, pairs], Groups::From(sizes))?;
            self.sort.sort(work, pairs)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{COUNTS, tested};
    use beamfarm_render::sampler::mix64;

    /// Keys with duplicates, and neighbours that differ in any bit.
    fn keys(size: u32) -> Vec<u64> {
        let size = u64::from(size);
        let key = |i: u64| match i % 4 {
            0 => mix64(i) >> 1,
            1 => mix64(i % 100) >> 1,
            2 => (size - i) << (i % 32),
            _ => 0x7fff_ffff_ffff_ffff,
        };
        (0..size).map(key).collect()
    }

    #[test]
    fn pairs_are_sorted_as_in_plain_rust() {
        let Some(tested) = tested() else { return };
        let most = COUNTS[COUNTS.len() - 1];
        let sort = Sort::new(tested, most).unwrap();
        for size in COUNTS {
            let mut pairs: Vec<[u32; 2]> = (0..).zip(keys(size)).map(|(i, key)| [key as u32, i]).collect();
            let behind = [&pairs[..], &[[0, 9]]].concat();
            let buffer = tested.device.buffer("pairs", &behind).unwrap();
            let count = tested.device.buffer("count", &[size]).unwrap();
            let mut work = tested.device.work();
            sort.run(&mut work, &count, &buffer).unwrap();
            work.submit().unwrap();
            pairs.sort_by_key(|[key, _]| *key);
            pairs.push([0, 9]);
            assert!(
                tested.device.read::<[u32; 2]>(&buffer, pairs.len()).unwrap() == pairs,
                "{size}"
            );
        }
    }

    #[test]
    fn passes_have_orders_of_their_own() {
        let Some(tested) = tested() else { return };
        let most = 5000;
        let counts = [4097_u32, 1, 0, most];
        let sort = WideSort::new(Together { tested, passes: 4 }, most).unwrap();
        let of_pass = |pass: usize| keys(most + pass as u32).into_iter().take(most as usize);
        let words = (0..4).flat_map(of_pass).map(|key| [key as u32, (key >> 32) as u32]);
        let source = tested.device.parts("keys", &words.collect::<Vec<_>>(), 4).unwrap();
        let count = tested.device.parts("count", &counts, 4).unwrap();
        let pairs = tested.device.empty_parts("pairs", 8 * u64::from(most), 4).unwrap();
        let mut work = tested.device.work_of(4);
        sort.run(&mut work, &count, &source, &pairs).unwrap();
        work.submit().unwrap();
        let got = tested.device.read::<[u32; 2]>(&pairs, 4 * most as usize).unwrap();
        for (pass, count) in counts.into_iter().enumerate() {
            let keys: Vec<u64> = of_pass(pass).collect();
            let mut expected: Vec<u32> = (0..count).collect();
            expected.sort_by_key(|i| keys[*i as usize]);
            let got = got[pass * most as usize..].iter().map(|[_, i]| *i).take(count as usize);
            assert!(got.eq(expected), "{pass}");
        }
    }

    #[test]
    fn keys_of_two_words_are_sorted_as_in_plain_rust() {
        let Some(tested) = tested() else { return };
        let most = 100_000;
        let sort = WideSort::new(tested, most).unwrap();
        for size in COUNTS.iter().copied().filter(|size| *size < most).chain([most]) {
            let keys = keys(size);
            let words: Vec<[u32; 2]> = keys.iter().map(|key| [*key as u32, (*key >> 32) as u32]).collect();
            let count = tested.device.buffer("count", &[size]).unwrap();
            let source = tested.device.buffer("keys", &words).unwrap();
            let pairs = tested.device.empty("pairs", 8 * u64::from(size)).unwrap();
            let mut work = tested.device.work();
            sort.run(&mut work, &count, &source, &pairs).unwrap();
            work.submit().unwrap();
            let mut expected: Vec<u32> = (0..size).collect();
            expected.sort_by_key(|i| keys[*i as usize]);
            let got = tested.device.read::<[u32; 2]>(&pairs, keys.len()).unwrap();
            assert!(got.iter().map(|[_, i]| *i).eq(expected), "{size}");
        }
    }
}
