// Cuts beams into pieces about a quarter as long as the mean beam, at most 64 per beam.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> beams: array<Beam>;
@group(1) @binding(2) var<storage, read_write> sums: array<f32>;
@group(1) @binding(3) var<storage, read_write> piece_length: array<f32>;
// By beam: number of pieces; then their prefix sum.
@group(1) @binding(4) var<storage, read_write> counts: array<u32>;
// By piece: its beam, and its number within that.
@group(1) @binding(5) var<storage, read_write> part_numbers: array<vec2u>;
@group(1) @binding(6) var<storage, read_write> boxes: array<Bounds>;
// y: piece numbers in BVH order.
@group(1) @binding(7) var<storage, read> order: array<vec2u>;
@group(1) @binding(8) var<storage, read_write> pieces: array<Piece>;

const TILE: u32 = 2048u;
const MAX_PIECES: f32 = 64.0;

var<workgroup> lengths: array<f32, 256>;

// Tree reduction over the workgroup, for its first invocation.
fn sum_of_threads(thread: u32, number: f32) -> f32 {
    lengths[thread] = number;
    workgroupBarrier();
    for (var apart = 128u; apart > 0u; apart = apart >> 1u) {
        if (thread < apart) { lengths[thread] += lengths[thread + apart]; }
        workgroupBarrier();
    }
    return lengths[0];
}

fn tile_count() -> u32 { return max(sizes.count / TILE + u32(sizes.count % TILE > 0u), 1u); }

@compute @workgroup_size(256)
fn sum_lengths(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = group_number(group, groups);
    if (tile >= tile_count()) { return; }
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let at = tile * TILE + i * 256u + thread;
        if (at < sizes.count) { sum += beams[at].extent.y - beams[at].extent.x; }
    }
    let all = sum_of_threads(thread, sum);
    if (thread == 0u) { sums[tile] = all; }
}

// Runs as one workgroup.
@compute @workgroup_size(256)
fn mean_length(@builtin(local_invocation_index) thread: u32) {
    var sum = 0.0;
    for (var at = thread; at < tile_count(); at += 256u) { sum += sums[at]; }
    let all = sum_of_threads(thread, sum);
    if (thread == 0u) { piece_length[0] = quotient(all, f32(max(sizes.count, 1u))) * 0.25; }
}

fn pieces_of(beam: Beam) -> u32 {
    let count = ceil(quotient(beam.extent.y - beam.extent.x, piece_length[0]));
    // NaN: no pieces.
    if (!(count == count)) { return 0u; }
    return u32(select(smaller(count, MAX_PIECES), 1.0, count < 1.0));
}

fn end_of(beam: Beam, n: u32, count: u32) -> f32 {
    if (n == count) { return beam.extent.y; }
    return beam.extent.x + (beam.extent.y - beam.extent.x) * quotient(f32(n), f32(count));
}

fn piece_of(number: u32, n: u32) -> Piece {
    let beam = beams[number];
    let count = pieces_of(beam);
    let start = end_of(beam, n, count);
    let end = end_of(beam, n + 1u, count);
    let radius = larger(beam.radius + beam.radius_slope * start, beam.radius + beam.radius_slope * end);
    return Piece(
        beam.origin, start, beam.dir, end, beam.power, beam.radius, beam.radius_slope, radius, number, beam.medium,
    );
}

@compute @workgroup_size(64)
fn count_pieces(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i < sizes.count) { counts[i] = pieces_of(beams[i]); }
}

@compute @workgroup_size(64)
fn cut(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let count = pieces_of(beams[i]);
    for (var n = 0u; n < count; n++) {
        part_numbers[counts[i] + n] = vec2u(i, n);
        boxes[counts[i] + n] = bounds_of(piece_of(i, n));
    }
}

// One invocation per piece.
@compute @workgroup_size(64)
fn place(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let part = part_numbers[order[i].y];
    var piece = piece_of(part.x, part.y);
    piece.medium |= wall_flags(beams[part.x].walls, piece.start, piece.end);
    pieces[i] = piece;
}
