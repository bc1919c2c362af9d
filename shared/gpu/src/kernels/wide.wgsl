// 64-bit integers as (low, high): not every device has them.

fn wide_add(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + u32(low < a.x));
}

// 64-bit product of two 32-bit numbers.
fn wide_product(a: u32, b: u32) -> vec2u {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    // At most 2^32 - 1.
    let middle = a1 * b0 + (low >> 16u);
    let other = a0 * b1 + (middle & 0xffffu);
    return vec2u((other << 16u) | (low & 0xffffu), a1 * b1 + (middle >> 16u) + (other >> 16u));
}

// Modulo 2^64.
fn wide_multiply(a: vec2u, b: vec2u) -> vec2u {
    let low = wide_product(a.x, b.x);
    return vec2u(low.x, low.y + a.x * b.y + a.y * b.x);
}

// Right shift by 1 to 31 bits.
fn wide_shift(a: vec2u, bits: u32) -> vec2u {
    return vec2u((a.x >> bits) | (a.y << (32u - bits)), a.y >> bits);
}

// Left shift by one bit.
fn wide_double(a: vec2u) -> vec2u {
    return vec2u(a.x << 1u, (a.y << 1u) | (a.x >> 31u));
}
