//! Arithmetic of numbers and vectors, by the rules of Blender's Math nodes: undefined results are zero.

use crate::math::{PI, Vec3, acos, asin, atan2, cos, cosh, exp, ln, powf, sin, sinh, tan, tanh};

macro_rules! operations {
    ($(#[$doc:meta])* $kind:ident: $($name:ident $word:literal),* $(,)?) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs)]
        pub enum $kind { $($name),* }

        impl $kind {
            /// All of them, with their names in files.
            pub const ALL: &'static [(&'static str, Self)] = &[$(($word, Self::$name)),*];
        }
    };
}

operations! {
    /// On numbers.
    Operation:
    Add "add", Subtract "subtract", Multiply "multiply", Divide "divide", MultiplyAdd "multiply_add", Power "power",
    Logarithm "logarithm", Sqrt "sqrt", InverseSqrt "inverse_sqrt", Absolute "absolute", Exponent "exponent",
    Minimum "minimum", Maximum "maximum", LessThan "less_than", GreaterThan "greater_than", Sign "sign",
    Compare "compare", SmoothMin "smooth_min", SmoothMax "smooth_max", Round "round", Floor "floor", Ceil "ceil",
    Trunc "trunc", Fract "fract", Modulo "modulo", FlooredModulo "floored_modulo", Wrap "wrap", Snap "snap",
    PingPong "pingpong", Sine "sine", Cosine "cosine", Tangent "tangent", Arcsine "arcsine", Arccosine "arccosine",
    Arctangent "arctangent", Arctan2 "arctan2", Sinh "sinh", Cosh "cosh", Tanh "tanh", Radians "radians",
    Degrees "degrees",
}

operations! {
    /// On vectors.
    VectorOperation:
    Add "add", Subtract "subtract", Multiply "multiply", Divide "divide", MultiplyAdd "multiply_add", Power "power",
    Sign "sign", CrossProduct "cross_product", Project "project", Reflect "reflect", Refract "refract",
    FaceForward "faceforward", DotProduct "dot_product", Distance "distance", Length "length", Scale "scale",
    Normalize "normalize", Absolute "absolute", Minimum "minimum", Maximum "maximum", Floor "floor", Ceil "ceil",
    Fraction "fraction", Modulo "modulo", Wrap "wrap", Snap "snap", Sine "sine", Cosine "cosine", Tangent "tangent",
    Round "round",
}

fn divided(a: f32, b: f32) -> f32 {
    if b != 0.0 { a / b } else { 0.0 }
}

/// `a^b`, zero where it is not real.
pub fn power(a: f32, b: f32) -> f32 {
    if a >= 0.0 {
        return if b == 0.0 { 1.0 } else { powf(a, b) };
    }
    match b {
        _ if b != b.floor() => 0.0,
        _ if b % 2.0 == 0.0 => powf(-a, b),
        _ => -powf(-a, b),
    }
}

fn logarithm(a: f32, base: f32) -> f32 {
    if a > 0.0 && base > 0.0 {
        divided(ln(a), ln(base))
    } else {
        0.0
    }
}

fn smooth_min(a: f32, b: f32, distance: f32) -> f32 {
    if distance == 0.0 {
        return a.min(b);
    }
    let h = (distance - (a - b).abs()).max(0.0) / distance;
    a.min(b) - h * h * h * distance / 6.0
}

fn wrapped(x: f32, high: f32, low: f32) -> f32 {
    let span = high - low;
    if span != 0.0 {
        x - span * ((x - low) / span).floor()
    } else {
        low
    }
}

fn sign(x: f32) -> f32 {
    if x == 0.0 { 0.0 } else { 1.0f32.copysign(x) }
}

fn modulo(a: f32, b: f32) -> f32 {
    if b != 0.0 { a % b } else { 0.0 }
}

/// The result of an operation.
pub fn math(operation: Operation, a: f32, b: f32, c: f32) -> f32 {
    let truth = |is_so: bool| if is_so { 1.0 } else { 0.0 };
    match operation {
        Operation::Add => a + b,
        Operation::Subtract => a - b,
        Operation::Multiply => a * b,
        Operation::Divide => divided(a, b),
        Operation::MultiplyAdd => a * b + c,
        Operation::Power => power(a, b),
        Operation::Logarithm => logarithm(a, b),
        Operation::Sqrt => a.max(0.0).sqrt(),
        Operation::InverseSqrt => divided(1.0, a.max(0.0).sqrt()),
        Operation::Absolute => a.abs(),
        Operation::Exponent => exp(a),
        Operation::Minimum => a.min(b),
        Operation::Maximum => a.max(b),
        Operation::LessThan => truth(a < b),
        Operation::GreaterThan => truth(a > b),
        Operation::Sign => sign(a),
        Operation::Compare => truth(a == b || (a - b).abs() <= c.max(1e-5)),
        Operation::SmoothMin => smooth_min(a, b, c),
        Operation::SmoothMax => -smooth_min(-a, -b, c),
        Operation::Round => (a + 0.5).floor(),
        Operation::Floor => a.floor(),
        Operation::Ceil => a.ceil(),
        Operation::Trunc => a.trunc(),
        Operation::Fract => a - a.floor(),
        Operation::Modulo => modulo(a, b),
        Operation::FlooredModulo => {
            if b != 0.0 {
                a - (a / b).floor() * b
            } else {
                0.0
            }
        }
        Operation::Wrap => wrapped(a, b, c),
        Operation::Snap => divided(a, b).floor() * b,
        Operation::PingPong => {
            let t = divided(a - b, 2.0 * b);
            if b != 0.0 {
                ((t - t.floor()) * 2.0 * b - b).abs()
            } else {
                0.0
            }
        }
        Operation::Sine => sin(a),
        Operation::Cosine => cos(a),
        Operation::Tangent => tan(a),
        Operation::Arcsine => asin(a),
        Operation::Arccosine => acos(a),
        Operation::Arctangent => atan2(a, 1.0),
        Operation::Arctan2 => atan2(a, b),
        Operation::Sinh => sinh(a),
        Operation::Cosh => cosh(a),
        Operation::Tanh => tanh(a),
        Operation::Radians => a * (PI / 180.0),
        Operation::Degrees => a * (180.0 / PI),
    }
}

/// The result of an operation on vectors; scalar results fill all three components.
pub fn vector_math(operation: VectorOperation, a: Vec3, b: Vec3, c: Vec3, scale: f32) -> Vec3 {
    let each = |of: fn(f32, f32) -> f32| Vec3::new(of(a.x, b.x), of(a.y, b.y), of(a.z, b.z));
    let unit = |v: Vec3| v.normalize_or_zero();
    match operation {
        VectorOperation::Add => a + b,
        VectorOperation::Subtract => a - b,
        VectorOperation::Multiply => a * b,
        VectorOperation::Divide => each(divided),
        VectorOperation::MultiplyAdd => a * b + c,
        VectorOperation::Power => each(power),
        VectorOperation::Sign => each(|a, _| sign(a)),
        VectorOperation::CrossProduct => a.cross(b),
        VectorOperation::Project => b * divided(a.dot(b), b.dot(b)),
        VectorOperation::Reflect => a - unit(b) * (2.0 * unit(b).dot(a)),
        VectorOperation::Refract => {
            let n = unit(b);
            let along = n.dot(a);
            let k = 1.0 - scale * scale * (1.0 - along * along);
            if k < 0.0 {
                Vec3::ZERO
            } else {
                a * scale - n * (scale * along + k.sqrt())
            }
        }
        VectorOperation::FaceForward => {
            if c.dot(b) < 0.0 {
                a
            } else {
                -a
            }
        }
        VectorOperation::DotProduct => Vec3::splat(a.dot(b)),
        VectorOperation::Distance => Vec3::splat(a.distance(b)),
        VectorOperation::Length => Vec3::splat(a.length()),
        VectorOperation::Scale => a * scale,
        VectorOperation::Normalize => unit(a),
        VectorOperation::Absolute => a.abs(),
        VectorOperation::Minimum => a.min(b),
        VectorOperation::Maximum => a.max(b),
        VectorOperation::Floor => a.floor(),
        VectorOperation::Ceil => a.ceil(),
        VectorOperation::Fraction => a - a.floor(),
        VectorOperation::Modulo => each(modulo),
        VectorOperation::Wrap => Vec3::new(wrapped(a.x, b.x, c.x), wrapped(a.y, b.y, c.y), wrapped(a.z, b.z, c.z)),
        VectorOperation::Snap => each(|a, b| divided(a, b).floor() * b),
        VectorOperation::Sine => each(|a, _| sin(a)),
        VectorOperation::Cosine => each(|a, _| cos(a)),
        VectorOperation::Tangent => each(|a, _| tan(a)),
        VectorOperation::Round => each(|a, _| (a + 0.5).floor()),
    }
}

/// Interpolation between two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs)]
pub enum Interpolation {
    Linear,
    Stepped,
    Smooth,
    Smoother,
}

/// Blender's Map Range for one number: `from` and `to` are ends.
pub fn map_range(x: f32, from: [f32; 2], to: [f32; 2], steps: f32, by: Interpolation, clamp: bool) -> f32 {
    let t = divided(x - from[0], from[1] - from[0]);
    let unit = t.clamp(0.0, 1.0);
    let t = match by {
        Interpolation::Linear => t,
        Interpolation::Stepped => {
            if steps > 0.0 {
                (t * (steps + 1.0)).floor() / steps
            } else {
                0.0
            }
        }
        Interpolation::Smooth => unit * unit * (3.0 - 2.0 * unit),
        Interpolation::Smoother => unit * unit * unit * (unit * (unit * 6.0 - 15.0) + 10.0),
    };
    let value = to[0] + t * (to[1] - to[0]);
    let (low, high) = (to[0].min(to[1]), to[0].max(to[1]));
    if clamp { value.max(low).min(high) } else { value }
}

/// Rotates a vector around a unit axis.
pub fn turned(v: Vec3, axis: Vec3, angle: f32) -> Vec3 {
    let (sine, cosine) = (sin(angle), cos(angle));
    v * cosine + axis.cross(v) * sine + axis * (axis.dot(v) * (1.0 - cosine))
}

/// Rotates a vector around x, then y, then z, by angles in radians.
pub fn turned_by_euler(v: Vec3, angles: Vec3) -> Vec3 {
    turned(
        turned(turned(v, Vec3::X, angles.x), Vec3::Y, angles.y),
        Vec3::Z,
        angles.z,
    )
}

/// The inverse of [`turned_by_euler`].
pub fn turned_back_by_euler(v: Vec3, angles: Vec3) -> Vec3 {
    turned(
        turned(turned(v, Vec3::Z, -angles.z), Vec3::Y, -angles.y),
        Vec3::X,
        -angles.x,
    )
}
