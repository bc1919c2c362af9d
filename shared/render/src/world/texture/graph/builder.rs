//! Compiles values to a program: shares equal values, folds constants, reuses registers.

use super::{CONSTANTS, INPUTS, Instruction, Op, Parts, Program, REGISTERS, Reads, Slot, range};
use crate::math::Vec3;
use crate::world::texture::TexturePoint;

/// The program needs more registers than there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooComplex;

/// Builds a program; equal values are shared.
#[derive(Clone, Debug, Default)]
pub struct Builder {
    /// By value: what computes it, in order of addition.
    values: Vec<Value>,
    constants: Vec<Vec3>,
    /// What instructions refer to by number.
    pub parts: Parts,
    reads: Reads,
}

#[derive(Clone, Copy, Debug)]
struct Value {
    op: Op,
    inputs: [Slot; INPUTS],
}

impl Builder {
    /// A constant.
    pub fn constant(&mut self, value: Vec3) -> Slot {
        let is_same = |known: &Vec3| known.to_array().map(f32::to_bits) == value.to_array().map(f32::to_bits);
        let number = self.constants.iter().position(is_same).unwrap_or_else(|| {
            self.constants.push(value);
            self.constants.len() - 1
        });
        // Far more than the number of instructions.
        Slot(CONSTANTS + (number as u16).min(CONSTANTS - 1))
    }

    /// The constant, if the value is one.
    pub fn known(&self, slot: Slot) -> Option<Vec3> {
        let number = slot.0.checked_sub(CONSTANTS)?;
        self.constants.get(usize::from(number)).copied()
    }

    /// The value of an instruction; constant if its inputs are, unless it reads the point.
    pub fn add(&mut self, op: Op, inputs: &[Slot]) -> Slot {
        let reads = op.reads();
        self.reads.uv |= reads.uv;
        self.reads.colors |= reads.colors;
        self.reads.place |= reads.place;
        self.reads.view |= reads.view;
        let mut all = [Slot(CONSTANTS); INPUTS];
        all[..inputs.len()].copy_from_slice(inputs);
        let known: Option<Vec<Vec3>> = inputs.iter().map(|&input| self.known(input)).collect();
        if let Some(known) = known.filter(|_| reads == Reads::default()) {
            let alone = Program {
                instructions: Vec::new(),
                constants: Vec::new(),
                registers: 0,
                result: Slot(0),
                bounds: [0.0; 2],
                range: [0.0; 2],
                reads: Reads::default(),
                parts: std::mem::take(&mut self.parts),
            };
            let value = alone.result_of(op, &TexturePoint::default(), |i| known[i]);
            self.parts = alone.parts;
            return self.constant(value);
        }
        let is_same = |known: &Value| known.op == op && known.inputs == all;
        let number = self.values.iter().position(is_same).unwrap_or_else(|| {
            self.values.push(Value { op, inputs: all });
            self.values.len() - 1
        });
        Slot((number as u16).min(CONSTANTS - 1))
    }

    /// The program that computes `result`, with each channel clamped to `bounds`.
    pub fn finish(self, result: Slot, bounds: [f32; 2]) -> Result<Program, TooComplex> {
        if self.values.len() >= usize::from(CONSTANTS) || self.constants.len() >= usize::from(CONSTANTS) {
            return Err(TooComplex);
        }
        let is_value = |slot: Slot| slot.0 < CONSTANTS;
        // The last use of each value.
        let mut last: Vec<Option<usize>> = vec![None; self.values.len()];
        if is_value(result) {
            last[usize::from(result.0)] = Some(usize::MAX);
        }
        for (number, value) in self.values.iter().enumerate().rev() {
            if last[number].is_some() {
                for input in value.inputs.into_iter().filter(|&input| is_value(input)) {
                    last[usize::from(input.0)].get_or_insert(number);
                }
            }
        }
        let mut register_of = vec![0u16; self.values.len()];
        let (mut free, mut registers) = (Vec::new(), 0u16);
        let mut instructions = Vec::new();
        for (number, value) in self
            .values
            .iter()
            .enumerate()
            .filter(|(number, _)| last[*number].is_some())
        {
            let placed = |input: Slot| match is_value(input) {
                true => Slot(register_of[usize::from(input.0)]),
                false => input,
            };
            let inputs = value.inputs.map(placed);
            let mut ended: Vec<u16> = (value.inputs.iter())
                .filter(|&&input| is_value(input) && last[usize::from(input.0)] == Some(number))
                .map(|input| register_of[usize::from(input.0)])
                .collect();
            ended.sort_unstable();
            ended.dedup();
            free.append(&mut ended);
            let output = free.pop().unwrap_or_else(|| {
                registers += 1;
                registers - 1
            });
            register_of[number] = output;
            instructions.push(Instruction {
                op: value.op,
                inputs,
                output,
            });
        }
        if usize::from(registers) > REGISTERS {
            return Err(TooComplex);
        }
        let result = match is_value(result) {
            true => Slot(register_of[usize::from(result.0)]),
            false => result,
        };
        let mut program = Program {
            instructions,
            constants: self.constants,
            registers: registers.into(),
            result,
            bounds,
            range: bounds,
            reads: self.reads,
            parts: self.parts,
        };
        program.range = range::of(&program);
        Ok(program)
    }
}
