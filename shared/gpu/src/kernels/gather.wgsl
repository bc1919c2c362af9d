// Each segment sums the contributions of beam pieces, in their order. A piece counts if the ray meets its box. Rounding
// is monotonic, so a ray, or a bundle with it, that meets a piece's box also meets every enclosing box: which boxes are
// visited changes no bit.

struct Level {
    here: u32,
    below: u32,
}

struct Levels {
    // The topmost level, which has one node.
    top: u32,
    spare: u32,
    all: array<Level>,
}

// A range of parts of the hierarchy, `end` exclusive. A part is a node of `level`, or of the topmost level if there are
// fewer.
struct PieceParts {
    first: u32,
    end: u32,
    level: u32,
    spare: u32,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> segments: array<Segment>;
@group(0) @binding(2) var<storage, read> media: array<Scattering>;
@group(1) @binding(3) var<storage, read> key: array<vec2u>;
@group(1) @binding(4) var<storage, read> piece_count: array<u32>;
@group(1) @binding(5) var<storage, read> pieces: array<Piece>;
@group(1) @binding(6) var<storage, read> piece_nodes: array<Bounds>;
@group(0) @binding(7) var<storage, read> levels: Levels;
@group(0) @binding(8) var<storage, read> range: PieceParts;
@group(1) @binding(9) var<storage, read_write> gathered: array<Brought>;
// Light group to gather, from 1 on; 0: all light.
@group(0) @binding(10) var<storage, read> of_light_group: u32;

fn part_level() -> u32 { return min(levels.top, range.level); }

fn end_of_parts() -> u32 {
    if (piece_count[0] == 0u) { return 0u; }
    return min(range.end, nodes_of(part_level()));
}

// The sum over earlier parts.
fn sum_before(number: u32) -> Brought {
    if (range.first == 0u) { return Brought(vec3f(0.0), 0u); }
    return gathered[number];
}

// Number of nodes on a level; there must be pieces.
fn nodes_of(level: u32) -> u32 { return ((piece_count[0] - 1u) >> (2u * level + 2u)) + 1u; }

// Reciprocal direction, bounded.
fn inverse(dir: vec3f) -> vec3f {
    let size = select(vec3f(1e-12f), abs(dir), abs(dir) > vec3f(1e-12f));
    let d = select(size, -size, dir < vec3f(0.0));
    return vec3f(quotient(1.0, d.x), quotient(1.0, d.y), quotient(1.0, d.z));
}

fn meets(origin: vec3f, inv: vec3f, length: f32, box: Bounds) -> bool {
    let t0 = (box.low - origin) * inv;
    let t1 = (box.high - origin) * inv;
    let a = select(t0, t1, t1 < t0);
    let b = select(t0, t1, t1 > t0);
    let near = larger(larger(a.x, a.y), larger(a.z, 0.0));
    let far = smaller(smaller(b.x, b.y), smaller(b.z, length));
    return near <= far;
}

// Cheap test whether a piece may contribute: the costly evaluation runs in few invocations, for these pieces only.
fn is_near(segment: Segment, inv: vec3f, piece: Piece) -> bool {
    if (HAS_LIGHT_GROUPS) {
        if (of_light_group > 0u && of_light_group != piece.medium >> LIGHT_GROUP_BITS) { return false; }
    }
    return (piece.medium & MEDIUM_BITS) == segment.medium
        && may_see(segment.bits >> WAVE_OF_SEGMENT, wave_of_light(piece.medium))
        && may_bring(piece, meeting_of(segment, piece))
        && meets(segment.origin, inv, segment.length, bounds_of(piece));
}

// `hidden`: bit mask of the piece's points that walls hide.
fn add(sum: ptr<function, Brought>, segment: Segment, piece: Piece, medium: Scattering, hidden: u32) {
    let more = brought(segment, piece, medium, key[0], hidden);
    if (more.count > 0u) {
        (*sum).radiance += as_found(more.radiance, segment.bits >> WAVE_OF_SEGMENT, wave_of_light(piece.medium));
        (*sum).count += 1u;
    }
}

// Pieces that wait for evaluation: two bits each fit a word.
const MOST_WAITING: u32 = 16u;

// One segment per invocation, without a stack: enters nodes that it meets, else goes to the next sibling, or up.
@compute @workgroup_size(64)
fn by_ray(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = group_number(group, groups) * 64u + thread;
    if (number >= sizes.count) { return; }
    let segment = segments[number];
    let medium = media[segment.medium];
    let inv = inverse(segment.dir);
    var sum = sum_before(number);
    let top = part_level();
    let end_part = end_of_parts();
    for (var part = range.first; part < end_part; part++) {
        var level = top;
        var i = part;
        var more = true;
        while (more) {
            var waiting: array<u32, MOST_WAITING>;
            var count = 0u;
            while (more && count + 4u <= MOST_WAITING) {
                if (meets(segment.origin, inv, segment.length, piece_nodes[levels.all[level].here + i])) {
                    if (level > 0u) {
                        level -= 1u;
                        i *= 4u;
                        continue;
                    }
                    let end = min(i * 4u + 4u, piece_count[0]);
                    for (var k = i * 4u; k < end; k++) {
                        if (is_near(segment, inv, pieces[k])) {
                            waiting[count] = k;
                            count += 1u;
                        }
                    }
                }
                i += 1u;
                while (level < top && ((i & 3u) == 0u || i >= nodes_of(level))) {
                    i = (i - 1u) / 4u + 1u;
                    level += 1u;
                }
                more = level < top;
            }
            // Two bits per piece: points that walls may hide, then those that they do.
            var asked = 0u;
            for (var k = 0u; k < count; k++) {
                asked |= asked_of(segment, pieces[waiting[k]], medium, key[0]) << (2u * k);
            }
            var hidden = asked;
            while (asked != 0u) {
                let bit = countTrailingZeros(asked);
                asked &= asked - 1u;
                if (!is_hidden(segment, pieces[waiting[bit / 2u]], medium, key[0], bit & 1u)) { hidden ^= 1u << bit; }
            }
            for (var k = 0u; k < count; k++) {
                add(&sum, segment, pieces[waiting[k]], medium, hidden >> (2u * k) & 3u);
            }
        }
    }
    gathered[number] = sum;
}
