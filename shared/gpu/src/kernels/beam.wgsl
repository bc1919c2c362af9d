// Photon beams and their pieces, laid out as in `beams/mod.rs`.

struct Beam {
    origin: vec3f,
    radius: f32,
    dir: vec3f,
    radius_slope: f32,
    power: vec3f,
    length: f32,
    extent: vec2f,
    // Medium number; from WAVE_BITS on, the wavelength of its light, from 1 on, or 0 for none; from LIGHT_GROUP_BITS
    // on, its light group, likewise.
    medium: u32,
    // Number of wall planes near it in the lowest bits; above them the index of the first.
    walls: u32,
}

// What a beam starts and ends on: unit normals and kinds.
struct BeamEnds {
    start: vec3f,
    start_is: u32,
    end: vec3f,
    end_is: u32,
}

const ENDS_NOWHERE: u32 = 0u;
const ENDS_ON_SURFACE: u32 = 1u;
const ENDS_ON_BOUNDARY: u32 = 2u;

// The part of a beam between two distances from its origin, `start` exclusive.
struct Piece {
    origin: vec3f,
    start: f32,
    dir: vec3f,
    end: f32,
    power: vec3f,
    radius: f32,
    radius_slope: f32,
    // The larger kernel radius of its two ends.
    max_radius: f32,
    beam: u32,
    // Medium number, then the wall flags below; from WAVE_BITS on as in `Beam`.
    medium: u32,
}

const MEDIUM_BITS: u32 = 0xffffu;
// Planes of walls are near the beam.
const HAS_PLANES: u32 = 0x10000u;
// The piece's kernel reaches behind a plane that is not an outer one.
const IS_WALLED: u32 = 0x20000u;
const WAVE_BITS: u32 = 20u;
const LIGHT_GROUP_BITS: u32 = 24u;

fn wave_of_light(medium: u32) -> u32 { return (medium >> WAVE_BITS) & 15u; }

struct Bounds {
    low: vec3f,
    spare_low: u32,
    high: vec3f,
    spare_high: u32,
}

fn larger(a: f32, b: f32) -> f32 { return select(a, b, b > a); }

fn smaller(a: f32, b: f32) -> f32 { return select(a, b, b < a); }

// Box around the piece's kernel, with a margin for rounding.
fn bounds_of(piece: Piece) -> Bounds {
    let a = piece.origin + piece.dir * piece.start;
    let b = piece.origin + piece.dir * piece.end;
    let low = select(a, b, b < a);
    let high = select(a, b, b > a);
    let size = select(abs(low), abs(high), abs(high) > abs(low));
    let reach = 1.0001f * piece.max_radius + 1e-5f * larger(larger(size.x, size.y), size.z);
    return Bounds(low - vec3f(reach), 0u, high + vec3f(reach), 0u);
}
