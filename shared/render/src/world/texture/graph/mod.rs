//! Textures as node graphs, compiled into flat programs: each instruction computes one value at a point.
//!
//! A value is three numbers: a colour, a vector, or one number three times. Programs have no loops and no memory except
//! registers, and give the same bits everywhere. Nodes compute the values of Blender's, since artists' files are made
//! with it.

mod builder;
pub mod color;
pub mod hash;
pub mod maths;
pub mod noise;
pub mod patterns;
mod place;
mod range;
pub mod table;
pub mod voronoi;

pub use builder::{Builder, TooComplex};
pub use place::{Place, Space, Viewer};

use crate::math::{Rgb, Vec3, luminance, powf};
use crate::world::fresnel::fresnel_dielectric;
use crate::world::texture::{Texture, TexturePoint};
use color::Blend;
use glam::Affine3A;
use maths::{Interpolation, Operation, VectorOperation};
use noise::{NoiseKind, Octaves};
use patterns::{GradientKind, Rows, WaveKind, WaveNoise, WaveProfile};
use table::Table;
use voronoi::{CellHash, Cells, Feature, Metric};

/// A register, or a constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot(u16);

/// Numbers from here on refer to constants.
const CONSTANTS: u16 = 1 << 15;
/// Most registers of a program.
const REGISTERS: usize = 256;
/// Enough for most programs: fewer registers take less time to clear.
const FEW: usize = 24;
/// Most inputs of an instruction.
pub const INPUTS: usize = 10;

/// An output of a Voronoi node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum VoronoiOutput {
    Distance,
    Color,
    Position,
    W,
}

/// What a mapping does to a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MappingKind {
    /// Scales, rotates, moves.
    Point,
    /// The inverse of that.
    Texture,
    /// Scales and rotates.
    Vector,
    /// Divides by the scale, rotates, and normalises.
    Normal,
}

/// Axis of a rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum RotationKind {
    AxisAngle,
    X,
    Y,
    Z,
    Euler,
}

/// One instruction. Its comment lists the inputs in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Op {
    /// Texture coordinates.
    Uv,
    /// Coordinates in the object's bounding box.
    Generated,
    /// The object's own coordinates.
    Own,
    /// The point in the world.
    World,
    /// The normal, facing the viewer.
    Normal,
    /// The geometric normal, facing the viewer.
    TrueNormal,
    /// The normal in the object's own coordinates.
    OwnNormal,
    /// The object's location.
    Location,
    /// 1 for this viewer.
    Viewer(Viewer),
    /// Unit vector to the viewer.
    Incoming,
    /// 1 where the surface is seen from inside.
    Backfacing,
    /// Random number of the object, in [0, 1].
    Random,
    /// Number of the object.
    Index,
    /// Colour of the mesh's vertices.
    VertexColor,
    /// A texture by number; (x, y) of its input is the UV.
    Texture(u16),
    /// Luminance of a colour.
    Luminance,
    /// Mean of a vector's components.
    Mean,
    /// One component.
    Component(u8),
    /// A vector from three numbers.
    Combine,
    /// vector, w, detail, roughness, lacunarity, offset, gain, distortion, scale.
    Noise {
        /// 1 to 4.
        dimensions: u8,
        /// How octaves are combined.
        kind: NoiseKind,
        /// Maps to [0, 1].
        normalize: bool,
        /// Three channels.
        color: bool,
    },
    /// vector, w, detail, roughness, lacunarity, smoothness, exponent, randomness, scale.
    Voronoi {
        /// 1 to 4.
        dimensions: u8,
        /// The feature.
        feature: Feature,
        /// The distance metric.
        metric: Metric,
        /// Maps to [0, 1].
        normalize: bool,
        /// Source of the cells' random numbers.
        hash: CellHash,
        /// The output.
        output: VoronoiOutput,
    },
    /// vector, w.
    WhiteNoise {
        /// 1 to 4.
        dimensions: u8,
        /// Three channels.
        color: bool,
    },
    /// vector.
    Gradient(GradientKind),
    /// vector, scale, distortion.
    Magic {
        /// Number of turns.
        depth: u8,
    },
    /// vector, scale, distortion, detail, detail scale, detail roughness, phase.
    Wave(WaveKind, WaveProfile),
    /// vector, scale, mortar size, mortar smooth, bias, brick width, row height; (share of the second colour, share of
    /// mortar, 0).
    Bricks(u16),
    /// vector, scale; 1 on squares of the first colour.
    Checker,
    /// A table by number, at the first component.
    Table(u16),
    /// The same for its alpha.
    TableAlpha(u16),
    /// Each component through its own table.
    Curves([u16; 3]),
    /// factor, a, b.
    Blend {
        /// The blend mode.
        blend: Blend,
        /// Clamps factors to [0, 1].
        clamp_factor: bool,
        /// Clamps results to [0, 1].
        clamp_result: bool,
    },
    /// factor, a, b: by component.
    MixVector {
        /// Clamps factors to [0, 1].
        clamp_factor: bool,
    },
    /// a, b, c.
    Math(Operation, bool),
    /// a, b, c, scale.
    VectorMath(VectorOperation),
    /// value, from min, from max, to min, to max, steps: by component.
    MapRange(Interpolation, bool),
    /// value, min, max.
    Clamp {
        /// Swaps the bounds if the first is the higher one.
        sorted: bool,
    },
    /// Converts a colour to a colour space.
    ToSpace(color::Space),
    /// Converts back from a colour space.
    FromSpace(color::Space),
    /// hue, saturation, value, factor, colour.
    HueSaturation,
    /// colour, bright, contrast.
    BrightContrast,
    /// colour, exponent.
    Gamma,
    /// factor, colour.
    Invert,
    /// Index of refraction.
    Fresnel,
    /// blend.
    LayerFresnel,
    /// blend.
    LayerFacing,
    /// vector, location, rotation in radians, scale.
    Mapping(MappingKind),
    /// Applies a matrix, by number, to a point.
    Transform(u16),
    /// vector, center, axis, angle, euler angles, radians.
    Rotate {
        /// The axis.
        kind: RotationKind,
        /// Rotates the other way.
        invert: bool,
    },
}

impl Op {
    /// What it reads of the point itself.
    fn reads(self) -> Reads {
        let place = Reads {
            place: true,
            ..Reads::default()
        };
        match self {
            Self::Uv => Reads {
                uv: true,
                ..Reads::default()
            },
            Self::VertexColor => Reads {
                colors: true,
                ..Reads::default()
            },
            Self::Generated
            | Self::Own
            | Self::World
            | Self::Random
            | Self::Index
            | Self::Location
            | Self::OwnNormal => place,
            Self::Normal
            | Self::TrueNormal
            | Self::Incoming
            | Self::Backfacing
            | Self::Viewer(_)
            | Self::Fresnel
            | Self::LayerFresnel
            | Self::LayerFacing => Reads { view: true, ..place },
            _ => Reads::default(),
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Instruction {
    op: Op,
    inputs: [Slot; INPUTS],
    output: u16,
}

/// What a graph reads of the points that it is evaluated at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    /// Texture coordinates.
    pub uv: bool,
    /// Vertex colours.
    pub colors: bool,
    /// Any part of [`Place`].
    pub place: bool,
    /// The direction of view.
    pub view: bool,
}

/// A compiled graph.
#[derive(Clone, Debug)]
pub struct Program {
    instructions: Vec<Instruction>,
    constants: Vec<Vec3>,
    registers: usize,
    result: Slot,
    bounds: [f32; 2],
    range: [f32; 2],
    reads: Reads,
    parts: Parts,
}

/// What instructions refer to by number.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Images.
    pub textures: Vec<Texture>,
    /// Ramps and curves.
    pub tables: Vec<Table>,
    /// Maps of points.
    pub matrices: Vec<Affine3A>,
    /// Rows of bricks.
    pub rows: Vec<Rows>,
}

impl Program {
    /// The value at a point, each channel clamped to the bounds. NaN becomes the lower bound.
    pub fn eval(&self, at: &TexturePoint) -> Rgb {
        match self.registers {
            0..=FEW => self.run::<FEW>(at),
            _ => self.run::<REGISTERS>(at),
        }
    }

    fn run<const N: usize>(&self, at: &TexturePoint) -> Rgb {
        let mut registers = [Vec3::ZERO; N];
        for instruction in &self.instructions {
            let inputs = |i: usize| self.value(&registers, instruction.inputs[i]);
            registers[usize::from(instruction.output)] = self.result_of(instruction.op, at, inputs);
        }
        self.bounded(self.value(&registers, self.result))
    }

    fn value(&self, registers: &[Vec3], slot: Slot) -> Vec3 {
        match slot.0 {
            CONSTANTS.. => self.constants[usize::from(slot.0 - CONSTANTS)],
            register => registers[usize::from(register)],
        }
    }

    fn bounded(&self, value: Vec3) -> Vec3 {
        let [low, high] = self.bounds;
        // Also for NaN.
        value.map(|x| if x > low { x.min(high) } else { low })
    }

    /// Bounds of all channels of all values.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// What it reads.
    pub fn reads(&self) -> Reads {
        self.reads
    }

    fn result_of(&self, op: Op, at: &TexturePoint, input: impl Fn(usize) -> Vec3) -> Vec3 {
        let number = |i: usize| input(i).x;
        let flag = |is_so: bool| Vec3::splat(if is_so { 1.0 } else { 0.0 });
        match op {
            Op::Uv => at.uv.extend(0.0),
            Op::Generated => at.place.generated,
            Op::Own => at.place.own,
            Op::World => at.place.world,
            Op::Normal => at.place.normal,
            Op::TrueNormal => at.place.true_normal,
            Op::OwnNormal => at.place.own_normal,
            Op::Location => at.place.location,
            Op::Viewer(viewer) => flag(at.place.viewer == viewer),
            Op::Incoming => at.place.wo,
            Op::Backfacing => flag(at.place.is_behind),
            Op::Random => Vec3::splat(at.place.random),
            Op::Index => Vec3::splat(at.place.index),
            Op::VertexColor => at.color,
            Op::Texture(number) => {
                let there = TexturePoint::of_uv(input(0).truncate());
                self.parts.textures[usize::from(number)].eval(&there)
            }
            Op::Luminance => Vec3::splat(luminance(input(0))),
            Op::Mean => Vec3::splat(input(0).element_sum() / 3.0),
            Op::Component(i) => Vec3::splat(input(0)[usize::from(i)]),
            Op::Combine => Vec3::new(number(0), number(1), number(2)),
            Op::Noise {
                dimensions,
                kind,
                normalize,
                color,
            } => {
                let octaves = Octaves {
                    detail: number(2).clamp(0.0, 15.0),
                    roughness: number(3).max(0.0),
                    lacunarity: number(4),
                    offset: number(5),
                    gain: number(6),
                };
                let (p, w, distortion) = (input(0) * number(8), number(1) * number(8), number(7));
                Vec3::from_array(match dimensions {
                    1 => noise::texture([w], kind, &octaves, normalize, distortion, color),
                    2 => noise::texture([p.x, p.y], kind, &octaves, normalize, distortion, color),
                    3 => noise::texture(p.to_array(), kind, &octaves, normalize, distortion, color),
                    _ => noise::texture([p.x, p.y, p.z, w], kind, &octaves, normalize, distortion, color),
                })
            }
            Op::Voronoi {
                dimensions,
                feature,
                metric,
                normalize,
                hash,
                output,
            } => {
                let cells = Cells {
                    feature,
                    metric,
                    normalize,
                    hash,
                    detail: number(2).clamp(0.0, 15.0),
                    roughness: number(3).clamp(0.0, 1.0),
                    lacunarity: number(4),
                    smoothness: (0.5 * number(5)).clamp(0.0, 0.5),
                    exponent: number(6),
                    randomness: number(7).clamp(0.0, 1.0),
                    scale: number(8),
                };
                voronoi(dimensions, &cells, input(0) * number(8), number(1) * number(8), output)
            }
            Op::WhiteNoise { dimensions, color } => {
                let (p, w) = (input(0), number(1));
                white_noise(dimensions, color, p, w)
            }
            Op::Gradient(kind) => Vec3::splat(patterns::gradient(input(0), kind)),
            Op::Magic { depth } => patterns::magic(input(0), number(1), depth.into(), number(2)),
            Op::Wave(kind, profile) => {
                let noise = WaveNoise {
                    distortion: number(2),
                    scale: number(4),
                    octaves: Octaves {
                        detail: number(3).clamp(0.0, 15.0),
                        roughness: number(5).max(0.0),
                        lacunarity: 2.0,
                        offset: 0.0,
                        gain: 0.0,
                    },
                };
                Vec3::splat(patterns::wave(input(0) * number(1), kind, profile, number(6), &noise))
            }
            Op::Bricks(rows) => {
                let bricks = patterns::Bricks {
                    size: [number(5), number(6)],
                    mortar_size: number(2),
                    mortar_smooth: number(3),
                    bias: number(4),
                };
                let rows = &self.parts.rows[usize::from(rows)];
                let [tint, mortar] = patterns::bricks(input(0) * number(1), &bricks, rows);
                Vec3::new(tint, mortar, 0.0)
            }
            Op::Checker => flag(patterns::is_first_square(input(0) * number(1))),
            Op::Table(table) => self.parts.tables[usize::from(table)].color(number(0)),
            Op::TableAlpha(table) => Vec3::splat(self.parts.tables[usize::from(table)].alpha(number(0))),
            Op::Curves(tables) => {
                let of = |i: usize| self.parts.tables[usize::from(tables[i])].color(input(0)[i]).x;
                Vec3::new(of(0), of(1), of(2))
            }
            Op::Blend {
                blend,
                clamp_factor,
                clamp_result,
            } => {
                let factor = if clamp_factor {
                    number(0).clamp(0.0, 1.0)
                } else {
                    number(0)
                };
                let made = color::blended(blend, factor, input(1), input(2));
                if clamp_result {
                    made.clamp(Vec3::ZERO, Vec3::ONE)
                } else {
                    made
                }
            }
            Op::MixVector { clamp_factor } => {
                let factor = if clamp_factor {
                    input(0).clamp(Vec3::ZERO, Vec3::ONE)
                } else {
                    input(0)
                };
                input(1) * (Vec3::ONE - factor) + input(2) * factor
            }
            Op::Math(operation, clamp) => {
                let made = maths::math(operation, number(0), number(1), number(2));
                Vec3::splat(if clamp { made.clamp(0.0, 1.0) } else { made })
            }
            Op::VectorMath(operation) => maths::vector_math(operation, input(0), input(1), input(2), number(3)),
            Op::MapRange(by, clamp) => {
                let inputs = [0, 1, 2, 3, 4, 5].map(&input);
                Vec3::from_array([0, 1, 2].map(|i| {
                    let [x, from_min, from_max, to_min, to_max, steps] = inputs.map(|v| v[i]);
                    maths::map_range(x, [from_min, from_max], [to_min, to_max], steps, by, clamp)
                }))
            }
            Op::Clamp { sorted } => {
                let (a, b) = (number(1), number(2));
                let (low, high) = if sorted { (a.min(b), a.max(b)) } else { (a, b) };
                Vec3::splat(number(0).max(low).min(high))
            }
            Op::ToSpace(color::Space::Rgb) | Op::FromSpace(color::Space::Rgb) => input(0),
            Op::ToSpace(color::Space::Hsv) => color::to_hsv(input(0)),
            Op::ToSpace(color::Space::Hsl) => color::to_hsl(input(0)),
            Op::FromSpace(color::Space::Hsv) => color::from_hsv(input(0)),
            Op::FromSpace(color::Space::Hsl) => color::from_hsl(input(0)),
            Op::HueSaturation => color::hue_saturation(number(0), number(1), number(2), number(3), input(4)),
            Op::BrightContrast => color::bright_contrast(input(0), number(1), number(2)),
            Op::Gamma => color::gamma(input(0), number(1)),
            Op::Invert => color::blended(Blend::Mix, number(0), input(1), Vec3::ONE - input(1)),
            Op::Fresnel => {
                let eta = number(0).max(1e-5);
                let eta = if at.place.is_behind { 1.0 / eta } else { eta };
                Vec3::splat(fresnel_dielectric(at.place.wo.dot(at.place.normal).clamp(0.0, 1.0), eta).0)
            }
            Op::LayerFresnel => {
                let eta = (1.0 - number(0)).max(1e-5);
                let eta = if at.place.is_behind { eta } else { 1.0 / eta };
                Vec3::splat(fresnel_dielectric(at.place.wo.dot(at.place.normal).clamp(0.0, 1.0), eta).0)
            }
            Op::LayerFacing => Vec3::splat(facing(at.place.wo.dot(at.place.normal).abs(), number(0))),
            Op::Mapping(kind) => mapped(kind, input(0), input(1), input(2), input(3)),
            Op::Transform(matrix) => self.parts.matrices[usize::from(matrix)].transform_point3(input(0)),
            Op::Rotate { kind, invert } => {
                let (center, angle) = (input(1), if invert { -number(3) } else { number(3) });
                let v = input(0) - center;
                center
                    + match kind {
                        RotationKind::AxisAngle => match input(2).try_normalize() {
                            Some(axis) => maths::turned(v, axis, angle),
                            None => v,
                        },
                        RotationKind::X => maths::turned(v, Vec3::X, angle),
                        RotationKind::Y => maths::turned(v, Vec3::Y, angle),
                        RotationKind::Z => maths::turned(v, Vec3::Z, angle),
                        RotationKind::Euler if invert => maths::turned_back_by_euler(v, input(4)),
                        RotationKind::Euler => maths::turned_by_euler(v, input(4)),
                    }
            }
        }
    }
}

fn voronoi(dimensions: u8, cells: &Cells, p: Vec3, w: f32, output: VoronoiOutput) -> Vec3 {
    fn told<const N: usize>(cells: &Cells, p: [f32; N], output: VoronoiOutput) -> Vec3 {
        let found = voronoi::texture(cells, p);
        let at = |i: usize| found.position.get(i).copied().unwrap_or(0.0);
        match output {
            VoronoiOutput::Distance => Vec3::splat(found.distance),
            VoronoiOutput::Color => Vec3::from_array(found.color),
            VoronoiOutput::Position if N == 1 => Vec3::ZERO,
            VoronoiOutput::Position => Vec3::new(at(0), at(1), at(2)),
            VoronoiOutput::W if N == 1 => Vec3::splat(at(0)),
            VoronoiOutput::W => Vec3::splat(at(3)),
        }
    }
    match dimensions {
        1 => told(cells, [w], output),
        2 => told(cells, [p.x, p.y], output),
        3 => told(cells, p.to_array(), output),
        _ => told(cells, [p.x, p.y, p.z, w], output),
    }
}

fn white_noise(dimensions: u8, color: bool, p: Vec3, w: f32) -> Vec3 {
    fn told<const N: usize>(p: [f32; N], color: bool) -> Vec3 {
        match color {
            true => Vec3::from_array(hash::color_of_floats(p)),
            false => Vec3::splat(hash::of_floats(p)),
        }
    }
    match dimensions {
        1 => told([w], color),
        2 => told([p.x, p.y], color),
        3 => told(p.to_array(), color),
        _ => told([p.x, p.y, p.z, w], color),
    }
}

/// The Facing output of Blender's Layer Weight node.
fn facing(cos: f32, blend: f32) -> f32 {
    if blend == 0.5 {
        return 1.0 - cos;
    }
    let blend = blend.clamp(0.0, 1.0 - 1e-5);
    let exponent = if blend < 0.5 { 2.0 * blend } else { 0.5 / (1.0 - blend) };
    1.0 - powf(cos, exponent)
}

fn mapped(kind: MappingKind, v: Vec3, location: Vec3, rotation: Vec3, scale: Vec3) -> Vec3 {
    let over = |v: Vec3| {
        let each = |x: f32, by: f32| if by != 0.0 { x / by } else { 0.0 };
        Vec3::new(each(v.x, scale.x), each(v.y, scale.y), each(v.z, scale.z))
    };
    match kind {
        MappingKind::Point => maths::turned_by_euler(v * scale, rotation) + location,
        MappingKind::Texture => over(maths::turned_back_by_euler(v - location, rotation)),
        MappingKind::Vector => maths::turned_by_euler(v * scale, rotation),
        MappingKind::Normal => maths::turned_by_euler(over(v), rotation).normalize_or_zero(),
    }
}

#[cfg(test)]
mod tests;
