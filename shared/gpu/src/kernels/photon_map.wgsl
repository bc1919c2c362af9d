// Bounding boxes of photon kernels, and the photons in the order of the BVH over them.

struct Bounds {
    low: vec3f,
    spare_low: u32,
    high: vec3f,
    spare_high: u32,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> photons: array<SurfacePhoton>;
@group(1) @binding(2) var<storage, read_write> boxes: array<Bounds>;
// y: photon numbers in BVH order.
@group(1) @binding(3) var<storage, read> order: array<vec2u>;
@group(1) @binding(4) var<storage, read_write> placed: array<SurfacePhoton>;

// Exactly that wide: rounding is monotonic, so what the kernel's rounded distance covers is inside.
fn box_around(point: vec3f, radius: f32) -> Bounds {
    return Bounds(point - vec3f(radius), 0u, point + vec3f(radius), 0u);
}

@compute @workgroup_size(64)
fn surround(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i < sizes.count) { boxes[i] = box_around(photons[i].point, photons[i].radius); }
}

@compute @workgroup_size(64)
fn place(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i < sizes.count) { placed[i] = photons[order[i].y]; }
}
