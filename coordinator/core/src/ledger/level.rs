//! How many passes a lease is of.
//!
//! With W workers that take p seconds for a pass, and a coordinator that takes a block in within q seconds, blocks of
//! 2^l passes arrive at W / (p 2^l) a second. The level is the lowest at which that is at most half of 1 / q, with the
//! p of the worker that asks: where some are quicker than others, each has its part of the coordinator's time.
//!
//! l = ceil(log2(2 W q / p)), at least 0 and at most [`HIGHEST`],
//!
//! and such that a block takes a worker no less than [`LEAST_LEASE`] where that does not need too many: messages cost
//! both sides a millisecond or two, which small pictures take for a pass. It holds no fewer passes than the worker
//! renders together.
//!
//! It is lowered until the block
//! - is aligned and made of open passes only,
//! - is at most half of the worker's share of what is open, by what it renders in the time of others, so that all end
//!   at about the same time,
//! - lies between two of the prefixes 2, 3, 4, 6, 8, 12, … (2^k and 3 2^k), at which a job may be found to be good
//!   enough.

use beamfarm_image::job::Block;
use std::ops::Range;

/// A lost lease costs at most 2^10 passes.
pub(super) const HIGHEST: u32 = 10;
/// Seconds that a lease is worth.
const LEAST_LEASE: f64 = 0.05;
/// Part of the coordinator's time that arriving blocks may take.
const UTILISATION: f64 = 0.5;

/// What the size of a block depends on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Load {
    /// Workers that ask for passes.
    pub workers: u64,
    /// What this worker renders of all that is rendered.
    pub share: f64,
    /// Time that it takes for a pass, seconds; zero when nothing is known.
    pub pass: f64,
    /// Passes that it renders together.
    pub together: u64,
    /// Time that the coordinator takes for a block, seconds; zero when nothing is known.
    pub intake: f64,
}

impl Load {
    /// The lowest level at which the coordinator is not hurried, and a lease is worth its messages.
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

/// Highest level of blocks that begin with this pass and do not reach over a prefix at which a job may end.
pub(super) fn highest_at(start: u64) -> u32 {
    let between = start.checked_ilog2().unwrap_or(0).saturating_sub(1);
    between.min(start.trailing_zeros())
}

/// The block to lease: the first of this range of open passes, of `open` in all.
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
            // It could not be higher, but for the two passes before the first prefix.
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
        // Towards the end, each by its share.
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
