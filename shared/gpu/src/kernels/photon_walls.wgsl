// Finds the walls that cross the kernels of surface photons, at the heights stored there.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read_write> surface_photons: array<SurfacePhoton>;

@compute @workgroup_size(64)
fn find_crossing(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let photon = surface_photons[i];
    let n = photon.ng * with_sign(1.0, dot3(photon.ng, photon.wi));
    let found = crossing_walls(photon.point, n, photon.radius, photon.height);
    surface_photons[i].beyond = found.beyond;
    surface_photons[i].height = found.height;
}
