//! A quick look at what was rendered.

use crate::merge::Node;

/// One row in this many is looked at: a look costs little compared with merging a block.
const ROWS: usize = 4;

/// Summary of a block's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Mean over the pixels and channels, per pass.
    pub mean: f64,
    /// Least value, per pass.
    pub least: f32,
    /// Largest value, per pass.
    pub most: f32,
}

impl Look {
    /// A look at every fourth row, starting from this one.
    pub fn of(node: &Node, from: usize) -> Self {
        let width = (node.sum.width as usize).max(1);
        let rows = node.sum.pixels.chunks(width);
        let rows = rows.skip(from % ROWS % (node.sum.height as usize).max(1)).step_by(ROWS);
        let (mut sum, mut count) = (0.0, 0);
        let (mut least, mut most) = (f32::MAX, f32::MIN);
        for row in rows {
            let values = row.as_flattened();
            count += values.len();
            // In lanes, so that several are handled at a time.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Film;

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
