//! Compares blocks with each other: outliers are checked at once. An outlier is not necessarily wrong; passes with a
//! bright caustic are outliers too.

use beamfarm_image::job::Block;
use beamfarm_image::look::Look;
use std::collections::BTreeMap;

/// Blocks needed before one can be an outlier.
const FEW: u32 = 12;
/// A mean is an outlier at this many standard deviations from the others.
const DEVIATIONS: f64 = 6.0;
/// Means within this relative difference are alike, however little others differ.
const ALIKE: f64 = 1e-3;
/// A value is an outlier at this many times the largest of the others.
const LARGER: f32 = 1e4;
/// Radiance beyond this is an outlier whatever the others are.
const HUGE: f32 = 1e12;

/// Brightness statistics of a job's blocks.
#[derive(Debug, Default)]
pub struct Plausible {
    blocks: u32,
    /// Over blocks that are no outliers or that were confirmed: passes, mean of their means, and sum of squared
    /// deviations.
    passes: f64,
    mean: f64,
    squares: f64,
    least: f32,
    most: f32,
    odd: BTreeMap<Block, Look>,
}

impl Plausible {
    /// Whether the block is an outlier among those before it.
    pub fn is_odd(&mut self, block: Block, look: Look) -> bool {
        let Look { mean, least, most } = look;
        let passes = block.len() as f64;
        let enough = self.blocks >= FEW;
        let away = mean - self.mean;
        // Variance of a single pass; a mean of several varies less.
        let variance = self.squares / f64::from(self.blocks.saturating_sub(1).max(1));
        let longest = DEVIATIONS * (variance * (1.0 / passes + 1.0 / self.passes.max(1.0))).sqrt();
        let is_far = enough && away.abs() > longest.max(ALIKE * self.mean.abs());
        let is_large = most > HUGE.max(self.most) || enough && most > LARGER * self.most;
        let is_odd = is_far || is_large || least < self.least;
        match is_odd {
            true => drop(self.odd.insert(block, look)),
            false => self.add(block, look),
        }
        is_odd
    }

    /// Two machines found this block: similar ones are outliers no more. Unconfirmed outliers do not widen the range.
    pub fn confirm(&mut self, block: Block) {
        if let Some(look) = self.odd.remove(&block) {
            self.add(block, look);
        }
    }

    fn add(&mut self, block: Block, look: Look) {
        let passes = block.len() as f64;
        let away = look.mean - self.mean;
        self.blocks += 1;
        self.passes += passes;
        self.mean += away * passes / self.passes;
        self.squares += passes * away * away * (1.0 - passes / self.passes);
        self.least = self.least.min(look.least);
        self.most = self.most.max(look.most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Passes that vary by a tenth.
    fn look(pass: u64, factor: f64) -> Look {
        let noise = (pass as f64 * 0.618).fract() - 0.5;
        let mean = factor * (1.0 + 0.2 * noise);
        Look {
            mean,
            least: 0.0,
            most: 5.0 * mean as f32,
        }
    }

    #[test]
    fn wrong_passes_are_odd_and_others_are_not() {
        let mut plausible = Plausible::default();
        for pass in 0..1000 {
            assert!(!plausible.is_odd(Block::leaf(pass), look(pass, 1.0)), "{pass}");
            if pass < 20 {
                continue;
            }
            let mut wrong = |look: Look| plausible.is_odd(Block::leaf(pass + 5000), look);
            if pass % 100 == 50 {
                assert!(wrong(look(pass, 1.5)));
                assert!(wrong(look(pass, 0.5)));
                let bright = look(pass, 1.0);
                assert!(wrong(Look { most: 1e20, ..bright }));
                assert!(wrong(Look { least: -1e-3, ..bright }));
            }
        }
    }

    #[test]
    fn what_two_machines_found_is_odd_no_more() {
        let mut plausible = Plausible::default();
        let dispersed = |pass| Look {
            least: -0.1,
            ..look(pass, 1.0)
        };
        let block = Block::leaf(0);
        assert!(plausible.is_odd(block, dispersed(0)));
        plausible.confirm(block);
        assert!(!plausible.is_odd(Block::leaf(1), dispersed(1)));
        let huge = Look {
            most: 1e13,
            ..look(2, 1.0)
        };
        assert!(plausible.is_odd(Block::leaf(2), huge));
        plausible.confirm(Block::leaf(2));
        assert!(!plausible.is_odd(Block::leaf(3), huge));
    }

    #[test]
    fn a_light_that_few_passes_see_is_no_news_for_ever() {
        let mut plausible = Plausible::default();
        let mut odd = 0;
        for pass in 0..2000 {
            let factor = if pass % 20 == 19 { 10.0 } else { 1.0 };
            odd += u32::from(plausible.is_odd(Block::leaf(pass), look(pass, factor)));
            plausible.confirm(Block::leaf(pass));
        }
        assert!(odd < 20, "{odd}");
    }
}
