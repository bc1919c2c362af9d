//! Gradient noise (Perlin 2002) in one to four dimensions and its fractals, with the values of Blender's Noise node.
//!
//! Fractals: Musgrave in Ebert et al., Texturing and Modeling, 3rd edition, chapter 16; the scales that map noise to
//! [-1, 1] are Open Shading Language's.

use super::hash::{self, lookup3};

/// How octaves of noise are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseKind {
    /// Fractal Brownian motion: their sum.
    Fbm,
    /// Their product.
    Multifractal,
    /// A sum weighted by the octaves below.
    HybridMultifractal,
    /// Sharp ridges.
    RidgedMultifractal,
    /// Rougher at higher values.
    HeteroTerrain,
}

/// Parameters of the octaves.
#[derive(Clone, Copy, Debug)]
pub struct Octaves {
    /// Number of octaves minus one, in [0, 15]; a fraction fades in the last one.
    pub detail: f32,
    /// Amplitude ratio of successive octaves.
    pub roughness: f32,
    /// Frequency ratio of successive octaves.
    pub lacunarity: f32,
    /// Added to ridges, hybrids and terrain.
    pub offset: f32,
    /// For ridges and hybrids.
    pub gain: f32,
}

/// Interpolation weight with zero derivative at integers.
fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// A gradient, chosen by a hash, times a vector.
fn slope<const N: usize>(hash: u32, p: [f32; N]) -> f32 {
    let sign = |value: f32, bit: u32| if hash & bit != 0 { -value } else { value };
    let at = |i: usize| p.get(i).copied().unwrap_or(0.0);
    match N {
        1 => sign((1 + (hash & 7)) as f32, 8) * at(0),
        2 => {
            let (u, v) = if hash & 7 < 4 { (at(0), at(1)) } else { (at(1), at(0)) };
            sign(u, 1) + sign(2.0 * v, 2)
        }
        3 => {
            let h = hash & 15;
            let u = if h < 8 { at(0) } else { at(1) };
            let v = match h {
                0..4 => at(1),
                12 | 14 => at(0),
                _ => at(2),
            };
            sign(u, 1) + sign(v, 2)
        }
        _ => {
            let h = hash & 31;
            let u = if h < 24 { at(0) } else { at(1) };
            let v = if h < 16 { at(1) } else { at(2) };
            let s = if h < 8 { at(2) } else { at(3) };
            sign(u, 1) + sign(v, 2) + sign(s, 4)
        }
    }
}

/// Noise in [-1, 1], zero at integers. It repeats after 100,000.
pub fn signed<const N: usize>(p: [f32; N]) -> f32 {
    let p = p.map(|x| x % 100_000.0 + if x.abs() >= 1_000_000.0 { 0.5 } else { 0.0 });
    let floor = p.map(f32::floor);
    let from: [f32; N] = std::array::from_fn(|i| p[i] - floor[i]);
    let cell = floor.map(|x| x as i32);
    let mut values = [0.0; 16];
    for (corner, value) in values.iter_mut().enumerate().take(1 << N) {
        let high = |i: usize| (corner >> i & 1) as i32;
        let key = std::array::from_fn(|i| cell[i].wrapping_add(high(i)) as u32);
        *value = slope::<N>(lookup3::<N>(key), std::array::from_fn(|i| from[i] - high(i) as f32));
    }
    for (i, &x) in from.iter().enumerate() {
        let t = fade(x);
        // Pairs that differ in the lowest remaining axis.
        for pair in 0..1 << (N - 1 - i) {
            values[pair] = values[2 * pair] * (1.0 - t) + values[2 * pair + 1] * t;
        }
    }
    [0.25, 0.6616, 0.982, 0.8344][N - 1] * values[0]
}

fn scaled<const N: usize>(p: [f32; N], by: f32) -> [f32; N] {
    p.map(|x| x * by)
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// A sum of octaves; `normalize`: in [0, 1].
pub fn fbm<const N: usize>(p: [f32; N], octaves: &Octaves, normalize: bool) -> f32 {
    let (mut scale, mut amplitude, mut most, mut sum) = (1.0, 1.0, 0.0, 0.0);
    let shown = |sum: f32, most: f32| if normalize { 0.5 * sum / most + 0.5 } else { sum };
    for _ in 0..=octaves.detail as i32 {
        sum += amplitude * signed(scaled(p, scale));
        most += amplitude;
        amplitude *= octaves.roughness;
        scale *= octaves.lacunarity;
    }
    match octaves.detail - octaves.detail.floor() {
        0.0 => shown(sum, most),
        rest => {
            let next = sum + amplitude * signed(scaled(p, scale));
            mix(shown(sum, most), shown(next, most + amplitude), rest)
        }
    }
}

fn multifractal<const N: usize>(mut p: [f32; N], octaves: &Octaves) -> f32 {
    let (mut value, mut power) = (1.0, 1.0);
    for _ in 0..=octaves.detail as i32 {
        value *= power * signed(p) + 1.0;
        power *= octaves.roughness;
        p = scaled(p, octaves.lacunarity);
    }
    match octaves.detail - octaves.detail.floor() {
        0.0 => value,
        rest => value * (rest * power * signed(p) + 1.0),
    }
}

fn hetero_terrain<const N: usize>(mut p: [f32; N], octaves: &Octaves) -> f32 {
    let mut power = octaves.roughness;
    let mut value = octaves.offset + signed(p);
    p = scaled(p, octaves.lacunarity);
    for _ in 1..=octaves.detail as i32 {
        value += (signed(p) + octaves.offset) * power * value;
        power *= octaves.roughness;
        p = scaled(p, octaves.lacunarity);
    }
    match octaves.detail - octaves.detail.floor() {
        0.0 => value,
        rest => value + rest * (signed(p) + octaves.offset) * power * value,
    }
}

fn hybrid<const N: usize>(mut p: [f32; N], octaves: &Octaves) -> f32 {
    let (mut power, mut value, mut weight) = (1.0, 0.0, 1.0f32);
    let mut octave = 0;
    while weight > 0.001 && octave <= octaves.detail as i32 {
        weight = weight.min(1.0);
        let signal = (signed(p) + octaves.offset) * power;
        power *= octaves.roughness;
        value += weight * signal;
        weight *= octaves.gain * signal;
        p = scaled(p, octaves.lacunarity);
        octave += 1;
    }
    let rest = octaves.detail - octaves.detail.floor();
    if rest != 0.0 && weight > 0.001 {
        value += rest * weight.min(1.0) * (signed(p) + octaves.offset) * power;
    }
    value
}

fn ridged<const N: usize>(mut p: [f32; N], octaves: &Octaves) -> f32 {
    let ridge = |p: [f32; N]| {
        let height = octaves.offset - signed(p).abs();
        height * height
    };
    let mut power = octaves.roughness;
    let mut signal = ridge(p);
    let mut value = signal;
    for _ in 1..=octaves.detail as i32 {
        p = scaled(p, octaves.lacunarity);
        signal = ridge(p) * (signal * octaves.gain).clamp(0.0, 1.0);
        value += signal * power;
        power *= octaves.roughness;
    }
    value
}

fn fractal<const N: usize>(p: [f32; N], kind: NoiseKind, octaves: &Octaves, normalize: bool) -> f32 {
    match kind {
        NoiseKind::Fbm => fbm(p, octaves, normalize),
        NoiseKind::Multifractal => multifractal(p, octaves),
        NoiseKind::HybridMultifractal => hybrid(p, octaves),
        NoiseKind::RidgedMultifractal => ridged(p, octaves),
        NoiseKind::HeteroTerrain => hetero_terrain(p, octaves),
    }
}

/// Shifts noise to a region unrelated to that near zero.
fn elsewhere<const N: usize>(p: [f32; N], seed: f32) -> [f32; N] {
    std::array::from_fn(|i| {
        let number = match N {
            1 => hash::of_floats([seed]),
            _ => hash::of_floats([seed, i as f32]),
        };
        p[i] + 100.0 + number * 100.0
    })
}

/// The Noise node's value at `p`, already scaled; with `color`, three values, the first of which is that one.
pub fn texture<const N: usize>(
    p: [f32; N],
    kind: NoiseKind,
    octaves: &Octaves,
    normalize: bool,
    distortion: f32,
    color: bool,
) -> [f32; 3] {
    let moved = match distortion {
        0.0 => p,
        _ => std::array::from_fn(|i| p[i] + signed(elsewhere(p, i as f32)) * distortion),
    };
    let value = fractal(moved, kind, octaves, normalize);
    let other = |i: usize| fractal(elsewhere(moved, (N + i) as f32), kind, octaves, normalize);
    match color {
        true => [value, other(0), other(1)],
        false => [value; 3],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_vanishes_at_whole_numbers_and_stays_within_one() {
        assert_eq!(signed([3.0]), 0.0);
        assert_eq!(signed([-2.0, 5.0]), 0.0);
        assert_eq!(signed([1.0, -7.0, 4.0]), 0.0);
        assert_eq!(signed([0.0, 2.0, -1.0, 8.0]), 0.0);
        let (mut low, mut high) = ([1.0f32; 4], [-1.0f32; 4]);
        for i in 0..20_000 {
            let x = |k: f32| i as f32 * k - 3000.0;
            let p = [x(0.754_87), x(0.569_84), x(0.819_17), x(0.671_04)];
            let values = [
                signed([p[0]]),
                signed([p[0], p[1]]),
                signed([p[0], p[1], p[2]]),
                signed(p),
            ];
            for (i, value) in values.into_iter().enumerate() {
                low[i] = low[i].min(value);
                high[i] = high[i].max(value);
            }
        }
        assert!(low.iter().all(|&x| (-1.01..-0.5).contains(&x)), "{low:?}");
        assert!(high.iter().all(|&x| (0.5..1.01).contains(&x)), "{high:?}");
    }

    #[test]
    fn noise_is_smooth() {
        let step = 1.0 / 1024.0;
        for i in 0..4096 {
            let at = |t: f32| signed([t, 0.3 * t, 0.7]);
            let x = i as f32 * step;
            assert!((at(x + step) - at(x)).abs() < 8.0 * step);
        }
    }
}
