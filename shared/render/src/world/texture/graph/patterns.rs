//! Gradients, waves, bricks, magic and checkers, with the values of Blender's nodes.

use super::noise::{Octaves, fbm};
use crate::math::{PI, Rgb, Vec3, atan2, cos, sin};

/// Shape of a gradient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum GradientKind {
    Linear,
    Quadratic,
    Easing,
    Diagonal,
    Spherical,
    QuadraticSphere,
    Radial,
}

/// In [0, 1].
pub fn gradient(p: Vec3, kind: GradientKind) -> f32 {
    let ball = || (0.999_999 - p.length()).max(0.0);
    let value = match kind {
        GradientKind::Linear => p.x,
        GradientKind::Quadratic => p.x.max(0.0) * p.x.max(0.0),
        GradientKind::Easing => {
            let t = p.x.clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }
        GradientKind::Diagonal => 0.5 * (p.x + p.y),
        GradientKind::Spherical => ball(),
        GradientKind::QuadraticSphere => ball() * ball(),
        GradientKind::Radial => atan2(p.y, p.x) / (2.0 * PI) + 0.5,
    };
    value.clamp(0.0, 1.0)
}

/// `depth` turns of nested sines and cosines.
pub fn magic(p: Vec3, scale: f32, depth: u32, distortion: f32) -> Rgb {
    let [px, py, pz] = p.to_array().map(|x| x % (2.0 * PI));
    let mut x = sin((px + py + pz) * 5.0 * scale);
    let mut y = cos((-px + py - pz) * 5.0 * scale);
    let mut z = -cos((-px - py + pz) * 5.0 * scale);
    if depth > 0 {
        (x, y, z) = (x * distortion, y * distortion, z * distortion);
        y = -cos(x - y + z) * distortion;
    }
    for turn in 1..depth.min(10) {
        match turn {
            1 => x = cos(x - y - z) * distortion,
            2 => z = sin(-x - y - z) * distortion,
            3 => x = -cos(-x + y - z) * distortion,
            4 => y = -sin(-x + y + z) * distortion,
            5 => y = -cos(-x + y + z) * distortion,
            6 => x = cos(x + y + z) * distortion,
            7 => z = sin(x + y - z) * distortion,
            8 => x = -cos(-x - y + z) * distortion,
            _ => y = -sin(x - y + z) * distortion,
        }
    }
    let color = Rgb::new(x, y, z);
    Rgb::splat(0.5)
        - if distortion != 0.0 {
            color / (2.0 * distortion)
        } else {
            color
        }
}

/// Direction of waves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaveKind {
    /// Along the coordinates times these factors.
    Bands([u8; 3]),
    /// Around the origin, in the coordinates times these factors.
    Rings([u8; 3]),
}

/// Profile of waves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum WaveProfile {
    Sine,
    Saw,
    Triangle,
}

/// Distortion of a wave.
#[derive(Clone, Copy, Debug)]
pub struct WaveNoise {
    /// Strength.
    pub distortion: f32,
    /// Frequency of the noise relative to the wave.
    pub scale: f32,
    /// Octaves of the noise.
    pub octaves: Octaves,
}

/// In [0, 1]; `p` is already scaled.
pub fn wave(p: Vec3, kind: WaveKind, profile: WaveProfile, phase: f32, noise: &WaveNoise) -> f32 {
    // Off the integers, at which a wave jumps.
    let p = (p + 1e-6) * 0.999_999;
    let of = |factors: [u8; 3]| p * Vec3::from_array(factors.map(f32::from));
    let mut n = match kind {
        // Diagonal bands are half as dense along each axis.
        WaveKind::Bands([1, 1, 1]) => p.element_sum() * 10.0,
        WaveKind::Bands(factors) => of(factors).element_sum() * 20.0,
        WaveKind::Rings(factors) => of(factors).length() * 20.0,
    };
    n += phase;
    if noise.distortion != 0.0 {
        let random = fbm((p * noise.scale).to_array(), &noise.octaves, true);
        n += noise.distortion * (random * 2.0 - 1.0);
    }
    let turns = n / (2.0 * PI);
    match profile {
        WaveProfile::Sine => 0.5 + 0.5 * sin(n - 0.5 * PI),
        WaveProfile::Saw => turns - turns.floor(),
        WaveProfile::Triangle => (turns - (turns + 0.5).floor()).abs() * 2.0,
    }
}

/// Variation between rows of bricks.
#[derive(Clone, Copy, Debug)]
pub struct Rows {
    /// Shift of every `offset_frequency`-th row, in bricks.
    pub offset: f32,
    /// Interval of shifted rows.
    pub offset_frequency: u32,
    /// Factor on the width of bricks in every `squash_frequency`-th row.
    pub squash: f32,
    /// Interval of rows with wider bricks.
    pub squash_frequency: u32,
}

/// Sizes of bricks and mortar.
#[derive(Clone, Copy, Debug)]
pub struct Bricks {
    /// Width and height, including half of the mortar around.
    pub size: [f32; 2],
    /// Width of the mortar on each side.
    pub mortar_size: f32,
    /// Softness of its border.
    pub mortar_smooth: f32,
    /// Shift towards the second colour.
    pub bias: f32,
}

/// (share of the second colour, share of mortar), each in [0, 1].
pub fn bricks(p: Vec3, bricks: &Bricks, rows: &Rows) -> [f32; 2] {
    let [mut width, height] = bricks.size;
    let row = (p.y / height).floor() as i32;
    let is_each = |frequency: u32| row % frequency as i32 == 0;
    let mut shift = 0.0;
    if rows.offset_frequency != 0 && rows.squash_frequency != 0 {
        width *= if is_each(rows.squash_frequency) {
            rows.squash
        } else {
            1.0
        };
        shift = if is_each(rows.offset_frequency) {
            width * rows.offset
        } else {
            0.0
        };
    }
    let number = ((p.x + shift) / width).floor() as i32;
    let x = p.x + shift - width * number as f32;
    let y = p.y - height * row as f32;
    let tint = (brick_number((row as u32) << 16 | number as u32 & 0xffff) + bricks.bias).clamp(0.0, 1.0);
    let edge = x.min(y).min((width - x).min(height - y));
    let mortar = if edge >= bricks.mortar_size {
        0.0
    } else if bricks.mortar_smooth == 0.0 {
        1.0
    } else {
        let t = ((1.0 - edge / bricks.mortar_size) / bricks.mortar_smooth).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    [tint, mortar]
}

/// Blender's random number of a brick, [0, 1].
fn brick_number(n: u32) -> f32 {
    const MASK: u32 = 0x7fff_ffff;
    let n = n.wrapping_add(1013) & MASK;
    let n = (n >> 13) ^ n;
    let n = n.wrapping_mul(n.wrapping_mul(n).wrapping_mul(60493).wrapping_add(19_990_303));
    0.5 * ((n.wrapping_add(1_376_312_589) & MASK) as f32 / 1_073_741_824.0)
}

/// Whether a point, already scaled, is on a square of the first colour.
pub fn is_first_square(p: Vec3) -> bool {
    let cell = ((p + 1e-6) * 0.999_999).floor();
    let odd = |x: f32| x as i32 & 1;
    odd(cell.x) ^ odd(cell.y) != odd(cell.z)
}
