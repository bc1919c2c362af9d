// Kernels for tests of `rays.wgsl`.

struct TestRay {
    origin: vec3f,
    t_max: f32,
    dir: vec3f,
    // Class bits of objects to pass through; from bit 8 on, the number of one more, plus one.
    ignored: u32,
}

fn ignored_of(ray: TestRay) -> Ignored { return Ignored((ray.ignored >> 8u) - 1u, ray.ignored & 255u); }

@group(0) @binding(0) var<storage, read> rays: array<TestRay>;
@group(0) @binding(1) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(2) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(3) var<storage, read> operands: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> differences: array<f32>;

@compute @workgroup_size(64)
fn closest(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= arrayLength(&rays)) { return; }
    let ray = rays[i];
    hits[i] = closest_hit(Ray(ray.origin, ray.dir), ray.t_max, ignored_of(ray));
}

@compute @workgroup_size(64)
fn any_at_all(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= arrayLength(&rays)) { return; }
    let ray = rays[i];
    blocked[i] = u32(any_hit(Ray(ray.origin, ray.dir), ray.t_max, ignored_of(ray)));
}

@compute @workgroup_size(64)
fn products(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= arrayLength(&operands)) { return; }
    let four = operands[i];
    differences[i] = difference_of_products(four.x, four.y, four.z, four.w);
}
