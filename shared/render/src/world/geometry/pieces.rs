//! Cuts many items into separate pieces, for trees that are built in parallel.

use crate::math::Vec3;
use crate::parallel;
use obvhs::aabb::Aabb;
use rayon::prelude::*;

/// Items close to each other.
pub(super) struct Piece {
    /// Their numbers, ascending.
    pub items: Vec<u32>,
    /// The box around them.
    pub bounds: Aabb,
}

/// Cuts items, given their boxes, into pieces of at most `largest` where the surface area heuristic suggests. Sums are
/// over integers, boxes have no order, and numbers break ties: nothing depends on threads.
pub(super) fn pieces(count: usize, around: impl Fn(usize) -> Aabb + Sync, largest: usize) -> Vec<Piece> {
    let entry = |index: u32| {
        let bounds = around(index as usize);
        Entry {
            low: bounds.min.into(),
            high: bounds.max.into(),
            index,
        }
    };
    let mut entries = parallel::collected((0..count as u32).into_par_iter().map(entry));
    let parts = cut(&mut entries, largest.max(1));
    parallel::map(parts.len(), |i| Piece::new(parts[i]))
}

impl Piece {
    fn new(entries: &[Entry]) -> Self {
        let mut items: Vec<u32> = entries.iter().map(|entry| entry.index).collect();
        items.sort_unstable();
        let bounds = entries
            .iter()
            .fold(EMPTY, |bounds, entry| bounds.around(entry.bounds()));
        Self {
            items,
            bounds: Aabb::new(bounds.low.into(), bounds.high.into()),
        }
    }
}

/// An item's box and number.
struct Entry {
    low: Vec3,
    high: Vec3,
    index: u32,
}

impl Entry {
    fn bounds(&self) -> Bounds {
        Bounds {
            low: self.low,
            high: self.high,
        }
    }

    fn center(&self) -> Vec3 {
        0.5 * self.low + 0.5 * self.high
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

const EMPTY: Bounds = Bounds {
    low: Vec3::INFINITY,
    high: Vec3::NEG_INFINITY,
};

impl Bounds {
    fn around(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    fn half_area(self) -> f32 {
        let d = self.high - self.low;
        (d.x + d.y) * d.z + d.x * d.y
    }
}

/// Slices along an axis between which items may be cut.
const SLICES: usize = 32;
/// Each side gets at least one in this many, which keeps the tree over the pieces small.
const LEAST: usize = 16;
/// Items per thread task.
const CHUNK: usize = 1 << 14;

/// By axis and slice: the number of centres in it, and the box around their items.
type Slices = [[(usize, Bounds); SLICES]; 3];

fn cut(entries: &mut [Entry], largest: usize) -> Vec<&[Entry]> {
    if entries.len() <= largest {
        return vec![entries];
    }
    let middle = divide(entries);
    let (left, right) = entries.split_at_mut(middle);
    let (mut parts, others) = rayon::join(|| cut(left, largest), || cut(right, largest));
    parts.extend(others);
    parts
}

/// Moves the items of one side before those of the other, and returns how many there are.
fn divide(entries: &mut [Entry]) -> usize {
    let chunks: Vec<&[Entry]> = entries.chunks(CHUNK).collect();
    let centers = parallel::map(chunks.len(), |i| {
        chunks[i].iter().fold(EMPTY, |bounds, entry| {
            let center = entry.center();
            bounds.around(Bounds {
                low: center,
                high: center,
            })
        })
    });
    let centers = centers.into_iter().fold(EMPTY, Bounds::around);
    let extent = centers.high - centers.low;
    let per_length = SLICES as f32 / extent;
    // Past the end where there is no extent; `as` makes that the last slice.
    let slice = |entry: &Entry, axis: usize| {
        let along = (entry.center()[axis] - centers.low[axis]) * per_length[axis];
        (along as usize).min(SLICES - 1)
    };
    let nothing: Slices = [[(0, EMPTY); SLICES]; 3];
    let of_chunks = parallel::map(chunks.len(), |i| {
        let mut slices = nothing;
        for entry in chunks[i] {
            for (axis, slices) in slices.iter_mut().enumerate() {
                let (count, bounds) = &mut slices[slice(entry, axis)];
                *count += 1;
                *bounds = bounds.around(entry.bounds());
            }
        }
        slices
    });
    let mut slices = nothing;
    for more in of_chunks {
        for ((count, bounds), (n, b)) in slices.iter_mut().flatten().zip(more.iter().flatten()) {
            *count += n;
            *bounds = bounds.around(*b);
        }
    }
    match cheapest(&slices, entries.len()) {
        Some((axis, limit)) => {
            let mut middle = 0;
            for i in 0..entries.len() {
                if slice(&entries[i], axis) < limit {
                    entries.swap(middle, i);
                    middle += 1;
                }
            }
            middle
        }
        None => {
            let (middle, axis) = (entries.len() / 2, extent.max_position());
            entries.select_nth_unstable_by(middle, |a, b| {
                let centers = a.center()[axis].total_cmp(&b.center()[axis]);
                centers.then(a.index.cmp(&b.index))
            });
            middle
        }
    }
}

/// The cheapest axis, and the first slice of its far side.
fn cheapest(slices: &Slices, count: usize) -> Option<(usize, usize)> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for (axis, slices) in slices.iter().enumerate() {
        let mut from_here = [(0, EMPTY); SLICES + 1];
        for i in (0..SLICES).rev() {
            let (n, bounds) = from_here[i + 1];
            from_here[i] = (n + slices[i].0, bounds.around(slices[i].1));
        }
        let mut before = (0, EMPTY);
        for limit in 1..SLICES {
            before = (before.0 + slices[limit - 1].0, before.1.around(slices[limit - 1].1));
            let after = from_here[limit];
            if before.0.min(after.0) < (count / LEAST).max(1) {
                continue;
            }
            let cost = before.0 as f32 * before.1.half_area() + after.0 as f32 * after.1.half_area();
            if cost < least {
                least = cost;
                best = Some((axis, limit));
            }
        }
    }
    best
}
