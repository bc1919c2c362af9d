//! What blocks look like beside each other: those that look unlike others are checked at once. It says nothing of who
//! is right; passes with a bright caustic look unlike others as well.

use beamfarm_image::job::Block;
use beamfarm_image::merge::Node;
use std::collections::BTreeMap;

/// One row in so many is looked at: a look costs little of what taking a block in does.
const ROWS: usize = 4;
/// Blocks that have to be there before one is unlike them.
const FEW: u32 = 12;
/// A mean is odd at so many standard deviations from that of others.
const DEVIATIONS: f64 = 6.0;
/// Means that differ by no more than this part are alike, however little others differ.
const ALIKE: f64 = 1e-3;
/// A value is odd that is so many times the largest of others.
const LARGER: f32 = 1e4;
/// Radiance that is odd whatever others show.
const HUGE: f32 = 1e12;

/// What a block looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Mean of its pixels and channels, of a pass.
    mean: f64,
    /// Least and largest value, of a pass.
    least: f32,
    most: f32,
}

impl Look {
    /// A look at some of the rows, from this one on.
    pub fn of(node: &Node, from: usize) -> Self {
        let width = (node.sum.width as usize).max(1);
        let rows = node.sum.pixels.chunks(width);
        let rows = rows.skip(from % ROWS % (node.sum.height as usize).max(1)).step_by(ROWS);
        let (mut sum, mut count) = (0.0, 0);
        let (mut least, mut most) = (f32::MAX, f32::MIN);
        for row in rows {
            let values = row.as_flattened();
            count += values.len();
            // Several at a time.
            let (mut sums, mut leasts, mut mosts) = ([0.0f32; 16], [f32::MAX; 16], [f32::MIN; 16]);
            let (lanes, rest) = values.as_chunks::<16>();
            for lane in lanes {
                for i in 0..16 {
                    sums[i] += lane[i];
                    leasts[i] = if lane[i] < leasts[i] { lane[i] } else { leasts[i] };
                    mosts[i] = if lane[i] > mosts[i] { lane[i] } else { mosts[i] };
                }
            }
            for value in sums.iter().chain(rest) {
                sum += f64::from(*value);
            }
            least = leasts.iter().chain(rest).copied().fold(least, f32::min);
            most = mosts.iter().chain(rest).copied().fold(most, f32::max);
        }
        let passes = node.block.len() as f32;
        Self {
            mean: sum / (count.max(1) as f64 * f64::from(passes)),
            least: least / passes,
            most: most / passes,
        }
    }
}

/// What the blocks of a job look like.
#[derive(Debug, Default)]
pub struct Plausible {
    blocks: u32,
    /// Of blocks that are like others, or that two machines found: passes, the mean of their means, and the sum of
    /// squared deviations from it.
    passes: f64,
    mean: f64,
    squares: f64,
    least: f32,
    most: f32,
    odd: BTreeMap<Block, Look>,
}

impl Plausible {
    /// Whether the block looks unlike those before it.
    pub fn is_odd(&mut self, block: Block, look: Look) -> bool {
        let Look { mean, least, most } = look;
        let passes = block.len() as f64;
        let enough = self.blocks >= FEW;
        let away = mean - self.mean;
        // Of a pass; a mean of several deviates less.
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

    /// Two machines found this block: such are odd no more. Those that nobody confirmed make no room for their kind.
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
    use beamfarm_image::film::Film;

    /// Passes that differ by a tenth.
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

    #[test]
    fn a_look_is_of_a_pass() {
        let mut film = Film::new(37, 9);
        film.pixels.fill([1.0, 2.0, 6.0]);
        let leaf = Node::leaf(0, film);
        let pair = Node::join(leaf.clone(), Node::leaf(1, leaf.sum.clone())).unwrap();
        for from in 0..256 {
            let look = Look::of(&pair, from);
            assert_eq!(look, Look::of(&leaf, from));
            assert!((look.mean - 3.0).abs() < 1e-6, "{look:?}");
            assert_eq!((look.least, look.most), (1.0, 6.0));
        }
    }
}
