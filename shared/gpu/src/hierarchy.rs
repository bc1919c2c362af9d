//! A hierarchy over boxes: sorted along a curve, then a box around every four.

use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::kernels::{ORDER, TREE};
use crate::self_test::Together;
use crate::sizes::Sizing;
use crate::sort::WideSort;
use bytemuck::{Pod, Zeroable};

/// A box. It is empty if any `low` is above its `high`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Lowest corner.
    pub low: [f32; 3],
    /// Padding.
    pub spare_low: u32,
    /// Highest corner.
    pub high: [f32; 3],
    /// Padding.
    pub spare_high: u32,
}

/// Position of a level's nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Level {
    /// First node of the level.
    pub here: u32,
    /// First node of the level below; 0 for the boxes themselves.
    pub below: u32,
}

/// Builds hierarchies on a device, over boxes that are counted there.
///
/// Node `i` of a level encloses `4 i` to `4 i + 3` of the level below, as far as they exist; on the first level, of the
/// sorted boxes. The number and positions of levels are those for the maximum number of boxes. The last level has one
/// node, around everything.
pub struct Hierarchy {
    threads: Sizing,
    sort: WideSort,
    as_given: Kernel,
    around_boxes: Kernel,
    around_nodes: Kernel,
    morton: Kernel,
    keys: Buffer,
    order: Buffer,
    nodes: Buffer,
    levels: Vec<(Level, Buffer, Sizing)>,
}

impl Hierarchy {
    /// For at most this many boxes.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most: u32) -> Result<Self> {
        let on = on.into();
        let plan = levels(most);
        let last = plan[plan.len() - 1].here;
        let level = |level: Level| {
            let buffer = on.device.buffer("level", &[level])?;
            Ok((level, buffer, Sizing::new(on, "threads_of_four")?))
        };
        Ok(Self {
            threads: Sizing::new(on, "threads")?,
            sort: WideSort::new(on, most)?,
            as_given: on.kernel(&TREE, "as_given"),
            around_boxes: on.kernel(&TREE, "around_boxes"),
            around_nodes: on.kernel(&TREE, "around_nodes"),
            morton: on.kernel(&ORDER, "main"),
            keys: on.empty("keys of boxes", 8 * u64::from(most))?,
            order: on.empty("order of boxes", 8 * u64::from(most))?,
            nodes: on.empty("nodes", size_of::<Bounds>() as u64 * (u64::from(last) + 1))?,
            levels: plan.into_iter().map(level).collect::<Result<_>>()?,
        })
    }

    /// Builds a hierarchy over boxes; `count`'s first word is their number.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, count: &Buffer, boxes: &Buffer) -> Result<()> {
        self.threads.run(work, count)?;
        let sizes = &self.threads.sizes;
        let mut below = sizes;
        for (_, _, sizing) in &self.levels {
            sizing.run(work, below)?;
            below = &sizing.sizes;
        }
        work.run(&self.as_given, &[sizes, &self.order], Groups::From(sizes))?;
        // A first pass for the box around everything.
        self.surround(work, boxes)?;
        let buffers = [sizes, boxes, &self.nodes, &self.keys];
        work.run(&self.morton, &buffers, Groups::From(sizes))?;
        self.sort.run(work, count, &self.keys, &self.order)?;
        self.surround(work, boxes)
    }

    /// Computes all levels for the current order.
    fn surround(&self, work: &mut Work, boxes: &Buffer) -> Result<()> {
        let mut below = &self.threads.sizes;
        for (i, (_, level, sizing)) in self.levels.iter().enumerate() {
            let sizes = &sizing.sizes;
            if i == 0 {
                let buffers = [sizes, below, level, &self.order, boxes, &self.nodes];
                work.run(&self.around_boxes, &buffers, Groups::From(sizes))?;
            } else {
                let buffers = [sizes, below, level, &self.nodes];
                work.run(&self.around_nodes, &buffers, Groups::From(sizes))?;
            }
            below = sizes;
        }
        Ok(())
    }

    /// Pairs of words; the second words are the boxes' numbers in sorted order.
    #[must_use]
    pub fn order(&self) -> &Buffer {
        &self.order
    }

    /// All [`Bounds`], level by level.
    #[must_use]
    pub fn nodes(&self) -> &Buffer {
        &self.nodes
    }

    /// Positions of the levels, from the boxes' level up.
    pub fn levels(&self) -> impl Iterator<Item = Level> {
        self.levels.iter().map(|(level, ..)| *level)
    }
}

/// The levels over this many boxes.
fn levels(most: u32) -> Vec<Level> {
    let (mut here, mut below, mut length) = (0, 0, most);
    let mut all = Vec::new();
    while all.is_empty() || length > 1 {
        all.push(Level { here, below });
        length = length.div_ceil(4).max(1);
        (here, below) = (here + length, here);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sizes::Sizes;
    use crate::testing::{COUNTS, same_layout, tested};
    use beamfarm_render::sampler::{Purpose, Sampler};

    fn bounds(low: [f32; 3], high: [f32; 3]) -> Bounds {
        Bounds {
            low,
            spare_low: 0,
            high,
            spare_high: 0,
        }
    }

    fn boxes(count: u32) -> Vec<Bounds> {
        let mut sampler = Sampler::new(1, 0, Purpose::Test, count.into());
        let mut boxes: Vec<Bounds> = (0..count)
            .map(|i| {
                let mut draw = || sampler.next_1d();
                // Of all sizes, some far away, many coincident.
                let scale = if i % 97 == 0 { 100.0 } else { 1.0 };
                let low = if i % 5 == 0 {
                    [0.25; 3]
                } else {
                    [draw() * scale, draw() - 0.5, -draw()]
                };
                let size = draw() * draw() * 0.1;
                bounds(low, low.map(|x| x + size))
            })
            .collect();
        if let Some(last) = boxes.last_mut() {
            last.low[1] = f32::NAN;
        }
        boxes
    }

    fn around(all: Bounds, b: &Bounds) -> Bounds {
        let low = |k: usize| if b.low[k] < all.low[k] { b.low[k] } else { all.low[k] };
        let high = |k: usize| {
            if b.high[k] > all.high[k] {
                b.high[k]
            } else {
                all.high[k]
            }
        };
        bounds([0, 1, 2].map(low), [0, 1, 2].map(high))
    }

    fn around_fours(below: &[Bounds]) -> Vec<Bounds> {
        let nothing = bounds([f32::MAX; 3], [f32::MIN; 3]);
        match below {
            [] => vec![nothing],
            _ => below.chunks(4).map(|four| four.iter().fold(nothing, around)).collect(),
        }
    }

    fn key(b: &Bounds, all: &Bounds) -> u64 {
        let mut key = 0;
        for k in 0..3 {
            let steps = ((b.low[k] * 0.5 + b.high[k] * 0.5) - all.low[k]) * (1_048_576.0 / (all.high[k] - all.low[k]));
            let steps = if steps > 0.0 { steps.min(1_048_575.0) as u64 } else { 0 };
            (0..20).for_each(|bit| key |= (steps >> bit & 1) << (3 * bit + k));
        }
        key
    }

    #[test]
    fn hierarchies_are_those_of_plain_rust() {
        let Some(tested) = tested() else { return };
        for (most, counts) in [(5000, &COUNTS[..8]), (300_000, &[299_999])] {
            let hierarchy = Hierarchy::new(tested, most).unwrap();
            for count in counts {
                let boxes = boxes(*count);
                let source = tested.device.buffer("boxes", &boxes).unwrap();
                let counted = tested.device.buffer("count", &[*count]).unwrap();
                let mut work = tested.device.work();
                hierarchy.run(&mut work, &counted, &source).unwrap();
                work.submit().unwrap();

                let nothing = bounds([f32::MAX; 3], [f32::MIN; 3]);
                let all = boxes.iter().fold(nothing, around);
                let mut order: Vec<u32> = (0..*count).collect();
                order.sort_by_cached_key(|i| key(&boxes[*i as usize], &all));
                let got = tested.device.read::<[u32; 2]>(hierarchy.order(), boxes.len()).unwrap();
                assert!(got.iter().map(|pair| pair[1]).eq(order.iter().copied()), "{count}");

                let levels: Vec<Level> = hierarchy.levels().collect();
                let length = levels[levels.len() - 1].here as usize + 1;
                let nodes = tested.device.read::<Bounds>(hierarchy.nodes(), length).unwrap();
                let mut below: Vec<Bounds> = order.iter().map(|i| boxes[*i as usize]).collect();
                for level in levels {
                    below = around_fours(&below);
                    let here = &nodes[level.here as usize..][..below.len()];
                    let bits = |boxes: &[Bounds]| bytemuck::cast_slice::<_, [u32; 8]>(boxes).to_vec();
                    let wrong = bits(here).iter().zip(bits(&below)).position(|(a, b)| *a != b);
                    assert_eq!(wrong.map(|i| (here[i], below[i])), None, "{count} {level:?}");
                }
                assert_eq!(below, [all]);
            }
        }
    }

    #[test]
    fn levels_end_in_one_node() {
        let heres = |most| levels(most).iter().map(|l| (l.here, l.below)).collect::<Vec<_>>();
        assert_eq!(heres(0), [(0, 0)]);
        assert_eq!(heres(1), [(0, 0)]);
        assert_eq!(heres(4), [(0, 0)]);
        assert_eq!(heres(5), [(0, 0), (2, 0)]);
        assert_eq!(heres(70), [(0, 0), (18, 0), (23, 18), (25, 23)]);
    }

    #[test]
    fn boxes_and_levels_lie_in_memory_as_kernels_have_them() {
        for program in [ORDER, TREE] {
            same_layout!(&program, Sizes { groups, count });
            same_layout!(
                &program,
                Bounds {
                    low,
                    spare_low,
                    high,
                    spare_high
                }
            );
        }
        same_layout!(&TREE, Level { here, below });
    }
}
