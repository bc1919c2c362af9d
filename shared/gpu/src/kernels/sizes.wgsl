// How many workgroups run over a count that is known on the device alone, for dispatches that follow. One thread.

@group(0) @binding(0) var<storage, read> count: array<u32>;
@group(0) @binding(0) var<storage, read> before: Sizes;
@group(0) @binding(1) var<storage, read_write> sizes: Sizes;
@group(0) @binding(1) var<storage, read_write> digits: array<u32>;
@group(0) @binding(2) var<storage, read> piece_count: array<u32>;
// The first three numbers of `PieceParts`.
@group(0) @binding(3) var<storage, read> parts: array<u32, 3>;

// Tiles of so many elements: at least one, so that a sum of none is written too.
const TILE: u32 = 2048u;

fn tile_count(elements: u32) -> u32 { return max(elements / TILE + u32(elements % TILE > 0u), 1u); }

@compute @workgroup_size(1)
fn tiles() {
    sizes = Sizes(group_rows(tile_count(count[0])), count[0]);
}

// Of the sums of tiles.
@compute @workgroup_size(1)
fn tiles_of_tiles() {
    let elements = tile_count(before.count);
    sizes = Sizes(group_rows(tile_count(elements)), elements);
}

// Of sixteen digits a tile.
@compute @workgroup_size(1)
fn digits_of_tiles() {
    digits[0] = 16u * tile_count(before.count);
}

// A thread each, 64 a workgroup.
@compute @workgroup_size(1)
fn threads() {
    sizes = Sizes(group_rows((count[0] + 63u) / 64u), count[0]);
}

// A thread for every four of those before, down to one.
@compute @workgroup_size(1)
fn threads_of_four() {
    let elements = max((before.count + 3u) / 4u, 1u);
    sizes = Sizes(group_rows((elements + 63u) / 64u), elements);
}

// The same, but none where all pieces of a hierarchy are in parts before these.
@compute @workgroup_size(1)
fn of_parts() {
    let first = parts[0] << (2u * parts[2] + 2u);
    let is_beyond = parts[0] > 0u && first >= piece_count[0];
    sizes = Sizes(select(before.groups, vec3u(0u, 1u, 1u), is_beyond), before.count);
}
