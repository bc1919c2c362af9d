// Single scattering of direct light along segments, in media whose light beams bring.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(3) var<storage, read_write> samplers: array<Sampler>;
@group(1) @binding(4) var<storage, read_write> found: array<Found>;
@group(1) @binding(7) var<storage, read> segments: array<PathSegment>;
@group(1) @binding(8) var<storage, read> tails: array<Tail>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;
// By light.
@group(1) @binding(46) var<storage, read> uses: array<Use>;

@compute @workgroup_size(64)
fn scattered_once(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let segment = segments[i];
    let tail = tails[i];
    if (!(segment.length > 0.0) || (tail.part & IS_SERVED) == 0u) { return; }
    let slot = on_way[i];
    var s = samplers[slot];
    let ray = Ray(segment.origin, segment.dir);
    let once = single_scattering(ray, segment.length, segment.medium, tail.beta, &s);
    samplers[slot] = s;
    found[slot].volume += once.radiance;
    if (HAS_LIGHT_GROUPS) { found_of_group(slot, uses[once.light].light_group, once.radiance); }
}
