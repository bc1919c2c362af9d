// One pass of a stable radix sort of (key, value), by four bits of the key. One tile per workgroup, eight consecutive
// pairs per invocation.

struct Step { shift: u32 }

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(0) @binding(1) var<storage, read> step_: Step;
@group(1) @binding(2) var<storage, read> pairs: array<vec2u>;
// By digit, then by tile: counts; after their prefix sum, where the pairs go.
@group(1) @binding(3) var<storage, read_write> digits: array<u32>;
@group(1) @binding(4) var<storage, read_write> sorted: array<vec2u>;

const TILE: u32 = 2048u;

// By digit and invocation; digits from eight on in the high half.
var<workgroup> counts: array<u32, 2048>;
var<workgroup> places: array<u32, 16>;

fn tile_count() -> u32 { return max(sizes.count / TILE + u32(sizes.count % TILE > 0u), 1u); }

fn digit_of(key: u32) -> u32 { return (key >> step_.shift) & 15u; }

fn count_at(digit: u32, thread: u32) -> u32 {
    return (counts[(digit & 7u) * 256u + thread] >> ((digit >> 3u) * 16u)) & 0xffffu;
}

fn count_one(digit: u32, thread: u32) { counts[(digit & 7u) * 256u + thread] += 1u << ((digit >> 3u) * 16u); }

// Counts the digits of an invocation's own pairs.
fn count_digits(tile: u32, thread: u32) {
    for (var k = 0u; k < 8u; k++) { counts[k * 256u + thread] = 0u; }
    let first = tile * TILE + thread * 8u;
    for (var i = 0u; i < 8u; i++) {
        if (first + i < sizes.count) { count_one(digit_of(pairs[first + i].x), thread); }
    }
    workgroupBarrier();
}

// Turns counts into prefix sums, by digit and then by invocation: places of pairs in the sorted tile.
fn sum_counts(thread: u32) {
    var total = 0u;
    for (var k = 0u; k < 8u; k++) {
        let at = thread * 8u + k;
        let here = counts[at];
        counts[at] = total;
        total += here;
    }
    let sum = sum_up_to(thread, total);
    // The low half's digits come before all of the high half's.
    let before = sum - total + (parts[255] << 16u);
    for (var k = 0u; k < 8u; k++) { counts[thread * 8u + k] += before; }
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn histogram(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = group_number(group, groups);
    let tiles = tile_count();
    if (tile >= tiles) { return; }
    count_digits(tile, thread);
    if (thread < 16u) {
        var total = 0u;
        for (var k = 0u; k < 256u; k++) { total += count_at(thread, k); }
        digits[thread * tiles + tile] = total;
    }
}

@compute @workgroup_size(256)
fn scatter(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = group_number(group, groups);
    let tiles = tile_count();
    if (tile >= tiles) { return; }
    count_digits(tile, thread);
    sum_counts(thread);
    if (thread < 16u) { places[thread] = digits[thread * tiles + tile] - count_at(thread, 0u); }
    workgroupBarrier();
    let first = tile * TILE + thread * 8u;
    for (var i = 0u; i < 8u; i++) {
        if (first + i < sizes.count) {
            let pair = pairs[first + i];
            let digit = digit_of(pair.x);
            sorted[places[digit] + count_at(digit, thread)] = pair;
            count_one(digit, thread);
        }
    }
}
