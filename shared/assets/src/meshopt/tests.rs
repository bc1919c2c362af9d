use super::*;
use crate::damage::damage;

/// Mode, filter, count, stride, packed and unpacked bytes, made by meshoptimizer 1.3.
const VECTORS: &str = include_str!("vectors.txt");

fn bytes(hex: &str) -> Vec<u8> {
    let digits = hex.as_bytes().as_chunks::<2>().0.iter();
    let byte = |pair: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    digits.map(|pair| byte(pair).expect("two digits")).collect()
}

fn vectors() -> Vec<(Layout, Vec<u8>, Vec<u8>)> {
    let vector = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        let layout = Layout {
            mode: match words[0] {
                "ATTRIBUTES" => Mode::Attributes,
                "TRIANGLES" => Mode::Triangles,
                _ => Mode::Indices,
            },
            filter: match words[1] {
                "OCTAHEDRAL" => Filter::Octahedral,
                "QUATERNION" => Filter::Quaternion,
                "EXPONENTIAL" => Filter::Exponential,
                "COLOR" => Filter::Color,
                _ => Filter::None,
            },
            count: words[2].parse().expect("a number"),
            stride: words[3].parse().expect("a number"),
        };
        (layout, bytes(words[4]), bytes(words[5]))
    };
    VECTORS.lines().map(vector).collect()
}

/// All numbers of an element after filtering, and their tolerance against another implementation.
fn numbers(layout: &Layout, bytes: &[u8]) -> (Vec<i32>, i32) {
    match (layout.filter, layout.stride) {
        (Filter::Octahedral, 4) => (bytes.iter().map(|b| i32::from(*b as i8)).collect(), 1),
        (Filter::Octahedral | Filter::Quaternion, _) => {
            let shorts = bytes.as_chunks().0.iter();
            (shorts.map(|b| i32::from(i16::from_le_bytes(*b))).collect(), 1)
        }
        (Filter::Color, 8) => {
            let shorts = bytes.as_chunks().0.iter();
            (shorts.map(|b| i32::from(u16::from_le_bytes(*b))).collect(), 1)
        }
        (filter, _) => {
            let bytes = bytes.iter().map(|b| i32::from(*b)).collect();
            (bytes, i32::from(filter == Filter::Color))
        }
    }
}

#[test]
fn what_meshoptimizer_packs_comes_back() {
    for (i, (layout, packed, expected)) in vectors().iter().enumerate() {
        let found = decode(packed, layout).unwrap_or_else(|flaw| panic!("{i}: {layout:?}: {}", flaw.message));
        assert_eq!(found.len(), expected.len(), "{i}: {layout:?}");
        let ((found, near), (expected, _)) = (numbers(layout, &found), numbers(layout, expected));
        for (at, (a, b)) in found.iter().zip(&expected).enumerate() {
            assert!((a - b).abs() <= near, "{i}: {layout:?}: {a} for {b} at {at}");
        }
    }
}

#[test]
fn damage_is_refused_or_read() {
    for (layout, packed, _) in vectors() {
        for cut in 0..packed.len() {
            assert!(decode(&packed[..cut], &layout).is_err(), "{layout:?} of {cut} bytes");
        }
        damage(&[packed], |bytes| drop(decode(bytes, &layout)));
    }
}

#[test]
fn layouts_that_cannot_be_are_refused() {
    let layout = |mode, filter, count, stride| Layout {
        mode,
        filter,
        count,
        stride,
    };
    for layout in [
        layout(Mode::Attributes, Filter::None, 1, 0),
        layout(Mode::Attributes, Filter::None, 1, 6),
        layout(Mode::Attributes, Filter::None, 1, 260),
        layout(Mode::Attributes, Filter::Quaternion, 1, 4),
        layout(Mode::Attributes, Filter::Octahedral, 1, 12),
        layout(Mode::Triangles, Filter::None, 4, 2),
        layout(Mode::Indices, Filter::None, 4, 1),
        layout(Mode::Indices, Filter::Color, 4, 4),
        layout(Mode::Attributes, Filter::None, usize::MAX, 4),
    ] {
        assert!(decode(&[0xa1; 64], &layout).is_err(), "{layout:?}");
    }
    // Much is claimed, little is there.
    let much = layout(Mode::Attributes, Filter::None, 1 << 40, 4);
    assert!(decode(&[0xa0; 64], &much).is_err());
}
