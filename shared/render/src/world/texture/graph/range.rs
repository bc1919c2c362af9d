//! Bounds of a program's values by interval arithmetic: never too narrow, often too wide.

use super::maths::Operation;
use super::noise::NoiseKind;
use super::{CONSTANTS, Op, Program, Slot, VoronoiOutput};
use crate::math::Vec3;

const ANY: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];
const UNIT: [f32; 2] = [0.0, 1.0];

/// Bounds over all channels, clamped to the program's.
pub(super) fn of(program: &Program) -> [f32; 2] {
    let mut registers = vec![ANY; program.registers.max(1)];
    let constant = |v: Vec3| [v.min_element(), v.max_element()];
    let at = |registers: &[[f32; 2]], slot: Slot| match slot.0 {
        CONSTANTS.. => constant(program.constants[usize::from(slot.0 - CONSTANTS)]),
        register => registers[usize::from(register)],
    };
    for instruction in &program.instructions {
        let input = |i: usize| at(&registers, instruction.inputs[i]);
        let found = of_op(program, instruction.op, input);
        // On overflow nothing is known.
        let is_known = found[0] <= found[1];
        registers[usize::from(instruction.output)] = if is_known { found } else { ANY };
    }
    let [low, high] = at(&registers, program.result);
    let [least, most] = program.bounds;
    [low.clamp(least, most), high.clamp(least, most)]
}

fn of_op(program: &Program, op: Op, input: impl Fn(usize) -> [f32; 2]) -> [f32; 2] {
    match op {
        Op::Backfacing
        | Op::Viewer(_)
        | Op::Random
        | Op::WhiteNoise { .. }
        | Op::Gradient(_)
        | Op::Wave(..)
        | Op::Bricks(_)
        | Op::Checker
        | Op::Fresnel
        | Op::LayerFresnel
        | Op::LayerFacing
        | Op::Voronoi {
            output: VoronoiOutput::Color,
            normalize: true,
            ..
        } => UNIT,
        Op::Noise {
            kind: NoiseKind::Fbm,
            normalize: true,
            ..
        } if input(3)[0] >= 0.0 => [-0.01, 1.01],
        Op::Luminance | Op::Mean | Op::Component(_) => input(0),
        Op::Combine => hull([input(0), input(1), input(2)]),
        Op::Table(number) | Op::TableAlpha(number) => {
            let table = &program.parts.tables[usize::from(number)];
            if table.extends() {
                return ANY;
            }
            let of_entry = |entry: &super::table::Entry| match op {
                Op::TableAlpha(_) => [entry.alpha; 2],
                _ => [entry.color.min_element(), entry.color.max_element()],
            };
            hull(table.entries().iter().map(of_entry))
        }
        Op::Texture(number) => program.parts.textures[usize::from(number)].range(),
        Op::Blend {
            blend: super::Blend::Mix,
            clamp_factor: true,
            ..
        }
        | Op::MixVector { clamp_factor: true } => hull([input(1), input(2)]),
        Op::Blend { clamp_result: true, .. } | Op::Math(_, true) => UNIT,
        Op::Math(operation, false) => of_math(operation, input),
        Op::MapRange(_, true) => hull([input(3), input(4)]),
        Op::Clamp { .. } => hull([input(1), input(2)]),
        Op::Invert => {
            let [low, high] = input(1);
            match input(0)[0] >= 0.0 && input(0)[1] <= 1.0 {
                true => hull([[low, high], [1.0 - high, 1.0 - low]]),
                false => ANY,
            }
        }
        _ => ANY,
    }
}

fn of_math(operation: Operation, input: impl Fn(usize) -> [f32; 2]) -> [f32; 2] {
    let products = |[a, b]: [f32; 2], [c, d]: [f32; 2]| hull([a * c, a * d, b * c, b * d].map(|x| [x; 2]));
    let (a, b) = (input(0), input(1));
    match operation {
        Operation::Add => [a[0] + b[0], a[1] + b[1]],
        Operation::Subtract => [a[0] - b[1], a[1] - b[0]],
        Operation::Multiply => products(a, b),
        Operation::MultiplyAdd => {
            let [low, high] = products(a, b);
            [low + input(2)[0], high + input(2)[1]]
        }
        Operation::Minimum => [a[0].min(b[0]), a[1].min(b[1])],
        Operation::Maximum => [a[0].max(b[0]), a[1].max(b[1])],
        Operation::LessThan | Operation::GreaterThan | Operation::Compare | Operation::Fract => UNIT,
        Operation::Sine | Operation::Cosine | Operation::Sign | Operation::Tanh => [-1.0, 1.0],
        Operation::Absolute => [0.0, a[0].abs().max(a[1].abs())],
        Operation::Power if a[0] >= 0.0 && a[1] <= 1.0 && b[0] >= 0.0 => UNIT,
        Operation::Exponent | Operation::Sqrt => [0.0, f32::INFINITY],
        _ => ANY,
    }
}

fn hull(all: impl IntoIterator<Item = [f32; 2]>) -> [f32; 2] {
    all.into_iter().fold([f32::INFINITY, f32::NEG_INFINITY], |hull, x| {
        // NaN means unknown.
        match x[0] <= x[1] {
            true => [hull[0].min(x[0]), hull[1].max(x[1])],
            false => ANY,
        }
    })
}
