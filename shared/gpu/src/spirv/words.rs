//! Decorations and execution modes that naga's SPIR-V lacks and that stop drivers from taking liberties.

use std::collections::{HashMap, HashSet};

/// SPIR-V operation numbers.
mod op {
    pub const EXTENSION: u32 = 10;
    pub const ENTRY_POINT: u32 = 15;
    pub const EXECUTION_MODE: u32 = 16;
    pub const CAPABILITY: u32 = 17;
    pub const TYPE_VOID: u32 = 19;
    pub const TYPE_ARRAY: u32 = 28;
    pub const TYPE_STRUCT: u32 = 30;
    pub const TYPE_POINTER: u32 = 32;
    pub const TYPE_FORWARD_POINTER: u32 = 39;
    pub const CONSTANT: u32 = 43;
    pub const VARIABLE: u32 = 59;
    pub const DECORATE: u32 = 71;
    /// FNegate, FAdd, FSub, FMul, FDiv, FRem, FMod, and products of vectors and matrices.
    pub const OF_FLOATS: [u32; 14] = [127, 129, 131, 133, 136, 140, 141, 142, 143, 144, 145, 146, 147, 148];
}

const NO_CONTRACTION: u32 = 42;
/// Capability and execution mode: denormals preserved; signed zeros, infinities and NaN preserved; rounding to nearest,
/// ties to even.
const MODES: [[u32; 2]; 3] = [[4464, 4459], [4466, 4461], [4467, 4462]];
const EXTENSION: &[u8] = b"SPV_KHR_float_controls\0\0";

/// Local arrays with at least this many elements are not cleared: stacks and lists whose elements are written before
/// they are read. naga would clear them at every call.
const LONG: u32 = 16;

/// Words of a module's header.
const HEADER: usize = 5;

/// Float controls that a device supports. Without support it may still behave as required, which its test finds out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controls {
    /// Denormal numbers are preserved.
    pub denormals: bool,
    /// Signed zeros, infinities and NaN are preserved.
    pub zeros: bool,
    /// Rounding to nearest, ties to even.
    pub rounding: bool,
}

impl Controls {
    fn modes(self) -> Vec<[u32; 2]> {
        let wanted = [self.denormals, self.zeros, self.rounding];
        let modes = MODES.iter().zip(wanted).filter(|(_, wanted)| *wanted);
        modes.map(|(mode, _)| *mode).collect()
    }
}

/// The module with every float operation decorated, execution modes for its entry points, and long arrays left
/// uninitialised. None if it is truncated.
pub fn exact(words: &[u32], controls: Controls) -> Option<Vec<u32>> {
    let controls = controls.modes();
    let long = pointers_to_long(words);
    let mut floats = Vec::new();
    for instruction in instructions(words) {
        let instruction = instruction?;
        if op::OF_FLOATS.contains(&operation(instruction)) {
            floats.push(*instruction.get(2)?);
        }
    }
    let mut out = words.get(..HEADER)?.to_vec();
    controls
        .iter()
        .for_each(|[capability, _]| push(&mut out, op::CAPABILITY, &[*capability]));
    let mut entries = Vec::new();
    // Still to be written, in the order of a module's sections.
    let (mut extension, mut modes, mut decorations) = (!controls.is_empty(), true, true);
    for instruction in instructions(words).flatten() {
        let here = operation(instruction);
        if extension && here != op::CAPABILITY {
            extension = false;
            let name: Vec<u32> = EXTENSION
                .chunks_exact(4)
                .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            push(&mut out, op::EXTENSION, &name);
        }
        match here {
            op::ENTRY_POINT => entries.push(*instruction.get(2)?),
            _ if modes && !entries.is_empty() => {
                modes = false;
                for (entry, [_, mode]) in entries.iter().flat_map(|e| controls.iter().map(|c| (*e, *c))) {
                    push(&mut out, op::EXECUTION_MODE, &[entry, mode, 32]);
                }
            }
            _ => {}
        }
        // Annotations end where types begin.
        if decorations && (op::TYPE_VOID..=op::TYPE_FORWARD_POINTER).contains(&here) {
            decorations = false;
            floats
                .iter()
                .for_each(|id| push(&mut out, op::DECORATE, &[*id, NO_CONTRACTION]));
        }
        match here {
            op::VARIABLE if long.contains(instruction.get(1)?) => push(&mut out, here, instruction.get(1..4)?),
            _ => out.extend_from_slice(instruction),
        }
    }
    Some(out)
}

/// Types of pointers to variables that contain a [`LONG`] array; in such a module they belong to functions.
fn pointers_to_long(words: &[u32]) -> HashSet<u32> {
    const OF_FUNCTIONS: u32 = 7;
    let (mut constants, mut long) = (HashMap::new(), HashSet::new());
    for instruction in instructions(words).flatten() {
        match (operation(instruction), instruction) {
            (op::CONSTANT, [_, _, id, value]) => drop(constants.insert(*id, *value)),
            (op::TYPE_ARRAY, [_, id, element, length])
                if long.contains(element) || constants.get(length).is_some_and(|n| *n >= LONG) =>
            {
                long.insert(*id);
            }
            (op::TYPE_STRUCT, [_, id, members @ ..]) if members.iter().any(|member| long.contains(member)) => {
                long.insert(*id);
            }
            (op::TYPE_POINTER, [_, id, OF_FUNCTIONS, to]) if long.contains(to) => drop(long.insert(*id)),
            _ => {}
        }
    }
    long
}

fn push(out: &mut Vec<u32>, operation: u32, operands: &[u32]) {
    out.push(((operands.len() as u32 + 1) << 16) | operation);
    out.extend_from_slice(operands);
}

fn operation(instruction: &[u32]) -> u32 {
    instruction[0] & 0xffff
}

/// All instructions with their first words; None for a truncated one, which is the last.
fn instructions(words: &[u32]) -> impl Iterator<Item = Option<&[u32]>> {
    let mut rest = words.get(HEADER..).unwrap_or_default();
    std::iter::from_fn(move || {
        let length = (*rest.first()? >> 16) as usize;
        let instruction = (length > 0).then(|| rest.get(..length)).flatten();
        rest = instruction.map_or(&[], |_| &rest[length..]);
        Some(instruction)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_that_are_cut_off_are_refused() {
        let header = [0x0723_0203, 0x1_0300, 0, 9, 0];
        assert_eq!(exact(&header[..4], Controls::default()), None);
        // An addition of two words, an instruction of none, one that exceeds the module.
        for words in [[(2 << 16) | 129, 1], [0, 0], [(3 << 16) | 129, 1]] {
            assert_eq!(exact(&[&header[..], &words].concat(), Controls::default()), None);
        }
        assert!(exact(&[&header[..], &[(2 << 16) | 17, 1]].concat(), Controls::default()).is_some());
    }
}
