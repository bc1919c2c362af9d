// Division and square root, correctly rounded as in IEEE 754: all other code uses `quotient` and `root`. They call the
// native operations if the self-test found those exact, else `own_*`, which fix up the native result with an integer
// remainder; see `Arithmetic` in `kernels.rs`. Inlined in hundreds of places, so kept short.

const INFINITY: u32 = 0x7f800000u;
const NOT_A_NUMBER: u32 = 0x7fc00000u;

// A float that compilers cannot constant-fold.
fn of_bits(u: u32) -> f32 { return bitcast<f32>(u); }

fn native_quotient(a: f32, b: f32) -> f32 { return a / b; }

fn native_root(x: f32) -> f32 { return sqrt(x); }

struct Parts {
    // In [2^23, 2^24).
    mantissa: u32,
    // The number is mantissa 2^(exponent - 150).
    exponent: i32,
}

// Of a positive finite number, given its bits.
fn parts(u: u32) -> Parts {
    let is_denormal = u < 0x800000u;
    let shift = select(0u, countLeadingZeros(u) - 8u, is_denormal);
    return Parts(((u << shift) & 0x7fffffu) | 0x800000u, select(i32(u >> 23u), 1 - i32(shift), is_denormal));
}

fn own_quotient(a: f32, b: f32) -> f32 {
    let ua = bitcast<u32>(a);
    let ub = bitcast<u32>(b);
    let sign = (ua ^ ub) & 0x80000000u;
    let aa = ua & 0x7fffffffu;
    let ab = ub & 0x7fffffffu;
    // One of them is zero, infinite or NaN.
    if (aa - 1u >= INFINITY - 1u || ab - 1u >= INFINITY - 1u) {
        let is_none = aa > INFINITY || ab > INFINITY || aa == ab;
        let size = select(0u, INFINITY, aa == INFINITY || ab == 0u);
        return of_bits(select(sign | size, NOT_A_NUMBER, is_none));
    }
    let pa = parts(aa);
    let pb = parts(ab);
    let divisor = bitcast<i32>(pb.mantissa);
    let less = u32(pa.mantissa < pb.mantissa);
    // The native quotient, in [2^23, 2^24), is off by a few. The remainder is exact modulo 2^32, and small.
    let fa = bitcast<f32>((pa.mantissa & 0x7fffffu) | ((150u + less) << 23u));
    let inverse = native_quotient(1.0, bitcast<f32>((pb.mantissa & 0x7fffffu) | 0x3f800000u));
    var q = u32(fa * inverse);
    var r = bitcast<i32>((pa.mantissa << (23u + less)) - q * pb.mantissa);
    // 2^-23: the inverse is of a divisor in [1, 2).
    let off = i32(floor(f32(r) * (inverse * 0.00000011920929f)));
    r -= off * divisor;
    // `off` is rounded, so one may be left.
    let last = i32(r >= divisor) - i32(r < 0);
    r -= last * divisor;
    q = bitcast<u32>(bitcast<i32>(q) + off + last);
    let e = pa.exponent - pb.exponent + 127 - i32(less);
    if (e >= 255) { return of_bits(sign | INFINITY); }
    if (e > 0) {
        q += u32(2 * r > divisor || (2 * r == divisor && (q & 1u) == 1u));
        // A carry out of the mantissa moves into the exponent, and from there to infinity.
        return of_bits(sign | ((u32(e - 1) << 23u) + q));
    }
    // A denormal result keeps fewer bits.
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
    // x = m 2^(2n) with m in [1, 4). The native root, in [2^23, 2^24), is off by a few.
    let odd = u32(p.exponent & 1) ^ 1u;
    let m = bitcast<f32>((p.mantissa & 0x7fffffu) | ((127u + odd) << 23u));
    var s = u32(native_root(m) * 8388608.0);
    var r = bitcast<i32>((p.mantissa << (23u + odd)) - s * s);
    let off = i32(floor(f32(r) * native_quotient(0.5, f32(s))));
    r -= off * (2 * bitcast<i32>(s) + off);
    s = bitcast<u32>(bitcast<i32>(s) + off);
    if (r < 0) {
        r += bitcast<i32>(2u * s - 1u);
        s -= 1u;
    }
    if (r > bitcast<i32>(2u * s)) {
        r -= bitcast<i32>(2u * s + 1u);
        s += 1u;
    }
    // Round up above s + 1/2: a tie is impossible, as (s + 1/2)^2 is no integer.
    s += u32(r > bitcast<i32>(s));
    let n = (p.exponent - 127 - i32(odd)) / 2;
    return of_bits((u32(n + 126) << 23u) + s);
}
