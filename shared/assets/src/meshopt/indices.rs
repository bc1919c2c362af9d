//! Coded indices, modes 1 and 2.

use super::Input;
use crate::Flaw;

/// The sixteen most recently pushed things.
struct Recent<T> {
    slots: [T; 16],
    pushed: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Self {
        Self {
            slots: [T::default(); 16],
            pushed: 0,
        }
    }

    fn push(&mut self, thing: T) {
        self.slots[self.pushed % 16] = thing;
        self.pushed += 1;
    }

    /// The one pushed `back` before the last.
    fn get(&self, back: u8) -> Result<T, Flaw> {
        let back = usize::from(back);
        match back < self.pushed.min(16) {
            true => Ok(self.slots[(self.pushed - 1 - back) % 16]),
            false => Err("a packed triangle names what did not come before it".into()),
        }
    }
}

/// Append the stored bytes of an index.
fn emit(indices: &mut Vec<u8>, index: u32, stride: usize) {
    indices.extend_from_slice(&index.to_le_bytes()[..stride]);
}

fn unfolded(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

struct Triangles<'b> {
    data: Input<'b>,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
    /// The next new index, and the last explicitly coded one.
    next: u32,
    last: u32,
}

pub fn triangles(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Flaw> {
    const TAIL: usize = 16;
    let Some((0xe1, rest)) = bytes.split_first() else {
        return Err("its packed triangles do not begin with 0xe1".into());
    };
    let (mut body, table) = match rest.len().checked_sub(TAIL) {
        Some(end) => (Input(&rest[..end]), &rest[end..]),
        None => return Err("its packed bytes end early".into()),
    };
    let codes = body.take(count / 3)?;
    let mut state = Triangles {
        data: body,
        edges: Recent::new(),
        vertices: Recent::new(),
        next: 0,
        last: 0,
    };
    let mut indices = Vec::with_capacity(count * stride);
    for code in codes {
        for index in state.triangle(*code, table)? {
            emit(&mut indices, index, stride);
        }
    }
    state.data.end()?;
    Ok(indices)
}

impl Triangles<'_> {
    fn new_one(&mut self) -> u32 {
        let index = self.next;
        self.next = self.next.wrapping_add(1);
        index
    }

    fn said(&mut self) -> Result<u32, Flaw> {
        self.last = self.last.wrapping_add(unfolded(self.data.varint()?));
        Ok(self.last)
    }

    /// A corner by its four-bit code: new, recent, or explicitly coded.
    fn corner(&mut self, by: u8) -> Result<u32, Flaw> {
        match by {
            0 => Ok(self.new_one()),
            15 => self.said(),
            _ => self.vertices.get(by - 1),
        }
    }

    fn triangle(&mut self, code: u8, table: &[u8]) -> Result<[u32; 3], Flaw> {
        let (x, y) = (code >> 4, code & 15);
        if x < 15 {
            let [a, b] = self.edges.get(x)?;
            let c = match y {
                0 => self.new_one(),
                13 | 14 => {
                    self.last = self.last.wrapping_add(if y == 13 { u32::MAX } else { 1 });
                    self.last
                }
                15 => self.said()?,
                _ => self.vertices.get(y)?,
            };
            self.edges.push([c, b]);
            self.edges.push([a, c]);
            if matches!(y, 0 | 13..) {
                self.vertices.push(c);
            }
            return Ok([a, b, c]);
        }
        let by = match table.get(usize::from(y)) {
            Some(by) if y < 14 => *by,
            _ => self.data.byte()?,
        };
        if y >= 14 && by == 0 {
            self.next = 0;
        }
        let a = if y == 15 { self.said()? } else { self.new_one() };
        // Both are looked up before either is pushed.
        let (z, w) = (by >> 4, by & 15);
        let b = self.corner(z)?;
        let c = self.corner(w)?;
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        self.vertices.push(a);
        for (by, index) in [(z, b), (w, c)] {
            if matches!(by, 0 | 15) {
                self.vertices.push(index);
            }
        }
        Ok([a, b, c])
    }
}

pub fn sequence(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, Flaw> {
    const TAIL: usize = 4;
    let Some((0xd1, rest)) = bytes.split_first() else {
        return Err("its packed indices do not begin with 0xd1".into());
    };
    let end = rest.len().checked_sub(TAIL).ok_or("its packed bytes end early")?;
    let mut input = Input(&rest[..end]);
    // Each takes at least a byte.
    if count > end {
        return Err("its packed bytes end early".into());
    }
    let mut last = [0u32; 2];
    let mut indices = Vec::with_capacity(count * stride);
    for _ in 0..count {
        let value = input.varint()?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(unfolded(value >> 1));
        emit(&mut indices, *last, stride);
    }
    input.end()?;
    Ok(indices)
}
