// What a piece of a beam brings to a segment: the 1D estimate of two lines that are nearest within the kernel's radius,
// or, where they are nearly parallel, the chord of the segment through the kernel. Step by step as on processors:
// `beamfarm_render::cpu::beam::estimate`. After `hidden.wgsl` or `open.wgsl`.

struct Segment {
    origin: vec3f,
    length: f32,
    dir: vec3f,
    medium: u32,
    // Which random numbers its chords have.
    pixel: u32,
    spare_a: u32,
    spare_b: u32,
    spare_c: u32,
}

// A homogeneous medium. Lobes of its phase function: (1 - g^2) / (4 pi) times their share, (1 - |g|)^2, 2 |g|, and
// the sign of g.
struct Scattering {
    sigma_s: vec3f,
    spare_s: u32,
    sigma_t: vec3f,
    spare_t: u32,
    lobes: array<vec4f, 2>,
}

struct Brought {
    radiance: vec3f,
    // 1 where there is any.
    count: u32,
}

const NOTHING_BROUGHT: Brought = Brought(vec3f(0.0), 0u);

// Below this sine lines are nearly parallel.
const PARALLEL_SIN: f32 = 0.1;
const PARALLEL_SIN2: f32 = 0.010000001;
const FAR_AWAY: f32 = 3.40282347e38f;

// How two lines lie to each other.
struct Meeting {
    cos: f32,
    // Their distance, times the sine.
    offset: f32,
    w_dot_d: f32,
    w_dot_b: f32,
}

fn meeting_of(segment: Segment, piece: Piece) -> Meeting {
    let w = piece.origin - segment.origin;
    let b = piece.dir;
    let moment = vec3f(b.y * w.z - b.z * w.y, b.z * w.x - b.x * w.z, b.x * w.y - b.y * w.x);
    return Meeting(dot3(segment.dir, b), dot3(segment.dir, moment), dot3(segment.dir, w), dot3(w, b));
}

fn lobe_by_x(lobe: vec4f, x: f32) -> f32 { return quotient(lobe.x, x * root(x)); }

// By the cosine between the old and the new direction of travel.
fn lobe_value(lobe: vec4f, cosine: f32) -> f32 {
    // The same everywhere; or nothing.
    if (lobe.z == 0.0) { return lobe.x; }
    let apart = 1.0 - lobe.w * cosine;
    return lobe_by_x(lobe, lobe.y + lobe.z * select(0.0, apart, apart > 0.0));
}

// By both directions, which is exact near the peak.
fn lobe_value_of_directions(lobe: vec4f, old: vec3f, new_: vec3f) -> f32 {
    if (lobe.z == 0.0) { return lobe.x; }
    let apart = old - lobe.w * new_;
    return lobe_by_x(lobe, lobe.y + 0.5 * lobe.z * dot3(apart, apart));
}

fn transmitted_over(sigma_t: vec3f, depth: f32) -> vec3f {
    return vec3f(exp_neg(-sigma_t.x * depth), exp_neg(-sigma_t.y * depth), exp_neg(-sigma_t.z * depth));
}

fn brought(segment: Segment, piece: Piece, medium: Scattering, key: vec2u) -> Brought {
    let meeting = meeting_of(segment, piece);
    let sin2 = 1.0 - meeting.cos * meeting.cos;
    let s_sin2 = meeting.cos * meeting.w_dot_d - meeting.w_dot_b;
    let offset2 = meeting.offset * meeting.offset;
    let radius = piece.max_radius;
    let is_chord = sin2 < PARALLEL_SIN2;
    var chord: Chord;
    // Of a point that both see: along the segment, along the beam, and what it counts.
    var t = 0.0;
    var s = 0.0;
    var value = 0.0;
    if (is_chord) {
        // Beyond the nearest points by up to radius / sine; with room for what the sine of small angles is off by.
        let beyond = PARALLEL_SIN * radius;
        if (!(offset2 <= 1.01f * radius * radius * (sin2 + 1e-5f)
            && s_sin2 + beyond >= piece.start * sin2
            && s_sin2 - beyond <= piece.end * sin2)) { return NOTHING_BROUGHT; }
        chord = chord_of(segment, piece, key);
        if (!(chord.near < chord.far)) { return NOTHING_BROUGHT; }
    } else {
        if (!(offset2 < radius * radius * sin2)) { return NOTHING_BROUGHT; }
        // One division serves both 1 / sin^2 and 1 / radius.
        let r_sin2 = piece.radius * sin2 + piece.radius_slope * s_sin2;
        let inv = quotient(1.0, sin2 * r_sin2);
        let inv_sin2 = inv * r_sin2;
        let inv_r_sin2 = inv * sin2;
        var x = meeting.offset * inv_r_sin2;
        x = x * x * sin2;
        t = (meeting.w_dot_d - meeting.cos * meeting.w_dot_b) * inv_sin2;
        s = s_sin2 * inv_sin2;
        if (!(t > 0.0 && t < segment.length && s > piece.start && s <= piece.end && x < 1.0)) {
            return NOTHING_BROUGHT;
        }
        // Before its start a beam is as strong as there.
        s = select(0.0, s, s > 0.0);
        value = 0.75 * (1.0 - x) * root(sin2) * inv_r_sin2;
        // Light is turned against the segment.
        value *= lobe_value(medium.lobes[0], -meeting.cos) + lobe_value(medium.lobes[1], -meeting.cos);
    }
    // Whether a point is hidden is asked at one place, since that may take a ray.
    let points = select(1u, 2u, is_chord);
    let step = (chord.far - chord.near) * 0.5;
    var sum = vec3f(0.0);
    var seen = 0u;
    for (var i = 0u; i < points; i++) {
        if (is_chord) {
            t = chord.near + step * (f32(i) + chord.u);
            s = chord.along + t * chord.cos;
            s = select(s, piece.start, s < piece.start);
            s = select(s, piece.end, s > piece.end);
            let here = piece.radius + piece.radius_slope * s;
            let at = chord.across + chord.across_dir * t;
            let x = quotient(dot3(at, at), here * here);
            if (!(x < 1.0)) { continue; }
            value = quotient(2.0, 3.14159274f * here * here) * (1.0 - x);
        }
        if (is_hidden(segment, piece, t, s)) { continue; }
        sum += transmitted_over(medium.sigma_t, t + select(0.0, s, s > 0.0)) * value;
        seen += 1u;
    }
    if (seen == 0u) { return NOTHING_BROUGHT; }
    if (!is_chord) { return Brought(sum * (piece.power * medium.sigma_s), 1u); }
    let against = -segment.dir;
    let phase = lobe_value_of_directions(medium.lobes[0], piece.dir, against)
        + lobe_value_of_directions(medium.lobes[1], piece.dir, against);
    let radiance = sum * piece.power * medium.sigma_s * (phase * step);
    return Brought(radiance, u32(any(radiance > vec3f(0.0))));
}

// A segment through the kernel of a nearly parallel beam, blurred over discs across that: two points of it count, at
// random within its halves.
struct Chord {
    // None where the near end is not before the far one.
    near: f32,
    far: f32,
    u: f32,
    // The segment is at distance |across + t across_dir| from the axis, at s = along + t cos.
    along: f32,
    cos: f32,
    across: vec3f,
    across_dir: vec3f,
}

fn chord_of(segment: Segment, piece: Piece, key: vec2u) -> Chord {
    var chord: Chord;
    chord.u = f32(mix64(key ^ mix64(vec2u(segment.pixel, piece.beam))).y >> 8u) * 5.9604644775390625e-8f;
    chord.cos = dot3(segment.dir, piece.dir);
    let offset = segment.origin - piece.origin;
    chord.along = dot3(offset, piece.dir);
    chord.across = offset - piece.dir * chord.along;
    chord.across_dir = segment.dir - piece.dir * chord.cos;
    // Where the line is within the largest radius.
    let a = dot3(chord.across_dir, chord.across_dir);
    let radius2 = piece.max_radius * piece.max_radius;
    var near = -FAR_AWAY;
    var far = FAR_AWAY;
    if (a < 1e-12f) {
        if (!(dot3(chord.across, chord.across) - radius2 < 0.0)) { return chord; }
    } else {
        let nearest = quotient(-dot3(chord.across, chord.across_dir), a);
        let least = chord.across + chord.across_dir * nearest;
        let half2 = quotient(radius2 - dot3(least, least), a);
        if (!(half2 > 0.0)) { return chord; }
        let half = root(half2);
        near = nearest - half;
        far = nearest + half;
    }
    let s0 = quotient(piece.start - chord.along, chord.cos);
    let s1 = quotient(piece.end - chord.along, chord.cos);
    chord.near = larger(larger(near, smaller(s0, s1)), 0.0);
    chord.far = smaller(smaller(far, larger(s0, s1)), segment.length);
    return chord;
}
