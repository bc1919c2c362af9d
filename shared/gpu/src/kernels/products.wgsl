// The difference of two products as 64-bit floats yield it; few devices have these.

// Shifts right, with a sticky last bit.
fn jammed(x: vec2u, bits: u32) -> vec2u {
    if (bits == 0u) { return x; }
    if (bits >= 64u) { return vec2u(u32((x.x | x.y) != 0u), 0u); }
    if (bits >= 32u) {
        let kept = x.y >> (bits - 32u);
        return vec2u(kept | u32((x.x | (x.y ^ (kept << (bits - 32u)))) != 0u), 0u);
    }
    return vec2u(((x.x >> bits) | (x.y << (32u - bits))) | u32((x.x << (32u - bits)) != 0u), x.y >> bits);
}

fn wide_left(x: vec2u, bits: u32) -> vec2u {
    if (bits == 0u) { return x; }
    if (bits >= 32u) { return vec2u(0u, x.x << (bits - 32u)); }
    return vec2u(x.x << bits, (x.y << bits) | (x.x >> (32u - bits)));
}

// The product is bits * 2^(exponent - 315), with bit 62 the highest one set; or zero.
struct Product { bits: vec2u, exponent: i32, sign: u32 }

fn whole_product(a: f32, b: f32) -> Product {
    let ua = bitcast<u32>(a);
    let ub = bitcast<u32>(b);
    let sign = (ua ^ ub) & 0x80000000u;
    if ((ua << 1u) == 0u || (ub << 1u) == 0u) { return Product(vec2u(0u), -1000, sign); }
    let pa = parts(ua & 0x7fffffffu);
    let pb = parts(ub & 0x7fffffffu);
    let bits = wide_product(pa.mantissa, pb.mantissa);
    // In [2^46, 2^48).
    let short = u32(bits.y < 0x8000u);
    return Product(wide_left(bits, 15u + short), pa.exponent + pb.exponent - i32(short), sign);
}

// One, with the number's sign, unless that is zero, infinite or NaN.
fn tame(x: f32) -> f32 {
    let size = bitcast<u32>(x) & 0x7fffffffu;
    return select(x, with_sign(1.0, x), size != 0u && size < INFINITY);
}

// a b - c d: exact products, the difference rounded to 53 bits, and then to a float.
fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let size = max(
        max(bitcast<u32>(a) & 0x7fffffffu, bitcast<u32>(b) & 0x7fffffffu),
        max(bitcast<u32>(c) & 0x7fffffffu, bitcast<u32>(d) & 0x7fffffffu),
    );
    if (size >= INFINITY) { return tame(a) * tame(b) - tame(c) * tame(d); }
    var one = whole_product(a, b);
    var other = whole_product(c, d);
    other.sign ^= 0x80000000u;
    let is_less = one.bits.y < other.bits.y || (one.bits.y == other.bits.y && one.bits.x < other.bits.x);
    if (one.exponent < other.exponent || (one.exponent == other.exponent && is_less)) {
        let kept = one;
        one = other;
        other = kept;
    }
    if ((one.bits.x | one.bits.y) == 0u) { return bitcast<f32>(one.sign & other.sign); }
    let small = jammed(other.bits, u32(one.exponent - other.exponent));
    var sum = vec2u(0u);
    if (one.sign == other.sign) {
        sum = wide_add(one.bits, small);
    } else {
        sum = vec2u(one.bits.x - small.x, one.bits.y - small.y - u32(one.bits.x < small.x));
    }
    if ((sum.x | sum.y) == 0u) { return 0.0; }
    var zeros = countLeadingZeros(sum.y);
    if (zeros == 32u) { zeros += countLeadingZeros(sum.x); }
    sum = wide_left(sum, zeros);
    // The highest bit is worth 2^first.
    var first = one.exponent - 315 - i32(zeros) + 63;
    // Round to 53 bits.
    let rest = sum.x & 0x7ffu;
    sum.x -= rest;
    if (rest > 0x400u || (rest == 0x400u && (sum.x & 0x800u) != 0u)) {
        sum = wide_add(sum, vec2u(0x800u, 0u));
        if (sum.y == 0u) {
            sum.y = 0x80000000u;
            first += 1;
        }
    }
    // Round to 24, or fewer for denormals.
    if (first > 127) { return bitcast<f32>(one.sign | INFINITY); }
    if (first < -150) { return bitcast<f32>(one.sign); }
    let cut = 8u + u32(max(-126 - first, 0));
    let kept = select(sum.y >> (cut & 31u), 0u, cut == 32u);
    let cut_off = select(sum.y - (kept << (cut & 31u)), sum.y, cut == 32u);
    let half = 1u << (cut - 1u);
    let up = cut_off > half || (cut_off == half && (sum.x != 0u || (kept & 1u) != 0u));
    let exponent = u32(max(first + 126, 0)) << 23u;
    return bitcast<f32>(one.sign | (exponent + kept + u32(up)));
}
