//! A density sampled on a sparse lattice with trilinear interpolation, in bricks of 8 x 8 x 8 cells.

use crate::parallel;
use glam::{DAffine3, DVec3, IVec3, UVec3, Vec3};
use std::collections::BTreeMap;

/// Cells, and the brick's own samples, along its side.
pub const BRICK: usize = 8;
/// Samples along the side of a stored brick: its own, and the first of the next brick, so that all eight corners of
/// every cell are in one place.
const SIDE: usize = BRICK + 1;
const STORED: usize = SIDE * SIDE * SIDE;
/// Offset from the first to the last corner of a cell.
const FARTHEST_CORNER: usize = 1 + SIDE + SIDE * SIDE;
/// Bricks of a lattice, empty ones included: 256 MiB of table.
const MAX_BRICKS: u64 = 1 << 26;
/// Most stored samples, so that each has a number: 16 GiB.
const MAX_VALUES: usize = u32::MAX as usize - STORED;
/// Largest index of a sample, which leaves single precision a few bits between samples.
const MAX_POSITION: i32 = 1 << 20;

/// The 512 samples of a brick.
#[derive(Clone, Debug, PartialEq)]
pub enum Core {
    /// All the same.
    Constant(f32),
    /// x fastest: sample (x, y, z) is number x + 8 (y + 8 z).
    Samples(Box<[f32; BRICK * BRICK * BRICK]>),
}

/// A density in its own index space, from a file or a recipe: samples at integer positions.
#[derive(Clone, Debug)]
pub struct RawDensity {
    /// By brick: brick (i, j, k) holds the samples from (8i, 8j, 8k) on. Missing bricks are zero.
    pub cores: BTreeMap<[i32; 3], Core>,
    /// First and last sample: positions are clamped to the box between them before interpolation.
    pub samples: [IVec3; 2],
    /// Opposite corners of the box that the medium fills, index space. The density is zero outside it.
    pub domain: [DVec3; 2],
    /// Index space to object space.
    pub to_object: DAffine3,
}

/// Bounds and mean of a density over a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower bound.
    pub minorant: f32,
    /// Upper bound.
    pub majorant: f32,
    /// Approximate mean, always within the bounds.
    pub mean: f32,
}

/// Deviations from the mean up to this share of the largest one count as small.
const NEAR_MEAN: f32 = 0.3;

impl Range {
    /// Range of samples and of all values between them.
    fn of(samples: &[f32]) -> Self {
        let minorant = samples.iter().copied().fold(f32::INFINITY, f32::min);
        let majorant = samples.iter().copied().fold(0.0, f32::max);
        let sum: f64 = samples.iter().map(|v| *v as f64).sum();
        Self {
            minorant,
            majorant,
            mean: ((sum / samples.len() as f64) as f32).clamp(minorant, majorant),
        }
    }

    /// The largest possible difference between the density and a value within its bounds.
    pub fn deviation_from(&self, value: f32) -> f32 {
        (self.majorant - value).max(value - self.minorant)
    }

    /// Whether a value is within the bounds and close to the mean, relative to the distance between the bounds.
    pub fn is_near_mean(&self, value: f32) -> bool {
        (value - self.mean).abs() <= NEAR_MEAN * self.deviation_from(self.mean)
            && value >= self.minorant
            && value <= self.majorant
    }

    /// Range of equally sized regions together.
    pub fn join(regions: &[Self]) -> Self {
        let minorant = regions.iter().map(|r| r.minorant).fold(f32::INFINITY, f32::min);
        let majorant = regions.iter().map(|r| r.majorant).fold(0.0, f32::max);
        let sum: f64 = regions.iter().map(|r| r.mean as f64).sum();
        Self {
            minorant,
            majorant,
            mean: ((sum / regions.len() as f64) as f32).clamp(minorant, majorant),
        }
    }
}

/// Why samples cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DensityError {
    /// No samples.
    #[error("it holds no samples")]
    Empty,
    /// Too many bricks.
    #[error("it spans {0} bricks of 8 x 8 x 8 samples; at most {MAX_BRICKS} are supported")]
    TooLarge(u64),
    /// Positions that single precision cannot resolve.
    #[error("it has samples further than {MAX_POSITION} from its index space's origin")]
    TooFar,
    /// NaN or infinite.
    #[error("its sample at {0} is not finite")]
    NotFinite(IVec3),
    /// The map to object space is singular.
    #[error("its transform flattens it or is not finite")]
    Flat,
}

/// Bricks laid out for lookups. Positions are in sample space, whose origin is the first sample of the first brick.
#[derive(Debug)]
pub struct Bricks {
    /// Bricks per axis.
    count: UVec3,
    /// By brick, x fastest: offset of its samples. Constant bricks of equal value share an entry.
    table: Vec<u32>,
    /// Stored bricks, x fastest.
    values: Vec<f32>,
    /// By brick: bounds of the density.
    ranges: Vec<Range>,
    /// Corners of the box that positions are clamped to.
    clamp: [Vec3; 2],
    /// Corners of the box outside which the density is zero.
    domain: [Vec3; 2],
    /// Sample space to object space.
    to_object: DAffine3,
}

/// The lookup data of [`Bricks`], for storage elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    /// Bricks per axis.
    pub count: UVec3,
    /// By brick, x fastest: offset of its samples.
    pub table: &'a [u32],
    /// Stored bricks, 9 samples along each side, x fastest.
    pub values: &'a [f32],
    /// Corners of the box that positions are clamped to.
    pub clamp: [Vec3; 2],
    /// Corners of the box outside which the density is zero.
    pub domain: [Vec3; 2],
}

impl Bricks {
    /// Lays out samples. Negative ones count as zero: filters that make volumes leave some behind.
    pub fn new(raw: &RawDensity) -> Result<Self, DensityError> {
        let finite = |core: &Core| match core {
            Core::Constant(value) => value.is_finite().then_some(()).ok_or(0),
            Core::Samples(values) => match values.iter().position(|v| !v.is_finite()) {
                Some(i) => Err(i as i32),
                None => Ok(()),
            },
        };
        for (key, core) in &raw.cores {
            finite(core).map_err(|i| {
                let brick = IVec3::from(*key) * BRICK as i32;
                DensityError::NotFinite(brick + IVec3::new(i & 7, i >> 3 & 7, i >> 6))
            })?;
        }
        if !raw.to_object.is_finite() || raw.to_object.matrix3.determinant() == 0.0 {
            return Err(DensityError::Flat);
        }
        let [first, last] = raw.samples;
        if first.cmpgt(last).any() {
            return Err(DensityError::Empty);
        }
        if first.min_element() < -MAX_POSITION || last.max_element() > MAX_POSITION {
            return Err(DensityError::TooFar);
        }
        let brick_of = |sample: IVec3| -> IVec3 { sample >> 3i32 };
        let (low, high) = (brick_of(first), brick_of(last));
        let count = (high.as_i64vec3() - low.as_i64vec3() + 1).as_u64vec3();
        let total = count.x.saturating_mul(count.y).saturating_mul(count.z);
        if total > MAX_BRICKS {
            return Err(DensityError::TooLarge(total));
        }
        let origin = low * BRICK as i32;
        let mut bricks = Self {
            count: count.as_uvec3(),
            table: Vec::new(),
            values: Vec::new(),
            ranges: Vec::with_capacity(total as usize),
            clamp: raw.samples.map(|s| (s - origin).as_vec3()),
            domain: raw.domain.map(|p| (p - origin.as_dvec3()).as_vec3()),
            to_object: raw.to_object * DAffine3::from_translation(origin.as_dvec3()),
        };
        // Until a brick has its samples, its table entry is its core's number.
        let cores: Vec<&Core> = raw.cores.values().collect();
        bricks.table.resize(total as usize, u32::MAX);
        for (i, key) in raw.cores.keys().enumerate() {
            let brick = IVec3::from(*key);
            if brick.cmpge(low).all() && brick.cmple(high).all() {
                let at = bricks.number((brick - low).as_uvec3());
                bricks.table[at] = i as u32;
            }
        }
        let mut constants = BTreeMap::new();
        let mut buffer = [0.0f32; STORED];
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let brick = IVec3::new(x, y, z);
                    // The core, and those that follow it along the axes; none of them includes samples of its
                    // neighbours yet.
                    let neighbours: [Option<&Core>; 8] = std::array::from_fn(|i| {
                        let i = i as i32;
                        let at = brick + IVec3::new(i & 1, i >> 1 & 1, i >> 2);
                        let inside = at.cmple(high).all();
                        let at = inside.then(|| bricks.number((at - low).as_uvec3()))?;
                        cores.get(bricks.table[at] as usize).copied()
                    });
                    let uniform = uniform(neighbours);
                    let range = match uniform {
                        Some(value) => Range::of(&[value]),
                        None => {
                            assemble(raw.samples[1], neighbours, brick, &mut buffer);
                            Range::of(&buffer)
                        }
                    };
                    let (min, max) = (range.minorant, range.majorant);
                    let next = bricks.values.len() as u32;
                    let index = match min == max {
                        true => *constants.entry(min.to_bits()).or_insert(next),
                        false => next,
                    };
                    if index == next {
                        if bricks.values.len() > MAX_VALUES {
                            return Err(DensityError::TooLarge(total));
                        }
                        if let Some(value) = uniform {
                            buffer.fill(value);
                        }
                        bricks.values.extend_from_slice(&buffer);
                    }
                    let at = bricks.ranges.len();
                    bricks.table[at] = index;
                    bricks.ranges.push(range);
                }
            }
        }
        Ok(bricks)
    }

    /// Other values by channel wherever this density has samples, as a function of the point in object space and its
    /// relative position in the box, by axis. Zero where the density is empty, except next to its samples.
    ///
    /// # Errors
    /// A value that is not finite.
    pub fn painted(&self, color: impl Fn(DVec3, DVec3) -> [f32; 3] + Sync) -> Result<Vec<Self>, DensityError> {
        let [low, high] = self.domain.map(|p| p.as_dvec3());
        let brick_of = |number: usize| {
            let (x, rest) = (number as u32 % self.count.x, number as u32 / self.count.x);
            UVec3::new(x, rest % self.count.y, rest / self.count.y)
        };
        // Cells at a brick's end reach into the next one.
        let is_near = |brick: UVec3| {
            (0..8).any(|i| {
                let before = UVec3::new(i & 1, i >> 1 & 1, i >> 2);
                before.cmple(brick).all() && self.range(brick - before).majorant > 0.0
            })
        };
        let cores = parallel::map(self.ranges.len(), |number| {
            let brick = brick_of(number);
            let mut channels = [(); 3].map(|()| Box::new([0.0f32; BRICK * BRICK * BRICK]));
            if is_near(brick) {
                for i in 0..BRICK * BRICK * BRICK {
                    let within = UVec3::new(i as u32 & 7, i as u32 >> 3 & 7, i as u32 >> 6);
                    let sample = (brick * BRICK as u32 + within).as_dvec3();
                    let sample = sample.clamp(self.clamp[0].as_dvec3(), self.clamp[1].as_dvec3());
                    let found = color(self.to_object.transform_point3(sample), (sample - low) / (high - low));
                    for (channel, value) in channels.iter_mut().zip(found) {
                        channel[i] = value;
                    }
                }
            }
            (brick.as_ivec3().to_array(), channels)
        });
        let channel = |c: usize| {
            let core =
                |(brick, channels): &([i32; 3], [Box<[f32; 512]>; 3])| (*brick, Core::Samples(channels[c].clone()));
            Self::new(&RawDensity {
                cores: cores.iter().map(core).collect(),
                samples: self.clamp.map(|p| p.as_ivec3()),
                domain: [low, high],
                to_object: self.to_object,
            })
        };
        (0..3).map(channel).collect()
    }

    /// Bricks per axis.
    pub fn count(&self) -> UVec3 {
        self.count
    }

    /// Samples per axis, from the first to the last.
    pub fn samples(&self) -> UVec3 {
        (self.clamp[1] - self.clamp[0]).as_uvec3() + 1
    }

    /// All lookup data.
    pub fn lookup(&self) -> Lookup<'_> {
        Lookup {
            count: self.count,
            table: &self.table,
            values: &self.values,
            clamp: self.clamp,
            domain: self.domain,
        }
    }

    /// Bounds of the density within a brick.
    pub fn range(&self, brick: UVec3) -> Range {
        self.ranges[self.number(brick)]
    }

    /// A brick's index in the table.
    fn number(&self, brick: UVec3) -> usize {
        (brick.x + self.count.x * (brick.y + self.count.y * brick.z)) as usize
    }

    /// Bounds of the density within an eighth of a brick: `half` counts halves of a brick's side along each axis.
    pub fn range_of_half(&self, half: UVec3) -> Range {
        const HALF: u32 = BRICK as u32 / 2;
        let brick = half / 2;
        let stored = self.table[self.number(brick)] as usize;
        let first = (half % 2) * HALF;
        let mut values = Vec::with_capacity((HALF as usize + 1).pow(3));
        for z in first.z..=first.z + HALF {
            for y in first.y..=first.y + HALF {
                for x in first.x..=first.x + HALF {
                    let at = x as usize + SIDE * (y as usize + SIDE * z as usize);
                    values.push(self.values[stored + at]);
                }
            }
        }
        Range::of(&values)
    }

    /// The largest density.
    pub fn max(&self) -> f32 {
        self.ranges.iter().map(|range| range.majorant).fold(0.0, f32::max)
    }

    /// The box outside which the density is zero, sample space.
    pub fn domain(&self) -> [Vec3; 2] {
        self.domain
    }

    /// Sample space to object space.
    pub fn to_object(&self) -> DAffine3 {
        self.to_object
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.table[..]) + size_of_val(&self.values[..]) + size_of_val(&self.ranges[..])
    }

    /// Density at a position, sample space.
    #[inline(always)]
    pub fn density(&self, position: Vec3) -> f32 {
        self.densities(&position.to_array().map(|x| [x]))[0]
    }

    /// Densities at several positions, sample space: x, y and z of each. Zero where a position is not finite.
    #[inline(always)]
    pub fn densities<const N: usize>(&self, positions: &[[f32; N]; 3]) -> [f32; N] {
        // Adding 1.5 * 2^23 rounds to an integer. Half is subtracted first, which rounds down, or to the integer just
        // reached with a weight of 1 for the next.
        const ROUND: f32 = 12_582_912.0;
        let mut outside = [0u32; N];
        let mut cell = [[0u32; N]; 3];
        let mut weight = [[0.0f32; N]; 3];
        for axis in 0..3 {
            let (low, high) = (self.domain[0][axis], self.domain[1][axis]);
            let (first, last) = (self.clamp[0][axis], self.clamp[1][axis]);
            for l in 0..N {
                let x = positions[axis][l];
                outside[l] |= !((x >= low) & (x <= high)) as u32;
                let x = if x > first { x } else { first };
                let x = if x < last { x } else { last };
                let shifted = (x - 0.5) + ROUND;
                cell[axis][l] = shifted.to_bits() & 0x3f_ffff;
                weight[axis][l] = x - (shifted - ROUND);
            }
        }
        let mut brick = [0u32; N];
        let mut corner = [0u32; N];
        for l in 0..N {
            let [x, y, z] = [cell[0][l], cell[1][l], cell[2][l]];
            let row = (z >> 3).wrapping_mul(self.count.y).wrapping_add(y >> 3);
            brick[l] = row.wrapping_mul(self.count.x).wrapping_add(x >> 3);
            let row = (z & 7).wrapping_mul(SIDE as u32).wrapping_add(y & 7);
            corner[l] = row.wrapping_mul(SIDE as u32).wrapping_add(x & 7);
        }
        let mut corners = [[0.0f32; N]; 8];
        let mut first = [0u32; N];
        let mut differ = 0;
        for l in 0..N {
            first[l] = self.table[brick[l] as usize].wrapping_add(corner[l]);
        }
        for l in 0..N {
            differ |= first[l] ^ first[0];
        }
        let offset = |i: usize| (i & 1) + SIDE * (i >> 1 & 1) + SIDE * SIDE * (i >> 2);
        if differ == 0 {
            // Neighbouring positions often share a cell.
            let v = &self.values[first[0] as usize..][..FARTHEST_CORNER + 1];
            for (i, value) in corners.iter_mut().enumerate() {
                *value = [v[offset(i)]; N];
            }
        } else {
            for l in 0..N {
                let v = &self.values[first[l] as usize..][..FARTHEST_CORNER + 1];
                for (i, value) in corners.iter_mut().enumerate() {
                    value[l] = v[offset(i)];
                }
            }
        }
        let mut out = [0.0; N];
        for l in 0..N {
            let edge = |i: usize| corners[i][l] + (corners[i + 1][l] - corners[i][l]) * weight[0][l];
            let [a, b, c, d] = [edge(0), edge(2), edge(4), edge(6)];
            let (near, far) = (a + (b - a) * weight[1][l], c + (d - c) * weight[1][l]);
            let density = near + (far - near) * weight[2][l];
            out[l] = if outside[l] == 0 { density } else { 0.0 };
        }
        out
    }
}

/// The density of a brick whose cores share one value, found without reading its samples.
fn uniform(neighbours: [Option<&Core>; 8]) -> Option<f32> {
    let constant = |core: Option<&Core>| match core {
        None => Some(0.0),
        Some(Core::Constant(value)) => Some(value.max(0.0)),
        Some(Core::Samples(_)) => None,
    };
    let value = constant(neighbours[0])?;
    neighbours
        .into_iter()
        .all(|core| constant(core) == Some(value))
        .then_some(value)
}

/// A brick with its share of the next bricks. Samples beyond the last one repeat it: they never get any weight.
fn assemble(last: IVec3, neighbours: [Option<&Core>; 8], brick: IVec3, buffer: &mut [f32; STORED]) {
    let mut out = buffer.iter_mut();
    for z in 0..SIDE as i32 {
        for y in 0..SIDE as i32 {
            for x in 0..SIDE as i32 {
                let at = (brick * BRICK as i32 + IVec3::new(x, y, z)).min(last) - brick * BRICK as i32;
                let neighbour = (at.x >> 3 | (at.y >> 3) << 1 | (at.z >> 3) << 2) as usize;
                let value = match neighbours[neighbour] {
                    None => 0.0,
                    Some(Core::Constant(value)) => *value,
                    Some(Core::Samples(values)) => values[((at.x & 7) + 8 * ((at.y & 7) + 8 * (at.z & 7))) as usize],
                };
                if let Some(out) = out.next() {
                    *out = value.max(0.0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::{Purpose, Sampler};

    fn value(x: i32, y: i32, z: i32) -> f32 {
        ((x * 7 + y * 13 + z * 29) % 17).abs() as f32 * 0.25
    }

    fn dense(samples: [IVec3; 2]) -> RawDensity {
        let mut cores = BTreeMap::new();
        let (low, high) = (samples[0] >> 3i32, samples[1] >> 3i32);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let core = std::array::from_fn(|i| {
                        let i = i as i32;
                        value(x * 8 + (i & 7), y * 8 + (i >> 3 & 7), z * 8 + (i >> 6))
                    });
                    cores.insert([x, y, z], Core::Samples(Box::new(core)));
                }
            }
        }
        RawDensity {
            cores,
            samples,
            domain: [samples[0].as_dvec3() - 0.5, samples[1].as_dvec3() + 0.5],
            to_object: DAffine3::IDENTITY,
        }
    }

    #[test]
    fn painted_is_what_is_painted_where_there_is_something() {
        let mut raw = dense([IVec3::new(-3, 2, 5), IVec3::new(20, 19, 30)]);
        // Empty on one side.
        raw.cores.retain(|brick, _| brick[0] < 1);
        raw.to_object = DAffine3::from_scale(DVec3::new(0.5, 2.0, 1.0)) * DAffine3::from_rotation_z(0.3);
        let bricks = Bricks::new(&raw).unwrap();
        // Linear, so that values between samples are exact too.
        let color = |p: DVec3, share: DVec3| [50.0 + p.x, 60.0 + 0.5 * p.y - p.z, 5.0 * share.x].map(|x| x as f32);
        let painted = bricks.painted(color).unwrap();
        let [low, high] = bricks.clamp;
        let mut sampler = Sampler::new(3, 0, Purpose::Test, 0);
        let mut seen = 0;
        for _ in 0..20_000 {
            let u = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
            let position = low + (high - low) * u;
            if bricks.density(position) == 0.0 {
                continue;
            }
            seen += 1;
            let [first, last] = bricks.domain.map(|p| p.as_dvec3());
            let own = bricks.to_object.transform_point3(position.as_dvec3());
            let expected = color(own, (position.as_dvec3() - first) / (last - first));
            for c in 0..3 {
                let found = painted[c].density(position);
                assert!(
                    (found - expected[c]).abs() < 1e-3 * 60.0,
                    "{position} {c}: {found} {expected:?}"
                );
            }
        }
        assert!(seen > 5_000, "{seen}");
    }

    #[test]
    fn positions_are_interpolated_between_eight_samples() {
        let samples = [IVec3::new(-5, 2, -17), IVec3::new(13, 9, 4)];
        let bricks = Bricks::new(&dense(samples)).unwrap();
        let [low, high] = bricks.domain();
        let origin = ((samples[0] >> 3i32) * 8).as_vec3();
        let mut sampler = Sampler::new(1, 0, Purpose::Test, 0);
        for _ in 0..20_000 {
            let u = Vec3::new(sampler.next_1d(), sampler.next_1d(), sampler.next_1d());
            let p = low + (high - low) * u;
            let q = (p + origin).max(samples[0].as_vec3()).min(samples[1].as_vec3());
            let cell = q.floor().as_ivec3();
            let f = q - q.floor();
            let mut expected = 0.0;
            for i in 0..8 {
                let at = |a: i32, f: f32| if a == 1 { f } else { 1.0 - f };
                let (a, b, c) = (i & 1, i >> 1 & 1, i >> 2);
                let weight = at(a, f.x) * at(b, f.y) * at(c, f.z);
                expected += weight * value(cell.x + a, cell.y + b, cell.z + c);
            }
            let got = bricks.density(p);
            assert!((got - expected).abs() < 1e-4, "{got} not {expected} at {p}");
            let brick = (p.max(Vec3::ZERO) / 8.0).as_uvec3().min(bricks.count() - 1);
            let Range {
                minorant: min,
                majorant: max,
                ..
            } = bricks.range(brick);
            assert!(got >= min - 1e-5 && got <= max + 1e-5, "{got} outside {min}..{max}");
            assert_eq!(bricks.density(high + 0.01), 0.0);
        }
    }

    #[test]
    fn bricks_of_one_value_are_stored_once() {
        let mut raw = dense([IVec3::ZERO, IVec3::new(799, 799, 799)].map(|p| p.min(IVec3::splat(7))));
        raw.samples[1] = IVec3::splat(799);
        raw.domain[1] = DVec3::splat(799.0);
        raw.cores.clear();
        raw.cores.insert([3, 4, 5], Core::Constant(2.0));
        let bricks = Bricks::new(&raw).unwrap();
        assert!(bricks.bytes() < 17_000_000, "{}", bricks.bytes());
        assert_eq!(bricks.density(Vec3::new(27.5, 36.5, 45.5)), 2.0);
        assert_eq!(bricks.density(Vec3::new(500.0, 36.5, 45.5)), 0.0);
    }

    #[test]
    fn unusable_samples_are_refused() {
        let sound = dense([IVec3::ZERO, IVec3::splat(9)]);
        let mut raw = sound.clone();
        raw.samples[1] = IVec3::splat(-1);
        assert_eq!(Bricks::new(&raw).unwrap_err(), DensityError::Empty);
        raw.samples = [IVec3::splat(-900_000), IVec3::splat(900_000)];
        assert!(matches!(Bricks::new(&raw), Err(DensityError::TooLarge(_))));
        raw.samples = [IVec3::MIN, IVec3::MAX];
        assert_eq!(Bricks::new(&raw).unwrap_err(), DensityError::TooFar);
        let mut raw = sound.clone();
        raw.cores.insert([1, 0, 0], Core::Constant(f32::NAN));
        let place = DensityError::NotFinite(IVec3::new(8, 0, 0));
        assert_eq!(Bricks::new(&raw).unwrap_err(), place);
        let mut raw = sound;
        raw.to_object.matrix3.z_axis = DVec3::ZERO;
        assert_eq!(Bricks::new(&raw).unwrap_err(), DensityError::Flat);
    }
}
