//! Reads the elements of a buffer, as in glTF files.

use beamfarm_render::parallel::collected;
use rayon::prelude::*;

/// Type of an element's component, little-endian.
#[derive(Clone, Copy, Debug)]
pub enum Component {
    /// Signed, one byte.
    I8,
    /// Unsigned, one byte.
    U8,
    /// Signed, two bytes.
    I16,
    /// Unsigned, two bytes.
    U16,
    /// Unsigned, four bytes.
    U32,
    /// Single precision.
    F32,
}

/// Read elements that are `stride` (at least 1) bytes apart, with adjacent components. `numbers` receives `components`
/// per element; elements beyond the end of `bytes` become zero. `normalized`: integers become fractions of their type's
/// largest value.
pub fn read(
    bytes: &[u8],
    stride: usize,
    component: Component,
    normalized: bool,
    (numbers, components): (&mut [f64], usize),
) {
    let elements = bytes.par_chunks(stride.max(1));
    let rows = numbers.par_chunks_mut(components.max(1));
    rows.zip(elements).for_each(|(row, element)| {
        for (i, number) in row.iter_mut().enumerate() {
            *number = self::number(component, normalized, element, i);
        }
    });
}

/// Read elements of one unsigned integer each.
pub fn whole(bytes: &[u8], stride: usize, component: Component) -> Vec<u32> {
    let elements = bytes.par_chunks(stride.max(1));
    collected(elements.map(|element| number(component, false, element, 0) as u32))
}

fn number(component: Component, normalized: bool, element: &[u8], i: usize) -> f64 {
    let size = match component {
        Component::I8 | Component::U8 => 1,
        Component::I16 | Component::U16 => 2,
        Component::U32 | Component::F32 => 4,
    };
    let bytes = element.get(i * size..).unwrap_or_default();
    let (value, largest) = match (component, bytes) {
        (Component::I8, [a, ..]) => (f64::from(*a as i8), 127.0),
        (Component::U8, [a, ..]) => (f64::from(*a), 255.0),
        (Component::I16, [a, b, ..]) => (f64::from(i16::from_le_bytes([*a, *b])), 32767.0),
        (Component::U16, [a, b, ..]) => (f64::from(u16::from_le_bytes([*a, *b])), 65535.0),
        (Component::U32, [a, b, c, d, ..]) => (f64::from(u32::from_le_bytes([*a, *b, *c, *d])), 4294967295.0),
        (Component::F32, [a, b, c, d, ..]) => return f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
        _ => (0.0, 1.0),
    };
    match normalized {
        true => (value / largest).max(-1.0),
        false => value,
    }
}
