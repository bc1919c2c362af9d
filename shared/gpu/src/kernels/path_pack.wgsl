// Compacts the slots of live paths, in order.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(2) var<storage, read> paths: array<Path>;
// 1 for each live path; then the prefix sum.
@group(1) @binding(9) var<storage, read_write> alive: array<u32>;
@group(1) @binding(10) var<storage, read_write> next_on_way: array<u32>;
// Number of rounds.
@group(1) @binding(11) var<storage, read_write> rounds_taken: array<u32>;

@compute @workgroup_size(64)
fn mark(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i < sizes.count) { alive[i] = u32(paths[on_way[i]].phase > ENDED); }
}

@compute @workgroup_size(64)
fn pack(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    if (i == 0u) { rounds_taken[0] += 1u; }
    let slot = on_way[i];
    if (paths[slot].phase > ENDED) { next_on_way[alive[i]] = slot; }
}
