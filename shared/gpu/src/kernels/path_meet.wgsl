// Traces the rays of camera paths.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(2) var<storage, read> paths: array<Path>;
@group(1) @binding(5) var<storage, read_write> met: array<SurfacePoint>;
// Light from photons, cleared here.
@group(1) @binding(10) var<storage, read_write> from_photons: array<vec3f>;

@compute @workgroup_size(64)
fn meet(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let slot = on_way[i];
    from_photons[i] = vec3f(0.0);
    met[i] = first_hit(Ray(paths[slot].origin, paths[slot].dir), Ignored(NOTHING, hidden_from(paths[slot])));
}
