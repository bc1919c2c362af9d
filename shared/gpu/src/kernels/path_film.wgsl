// Copies what each slot's path has found to its pixel of the film.

@group(1) @binding(2) var<storage, read> paths: array<Path>;
@group(1) @binding(4) var<storage, read> found: array<Found>;
// Four records of statistics, then one per pixel; then those of light groups.
@group(1) @binding(10) var<storage, read_write> film: array<Found>;
@group(1) @binding(11) var<storage, read> alive_count: array<u32>;
@group(1) @binding(12) var<storage, read> told: array<u32>;
@group(1) @binding(13) var<storage, read> rounds_taken: array<u32>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;

@compute @workgroup_size(64)
fn to_film(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let slot = group_number(group, groups) * 64u + thread;
    if (slot >= constants.slots) { return; }
    let x = paths[slot].x;
    let y = paths[slot].y;
    if (x < camera.width && y < camera.height) {
        for (var k = 0u; k < constants.records; k++) {
            film[4u + (k * camera.height + y) * camera.width + x] = found[k * constants.slots + slot];
        }
    }
    if (slot == 0u) {
        // Unfinished camera paths and beams; unfinished photon paths and rounds.
        film[0] = Found(vec3f(0.0), alive_count[0], vec3f(0.0), told[0], vec3f(0.0), 0.0);
        film[1] = Found(vec3f(0.0), told[2], vec3f(0.0), rounds_taken[0], vec3f(0.0), 0.0);
        // Transmittance steps in media of varying density: along beams, and along a round's segments. Then photons.
        film[2] = Found(vec3f(0.0), told[3], vec3f(0.0), rounds_taken[1], vec3f(0.0), 0.0);
        film[3] = Found(vec3f(0.0), told[1], vec3f(0.0), 0u, vec3f(0.0), 0.0);
    }
}
