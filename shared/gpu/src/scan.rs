//! Prefix sums.

use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::SCAN;
use crate::self_test::Together;
use crate::sizes::{Sizing, TILE};

/// Computes prefix sums of numbers that are counted on the device.
pub struct Scan {
    tiles: Kernel,
    add: Kernel,
    /// The numbers, the sums of their tiles, the sums of the tiles of those, and so on down to one.
    levels: Vec<Level>,
}

struct Level {
    sizing: Sizing,
    sums: Buffer,
}

impl Scan {
    /// For at most this many numbers.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most: u32) -> Result<Self> {
        let on = on.into();
        let mut levels = Vec::new();
        let mut most = most;
        while levels.is_empty() || most > 1 {
            let entry = if levels.is_empty() { "tiles" } else { "tiles_of_tiles" };
            most = most.div_ceil(TILE).max(1);
            levels.push(Level {
                sizing: Sizing::new(on, entry)?,
                sums: on.empty("sums of tiles", 4 * u64::from(most))?,
            });
        }
        Ok(Self {
            tiles: on.kernel(&SCAN, "scan_tiles"),
            add: on.kernel(&SCAN, "add_sums"),
            levels,
        })
    }

    /// Replaces each number by the sum of all before it, modulo 2^32. `count`'s first word is how many they are.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, count: &Buffer, numbers: &Buffer) -> Result<()> {
        self.count(work, count)?;
        self.sum(work, numbers)
    }

    /// The first half of [`Self::run`], shared by all lists of this length.
    ///
    /// # Errors
    /// Device errors.
    pub fn count(&self, work: &mut Work, count: &Buffer) -> Result<()> {
        let mut from = count;
        for level in &self.levels {
            level.sizing.run(work, from)?;
            from = &level.sizing.sizes;
        }
        Ok(())
    }

    /// The second half of [`Self::run`].
    ///
    /// # Errors
    /// Device errors.
    pub fn sum(&self, work: &mut Work, numbers: &Buffer) -> Result<()> {
        let mut here = numbers;
        for level in &self.levels {
            let sizes = &level.sizing.sizes;
            work.run(&self.tiles, &[sizes, here, &level.sums], Groups::From(sizes))?;
            here = &level.sums;
        }
        for (i, level) in self.levels.iter().enumerate().rev().skip(1) {
            let here = if i == 0 { numbers } else { &self.levels[i - 1].sums };
            let sizes = &level.sizing.sizes;
            work.run(&self.add, &[sizes, here, &level.sums], Groups::From(sizes))?;
        }
        Ok(())
    }

    /// The sum of all numbers, in its first word, after [`Self::run`].
    #[must_use]
    pub fn total(&self) -> &Buffer {
        &self.levels[self.levels.len() - 1].sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{COUNTS, tested};
    use beamfarm_render::sampler::mix64;

    #[test]
    fn sums_are_those_of_plain_rust() {
        let Some(tested) = tested() else { return };
        let most = 5_000_000;
        let scan = Scan::new(tested, most).unwrap();
        for size in COUNTS
            .iter()
            .copied()
            .chain([2047, 2048, 2049, 2048 * 2048, 2048 * 2048 + 1, most])
        {
            let numbers: Vec<u32> = (0..u64::from(size)).map(|i| mix64(i) as u32).collect();
            // Elements after the count are left alone.
            let behind: Vec<u32> = [&numbers[..], &[7; 3]].concat();
            let buffer = tested.device.buffer("numbers", &behind).unwrap();
            let count = tested.device.buffer("count", &[size]).unwrap();
            let mut work = tested.device.work();
            scan.run(&mut work, &count, &buffer).unwrap();
            work.submit().unwrap();
            let mut sum = 0u32;
            let mut expected: Vec<u32> = Vec::new();
            for number in numbers {
                expected.push(sum);
                sum = sum.wrapping_add(number);
            }
            expected.extend([7; 3]);
            assert!(
                tested.device.read::<u32>(&buffer, expected.len()).unwrap() == expected,
                "{size}"
            );
            assert_eq!(tested.device.read::<u32>(scan.total(), 1).unwrap(), [sum], "{size}");
        }
    }

    #[test]
    fn passes_have_sums_of_their_own() {
        let Some(tested) = tested() else { return };
        let most = 300_000;
        let counts = [5_u32, 0, most];
        let on = Together { tested, passes: 3 };
        let scan = Scan::new(on, most).unwrap();
        let of_pass = |count: u32| (0..most).map(move |i| if i < count { i % 7 + count } else { 9 });
        let numbers: Vec<u32> = counts.iter().flat_map(|count| of_pass(*count)).collect();
        let numbers = tested.device.parts("numbers", &numbers, 3).unwrap();
        let count = tested.device.parts("count", &counts, 3).unwrap();
        // And only the first two of three.
        for passes in [3, 2] {
            let mut work = tested.device.work_of(passes);
            scan.run(&mut work, &count, &numbers).unwrap();
            work.submit().unwrap();
        }
        let mut expected = Vec::new();
        for (pass, count) in counts.into_iter().enumerate() {
            let mut numbers: Vec<u32> = of_pass(count).collect();
            for _ in 0..if pass < 2 { 2 } else { 1 } {
                let mut sum = 0_u32;
                for number in &mut numbers[..count as usize] {
                    let before = sum;
                    sum = sum.wrapping_add(*number);
                    *number = before;
                }
            }
            expected.extend(numbers);
        }
        assert!(tested.device.read::<u32>(&numbers, expected.len()).unwrap() == expected);
    }
}
