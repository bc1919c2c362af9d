// Random numbers addressed by (seed, pass, purpose, chunk), bitwise equal to the renderer's `sampler.rs`.

struct Stream {
    // 64-bit integers as (low, high).
    seed: vec2u,
    pass_index: vec2u,
    // Replication that the pass belongs to, and the pass's place in it.
    replication: vec2u,
    place: u32,
    purpose: u32,
}

struct Sampler {
    // PCG.
    state: vec2u,
    increment: vec2u,
    // Even points: key, number with its bits reversed, next square, and number of even squares.
    key: vec2u,
    index: u32,
    square: u32,
    squares: u32,
}

const EVEN_SQUARES: u32 = 96u;
const EVEN_SQUARES_OF_PATHS: u32 = 8u;

// SplitMix64's finaliser.
fn mix64(x: vec2u) -> vec2u {
    var z = wide_add(x, vec2u(0x7f4a7c15u, 0x9e3779b9u));
    z = wide_multiply(z ^ wide_shift(z, 30u), vec2u(0x1ce4e5b9u, 0xbf58476du));
    z = wide_multiply(z ^ wide_shift(z, 27u), vec2u(0x133111ebu, 0x94d049bbu));
    return z ^ wide_shift(z, 31u);
}

fn stream_key(stream: Stream, pass_index: vec2u) -> vec2u {
    return mix64(mix64(mix64(stream.seed) ^ pass_index) ^ vec2u(0u, stream.purpose << 24u));
}

fn sampler_step(s: ptr<function, Sampler>) {
    (*s).state = wide_add(wide_multiply((*s).state, vec2u(0x4c957f2du, 0x5851f42du)), (*s).increment);
}

// Random numbers only.
fn sampler_random(stream: Stream, chunk: vec2u) -> Sampler {
    var s: Sampler;
    let state = mix64(stream_key(stream, stream.pass_index) ^ chunk);
    let double = wide_double(mix64(state ^ vec2u(0xf3bcc909u, 0x6a09e667u)));
    s.increment = vec2u(double.x | 1u, double.y);
    s.state = wide_add(state, s.increment);
    sampler_step(&s);
    return s;
}

// The first squares are even over the passes of a replication.
fn sampler_even(stream: Stream, chunk: vec2u) -> Sampler {
    var s = sampler_random(stream, chunk);
    s.key = ~mix64(stream_key(stream, stream.replication) ^ chunk);
    s.index = reverseBits(stream.place);
    s.squares = EVEN_SQUARES;
    return s;
}

// The first squares are even over the paths of a pass, and over the passes of a replication.
fn sampler_of_paths(stream: Stream, path: u32, paths: u32) -> Sampler {
    var s = sampler_random(stream, vec2u(path, 0u));
    s.key = ~mix64(stream_key(stream, stream.replication));
    s.index = reverseBits(stream.place * paths + path);
    s.squares = EVEN_SQUARES_OF_PATHS;
    return s;
}

// 32 random bits.
fn next_u32(s: ptr<function, Sampler>) -> u32 {
    let x = (*s).state;
    sampler_step(s);
    let mixed = wide_shift(wide_shift(x, 18u) ^ x, 27u).x;
    let turn = x.y >> 27u;
    return (mixed >> turn) | (mixed << ((32u - turn) & 31u));
}

// Uniform in [0, 1): 24 bits, never 1.
fn unit(bits: u32) -> f32 { return f32(bits >> 8u) * 5.9604644775390625e-8; }

// Owen scrambling of a number with reversed bits.
fn owen_reversed(bits: u32, seed: u32) -> u32 {
    var x = bits + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    return x ^ (x * 0x8d22f6e6u);
}

// Second dimension of Sobol's sequence, bits reversed; the first is the index.
fn sobol_reversed(index: u32) -> u32 {
    var y = index;
    y ^= (y >> 1u) & 0x55555555u;
    y ^= (y >> 2u) & 0x33333333u;
    y ^= (y >> 4u) & 0x0f0f0f0fu;
    y ^= (y >> 8u) & 0x00ff00ffu;
    return y ^ (y >> 16u);
}

fn next_square(s: ptr<function, Sampler>) -> vec2u {
    let hash = mix64(vec2u((*s).key.x ^ (*s).square, (*s).key.y));
    (*s).square += 1u;
    return hash;
}

// Uniform in [0, 1).
fn next_1d(s: ptr<function, Sampler>) -> f32 {
    if ((*s).square >= (*s).squares) { return unit(next_u32(s)); }
    let hash = next_square(s);
    let shuffled = reverseBits(owen_reversed((*s).index, hash.x));
    return unit(reverseBits(owen_reversed(shuffled, hash.y)));
}

// Uniform in [0, 1)^2.
fn next_2d(s: ptr<function, Sampler>) -> vec2f {
    if ((*s).square >= (*s).squares) {
        let x = next_u32(s);
        let y = next_u32(s);
        return vec2f(unit(x), unit(y));
    }
    let hash = next_square(s);
    let shuffled = reverseBits(owen_reversed((*s).index, hash.x));
    let x = owen_reversed(shuffled, hash.y);
    let y = owen_reversed(sobol_reversed(shuffled), mix64(hash).x);
    return vec2f(unit(reverseBits(x)), unit(reverseBits(y)));
}

// Goes on as if a number of so many dimensions had been drawn.
fn sampler_skip(s: ptr<function, Sampler>, dimensions: u32) {
    if ((*s).square < (*s).squares) {
        (*s).square += 1u;
        return;
    }
    for (var i = 0u; i < dimensions; i++) { _ = next_u32(s); }
}

// Goes on at the next multiple of `apart` squares, so that all passes of a replication draw the same for the same
// thing.
fn sampler_align(s: ptr<function, Sampler>, apart: u32) {
    (*s).square = ((*s).square + apart - 1u) / apart * apart;
}
