// Planes that walls near beams lie in or behind, as `beams/walls.rs` lays them out: the beam is before them. On
// `beam.wgsl`.

struct Plane {
    // Of unit length, towards the beam; zero where no plane tells what is behind walls.
    n: vec3f,
    // Product of the normal and any point of the plane.
    at: f32,
    // Where along the beam the kernel reaches behind it.
    range: vec2f,
    // Of a crowd: square of the distance from the beam's line within which no wall is; else zero.
    clear2: f32,
    // 1: all of a closed scene is before it.
    is_outer: u32,
}

@group(1) @binding(52) var<storage, read> planes: array<Plane>;

const WALL_BITS: u32 = 4u;

fn packed_walls(first: u32, count: u32) -> u32 { return (first << WALL_BITS) | count; }

// The number of the first of a beam's planes, and of the one after the last.
fn walls_of(packed: u32) -> vec2u {
    let first = packed >> WALL_BITS;
    return vec2u(first, first + (packed & ((1u << WALL_BITS) - 1u)));
}

fn all_clear() -> vec2f { return vec2f(-of_bits(INFINITY), of_bits(INFINITY)); }

// What is left of a stretch of a beam, looked at from `start` to `end`, where its kernel reaches behind a plane that is
// no outer one: one stretch.
fn without_plane(clear: vec2f, plane: Plane, start: f32, end: f32) -> vec2f {
    let low = plane.range.x;
    let high = plane.range.y;
    if (plane.is_outer == 1u || low >= end || high <= start) { return clear; }
    // At which end less of the beam is lost.
    if (smaller(high, end) - start < end - larger(low, start)) { return vec2f(larger(clear.x, high), clear.y); }
    return vec2f(clear.x, smaller(clear.y, low));
}

// What stands near a piece of a beam, as bits above the number of its medium: whether there are planes of the beam at
// all, and whether its kernel reaches behind one that is no outer one.
fn wall_flags(packed: u32, start: f32, end: f32) -> u32 {
    let walls = walls_of(packed);
    if (walls.x == walls.y) { return 0u; }
    var clear = all_clear();
    for (var i = walls.x; i < walls.y; i++) { clear = without_plane(clear, planes[i], start, end); }
    return HAS_PLANES | select(IS_WALLED, 0u, all(clear == all_clear()));
}
