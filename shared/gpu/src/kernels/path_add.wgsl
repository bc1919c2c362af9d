// What was gathered along segments of camera paths is theirs, and what photons bring to their vertices.

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

@group(1) @binding(10) var<storage, read> from_photons: array<vec3f>;

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
    // It comes from surfaces and media, at first vertices too.
    let own = y.part & OF_PART;
    let part = select(own, SURFACE_PART, own == DIRECT_PART);
    found[slot] = found_more(found[slot], part, from_photons[i]);
}
