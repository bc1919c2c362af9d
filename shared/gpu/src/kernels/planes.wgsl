// Planes that walls near a beam lie in or behind; the beam is in front of them. `beams/walls.rs` has the same struct.
// Goes after `beam.wgsl`.

struct Plane {
    // Unit normal, towards the beam; zero if no plane bounds what walls hide.
    n: vec3f,
    // Dot product of the normal and any point of the plane.
    at: f32,
    // Range along the beam in which the kernel reaches behind the plane.
    range: vec2f,
    // For a crowd: square of the distance from the beam's line within which there is no wall; otherwise zero.
    clear2: f32,
    // 1: all of a closed scene is in front of it.
    is_outer: u32,
}

@group(1) @binding(52) var<storage, read> planes: array<Plane>;

const WALL_BITS: u32 = 4u;

fn packed_walls(first: u32, count: u32) -> u32 { return (first << WALL_BITS) | count; }

// A beam's planes: first, and one past the last.
fn walls_of(packed: u32) -> vec2u {
    let first = packed >> WALL_BITS;
    return vec2u(first, first + (packed & ((1u << WALL_BITS) - 1u)));
}

fn all_clear() -> vec2f { return vec2f(-of_bits(INFINITY), of_bits(INFINITY)); }

// Shrinks a clear stretch of a beam, looked at from `start` to `end`, to one that has the kernel in front of a plane.
// Outer planes do not count.
fn without_plane(clear: vec2f, plane: Plane, start: f32, end: f32) -> vec2f {
    let low = plane.range.x;
    let high = plane.range.y;
    if (plane.is_outer == 1u || low >= end || high <= start) { return clear; }
    // Cut where less of the beam is lost.
    if (smaller(high, end) - start < end - larger(low, start)) { return vec2f(larger(clear.x, high), clear.y); }
    return vec2f(clear.x, smaller(clear.y, low));
}

// Flags of a piece of a beam: HAS_PLANES if the beam has planes, IS_WALLED if the piece's kernel reaches behind one
// that is not outer.
fn wall_flags(packed: u32, start: f32, end: f32) -> u32 {
    let walls = walls_of(packed);
    if (walls.x == walls.y) { return 0u; }
    var clear = all_clear();
    for (var i = walls.x; i < walls.y; i++) { clear = without_plane(clear, planes[i], start, end); }
    return HAS_PLANES | select(IS_WALLED, 0u, all(clear == all_clear()));
}
