// Quotients and roots as IEEE 754 rounds them, to nearest. The device's own where the self-test found them exact
// (NATIVE_QUOTIENT, NATIVE_ROOT), or else mended by an integer remainder. All other functions divide by these two.

const INFINITY: u32 = 0x7f800000u;
const NOT_A_NUMBER: u32 = 0x7fc00000u;

// A float that no compiler computes with beforehand.
fn of_bits(u: u32) -> f32 { return bitcast<f32>(u); }

fn native_quotient(a: f32, b: f32) -> f32 { return a / b; }

fn native_root(x: f32) -> f32 { return sqrt(x); }

fn quotient(a: f32, b: f32) -> f32 {
    if (NATIVE_QUOTIENT) { return native_quotient(a, b); }
    return own_quotient(a, b);
}

fn root(x: f32) -> f32 {
    if (NATIVE_ROOT) { return native_root(x); }
    return own_root(x);
}

struct Parts {
    // In [2^23, 2^24).
    mantissa: u32,
    // The number is mantissa 2^(exponent - 150).
    exponent: i32,
}

// Of a positive finite number, by its bits.
fn parts(u: u32) -> Parts {
    if (u >= 0x800000u) { return Parts((u & 0x7fffffu) | 0x800000u, i32(u >> 23u)); }
    let shift = countLeadingZeros(u) - 8u;
    return Parts(u << shift, 1 - i32(shift));
}

fn own_quotient(a: f32, b: f32) -> f32 {
    let ua = bitcast<u32>(a);
    let ub = bitcast<u32>(b);
    let sign = (ua ^ ub) & 0x80000000u;
    let aa = ua & 0x7fffffffu;
    let ab = ub & 0x7fffffffu;
    if (aa > INFINITY || ab > INFINITY) { return of_bits(NOT_A_NUMBER); }
    if (aa == INFINITY || ab == 0u) {
        return of_bits(select(sign | INFINITY, NOT_A_NUMBER, ab == INFINITY || aa == 0u));
    }
    if (aa == 0u || ab == INFINITY) { return of_bits(sign); }
    let pa = parts(aa);
    let pb = parts(ab);
    let divisor = bitcast<i32>(pb.mantissa);
    let less = u32(pa.mantissa < pb.mantissa);
    // A quotient in [2^23, 2^24), by the device off by a few. What is left over is exact modulo 2^32, and small.
    let fa = bitcast<f32>((pa.mantissa & 0x7fffffu) | ((150u + less) << 23u));
    let fb = bitcast<f32>((pb.mantissa & 0x7fffffu) | 0x3f800000u);
    var q = u32(native_quotient(fa, fb));
    var r = bitcast<i32>((pa.mantissa << (23u + less)) - q * pb.mantissa);
    for (var i = 0; i < 6; i++) { if (r < 0) { q -= 1u; r += divisor; } }
    for (var i = 0; i < 6; i++) { if (r >= divisor) { q += 1u; r -= divisor; } }
    let e = pa.exponent - pb.exponent + 127 - i32(less);
    if (e >= 255) { return of_bits(sign | INFINITY); }
    if (e > 0) {
        q += u32(2 * r > divisor || (2 * r == divisor && (q & 1u) == 1u));
        // A carry out of the mantissa goes to the exponent, and out of that to infinity.
        return of_bits(sign | ((u32(e - 1) << 23u) + q));
    }
    // A denormal number: fewer bits are kept.
    let shift = u32(1 - e);
    if (shift > 24u) { return of_bits(sign); }
    let kept = q >> shift;
    let rest = q - (kept << shift);
    let half = 1u << (shift - 1u);
    let up = rest > half || (rest == half && (r > 0 || (kept & 1u) == 1u));
    return of_bits(sign | (kept + u32(up)));
}

fn own_root(x: f32) -> f32 {
    let u = bitcast<u32>(x);
    if ((u << 1u) == 0u || u == INFINITY) { return x; }
    if (u > INFINITY) { return of_bits(NOT_A_NUMBER); }
    let p = parts(u);
    // x = m 2^(2n) with m in [1, 4); a root in [2^23, 2^24), by the device off by a few.
    let odd = u32(p.exponent & 1) ^ 1u;
    let m = bitcast<f32>((p.mantissa & 0x7fffffu) | ((127u + odd) << 23u));
    var s = u32(native_root(m) * 8388608.0);
    var r = bitcast<i32>((p.mantissa << (23u + odd)) - s * s);
    for (var i = 0; i < 6; i++) { if (r < 0) { r += bitcast<i32>(2u * s - 1u); s -= 1u; } }
    for (var i = 0; i < 6; i++) { if (r > bitcast<i32>(2u * s)) { r -= bitcast<i32>(2u * s + 1u); s += 1u; } }
    // Above s + 1/2, of which the square is no integer.
    s += u32(r > bitcast<i32>(s));
    let n = (p.exponent - 127 - i32(odd)) / 2;
    return of_bits((u32(n + 126) << 23u) + s);
}
