//! The number of passes in a lease.
//!
//! Let W workers take p seconds per pass, and let the coordinator take in a block in q seconds. Blocks of 2^l passes
//! then arrive at W / (p 2^l) per second. The level l is the lowest at which this rate is at most half of 1 / q. p is
//! that of the worker that asks: where speeds differ, each gets its share of the coordinator's time.
//!
//! l = ceil(log2(2 W q / p)), at least 0 and at most [`HIGHEST`].
//!
//! A block also takes the worker at least [`LEAST_LEASE`], where the level allows: messages cost both sides a
//! millisecond or two, as much as a pass of a small picture. And it holds at least as many passes as the worker renders
//! together.
//!
//! The level is then lowered until the block
//! - is aligned and made of open passes only,
//! - is at most half of the worker's share of what is open, in proportion to its speed, so that all workers end at
//!   about the same time,
//! - lies between two of the prefixes 2, 3, 4, 6, 8, 12, … (2^k and 3 2^k), at which a job may meet its target.

use beamfarm_image::job::Block;
use std::ops::Range;

/// A lost lease costs at most 2^10 passes.
pub(super) const HIGHEST: u32 = 10;
/// The least seconds of work in a lease.
const LEAST_LEASE: f64 = 0.05;
/// The fraction of the coordinator's time that arriving blocks may take.
const UTILISATION: f64 = 0.5;

/// What the size of a block depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Load {
    /// Present workers.
    pub workers: u64,
    /// This worker's fraction of all passes rendered.
    pub share: f64,
    /// Its seconds per pass; zero when unknown.
    pub pass: f64,
    /// Passes that it renders together.
    pub together: u64,
    /// The coordinator's seconds per block; zero when unknown.
    pub intake: f64,
}

impl Load {
    /// The lowest level at which the coordinator keeps up and a lease is worth its messages.
    pub fn level(&self) -> u32 {
        let blocks = self.workers as f64 * self.intake / (UTILISATION * self.pass);
        let least = LEAST_LEASE / self.pass;
        let known = if least.is_finite() { blocks.max(least) } else { 0.0 };
        let passes = known.max(self.together as f64);
        (0..HIGHEST)
            .find(|level| passes <= f64::from(1 << level))
            .unwrap_or(HIGHEST)
    }
}

/// The highest level of a block that starts with this pass and does not cross a prefix at which a job may end.
pub(super) fn highest_at(start: u64) -> u32 {
    let between = start.checked_ilog2().unwrap_or(0).saturating_sub(1);
    between.min(start.trailing_zeros())
}

/// The block to lease: the first of this range of open passes, with `open` passes in all.
pub(super) fn first_block(range: &Range<u64>, open: u64, load: &Load) -> Block {
    let start = range.start;
    let share = ((open as f64 * load.share / 2.0) as u64).max(1);
    let room = (range.end - start).min(share);
    let level = load.level().min(highest_at(start)).min(room.ilog2());
    Block {
        level,
        index: start >> level,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_do_not_reach_over_a_prefix() {
        let prefixes: Vec<u64> = (0..20).flat_map(|k| [2 << k, 3 << k]).collect();
        for start in 0..5000 {
            let level = highest_at(start);
            let fits = |level: u32| {
                let passes = Block {
                    level,
                    index: start >> level,
                }
                .passes();
                passes.start == start && prefixes.iter().all(|p| !(passes.start < *p && *p < passes.end))
            };
            assert!((0..=level).all(fits), "{start}");
            // It could not be higher, except for the two passes before the first prefix.
            assert!(start < 2 || !fits(level + 1), "{start}");
        }
    }

    #[test]
    fn few_workers_get_single_passes_and_many_get_as_few_blocks_as_are_needed() {
        let load = |workers, pass, intake| {
            Load {
                workers,
                pass,
                intake,
                ..Load::default()
            }
            .level()
        };
        assert_eq!(load(0, 0.0, 0.0), 0);
        assert_eq!(load(10, 0.0, 0.0), 0);
        assert_eq!(load(10, 1.0, 0.0), 0);
        // Two blocks a second at 10 ms each.
        assert_eq!(load(2, 1.0, 0.01), 0);
        assert_eq!(load(1_000, 10.0, 0.02), 2);
        assert_eq!(load(10_000, 10.0, 0.02), 6);
        assert_eq!(load(u64::MAX, 1.0, 1.0), HIGHEST);
        // Passes of four milliseconds: sixteen of them.
        assert_eq!(load(2, 0.004, 0.0), 4);
        assert_eq!(load(2, 1e-9, 0.0), HIGHEST);
        for workers in [1, 10, 100, 1000, 10_000] {
            let level = load(workers, 3.0, 0.015);
            let busy = |level: u32| workers as f64 / 3.0 / f64::from(1 << level) * 0.015;
            assert!(busy(level) <= UTILISATION);
            assert!(level == 0 || busy(level - 1) > UTILISATION);
        }
    }

    #[test]
    fn blocks_get_smaller_towards_the_end() {
        let load = Load {
            workers: 4,
            share: 0.25,
            pass: 1.0,
            together: 1,
            intake: 1.0,
        };
        let block = |start: u64, end: u64| first_block(&(start..end), end - start, &load);
        assert_eq!(block(1024, 4096), Block { level: 3, index: 128 });
        assert_eq!(block(1024, 1056).level, 2);
        assert_eq!(block(1024, 1031).level, 0);
        assert_eq!(block(1027, 4096), Block::leaf(1027));
        assert_eq!(block(0, 4096), Block::leaf(0));
        let alone = Load {
            workers: 1,
            share: 1.0,
            ..load
        };
        assert_eq!(first_block(&(1024..1025), 1 << 20, &alone), Block::leaf(1024));
        assert_eq!(first_block(&(1024..1026), 1 << 20, &alone).level, 1);
    }

    #[test]
    fn the_quick_get_more_and_devices_what_they_render_together() {
        let quick = Load {
            workers: 2,
            share: 0.99,
            pass: 0.01,
            together: 1,
            intake: 0.0,
        };
        let slow = Load {
            share: 0.01,
            pass: 1.0,
            ..quick
        };
        let block = |load: &Load, open: u64| first_block(&(4096..4096 + open), open, load).len();
        assert_eq!([block(&quick, 1024), block(&slow, 1024)], [8, 1]);
        // Towards the end each worker gets its share.
        let hurried = |load: Load| Load { intake: 1.0, ..load };
        assert_eq!([block(&hurried(quick), 1024), block(&hurried(slow), 1024)], [256, 4]);
        let batch = Load { together: 24, ..slow };
        assert_eq!(batch.level(), 5);
        assert_eq!(Load { pass: 0.0, ..batch }.level(), 5);
        assert_eq!(
            Load {
                together: u64::MAX,
                ..batch
            }
            .level(),
            HIGHEST
        );
    }
}
