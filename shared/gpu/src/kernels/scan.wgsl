// Exclusive prefix sums, modulo 2^32: within tiles, then with the sums of the tiles before.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read_write> numbers: array<u32>;
@group(1) @binding(2) var<storage, read_write> sums: array<u32>;

const TILE: u32 = 2048u;

fn tile_count() -> u32 { return max(sizes.count / TILE + u32(sizes.count % TILE > 0u), 1u); }

// One tile per workgroup, eight consecutive numbers per invocation.
@compute @workgroup_size(256)
fn scan_tiles(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = group_number(group, groups);
    if (tile >= tile_count()) { return; }
    let first = tile * TILE + thread * 8u;
    var before: array<u32, 8>;
    var total = 0u;
    for (var i = 0u; i < 8u; i++) {
        before[i] = total;
        if (first + i < sizes.count) { total += numbers[first + i]; }
    }
    let sum = sum_up_to(thread, total);
    for (var i = 0u; i < 8u; i++) {
        if (first + i < sizes.count) { numbers[first + i] = sum - total + before[i]; }
    }
    if (thread == 255u) { sums[tile] = sum; }
}

@compute @workgroup_size(256)
fn add_sums(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = group_number(group, groups);
    if (tile >= tile_count()) { return; }
    for (var i = 0u; i < 8u; i++) {
        let at = tile * TILE + i * 256u + thread;
        if (at < sizes.count) { numbers[at] += sums[tile]; }
    }
}
