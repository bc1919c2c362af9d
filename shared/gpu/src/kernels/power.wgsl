// x^y, step by step as in crate libm's powf.

// Clears the last bits of the mantissa.
fn power_head(x: f32) -> f32 { return bitcast<f32>(bitcast<u32>(x) & 0xfffff000u); }

// log2 of a positive number, as head and tail; `far`: for exponents beyond 2^27, of numbers near one.
fn power_log2(ax_: f32, far: bool) -> vec2f {
    if (far) {
        let t = ax_ - 1.0;
        let w = (t * t) * (0.5 - t * (0.333333333333f - t * 0.25));
        let u = 1.4426879883e+00f * t;
        let v = t * 7.0526075433e-06f - w * 1.4426950216e+00f;
        let t1 = power_head(u + v);
        return vec2f(t1, v - (t1 - u));
    }
    var ax = ax_;
    var n = 0;
    if (bitcast<u32>(ax) < 0x00800000u) {
        ax *= 16777216.0;
        n = -24;
    }
    let bits = bitcast<u32>(ax);
    n += i32(bits >> 23u) - 127;
    let j = bits & 0x7fffffu;
    var ix = j | 0x3f800000u;
    var k = 0u;
    if (j > 0x1cc471u) {
        if (j < 0x5db3d7u) {
            k = 1u;
        } else {
            n += 1;
            ix -= 0x00800000u;
        }
    }
    ax = bitcast<f32>(ix);
    // s = (x - b) / (x + b), b = 1 or 3/2, as head and tail.
    let b = select(1.0, 1.5, k == 1u);
    let dp_h = select(0.0, 5.84960938e-01f, k == 1u);
    let dp_l = select(0.0, 1.56322085e-06f, k == 1u);
    var u = ax - b;
    var v = quotient(1.0, ax + b);
    let s = u * v;
    let s_h = power_head(s);
    var t_h = bitcast<f32>((((ix >> 1u) & 0xfffff000u) | 0x20000000u) + 0x00400000u + (k << 21u));
    var t_l = ax - (t_h - b);
    let s_l = v * ((u - s_h * t_h) - s_h * t_l);
    var s2 = s * s;
    var r = s2 * s2 * (6.0000002384e-01f + s2 * (4.2857143283e-01f + s2 * (3.3333334327e-01f
        + s2 * (2.7272811532e-01f + s2 * (2.3066075146e-01f + s2 * 2.0697501302e-01f)))));
    r += s_l * (s_h + s);
    s2 = s_h * s_h;
    t_h = power_head(3.0 + s2 + r);
    t_l = r - ((t_h - 3.0) - s2);
    u = s_h * t_h;
    v = s_l * t_h + t_l * s;
    let p_h = power_head(u + v);
    let p_l = v - (p_h - u);
    let z_h = 9.6191406250e-01f * p_h;
    let z_l = -1.1736857402e-04f * p_h + p_l * 9.6179670095e-01f + dp_l;
    let t = f32(n);
    let t1 = power_head(((z_h + z_l) + dp_h) + t);
    return vec2f(t1, z_l - (((t1 - t) - dp_h) - z_h));
}

// 2^(p_h + p_l); `bits`: those of the sum, which is at most 150 in size.
fn power_exp2(head: f32, p_l: f32, bits: u32) -> f32 {
    var p_h = head;
    var n = 0;
    let i = bits & 0x7fffffffu;
    if (i > 0x3f000000u) {
        let shifted = bits + (0x00800000u >> ((i >> 23u) - 126u));
        let k = ((shifted & 0x7fffffffu) >> 23u) - 127u;
        p_h -= bitcast<f32>(shifted & ~(0x007fffffu >> k));
        n = i32(((shifted & 0x007fffffu) | 0x00800000u) >> (23u - k));
        if ((bits >> 31u) != 0u) { n = -n; }
    }
    var t = bitcast<f32>(bitcast<u32>(p_l + p_h) & 0xffff8000u);
    let u = t * 6.93145752e-01f;
    let v = (p_l - (t - p_h)) * 6.9314718246e-01f + t * 1.42860654e-06f;
    var z = u + v;
    let w = v - (z - u);
    t = z * z;
    let t1 = z - t * (1.6666667163e-1f + t * (-2.7777778450e-3f + t * (6.6137559770e-5f
        + t * (-1.6533901999e-6f + t * 4.1381369442e-8f))));
    let r = quotient(z * t1, t1 - 2.0) - (w + z * w);
    z = 1.0 - (r - z);
    let whole = bitcast<i32>(bitcast<u32>(z) + (bitcast<u32>(n) << 23u));
    if ((whole >> 23u) <= 0) { return scaled(z, n); }
    return bitcast<f32>(whole);
}

// Of a number's bits without the sign: 0 if it is no integer, 1 if odd, 2 if even.
fn power_parity(bits: u32) -> u32 {
    if (bits >= 0x4b800000u) { return 2u; }
    if (bits < 0x3f800000u) { return 0u; }
    let k = (bits >> 23u) - 127u;
    let j = bits >> (23u - k);
    return select(0u, 2u - (j & 1u), (j << (23u - k)) == bits);
}

fn power(x: f32, y: f32) -> f32 {
    let bx = bitcast<u32>(x);
    let by = bitcast<u32>(y);
    let ix = bx & 0x7fffffffu;
    let iy = by & 0x7fffffffu;
    let negative = (bx >> 31u) != 0u;
    let inverse = (by >> 31u) != 0u;
    if (iy == 0u || bx == 0x3f800000u) { return 1.0; }
    if (ix > INFINITY || iy > INFINITY) { return of_bits(NOT_A_NUMBER); }
    var parity = 0u;
    if (negative) { parity = power_parity(iy); }
    if (iy == INFINITY) {
        if (ix == 0x3f800000u) { return 1.0; }
        return of_bits(select(0u, INFINITY, (ix > 0x3f800000u) != inverse));
    }
    if (iy == 0x3f800000u) {
        if (inverse) { return quotient(1.0, x); }
        return x;
    }
    if (by == 0x40000000u) { return x * x; }
    if (by == 0x3f000000u && !negative) { return root(x); }
    let ax = abs(x);
    if (ix == INFINITY || ix == 0u || ix == 0x3f800000u) {
        var z = ax;
        if (inverse) { z = quotient(1.0, z); }
        if (negative) {
            if (ix == 0x3f800000u && parity == 0u) { return of_bits(NOT_A_NUMBER); }
            if (parity == 1u) { z = -z; }
        }
        return z;
    }
    if (negative && parity == 0u) { return of_bits(NOT_A_NUMBER); }
    let sign = select(0u, 0x80000000u, parity == 1u);
    let far = iy > 0x4d000000u;
    if (far) {
        if (ix < 0x3f7ffff8u) { return of_bits(sign | select(0u, INFINITY, inverse)); }
        if (ix > 0x3f800007u) { return of_bits(sign | select(INFINITY, 0u, inverse)); }
    }
    let log = power_log2(ax, far);
    let y1 = power_head(y);
    let p_l = (y - y1) * log.x + y * log.y;
    let p_h = y1 * log.x;
    let z = p_l + p_h;
    let bits = bitcast<u32>(z);
    let large = bitcast<i32>(bits);
    if (large > 0x43000000 || (large == 0x43000000 && p_l + 4.2995665694e-8f > z - p_h)) {
        return of_bits(sign | INFINITY);
    }
    if ((bits & 0x7fffffffu) > 0x43160000u || (bits == 0xc3160000u && p_l <= z - p_h)) { return of_bits(sign); }
    let result = power_exp2(p_h, p_l, bits);
    return of_bits(bitcast<u32>(result) ^ sign);
}
