// Photon beams and pieces of them, as `beams/mod.rs` lays them out.

struct Beam {
    origin: vec3f,
    radius: f32,
    dir: vec3f,
    radius_slope: f32,
    power: vec3f,
    length: f32,
    extent: vec2f,
    // The number of the medium; above WAVE_BITS the wavelength of its light, from 1 on; 0: none; and above
    // LIGHT_GROUP_BITS the group of its light, likewise.
    medium: u32,
    // How many planes of walls are near it in the lowest bits, and above those the number of the first.
    walls: u32,
}

// What a beam starts and ends on, by unit normals and what it is.
struct BeamEnds {
    start: vec3f,
    start_is: u32,
    end: vec3f,
    end_is: u32,
}

const ENDS_NOWHERE: u32 = 0u;
const ENDS_ON_SURFACE: u32 = 1u;
const ENDS_ON_BOUNDARY: u32 = 2u;

// What is between two distances from a beam's origin, the first exclusive.
struct Piece {
    origin: vec3f,
    start: f32,
    dir: vec3f,
    end: f32,
    power: vec3f,
    radius: f32,
    radius_slope: f32,
    // Of the kernel, at either end.
    max_radius: f32,
    beam: u32,
    // The number of the medium, and above that what stands near it; above WAVE_BITS as a beam.
    medium: u32,
}

const MEDIUM_BITS: u32 = 0xffffu;
// There are planes of walls near the beam.
const HAS_PLANES: u32 = 0x10000u;
// The piece's kernel reaches behind one, of those that are no outer ones.
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

// Around the kernel, with room for what rounding moves it by.
fn bounds_of(piece: Piece) -> Bounds {
    let a = piece.origin + piece.dir * piece.start;
    let b = piece.origin + piece.dir * piece.end;
    let low = select(a, b, b < a);
    let high = select(a, b, b > a);
    let size = select(abs(low), abs(high), abs(high) > abs(low));
    let reach = 1.0001f * piece.max_radius + 1e-5f * larger(larger(size.x, size.y), size.z);
    return Bounds(low - vec3f(reach), 0u, high + vec3f(reach), 0u);
}
