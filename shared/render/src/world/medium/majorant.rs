//! Bounds of a density on a coarse grid, and the spans into which they cut a ray.

use super::bricks::{BRICK, Bricks, Range};
use crate::math::Vec3;
use glam::UVec3;

/// Most and fewest cells along the longest side.
const MAX_CELLS: u32 = 64;
const FEWEST_CELLS: u32 = 8;

/// Least and largest density per cell of a grid over sample space.
#[derive(Debug)]
pub struct MajorantGrid {
    /// Side of a cell, in samples.
    cell: f32,
    /// Cells per axis.
    count: UVec3,
    /// By cell, x fastest.
    ranges: Vec<Range>,
    /// Corners of the box that the medium fills.
    domain: [Vec3; 2],
    /// Largest deviation from the cell's mean density, averaged over all cells.
    deviation: f32,
}

/// A span of a ray on which the density stays within these bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Distance along the ray where it begins.
    pub start: f32,
    /// Where it ends.
    pub end: f32,
    /// Bounds of the density.
    pub density: Range,
}

impl MajorantGrid {
    /// Bounds for cells of half a brick's side, or of one or more bricks. `free_path`: in samples, at the highest
    /// density. The cells have about this size; smaller ones take longer to traverse than they save.
    pub fn new(bricks: &Bricks, free_path: f32) -> Self {
        let longest = bricks.count().max_element();
        let brick = BRICK as f32;
        if free_path < brick && 2 * longest <= MAX_CELLS {
            return Self::of(bricks, BRICK as u32 / 2, bricks.count() * 2, |cell| {
                bricks.range_of_half(cell)
            });
        }
        let wanted = (free_path / brick).min(longest.div_ceil(FEWEST_CELLS) as f32);
        let per_cell = (wanted as u32).max(longest.div_ceil(MAX_CELLS)).max(1);
        let count = (bricks.count() + per_cell - 1) / per_cell;
        Self::of(bricks, per_cell * BRICK as u32, count, |cell| {
            let first = cell * per_cell;
            let end = (first + per_cell).min(bricks.count());
            let mut within = Vec::new();
            for z in first.z..end.z {
                for y in first.y..end.y {
                    for x in first.x..end.x {
                        within.push(bricks.range(UVec3::new(x, y, z)));
                    }
                }
            }
            Range::join(&within)
        })
    }

    fn of(bricks: &Bricks, cell: u32, count: UVec3, range: impl Fn(UVec3) -> Range) -> Self {
        let at = |i: u32| UVec3::new(i % count.x, i / count.x % count.y, i / (count.x * count.y));
        let cells = count.element_product();
        let ranges: Vec<Range> = (0..cells).map(|i| range(at(i))).collect();
        let deviations = ranges.iter().map(|range| range.deviation_from(range.mean) as f64);
        Self {
            cell: cell as f32,
            count,
            deviation: (deviations.sum::<f64>() / cells as f64) as f32,
            ranges,
            domain: bricks.domain(),
        }
    }

    /// Side of a cell, in samples.
    pub fn cell(&self) -> f32 {
        self.cell
    }

    /// Cells per axis.
    pub fn count(&self) -> UVec3 {
        self.count
    }

    /// By cell, x fastest.
    pub fn ranges(&self) -> &[Range] {
        &self.ranges
    }

    /// Largest deviation from the cell's mean density, averaged over all cells.
    pub fn deviation(&self) -> f32 {
        self.deviation
    }

    /// The part of a ray in sample space (with a direction of any length) inside the domain, between the distances 0
    /// and `length`.
    pub fn clip(&self, origin: Vec3, dir: Vec3, length: f32) -> Option<[f32; 2]> {
        let (mut start, mut end) = (0.0f32, length);
        for axis in 0..3 {
            let (low, high) = (self.domain[0][axis], self.domain[1][axis]);
            let (o, d) = (origin[axis], dir[axis]);
            if d == 0.0 {
                if o < low || o > high {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - o) / d, (high - o) / d);
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
        (start < end && end.is_finite()).then_some([start, end])
    }

    /// The spans of a ray of sample space between two distances within the domain (Amanatides, Woo 1987).
    pub fn spans(&self, origin: Vec3, dir: Vec3, range: [f32; 2]) -> Spans<'_> {
        let position = (origin + dir * range[0]) / self.cell;
        let last = self.count - 1;
        // Conversion to unsigned numbers saturates, and the domain may begin half a sample before the first cell.
        let cell = UVec3::new(position.x as u32, position.y as u32, position.z as u32).min(last);
        let mut next = Vec3::INFINITY;
        let mut step = Vec3::INFINITY;
        for axis in 0..3 {
            let d = dir[axis];
            if d != 0.0 {
                let plane = cell[axis] + (d > 0.0) as u32;
                next[axis] = (plane as f32 * self.cell - origin[axis]) / d;
                step[axis] = self.cell / d.abs();
            }
        }
        Spans {
            grid: self,
            cell,
            forward: [dir.x > 0.0, dir.y > 0.0, dir.z > 0.0],
            next,
            step,
            at: range[0],
            end: range[1],
        }
    }
}

fn flat(cell: UVec3, count: UVec3) -> usize {
    (cell.x + count.x * (cell.y + count.y * cell.z)) as usize
}

/// Iterator over the spans of a ray.
#[derive(Clone, Debug)]
pub struct Spans<'a> {
    grid: &'a MajorantGrid,
    cell: UVec3,
    forward: [bool; 3],
    /// By axis: distance to the next plane between cells.
    next: Vec3,
    /// By axis: distance from plane to plane.
    step: Vec3,
    at: f32,
    end: f32,
}

impl Iterator for Spans<'_> {
    type Item = Span;

    #[inline]
    fn next(&mut self) -> Option<Span> {
        if self.at >= self.end {
            return None;
        }
        let density = self.grid.ranges[flat(self.cell, self.grid.count)];
        let next = self.next;
        let axis = if next.x <= next.y && next.x <= next.z {
            0
        } else if next.y <= next.z {
            1
        } else {
            2
        };
        let start = self.at;
        let mut end = next[axis].clamp(start, self.end);
        // At the grid's edge, the last cell extends to the end of the domain.
        let cell = self.cell[axis];
        let leaves = match self.forward[axis] {
            true => cell + 1 >= self.grid.count[axis],
            false => cell == 0,
        };
        if leaves {
            self.next[axis] = f32::INFINITY;
            if self.next.min_element() >= self.end {
                end = self.end;
            }
        } else {
            self.cell[axis] = match self.forward[axis] {
                true => cell + 1,
                false => cell - 1,
            };
            self.next[axis] += self.step[axis];
        }
        self.at = end;
        Some(Span { start, end, density })
    }
}
