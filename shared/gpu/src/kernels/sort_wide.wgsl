// Keys of two words: pairs for sorting by low words, then, in that order, by high words.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
// (low, high).
@group(1) @binding(1) var<storage, read> keys: array<vec2u>;
@group(1) @binding(2) var<storage, read_write> pairs: array<vec2u>;

fn number(group: vec3u, groups: vec3u, thread: u32) -> u32 { return group_number(group, groups) * 64u + thread; }

@compute @workgroup_size(64)
fn low_words(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = number(group, groups, thread);
    if (i < sizes.count) { pairs[i] = vec2u(keys[i].x, i); }
}

@compute @workgroup_size(64)
fn high_words(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = number(group, groups, thread);
    if (i < sizes.count) { pairs[i] = vec2u(keys[pairs[i].y].y, pairs[i].y); }
}
