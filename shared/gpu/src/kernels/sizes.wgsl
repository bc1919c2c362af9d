// Workgroup counts for indirect dispatches over counts known only on the device. One invocation per pass: dispatches
// cover all passes together, with as many workgroups for each as the largest needs. So each pass's part of the buffers
// is found by hand here.

@group(0) @binding(0) var<storage, read> count: array<u32>;
@group(0) @binding(0) var<storage, read> before: array<Sizes>;
@group(0) @binding(1) var<storage, read_write> sizes: array<Sizes>;
@group(0) @binding(1) var<storage, read_write> digits: array<u32>;
@group(0) @binding(2) var<storage, read> piece_count: array<u32>;
// First three members of `PieceParts`.
@group(0) @binding(3) var<storage, read> parts: array<u32, 3>;

// Elements of a tile. There is at least one tile, so that a sum of none is written too.
const TILE: u32 = 2048u;

fn tile_count(elements: u32) -> u32 { return max(elements / TILE + u32(elements % TILE > 0u), 1u); }

fn count_of(number: u32, passes: u32) -> u32 { return count[number * (arrayLength(&count) / passes)]; }

fn quarter_of(elements: u32) -> u32 { return max((elements + 3u) / 4u, 1u); }

@compute @workgroup_size(1)
fn tiles(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    var most = 0u;
    for (var i = 0u; i < groups.z; i++) { most = max(most, tile_count(count_of(i, groups.z))); }
    sizes[group.z] = Sizes(group_rows(most, groups.z), count_of(group.z, groups.z));
}

// For the sums of tiles.
@compute @workgroup_size(1)
fn tiles_of_tiles(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    var most = 0u;
    for (var i = 0u; i < groups.z; i++) { most = max(most, tile_count(tile_count(before[i].count))); }
    sizes[group.z] = Sizes(group_rows(most, groups.z), tile_count(before[group.z].count));
}

// Sixteen digits per tile.
@compute @workgroup_size(1)
fn digits_of_tiles(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    digits[group.z * (arrayLength(&digits) / groups.z)] = 16u * tile_count(before[group.z].count);
}

// One invocation per element, 64 per workgroup.
@compute @workgroup_size(1)
fn threads(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    var most = 0u;
    for (var i = 0u; i < groups.z; i++) { most = max(most, (count_of(i, groups.z) + 63u) / 64u); }
    sizes[group.z] = Sizes(group_rows(most, groups.z), count_of(group.z, groups.z));
}

// One invocation for every four of the earlier elements, at least one.
@compute @workgroup_size(1)
fn threads_of_four(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    var most = 0u;
    for (var i = 0u; i < groups.z; i++) { most = max(most, (quarter_of(before[i].count) + 63u) / 64u); }
    sizes[group.z] = Sizes(group_rows(most, groups.z), quarter_of(before[group.z].count));
}

// The earlier sizes, or no workgroups if all pieces are in earlier parts.
@compute @workgroup_size(1)
fn of_parts(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let first = parts[0] << (2u * parts[2] + 2u);
    let apart = arrayLength(&piece_count) / groups.z;
    var all_beyond = true;
    for (var i = 0u; i < groups.z; i++) {
        all_beyond = all_beyond && parts[0] > 0u && first >= piece_count[i * apart];
    }
    let here = before[group.z];
    sizes[group.z] = Sizes(select(here.groups, vec3u(0u, 1u, 1u), all_beyond), here.count);
}
