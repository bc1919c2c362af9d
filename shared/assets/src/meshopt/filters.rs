//! Filters applied to unpacked elements.

use super::Filter;

/// `stride`: bytes per element, as the filter requires.
pub fn apply(elements: &mut [u8], filter: Filter, stride: usize) {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Exponential, _) => elements.as_chunks_mut().0.iter_mut().for_each(exponential),
        (Filter::Quaternion, _) => shorts(elements, |q| {
            quaternion(q.map(u16::cast_signed)).map(i16::cast_unsigned)
        }),
        (Filter::Octahedral, 4) => bytes(elements, |n| {
            octahedral(n.map(|x| i32::from(x as i8)), 127.0).map(|x| x as u8)
        }),
        (Filter::Octahedral, _) => shorts(elements, |n| {
            octahedral(n.map(|x| i32::from(x as i16)), 32767.0).map(|x| x as u16)
        }),
        (Filter::Color, 4) => bytes(elements, |c| {
            let [y, co, cg, a] = c;
            color(
                [i32::from(y), i32::from(co as i8), i32::from(cg as i8), i32::from(a)],
                255.0,
            )
            .map(|x| x as u8)
        }),
        (Filter::Color, _) => shorts(elements, |c| {
            let [y, co, cg, a] = c;
            color(
                [i32::from(y), i32::from(co as i16), i32::from(cg as i16), i32::from(a)],
                65535.0,
            )
            .map(|x| x as u16)
        }),
    }
}

fn bytes(elements: &mut [u8], f: impl Fn([u8; 4]) -> [u8; 4]) {
    elements
        .as_chunks_mut()
        .0
        .iter_mut()
        .for_each(|element| *element = f(*element));
}

fn shorts(elements: &mut [u8], f: impl Fn([u16; 4]) -> [u16; 4]) {
    for element in elements.as_chunks_mut::<8>().0 {
        let numbers = std::array::from_fn(|i| u16::from_le_bytes([element[2 * i], element[2 * i + 1]]));
        for (to, number) in element.as_chunks_mut().0.iter_mut().zip(f(numbers)) {
            *to = number.to_le_bytes();
        }
    }
}

/// 2^e m, with an 8-bit exponent and a 24-bit mantissa.
fn exponential(element: &mut [u8; 4]) {
    let bits = i32::from_le_bytes(*element);
    let (e, m) = (bits >> 24, (bits << 8) >> 8);
    *element = (libm::ldexp(f64::from(m), e) as f32).to_le_bytes();
}

/// A unit vector scaled to `most`; the last component is passed through.
fn octahedral([x, y, one, w]: [i32; 4], most: f32) -> [i32; 4] {
    let one = one.max(1) as f32;
    let (x, y) = (x as f32 / one, y as f32 / one);
    let z = 1.0 - x.abs() - y.abs();
    let t = z.min(0.0);
    let (x, y) = (x - t.copysign(x), y - t.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    let [x, y, z] = [x, y, z].map(|c| (c / length * most).round() as i32);
    [x, y, z, w]
}

fn quaternion([x, y, z, last]: [i16; 4]) -> [i16; 4] {
    let one = f32::from(last | 3);
    let scale = std::f32::consts::FRAC_1_SQRT_2 / one;
    let [x, y, z] = [x, y, z].map(|c| f32::from(c) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (last & 3) as usize;
    let mut q = [0; 4];
    for (i, c) in [w, x, y, z].into_iter().enumerate() {
        q[(largest + i) % 4] = (c * 32767.0).round() as i16;
    }
    q
}

/// Red, green, blue and alpha scaled to `most`, from luma and chroma.
fn color([y, co, cg, a]: [i32; 4], most: f32) -> [i32; 4] {
    // All bits up to alpha's highest set bit.
    let all = match a {
        0 => return [0; 4],
        _ => (2 << a.ilog2()) - 1,
    };
    let share = a & (all >> 1);
    let share = (share << 1) | (share & 1);
    let scale = most / all as f32;
    [y + co - cg, y + cg, y - co - cg, share].map(|c| ((c as f32) * scale).round().clamp(0.0, most) as i32)
}
