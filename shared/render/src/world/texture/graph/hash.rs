//! Pseudo-random numbers for cells: the same as in Blender's textures, so that pictures agree.
//!
//! Lookup3 by Bob Jenkins (<https://burtleburtle.net/bob/c/lookup3.c>) over the bits of numbers, and PCG in two to four
//! dimensions (Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 9(3), 2020) with signed shifts.

/// Lookup3 of one to four words.
pub fn lookup3<const N: usize>(key: [u32; N]) -> u32 {
    const { assert!(N >= 1 && N <= 4) };
    let start = 0xdead_beef_u32.wrapping_add((N as u32) << 2).wrapping_add(13);
    let word = |i: usize| key.get(i).copied().unwrap_or(0);
    let mut state = [0, 1, 2].map(|i| start.wrapping_add(word(i)));
    if N == 4 {
        state = mixed(state);
        state[0] = state[0].wrapping_add(word(3));
    }
    let [mut a, mut b, mut c] = state;
    let step = |x: u32, y: u32, by: u32| (x ^ y).wrapping_sub(y.rotate_left(by));
    c = step(c, b, 14);
    a = step(a, c, 11);
    b = step(b, a, 25);
    c = step(c, b, 16);
    a = step(a, c, 4);
    b = step(b, a, 14);
    step(c, b, 24)
}

fn mixed([mut a, mut b, mut c]: [u32; 3]) -> [u32; 3] {
    let turn = |x: &mut u32, y: &mut u32, z: u32, by: u32| {
        *x = x.wrapping_sub(*y) ^ y.rotate_left(by);
        *y = y.wrapping_add(z);
    };
    turn(&mut a, &mut c, b, 4);
    turn(&mut b, &mut a, c, 6);
    turn(&mut c, &mut b, a, 8);
    turn(&mut a, &mut c, b, 16);
    turn(&mut b, &mut a, c, 19);
    turn(&mut c, &mut b, a, 4);
    [a, b, c]
}

/// A number in [0, 1] from the bits of one to four numbers.
pub fn of_floats<const N: usize>(key: [f32; N]) -> f32 {
    lookup3(key.map(f32::to_bits)) as f32 * (1.0 / u32::MAX as f32)
}

/// Three numbers in [0, 1] from one to four numbers, for the colour of a cell of that dimension.
pub fn color_of_floats<const N: usize>(key: [f32; N]) -> [f32; 3] {
    let k = |i: usize| key.get(i).copied().unwrap_or(0.0);
    match N {
        1 => [of_floats([k(0)]), of_floats([k(0), 1.0]), of_floats([k(0), 2.0])],
        2 => [
            of_floats([k(0), k(1)]),
            of_floats([k(0), k(1), 1.0]),
            of_floats([k(0), k(1), 2.0]),
        ],
        3 => [
            of_floats([k(0), k(1), k(2)]),
            of_floats([k(0), k(1), k(2), 1.0]),
            of_floats([k(0), k(1), k(2), 2.0]),
        ],
        _ => [
            of_floats([k(0), k(1), k(2), k(3)]),
            of_floats([k(2), k(0), k(3), k(1)]),
            of_floats([k(3), k(2), k(1), k(0)]),
        ],
    }
}

/// As many numbers in [0, 1] as the cell has dimensions, one to four, from the coordinates of its corner.
pub fn cell_of_floats<const N: usize>(key: [f32; N]) -> [f32; N] {
    let k = |i: usize| key.get(i).copied().unwrap_or(0.0);
    let all = match N {
        1 | 3 => {
            let [x, y, z] = color_of_floats(key);
            [x, y, z, 0.0]
        }
        2 => [of_floats([k(0), k(1)]), of_floats([k(0), k(1), 1.0]), 0.0, 0.0],
        _ => [
            of_floats([k(0), k(1), k(2), k(3)]),
            of_floats([k(3), k(0), k(1), k(2)]),
            of_floats([k(2), k(3), k(0), k(1)]),
            of_floats([k(1), k(2), k(3), k(0)]),
        ],
    };
    std::array::from_fn(|i| all[i])
}

/// As many numbers in [0, 1] as the cell has dimensions, two to four, from its integer coordinates.
pub fn of_cell<const N: usize>(cell: [i32; N]) -> [f32; N] {
    const { assert!(N >= 2 && N <= 4) };
    // The two other components that each component mixes in, in turn.
    let others = |i: usize| match (N, i) {
        (3, 0) => (1, 2),
        (3, 1) => (2, 0),
        (3, _) => (0, 1),
        (_, 0) => (1, 3),
        (_, 1) => (2, 0),
        (_, 2) => (0, 1),
        _ => (1, 2),
    };
    const FACTOR: i32 = 1_664_525;
    let mut v = cell.map(|x| x.wrapping_mul(FACTOR).wrapping_add(1_013_904_223));
    let round = |v: &mut [i32; N]| {
        for i in 0..N {
            let by = match N {
                2 => v[1 - i].wrapping_mul(FACTOR),
                _ => {
                    let (a, b) = others(i);
                    v[a].wrapping_mul(v[b])
                }
            };
            v[i] = v[i].wrapping_add(by);
        }
    };
    round(&mut v);
    v = v.map(|x| x ^ (x >> 16));
    round(&mut v);
    v.map(|x| (x & i32::MAX) as f32 * (1.0 / i32::MAX as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blender's white noise.
    #[test]
    fn numbers_of_floats_are_blenders() {
        let p = [2.668_945_3, 0.750_976_56, 1.104_492_2, 2.668_945_3f32];
        let near = |value: f32, expected: f32| assert!((value - expected).abs() < 1e-6, "{value} {expected}");
        near(of_floats([p[0]]), 0.889_248_13);
        near(of_floats([p[0], p[1]]), 0.308_154_3);
        near(of_floats([p[0], p[1], p[2]]), 0.311_634_15);
        near(of_floats(p), 0.489_902);
        for (value, expected) in color_of_floats(p)
            .into_iter()
            .zip([0.489_902, 0.197_308_1, 0.686_077_1])
        {
            near(value, expected);
        }
    }

    #[test]
    fn numbers_of_cells_are_even() {
        let mut sums = [0.0; 3];
        for i in 0..1000 {
            let numbers = of_cell([i % 10 - 5, i / 10 % 10, i / 100 - 500]);
            for (sum, x) in sums.iter_mut().zip(numbers) {
                assert!((0.0..=1.0).contains(&x));
                *sum += f64::from(x) / 1000.0;
            }
        }
        // Five standard errors of a mean of 1000 uniform numbers.
        assert!(sums.iter().all(|mean| (mean - 0.5).abs() < 5.0 * 0.0092), "{sums:?}");
    }
}
