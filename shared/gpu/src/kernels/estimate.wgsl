// Contribution of a beam piece to a segment: the 1D estimate where the two lines are nearest, within the kernel radius,
// or, if they are nearly parallel, an integral over the segment's chord through the kernel. Same operations, in the
// same order, as `beamfarm_render::cpu::beam::estimate` on CPUs. Goes after `hidden.wgsl` or `open.wgsl`, and
// `attenuation.wgsl` or `even_attenuation.wgsl`.

struct Segment {
    origin: vec3f,
    length: f32,
    dir: vec3f,
    medium: u32,
    // Address of the chords' random numbers, with the beam's number.
    pixel: u32,
    // Steps of the transmittance along it, if the density varies: first word, and number of steps.
    steps: u32,
    step_count: u32,
    // From WAVE_OF_SEGMENT on, the wavelength of the path, from 1 on; 0: none.
    bits: u32,
}

const WAVE_OF_SEGMENT: u32 = 8u;

// A medium, at density 1. Phase function lobes: (1 - g^2) / (4 pi) times their share, (1 - |g|)^2, 2 |g|, and the sign
// of g.
struct Scattering {
    sigma_s: vec3f,
    spare_s: u32,
    sigma_t: vec3f,
    spare_t: u32,
    lobes: array<vec4f, 2>,
}

struct Brought {
    radiance: vec3f,
    // Number of contributions.
    count: u32,
}

const NOTHING_BROUGHT: Brought = Brought(vec3f(0.0), 0u);

// Below this sine, lines count as nearly parallel.
const PARALLEL_SIN: f32 = 0.1;
const PARALLEL_SIN2: f32 = 0.010000001;
const FAR_AWAY: f32 = 3.40282347e38f;

// Relative position of two lines: w goes from the segment's origin to the beam's, d and b are their directions.
struct Meeting {
    cos: f32,
    // Their distance times the sine.
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
    // Isotropic, or an unused lobe.
    if (lobe.z == 0.0) { return lobe.x; }
    let apart = 1.0 - lobe.w * cosine;
    return lobe_by_x(lobe, lobe.y + lobe.z * select(0.0, apart, apart > 0.0));
}

// By both directions, which is accurate near the peak.
fn lobe_value_of_directions(lobe: vec4f, old: vec3f, new_: vec3f) -> f32 {
    if (lobe.z == 0.0) { return lobe.x; }
    let apart = old - lobe.w * new_;
    return lobe_by_x(lobe, lobe.y + 0.5 * lobe.z * dot3(apart, apart));
}

fn transmitted_over(sigma_t: vec3f, depth: f32) -> vec3f {
    return vec3f(exp_neg(-sigma_t.x * depth), exp_neg(-sigma_t.y * depth), exp_neg(-sigma_t.z * depth));
}

// Whether the lines come near enough; needs no division.
fn may_bring(piece: Piece, meeting: Meeting) -> bool {
    let sin2 = 1.0 - meeting.cos * meeting.cos;
    let s_sin2 = meeting.cos * meeting.w_dot_d - meeting.w_dot_b;
    let offset2 = meeting.offset * meeting.offset;
    let radius = piece.max_radius;
    if (!(sin2 < PARALLEL_SIN2)) { return offset2 < radius * radius * sin2; }
    // A chord reaches beyond the nearest points by up to radius / sine; leaves room for rounding in small sines.
    let beyond = PARALLEL_SIN * radius;
    return offset2 <= 1.01f * radius * radius * (sin2 + 1e-5f)
        && s_sin2 + beyond >= piece.start * sin2
        && s_sin2 - beyond <= piece.end * sin2;
}

// Points of a segment that see a beam: the nearest one, or two on a chord.
struct Points {
    // Bit mask of the valid points.
    are: u32,
    is_chord: bool,
    // Distances along the segment and along the beam, and kernel values.
    t: vec2f,
    s: vec2f,
    value: vec2f,
    // Length that each chord point stands for.
    step: f32,
}

fn points_of(segment: Segment, piece: Piece, medium: Scattering, key: vec2u) -> Points {
    var points: Points;
    let meeting = meeting_of(segment, piece);
    if (!may_bring(piece, meeting)) { return points; }
    let sin2 = 1.0 - meeting.cos * meeting.cos;
    let s_sin2 = meeting.cos * meeting.w_dot_d - meeting.w_dot_b;
    points.is_chord = sin2 < PARALLEL_SIN2;
    if (points.is_chord) {
        let chord = chord_of(segment, piece, key);
        if (!(chord.near < chord.far)) { return points; }
        points.step = (chord.far - chord.near) * 0.5;
        let one = point_of_chord(piece, chord, chord.near + points.step * (0.0 + chord.u));
        let other = point_of_chord(piece, chord, chord.near + points.step * (1.0 + chord.u));
        points.are = u32(one.is) | (u32(other.is) << 1u);
        points.t = vec2f(one.t, other.t);
        points.s = vec2f(one.s, other.s);
        points.value = vec2f(one.value, other.value);
        return points;
    }
    // One division serves both 1 / sin^2 and 1 / radius.
    let r_sin2 = piece.radius * sin2 + piece.radius_slope * s_sin2;
    let inv = quotient(1.0, sin2 * r_sin2);
    let inv_sin2 = inv * r_sin2;
    let inv_r_sin2 = inv * sin2;
    var x = meeting.offset * inv_r_sin2;
    x = x * x * sin2;
    let t = (meeting.w_dot_d - meeting.cos * meeting.w_dot_b) * inv_sin2;
    let s = s_sin2 * inv_sin2;
    if (!(t > 0.0 && t < segment.length && s > piece.start && s <= piece.end && x < 1.0)) { return points; }
    points.are = 1u;
    points.t.x = t;
    // Before its start, a beam is as strong as at the start.
    points.s.x = select(0.0, s, s > 0.0);
    points.value.x = 0.75 * (1.0 - x) * root(sin2) * inv_r_sin2;
    // Light turns against the segment's direction.
    points.value.x *= lobe_value(medium.lobes[0], -meeting.cos) + lobe_value(medium.lobes[1], -meeting.cos);
    return points;
}

// Bit mask of the points that walls may hide.
fn asked_of(segment: Segment, piece: Piece, medium: Scattering, key: vec2u) -> u32 {
    let points = points_of(segment, piece, medium, key);
    var asked = 0u;
    for (var i = 0u; i < 2u; i++) {
        let here = (points.are >> i & 1u) == 1u;
        if (here && may_hide(segment, piece, points.t[i], points.s[i])) { asked |= 1u << i; }
    }
    return asked;
}

// Whether walls hide point `i`; traces a ray.
fn is_hidden(segment: Segment, piece: Piece, medium: Scattering, key: vec2u, i: u32) -> bool {
    let points = points_of(segment, piece, medium, key);
    return hides(segment, piece, points.t[i], points.s[i]);
}

// Contribution of the points that are not in the mask `hidden`.
fn brought(segment: Segment, piece: Piece, medium: Scattering, key: vec2u, hidden: u32) -> Brought {
    let points = points_of(segment, piece, medium, key);
    let seen = points.are & ~hidden;
    if (seen == 0u) { return NOTHING_BROUGHT; }
    var sum = vec3f(0.0);
    for (var i = 0u; i < 2u; i++) {
        if ((seen >> i & 1u) == 0u) { continue; }
        let along = select(0.0, points.s[i], points.s[i] > 0.0);
        sum += attenuation(segment, piece, medium, points.t[i], along) * points.value[i];
    }
    if (!points.is_chord) { return Brought(sum * (piece.power * medium.sigma_s), 1u); }
    let against = -segment.dir;
    let phase = lobe_value_of_directions(medium.lobes[0], piece.dir, against)
        + lobe_value_of_directions(medium.lobes[1], piece.dir, against);
    let radiance = sum * piece.power * medium.sigma_s * (phase * points.step);
    return Brought(radiance, u32(any(radiance > vec3f(0.0))));
}

// A segment's chord through the kernel of a nearly parallel beam, which is blurred over discs across the beam. Two
// stratified points are evaluated, `u` into each half.
struct Chord {
    // Empty unless near < far.
    near: f32,
    far: f32,
    u: f32,
    // At distance t along the segment, it is |across + t across_dir| from the beam's axis, at s = along + t cos.
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
    // The range within the largest radius.
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

struct ChordPoint {
    is: bool,
    t: f32,
    s: f32,
    value: f32,
}

fn point_of_chord(piece: Piece, chord: Chord, t: f32) -> ChordPoint {
    var s = chord.along + t * chord.cos;
    s = select(s, piece.start, s < piece.start);
    s = select(s, piece.end, s > piece.end);
    let here = piece.radius + piece.radius_slope * s;
    let at = chord.across + chord.across_dir * t;
    let x = quotient(dot3(at, at), here * here);
    return ChordPoint(x < 1.0, t, s, quotient(2.0, 3.14159274f * here * here) * (1.0 - x));
}
