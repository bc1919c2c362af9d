//! Cuts beams into pieces, and builds a hierarchy over them.

use super::Piece;
use crate::device::{Buffer, Groups, Kernel, Work};
use crate::error::Result;
use crate::hierarchy::{Bounds, Hierarchy, Level};
use crate::kernels::PIECES;
use crate::scan::Scan;
use crate::self_test::Together;
use crate::sizes::{Sizing, TILE};

/// Cuts beams, which are counted on the device, and lays out the pieces for searching.
pub struct Pieces {
    tiles: Sizing,
    threads: Sizing,
    piece_threads: Sizing,
    sum_lengths: Kernel,
    mean_length: Kernel,
    count_pieces: Kernel,
    cut: Kernel,
    place: Kernel,
    scan: Scan,
    hierarchy: Hierarchy,
    sums: Buffer,
    length: Buffer,
    counts: Buffer,
    parts: Buffer,
    boxes: Buffer,
    pieces: Buffer,
    levels: Buffer,
    no_planes: Buffer,
}

/// Most pieces of this many beams. A beam has at most its length over a quarter of the mean length, plus one; that adds
/// up to five per beam, apart from the rounding of the mean.
pub(super) fn most_pieces(beams: u32) -> u32 {
    let most = u64::from(beams) * 5 + u64::from(beams) / 1024 + 64;
    most.min(u32::MAX.into()) as u32
}

impl Pieces {
    /// For at most this many beams.
    ///
    /// # Errors
    /// Device errors.
    pub fn new<'a>(on: impl Into<Together<'a>>, most_beams: u32) -> Result<Self> {
        let on = on.into();
        let most = most_pieces(most_beams);
        let each = |name, bytes: usize, count: u32| on.empty(name, bytes as u64 * u64::from(count));
        let hierarchy = Hierarchy::new(on, most)?;
        let levels: Vec<Level> = hierarchy.levels().collect();
        let top = Level {
            here: levels.len() as u32 - 1,
            below: 0,
        };
        Ok(Self {
            tiles: Sizing::new(on, "tiles")?,
            threads: Sizing::new(on, "threads")?,
            piece_threads: Sizing::new(on, "threads")?,
            sum_lengths: on.kernel(&PIECES, "sum_lengths"),
            mean_length: on.kernel(&PIECES, "mean_length"),
            count_pieces: on.kernel(&PIECES, "count_pieces"),
            cut: on.kernel(&PIECES, "cut"),
            place: on.kernel(&PIECES, "place"),
            scan: Scan::new(on, most_beams)?,
            sums: each("sums of lengths", 4, most_beams.div_ceil(TILE).max(1))?,
            length: each("length of pieces", 4, 1)?,
            counts: each("pieces of beams", 4, most_beams)?,
            parts: each("parts of beams", 8, most)?,
            boxes: each("boxes of pieces", size_of::<Bounds>(), most)?,
            pieces: each("pieces", size_of::<Piece>(), most)?,
            levels: on.device.buffer("levels", &[&[top], &levels[..]].concat())?,
            no_planes: on.empty("no planes", 0)?,
            hierarchy,
        })
    }

    /// Cuts [`Beam`](super::Beam)s; `count`'s first word is their number.
    ///
    /// The pieces of a beam have equal lengths, about a quarter of the mean length of all beams, or a 64th of the beam.
    /// A beam with a length that is not a number has none. The mean is summed in single precision, unlike on the
    /// processor: pieces may end elsewhere than there, which affects only how they are found.
    ///
    /// # Errors
    /// Device errors.
    pub fn run(&self, work: &mut Work, count: &Buffer, beams: &Buffer) -> Result<()> {
        self.run_by_walls(work, count, beams, &self.no_planes)
    }

    /// The same for beams that know the walls near them: [`Walls::planes`](super::Walls::planes).
    ///
    /// # Errors
    /// Device errors.
    pub fn run_by_walls(&self, work: &mut Work, count: &Buffer, beams: &Buffer, planes: &Buffer) -> Result<()> {
        self.tiles.run(work, count)?;
        self.threads.run(work, count)?;
        let (tiles, threads) = (&self.tiles.sizes, &self.threads.sizes);
        let (length, counts) = (&self.length, &self.counts);
        work.run(&self.sum_lengths, &[tiles, beams, &self.sums], Groups::From(tiles))?;
        work.run(&self.mean_length, &[tiles, &self.sums, length], Groups::Count(1))?;
        let groups = Groups::From(threads);
        work.run(&self.count_pieces, &[threads, beams, length, counts], groups)?;
        self.scan.run(work, count, counts)?;
        let buffers = [threads, beams, length, counts, &self.parts, &self.boxes];
        work.run(&self.cut, &buffers, groups)?;
        self.hierarchy.run(work, self.count(), &self.boxes)?;
        self.piece_threads.run(work, self.count())?;
        let sizes = &self.piece_threads.sizes;
        let order = self.hierarchy.order();
        let buffers = [sizes, beams, length, &self.parts, order, &self.pieces, planes];
        work.run(&self.place, &buffers, Groups::From(sizes))?;
        Ok(())
    }

    /// The number of pieces, in its first word.
    #[must_use]
    pub fn count(&self) -> &Buffer {
        self.scan.total()
    }

    /// All [`Piece`]s, with neighbours close together.
    #[must_use]
    pub fn pieces(&self) -> &Buffer {
        &self.pieces
    }

    /// Boxes around every four pieces, every four of these, and so on: see [`Hierarchy`].
    #[must_use]
    pub fn nodes(&self) -> &Buffer {
        self.hierarchy.nodes()
    }

    /// Two words, the first the number of the last level, and then each [`Level`] of the boxes.
    #[must_use]
    pub fn levels(&self) -> &Buffer {
        &self.levels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beams::Beam;
    use crate::testing::{COUNTS, tested};
    use beamfarm_render::sampler::{Purpose, Sampler};

    /// Beams of many lengths: some of length zero, some infinite, and one NaN.
    fn beams(count: u32) -> Vec<Beam> {
        let mut sampler = Sampler::new(2, 0, Purpose::Test, count.into());
        let mut beams: Vec<Beam> = (0..count)
            .map(|i| {
                let length = match i % 50 {
                    0 => 0.0,
                    1 => 100.0 * sampler.next_1d(),
                    _ => sampler.next_1d(),
                };
                let [x, y] = sampler.next_2d().to_array();
                Beam {
                    origin: [x, y, sampler.next_1d() - 3.0],
                    radius: 0.01 + 0.1 * sampler.next_1d(),
                    dir: [0.6, -0.8, 0.0],
                    radius_slope: 0.1 * (sampler.next_1d() - 0.5),
                    power: [1.0, x, y],
                    length,
                    extent: if i % 50 == 0 {
                        [0.0; 2]
                    } else {
                        [-0.01 * x, length + 0.01 * y]
                    },
                    medium: i % 3,
                    walls: 0,
                }
            })
            .collect();
        if let Some(last) = beams.last_mut().filter(|_| count == 64) {
            last.extent[1] = f32::NAN;
        }
        beams
    }

    /// Sums every 256th number, then halves the 256 sums repeatedly.
    fn sum(numbers: &[f32]) -> f32 {
        let mut sums = [0.0; 256];
        for (i, number) in numbers.iter().enumerate() {
            sums[i % 256] += number;
        }
        for apart in [128, 64, 32, 16, 8, 4, 2, 1] {
            (0..apart).for_each(|i| sums[i] += sums[i + apart]);
        }
        sums[0]
    }

    fn cut(beam: &Beam, number: u32, length: f32) -> Vec<Piece> {
        let [start, end] = beam.extent;
        let count = ((end - start) / length).ceil().clamp(1.0, 64.0) as u32;
        let at = |n: u32| match n == count {
            true => end,
            false => start + (end - start) * (n as f32 / count as f32),
        };
        let radius_at = |s: f32| beam.radius + beam.radius_slope * s;
        (0..count)
            .map(|n| Piece {
                origin: beam.origin,
                start: at(n),
                dir: beam.dir,
                end: at(n + 1),
                power: beam.power,
                radius: beam.radius,
                radius_slope: beam.radius_slope,
                max_radius: radius_at(at(n)).max(radius_at(at(n + 1))),
                beam: number,
                medium: beam.medium,
            })
            .collect()
    }

    fn bits(pieces: &[Piece]) -> Vec<[u32; 16]> {
        bytemuck::cast_slice(pieces).to_vec()
    }

    #[test]
    fn pieces_are_those_of_plain_rust() {
        let Some(tested) = tested() else { return };
        let most = 10_000;
        let on_device = Pieces::new(tested, most).unwrap();
        for count in COUNTS.iter().copied().filter(|count| *count < most).chain([most]) {
            let beams = beams(count);
            let lengths: Vec<f32> = beams.iter().map(|beam| beam.extent[1] - beam.extent[0]).collect();
            let tiles: Vec<f32> = lengths.chunks(TILE as usize).map(sum).collect();
            let length = sum(&tiles) / count.max(1) as f32 * 0.25;
            let exact: f64 = lengths.iter().copied().map(f64::from).sum();
            let exact = (exact / f64::from(count.max(1))) as f32 / 4.0;
            assert!(
                count == 64 || (length - exact).abs() <= 1e-6 * exact,
                "{length} {exact}"
            );
            let all = |length: f32| {
                let each = (0..).zip(&beams);
                each.flat_map(move |(i, beam)| cut(beam, i, length))
                    .collect::<Vec<Piece>>()
            };
            let expected = all(length);
            // As many as with the processor's mean, except for a few.
            assert!(expected.len().abs_diff(all(exact).len()) <= beams.len() / 1000);

            let device = &tested.device;
            let counted = device.buffer("count", &[count]).unwrap();
            let source = device.buffer("beams", &beams).unwrap();
            let mut work = device.work();
            on_device.run(&mut work, &counted, &source).unwrap();
            work.submit().unwrap();
            assert_eq!(
                device.read::<u32>(on_device.count(), 1).unwrap(),
                [expected.len() as u32]
            );
            let order = device
                .read::<[u32; 2]>(on_device.hierarchy.order(), expected.len())
                .unwrap();
            let mut seen = vec![false; expected.len()];
            order.iter().for_each(|[_, i]| seen[*i as usize] = true);
            assert!(seen.iter().all(|seen| *seen), "{count}");
            let ordered: Vec<Piece> = order.iter().map(|[_, i]| expected[*i as usize]).collect();
            let got = device.read::<Piece>(on_device.pieces(), expected.len()).unwrap();
            assert!(bits(&got) == bits(&ordered), "{count}");

            let boxes = device.read::<Bounds>(&on_device.boxes, expected.len()).unwrap();
            for (piece, bounds) in expected.iter().zip(boxes) {
                let at = |k: usize| [piece.start, piece.end].map(|s| piece.origin[k] + piece.dir[k] * s);
                let low = [0, 1, 2].map(|k| at(k)[0].min(at(k)[1]));
                let high = [0, 1, 2].map(|k| at(k)[0].max(at(k)[1]));
                let size = low.iter().chain(&high).fold(0.0f32, |size, x| size.max(x.abs()));
                let reach = 1.0001 * piece.max_radius + 1e-5 * size;
                assert_eq!(bounds.low, low.map(|x| x - reach));
                assert_eq!(bounds.high, high.map(|x| x + reach));
            }
        }
    }

    #[test]
    fn pieces_have_room() {
        assert_eq!(most_pieces(0), 64);
        assert_eq!(most_pieces(1 << 20), 5 * (1 << 20) + 1024 + 64);
        assert_eq!(most_pieces(u32::MAX), u32::MAX);
    }
}
