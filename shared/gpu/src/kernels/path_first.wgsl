// The first surface met by each pixel's path, for AOV layers. Pure boundaries of media do not count.

@group(1) @binding(2) var<storage, read> paths: array<Path>;
@group(1) @binding(3) var<storage, read> samplers: array<Sampler>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;

// `pass/layers.rs` has the same struct.
struct First {
    // Unit shading normal.
    normal: vec3f,
    // Distance along the camera's axis.
    depth: f32,
    albedo: vec3f,
    // NONE if there is no surface.
    object: u32,
}

// By pixel.
@group(1) @binding(10) var<storage, read_write> firsts: array<First>;

// More surfaces than any ray passes.
const MOST_PASSED: u32 = 4096u;

// Runs once paths have started.
@compute @workgroup_size(64)
fn find_first(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let slot = group_number(group, groups) * 64u + thread;
    if (slot >= constants.slots) { return; }
    let path = paths[slot];
    if (path.x >= camera.width || path.y >= camera.height) { return; }
    // A copy: the path itself draws the same numbers.
    var s = samplers[slot];
    var ray = Ray(path.origin, path.dir);
    var first = First(vec3f(0.0), 0.0, vec3f(0.0), NONE);
    for (var k = 0u; k < MOST_PASSED; k++) {
        let at = first_hit(ray, Ignored(NOTHING, lighting.camera_hides));
        if (at.object == NOTHING) { break; }
        let number = met_material(surfaces[at.object].material, at, &s);
        if (number == PASSED) {
            ray = spawn_ray(at, ray.dir);
            continue;
        }
        let found = bsdf_at(number, at, ray.dir);
        let depth = dot3(at.point - camera.position, camera.n);
        first = First(found.frame.n, depth, albedo_of(found.material), at.object);
        break;
    }
    firsts[path.y * camera.width + path.x] = first;
}
