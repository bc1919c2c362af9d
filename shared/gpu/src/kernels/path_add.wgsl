// Adds to camera paths what was gathered along their segments, and what photons bring to their vertices.

struct Brought {
    radiance: vec3f,
    count: u32,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(4) var<storage, read_write> found: array<Found>;
@group(1) @binding(6) var<storage, read> path_vertices: array<PathVertex>;
@group(1) @binding(7) var<storage, read> segments: array<PathSegment>;
@group(1) @binding(8) var<storage, read> tails: array<Tail>;
@group(1) @binding(9) var<storage, read> gathered: array<Brought>;

@group(1) @binding(10) var<storage, read_write> from_photons: array<vec3f>;
// Light group of this light, 1-based; 0: all light.
@group(0) @binding(11) var<storage, read> of_light_group: u32;
@group(1) @binding(45) var<storage, read> constants: PassConstants;

@compute @workgroup_size(64)
fn add_gathered(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    if (!(segments[i].length > 0.0)) { return; }
    let slot = on_way[i];
    let more = gathered[i];
    let tail = tails[i];
    if (HAS_LIGHT_GROUPS) {
        if (of_light_group > 0u) {
            found_of_group(slot, of_light_group, tail.beta * more.radiance);
            return;
        }
    }
    found[slot] = found_more(found[slot], tail.part & 3u, tail.beta * more.radiance);
    found[slot].beams += more.count;
}

@compute @workgroup_size(64)
fn add_photons(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let y = path_vertices[i];
    if (y.kind == NO_VERTEX || y.kind == SCATTERS) { return; }
    let slot = on_way[i];
    let brought = from_photons[i];
    if (HAS_LIGHT_GROUPS) {
        // Clears the sum for the next group.
        from_photons[i] = vec3f(0.0);
        if (of_light_group > 0u) {
            found_of_group(slot, of_light_group, brought);
            return;
        }
    }
    // Counts as indirect light even at first vertices.
    let own = y.part & OF_PART;
    let part = select(own, SURFACE_PART, own == DIRECT_PART);
    found[slot] = found_more(found[slot], part, brought);
}
