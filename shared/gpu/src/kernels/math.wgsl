// The renderer's math functions, in the same steps as crate libm, except sine and cosine: the renderer computes those
// with 64-bit floats. The `twin` module lists their errors.

// x 2^n, rounded once; |n| at most 250.
fn scaled(x: f32, n: i32) -> f32 {
    var y = x;
    var k = n;
    if (k > 127) {
        y *= of_bits(0x7f000000u);
        k -= 127;
    } else if (k < -126) {
        // 2^-102: only the last step cuts bits off.
        y *= of_bits(0x0c800000u);
        k += 102;
        if (k < -126) {
            y *= of_bits(0x0c800000u);
            k += 102;
        }
    }
    return y * bitcast<f32>(u32(k + 127) << 23u);
}

// e^x.
fn exponential(value: f32) -> f32 {
    let bits = bitcast<u32>(value);
    let negative = (bits >> 31u) != 0u;
    let size = bits & 0x7fffffffu;
    if (size > INFINITY) { return value; }
    if (size >= 0x42b17218u && !negative) { return of_bits(INFINITY); }
    if (size >= 0x42cff1b5u && negative) { return 0.0; }
    var x = value;
    var k = 0;
    var hi = x;
    var lo = 0.0;
    if (size > 0x3eb17218u) {
        if (size > 0x3f851592u) {
            k = i32(1.4426950216f * x + select(0.5, -0.5, negative));
        } else {
            k = select(1, -1, negative);
        }
        let kf = f32(k);
        hi = x - kf * 6.9314575195e-01f;
        lo = kf * 1.4286067653e-06f;
        x = hi - lo;
    } else if (size <= 0x39000000u) {
        return 1.0 + x;
    }
    let xx = x * x;
    let c = x - xx * (1.6666625440e-1f + xx * -2.7667332906e-3f);
    let y = 1.0 + (quotient(x * c, 2.0 - c) - lo + hi);
    if (k == 0) { return y; }
    return scaled(y, k);
}

// e^x for x <= 0, in fewer steps; results below the smallest normal number become zero.
fn exp_neg(x: f32) -> f32 {
    // e^x = 2^(n + f) with |f| <= 1/2; adding and subtracting 1.5 * 2^23 rounds to an integer.
    let y = select(x, -87.0, x < -87.0) * 1.44269504f;
    let shifted = y + 12582912.0;
    let f = y - (shifted - 12582912.0);
    let f2 = f * f;
    let low = 6.931472e-1f + 2.402265e-1f * f;
    let middle = 5.550357e-2f + 9.618057e-3f * f;
    let high = 1.3390867e-3f + 1.5461448e-4f * f;
    let e = 1.0 + f * (low + f2 * (middle + f2 * high));
    let scale = bitcast<f32>((bitcast<u32>(shifted) << 23u) + 0x3f800000u);
    return select(e * scale, 0.0, x <= -87.0);
}

fn ln(value: f32) -> f32 {
    var x = value;
    var bits = bitcast<u32>(x);
    var k = 0;
    if (bits < 0x00800000u || (bits >> 31u) != 0u) {
        if ((bits << 1u) == 0u) { return of_bits(0x80000000u | INFINITY); }
        if ((bits >> 31u) != 0u) { return of_bits(NOT_A_NUMBER); }
        k = -25;
        x *= 33554432.0;
        bits = bitcast<u32>(x);
    } else if (bits >= INFINITY) {
        return x;
    } else if (bits == 0x3f800000u) {
        return 0.0;
    }
    // x in [sqrt(2) / 2, sqrt(2)].
    bits += 0x3f800000u - 0x3f3504f3u;
    k += i32(bits >> 23u) - 127;
    x = bitcast<f32>((bits & 0x7fffffu) + 0x3f3504f3u);
    let f = x - 1.0;
    let s = quotient(f, 2.0 + f);
    let z = s * s;
    let w = z * z;
    let t1 = w * (0.40000972152f + w * 0.24279078841f);
    let t2 = z * (0.66666662693f + w * 0.28498786688f);
    let r = t2 + t1;
    let half = 0.5 * f * f;
    let kf = f32(k);
    return s * (half + r) + kf * 9.0580006145e-06f - half + f + kf * 6.9313812256e-01f;
}

// ln(1 - y) for y in [0, 1], accurate for small y.
fn ln_of_one_minus(y: f32) -> f32 {
    let x = -y;
    if (x <= -1.0) { return of_bits(0x80000000u | INFINITY); }
    let bits = bitcast<u32>(x);
    if ((bits << 1u) < 0x67000000u) { return x; }
    var k = 0;
    var f = x;
    var c = 0.0;
    if (bits > 0xbe95f619u) {
        let u = 1.0 + x;
        let shifted = bitcast<u32>(u) + (0x3f800000u - 0x3f3504f3u);
        k = i32(shifted >> 23u) - 127;
        // The rounding error of the sum.
        c = quotient(x - (u - 1.0), u);
        f = bitcast<f32>((shifted & 0x7fffffu) + 0x3f3504f3u) - 1.0;
    }
    let s = quotient(f, 2.0 + f);
    let z = s * s;
    let w = z * z;
    let t1 = w * (0.40000972152f + w * 0.24279078841f);
    let t2 = z * (0.66666662693f + w * 0.28498786688f);
    let r = t2 + t1;
    let half = 0.5 * f * f;
    let kf = f32(k);
    return s * (half + r) + (kf * 9.0580006145e-06f + c) - half + f + kf * 6.9313812256e-01f;
}

// 1 - e^-y for y >= 0, accurate for small y.
fn one_minus_exp_neg(y: f32) -> f32 {
    var x = -y;
    let size = bitcast<u32>(x) & 0x7fffffffu;
    if (size > INFINITY || size < 0x33000000u) { return y; }
    if (size >= 0x4195b844u) { return 1.0; }
    var k = 0;
    var c = 0.0;
    if (size > 0x3eb17218u) {
        k = -1;
        if (size >= 0x3f851592u) { k = i32(1.4426950216e+00f * x - 0.5); }
        let kf = f32(k);
        let hi = x - kf * 6.9313812256e-01f;
        let lo = kf * 9.0580006145e-06f;
        x = hi - lo;
        c = (hi - x) - lo;
    }
    let half = 0.5 * x;
    let square = x * half;
    let r = 1.0 + square * (-3.3333212137e-2f + square * 1.5807170421e-3f);
    let t = 3.0 - r * half;
    var e = square * quotient(r - t, 6.0 - x * t);
    if (k == 0) { return x * e - square - x; }
    e = x * (e - c) - c;
    e -= square;
    if (k == -1) { return 0.5 - 0.5 * (x - e); }
    return 1.0 - (x - e + 1.0) * bitcast<f32>(u32(127 + k) << 23u);
}

// 32 bits of 2/pi, starting 32 i - 2 bits behind the point.
fn two_over_pi(i: u32) -> u32 {
    switch i {
        case 0u: { return 0x28be60dbu; }
        case 1u: { return 0x9391054au; }
        case 2u: { return 0x7f09d5f4u; }
        case 3u: { return 0x7d4d3770u; }
        case 4u: { return 0x36d8a566u; }
        case 5u: { return 0x4f10e410u; }
        default: { return 0x7f9458eau; }
    }
}

// An angle reduced to [-pi/4, pi/4] by a number of quarter turns.
struct Reduced { angle: f32, quarters: u32 }

fn reduced(x: f32) -> Reduced {
    let bits = bitcast<u32>(x);
    if ((bits & 0x7fffffffu) <= 0x3f490fdau) { return Reduced(x, 0u); }
    // Quarter turns modulo four, in fixed point with 62 fraction bits: the mantissa times the 96 bits of 2/pi that
    // matter.
    let mantissa = (bits << 8u) | 0x80000000u;
    let e = ((bits >> 23u) & 255u) - 126u;
    let i = e >> 5u;
    let shift = e & 31u;
    var high = 0u;
    if (i > 0u) { high = two_over_pi(i - 1u); }
    var middle = two_over_pi(i);
    var low = two_over_pi(i + 1u);
    if (shift > 0u) {
        high = (high << shift) | (middle >> (32u - shift));
        middle = (middle << shift) | (low >> (32u - shift));
        low = (low << shift) | (two_over_pi(i + 2u) >> (32u - shift));
    }
    var p = wide_add(wide_product(mantissa, middle), vec2u(wide_product(mantissa, low).y, 0u));
    p.y += mantissa * high;
    var quarters = p.y >> 30u;
    p.y &= 0x3fffffffu;
    // Round to nearest.
    var negative = false;
    if (p.y >= 0x20000000u) {
        quarters += 1u;
        negative = true;
        p = wide_add(vec2u(~p.x, ~p.y), vec2u(1u, 0x40000000u));
    }
    // The first 32 bits of the rest, times pi/2.
    var zeros = countLeadingZeros(p.y);
    var first = p.y;
    if (zeros == 32u) {
        zeros += countLeadingZeros(p.x);
        first = p.x << (zeros - 32u);
    } else if (zeros > 0u) {
        first = (p.y << zeros) | (p.x >> (32u - zeros));
    }
    let angle = f32(wide_product(first, 0xc90fdaa2u).y) * bitcast<f32>((98u - zeros) << 23u);
    if ((bits >> 31u) != 0u) { return Reduced(select(-angle, angle, negative), 0u - quarters); }
    return Reduced(select(angle, -angle, negative), quarters);
}

// Sine and cosine.
fn sin_cos(x: f32) -> vec2f {
    if ((bitcast<u32>(x) & 0x7fffffffu) >= INFINITY) { return vec2f(of_bits(NOT_A_NUMBER)); }
    let r = reduced(x);
    let a = r.angle;
    let z = a * a;
    let s = a + a * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
    let c = 1.0 - 0.5 * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
    let odd = (r.quarters & 1u) != 0u;
    let sine = select(s, c, odd);
    let cosine = select(c, s, odd);
    return vec2f(select(sine, -sine, (r.quarters & 2u) != 0u), select(cosine, -cosine, ((r.quarters + 1u) & 2u) != 0u));
}

fn arc_cos_tail(z: f32) -> f32 {
    let p = z * (1.6666586697e-01f + z * (-4.2743422091e-02f + z * -8.6563630030e-03f));
    return quotient(p, 1.0 + z * -7.0662963390e-01f);
}

// Arc cosine; the argument is clamped to [-1, 1].
fn arc_cos(x: f32) -> f32 {
    let pio2_hi = 1.5707962513e+00f;
    let pio2_lo = 7.5497894159e-08f;
    let bits = bitcast<u32>(x);
    let size = bits & 0x7fffffffu;
    if (size > INFINITY) { return x; }
    if (size >= 0x3f800000u) { return select(0.0, 2.0 * pio2_hi, (bits >> 31u) != 0u); }
    if (size < 0x3f000000u) {
        if (size <= 0x32800000u) { return pio2_hi; }
        return pio2_hi - (x - (pio2_lo - x * arc_cos_tail(x * x)));
    }
    if ((bits >> 31u) != 0u) {
        let z = (1.0 + x) * 0.5;
        let s = root(z);
        let w = arc_cos_tail(z) * s - pio2_lo;
        return 2.0 * (pio2_hi - (s + w));
    }
    let z = (1.0 - x) * 0.5;
    let s = root(z);
    let df = bitcast<f32>(bitcast<u32>(s) & 0xfffff000u);
    let c = quotient(z - df * df, s + df);
    let w = arc_cos_tail(z) * s + c;
    return 2.0 * (df + w);
}

fn arc_tan(value: f32) -> f32 {
    var x = value;
    let size = bitcast<u32>(x) & 0x7fffffffu;
    let negative = (bitcast<u32>(x) >> 31u) != 0u;
    if (size >= 0x4c800000u) {
        if (size > INFINITY) { return x; }
        return select(1.5707962513e+00f, -1.5707962513e+00f, negative);
    }
    var hi = 0.0;
    var lo = 0.0;
    let small = size < 0x3ee00000u;
    if (small) {
        if (size < 0x39800000u) { return x; }
    } else {
        x = abs(x);
        if (size < 0x3f300000u) {
            x = quotient(2.0 * x - 1.0, 2.0 + x);
            hi = 4.6364760399e-01f;
            lo = 5.0121582440e-09f;
        } else if (size < 0x3f980000u) {
            x = quotient(x - 1.0, x + 1.0);
            hi = 7.8539812565e-01f;
            lo = 3.7748947079e-08f;
        } else if (size < 0x401c0000u) {
            x = quotient(x - 1.5, 1.0 + 1.5 * x);
            hi = 9.8279368877e-01f;
            lo = 3.4473217170e-08f;
        } else {
            x = quotient(-1.0, x);
            hi = 1.5707962513e+00f;
            lo = 7.5497894159e-08f;
        }
    }
    let z = x * x;
    let w = z * z;
    let s1 = z * (3.3333328366e-01f + w * (1.4253635705e-01f + w * 6.1687607318e-02f));
    let s2 = w * (-1.9999158382e-01f + w * -1.0648017377e-01f);
    if (small) { return x - x * (s1 + s2); }
    let angle = hi - ((x * (s1 + s2) - lo) - x);
    return select(angle, -angle, negative);
}

// The angle of the point (x, y), in (-pi, pi].
fn arc_tan2(y: f32, x: f32) -> f32 {
    let pi = 3.1415927410e+00f;
    let pi_lo = -8.7422776573e-08f;
    let bx = bitcast<u32>(x);
    let by = bitcast<u32>(y);
    let ix = bx & 0x7fffffffu;
    let iy = by & 0x7fffffffu;
    if (ix > INFINITY || iy > INFINITY) { return of_bits(NOT_A_NUMBER); }
    if (bx == 0x3f800000u) { return arc_tan(y); }
    let below = (by >> 31u) != 0u;
    let left = (bx >> 31u) != 0u;
    if (iy == 0u) { return select(y, select(pi, -pi, below), left); }
    let up = select(0.5 * pi, -0.5 * pi, below);
    if (ix == 0u) { return up; }
    if (ix == INFINITY) {
        var angle = select(0.0, pi, left);
        if (iy == INFINITY) { angle = select(0.25 * pi, 3.0 * pi * 0.25, left); }
        return select(angle, -angle, below);
    }
    if (ix + (26u << 23u) < iy || iy == INFINITY) { return up; }
    var z = 0.0;
    if (!(left && iy + (26u << 23u) < ix)) { z = arc_tan(abs(quotient(y, x))); }
    if (left) { return select(pi - (z - pi_lo), (z - pi_lo) - pi, below); }
    return select(z, -z, below);
}

// erfc(x) for large positive x: a quotient of two polynomials in 1 / x^2, times a Gaussian over x.
fn erf_tail(x: f32) -> f32 {
    let s = quotient(1.0, x * x);
    var r = 0.0;
    var t = 0.0;
    if (bitcast<u32>(x) < 0x4036db6du) {
        r = s * (-8.1287437439e+01f + s * -9.8143291473e+00f);
        r = s * (-1.6239666748e+02f + s * (-1.8460508728e+02f + r));
        r = s * (-1.0558626175e+01f + s * (-6.2375331879e+01f + r));
        r = -9.8649440333e-03f + s * (-6.9385856390e-01f + r);
        t = s * (6.5702495575e+00f + s * -6.0424413532e-02f);
        t = s * (4.2900814819e+02f + s * (1.0863500214e+02f + t));
        t = s * (4.3456588745e+02f + s * (6.4538726807e+02f + t));
        t = 1.0 + s * (1.9651271820e+01f + s * (1.3765776062e+02f + t));
    } else {
        r = s * (-1.0250950928e+03f + s * -4.8351919556e+02f);
        r = s * (-1.6063638306e+02f + s * (-6.3756646729e+02f + r));
        r = -9.8649431020e-03f + s * (-7.9928326607e-01f + s * (-1.7757955551e+01f + r));
        t = s * (4.7452853394e+02f + s * -2.2440952301e+01f);
        t = s * (3.1998581543e+03f + s * (2.5530502930e+03f + t));
        t = s * (3.2579251099e+02f + s * (1.5367296143e+03f + t));
        t = 1.0 + s * (3.0338060379e+01f + t);
    }
    let z = bitcast<f32>(bitcast<u32>(x) & 0xffffe000u);
    let both = (z - x) * (z + x) + quotient(r, t);
    return quotient(exponential((-z) * z - 0.5625) * exponential(both), x);
}

// erfc(|x|) for |x| >= 0.84375.
fn erfc_beyond(x: f32) -> f32 {
    let size = abs(x);
    if (bitcast<u32>(size) < 0x3fa00000u) {
        let s = size - 1.0;
        var p = s * (-1.1089469492e-01f + s * (3.5478305072e-02f + s * -2.1663755178e-03f));
        p = -2.3621185683e-03f + s * (4.1485610604e-01f + s * (-3.7220788002e-01f + s * (3.1834661961e-01f + p)));
        var q = s * (1.2617121637e-01f + s * (1.3637083583e-02f + s * 1.1984500103e-02f));
        q = 1.0 + s * (1.0642088205e-01f + s * (5.4039794207e-01f + s * (7.1828655899e-02f + q)));
        return 1.0 - 8.4506291151e-01f - quotient(p, q);
    }
    return erf_tail(size);
}

// erf(x) / x - 1 for small x.
fn erf_near(x: f32) -> f32 {
    let z = x * x;
    let r = 1.2837916613e-01f
        + z * (-3.2504209876e-01f + z * (-2.8481749818e-02f + z * (-5.7702702470e-03f + z * -2.3763017452e-05f)));
    var s = z * (5.0813062117e-03f + z * (1.3249473704e-04f + z * -3.9602282413e-06f));
    s = 1.0 + z * (3.9791721106e-01f + z * (6.5022252500e-02f + s));
    return quotient(r, s);
}

fn error_function(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let size = bits & 0x7fffffffu;
    let sign = bits >> 31u;
    if (size >= INFINITY) { return 1.0 - 2.0 * f32(sign) + quotient(1.0, x); }
    if (size < 0x3f580000u) {
        if (size < 0x31800000u) { return 0.125 * (8.0 * x + 1.0270333290e+00f * x); }
        return x + x * erf_near(x);
    }
    var y = 1.0 - of_bits(0x03800000u);
    if (size < 0x40c00000u) { y = 1.0 - erfc_beyond(x); }
    return select(y, -y, sign == 1u);
}

// 1 - erf(x).
fn error_function_rest(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let size = bits & 0x7fffffffu;
    let is_negative = (bits >> 31u) == 1u;
    if (size >= INFINITY) { return select(0.0, 2.0, is_negative) + quotient(1.0, x); }
    if (size < 0x3f580000u) {
        if (size < 0x23800000u) { return 1.0 - x; }
        let y = erf_near(x);
        if (is_negative || size < 0x3e800000u) { return 1.0 - (x + x * y); }
        return 0.5 - (x - 0.5 + x * y);
    }
    var y = 0.0;
    if (size < 0x41e00000u) { y = erfc_beyond(x); }
    return select(y, 2.0 - y, is_negative);
}

// Inverse error function, for |x| < 1.
fn error_function_inverse(x: f32) -> f32 {
    var w = -ln((1.0 - x) * (1.0 + x));
    var p = 0.0;
    if (w < 5.0) {
        w = w - 2.5;
        p = (2.8102264e-8f * w + 3.4327394e-7f) * w - 3.5233877e-6f;
        p = ((p * w - 4.3915065e-6f) * w + 2.1858087e-4f) * w - 1.253725e-3f;
        p = ((p * w - 4.1776816e-3f) * w + 2.4664073e-1f) * w + 1.5014094f;
    } else {
        w = root(w) - 3.0;
        p = (-2.0021426e-4f * w + 1.0095056e-4f) * w + 1.3493432e-3f;
        p = ((p * w - 3.6734284e-3f) * w + 5.7395077e-3f) * w - 7.6224613e-3f;
        p = ((p * w + 9.4388705e-3f) * w + 1.001674f) * w + 2.8329768f;
    }
    return p * x;
}
