// Media of varying density: samples on a sparse lattice, trilinear in between, and bounds. One buffer of words, laid
// out by `world/volumes.rs`; it starts with each medium's offset of its record, zero for homogeneous ones. Scenes
// without such media use `even.wgsl` instead.

const VARIES = true;
// Walks of a photon per turn: along its beam, and its flight.
const MOST_WALKS: u32 = 2u;

@group(0) @binding(55) var<storage, read> volumes: array<u32>;

// Offsets in a record.
const ESTIMATOR: u32 = 0u;
const ALBEDO_CHANNELS: u32 = 1u;
const CELL_SIDE: u32 = 2u;
const RANGES: u32 = 3u;
const DEVIATION: u32 = 4u;
const CELLS: u32 = 5u;
const TO_SAMPLES: u32 = 8u;
const TO_ALBEDO: u32 = 20u;
const DENSITY: u32 = 32u;
const ALBEDO: u32 = 48u;
// Offsets in a grid.
const DOMAIN: u32 = 0u;
const CLAMPED: u32 = 6u;
const BRICKS: u32 = 12u;
const TABLE: u32 = 14u;
const VALUES: u32 = 15u;
const GRID_WORDS: u32 = 16u;

// Samples per side of a stored brick.
const BRICK_SIDE: u32 = 9u;

fn is_varying(medium: u32) -> bool { return !(volumes[medium] == 0u); }

fn volume_float(at: u32) -> f32 { return of_bits(volumes[at]); }

fn volume_vector(at: u32) -> vec3f { return vec3f(volume_float(at), volume_float(at + 1u), volume_float(at + 2u)); }

// Applies a map to a direction, and to a point.
fn turned_by(map: u32, v: vec3f) -> vec3f {
    return volume_vector(map) * v.x + volume_vector(map + 3u) * v.y + volume_vector(map + 6u) * v.z;
}

fn moved_by(map: u32, p: vec3f) -> vec3f { return turned_by(map, p) + volume_vector(map + 9u); }

// Value of a grid at a position in its own space; zero outside and for NaN.
fn grid_value(grid: u32, p: vec3f) -> f32 {
    let inside = all(p >= volume_vector(grid + DOMAIN)) && all(p <= volume_vector(grid + DOMAIN + 3u));
    if (!inside) { return 0.0; }
    let first = volume_vector(grid + CLAMPED);
    let last = volume_vector(grid + CLAMPED + 3u);
    var x = select(first, p, p > first);
    x = select(last, x, x < last);
    // Adding 1.5 * 2^23 rounds to an integer; less a half, to the one below. At an integer that may be the previous
    // one, with a weight of 1 for the next.
    let shifted = (x - vec3f(0.5)) + vec3f(12582912.0);
    let cell = bitcast<vec3u>(shifted) & vec3u(0x3fffffu);
    let weight = x - (shifted - vec3f(12582912.0));
    let brick = ((cell.z >> 3u) * volumes[grid + BRICKS + 1u] + (cell.y >> 3u)) * volumes[grid + BRICKS]
        + (cell.x >> 3u);
    let corner = ((cell.z & 7u) * BRICK_SIDE + (cell.y & 7u)) * BRICK_SIDE + (cell.x & 7u);
    let at = volumes[grid + VALUES] + volumes[volumes[grid + TABLE] + brick] + corner;
    let near = grid_face(at, weight);
    let far = grid_face(at + BRICK_SIDE * BRICK_SIDE, weight);
    return near + (far - near) * weight.z;
}

fn grid_face(at: u32, weight: vec3f) -> f32 {
    let a = grid_edge(at, weight.x);
    let b = grid_edge(at + BRICK_SIDE, weight.x);
    return a + (b - a) * weight.y;
}

fn grid_edge(at: u32, weight: f32) -> f32 {
    let a = volume_float(at);
    return a + (volume_float(at + 1u) - a) * weight;
}

fn density_at(record: u32, p: vec3f) -> f32 { return grid_value(record + DENSITY, p); }

// Share of `sigma_s` that scatters, at a position in the density's space.
fn albedo_at(record: u32, p: vec3f) -> vec3f {
    let channels = volumes[record + ALBEDO_CHANNELS];
    var albedo = vec3f(1.0);
    if (channels == 0u) { return albedo; }
    let q = moved_by(record + TO_ALBEDO, p);
    for (var c = 0u; c < channels; c++) {
        let value = grid_value(record + ALBEDO + GRID_WORDS * c, q);
        // A single one counts for all channels.
        albedo = select(albedo, vec3f(value), vec3<bool>(c == 0u, c < 2u, true));
    }
    return albedo;
}
