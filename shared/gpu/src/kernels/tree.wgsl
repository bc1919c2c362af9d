// BVH, bottom-up: boxes around every four boxes in order, around every four of those, and so on.

struct Bounds {
    low: vec3f,
    spare_low: u32,
    high: vec3f,
    spare_high: u32,
}

// First node of a level, and of the level below.
struct Level {
    here: u32,
    below: u32,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> below: Sizes;
@group(0) @binding(2) var<storage, read> level: Level;
// y: box numbers in order.
@group(1) @binding(3) var<storage, read_write> order: array<vec2u>;
@group(1) @binding(4) var<storage, read> boxes: array<Bounds>;
@group(1) @binding(5) var<storage, read_write> nodes: array<Bounds>;

const LARGEST: f32 = 3.40282347e38f;

fn nothing() -> Bounds { return Bounds(vec3f(LARGEST), 0u, vec3f(-LARGEST), 0u); }

fn around(a: Bounds, b: Bounds) -> Bounds {
    return Bounds(select(a.low, b.low, b.low < a.low), 0u, select(a.high, b.high, b.high > a.high), 0u);
}

fn number(group: vec3u, groups: vec3u, thread: u32) -> u32 { return group_number(group, groups) * 64u + thread; }

// Takes boxes in the order given.
@compute @workgroup_size(64)
fn as_given(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = number(group, groups, thread);
    if (i < sizes.count) { order[i] = vec2u(0u, i); }
}

@compute @workgroup_size(64)
fn around_boxes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = number(group, groups, thread);
    if (i >= sizes.count) { return; }
    var all = nothing();
    for (var k = i * 4u; k < min(i * 4u + 4u, below.count); k++) { all = around(all, boxes[order[k].y]); }
    nodes[level.here + i] = all;
}

@compute @workgroup_size(64)
fn around_nodes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = number(group, groups, thread);
    if (i >= sizes.count) { return; }
    var all = nothing();
    for (var k = i * 4u; k < min(i * 4u + 4u, below.count); k++) { all = around(all, nodes[level.below + k]); }
    nodes[level.here + i] = all;
}
