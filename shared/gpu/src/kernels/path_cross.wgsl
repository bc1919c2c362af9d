// Takes camera paths through media of varying density: estimates the transmittance along their segments, and scatters
// the paths. Steps of segments are counted first, then written.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(2) var<storage, read> paths: array<Path>;
@group(1) @binding(3) var<storage, read_write> samplers: array<Sampler>;
@group(1) @binding(5) var<storage, read> met: array<SurfacePoint>;
@group(1) @binding(7) var<storage, read_write> segments: array<PathSegment>;
@group(1) @binding(8) var<storage, read_write> tails: array<Tail>;
@group(1) @binding(11) var<storage, read_write> rounds_taken: array<u32>;
// By path: number of steps of its segment; then their prefix sum.
@group(1) @binding(12) var<storage, read_write> step_places: array<u32>;
@group(1) @binding(13) var<storage, read> all_steps: array<u32>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;
// By light, then by medium.
@group(1) @binding(46) var<storage, read> uses: array<Use>;
@group(1) @binding(57) var<storage, read_write> segment_steps: array<u32>;

const WORDS_OF_STEP: u32 = 6u;

fn keep_step(place: u32, walk: Walk) {
    let at = WORDS_OF_STEP * place;
    if (at + WORDS_OF_STEP > arrayLength(&segment_steps)) { return; }
    segment_steps[at] = bitcast<u32>(walk.distance);
    segment_steps[at + 1u] = bitcast<u32>(walk.value.x);
    segment_steps[at + 2u] = bitcast<u32>(walk.value.y);
    segment_steps[at + 3u] = bitcast<u32>(walk.value.z);
    segment_steps[at + 4u] = bitcast<u32>(walk.depth);
    segment_steps[at + 5u] = bitcast<u32>(walk.decay);
}

// Whether a path leaves a segment in its medium, and whether the medium may scatter the path.
struct Asked {
    leaves: bool,
    flies: bool,
}

fn asked_of(path: Path) -> Asked {
    let is_served = uses[lighting.lights + path.medium].way == 1u;
    let is_passed = (path.phase == WALKS && is_served) || path.rest == 0.0;
    if (!medium_scatters(media[path.medium]) || is_passed) { return Asked(false, false); }
    // Rays that look only for direct light leave no segment in media that scatter paths.
    let is_left = constants.leave_beams == 1u && (path.flags & ONLY_DIRECT) == 0u;
    return Asked(is_served || is_left, !is_served);
}

// Crosses a medium and returns the number of steps of the path's segment. `writes`: also stores these from `place` on,
// the segment and the tail.
fn cross(i: u32, writes: bool, place: u32) -> u32 {
    let slot = on_way[i];
    let path = paths[slot];
    if (writes) { segments[i].crossed = 0u; }
    if (path.medium >= VACUUM) { return 0u; }
    if (!is_varying(path.medium)) { return 0u; }
    let asked = asked_of(path);
    if (!writes && !asked.leaves) { return 0u; }
    var s = samplers[slot];
    sampler_align(&s, SQUARES_OF_VERTEX);
    let length = met[i].t;
    var steps = 0u;
    var seen = 0.0;
    var weight = vec3f(1.0);
    var distance = -1.0;
    // First the transmittance along the segment, if the path leaves one; then the path itself.
    for (var k = select(1u, 0u, asked.leaves); k < 2u; k++) {
        let is_kept = k == 0u;
        if (!is_kept && (!writes || (asked.leaves && !asked.flies))) { break; }
        var walk = walk_begins(path.medium, path.origin, path.dir, length, asked.flies && !is_kept, is_kept, path.beta, &s);
        if (walk.is == NO_WALK) { continue; }
        loop {
            let more = walk_on(&walk, &s);
            if (is_kept && walk.has_step) {
                if (writes) { keep_step(place + steps, walk); }
                steps += 1u;
            }
            if (!more) { break; }
        }
        if (is_kept) {
            seen = select(walk.range.y, walk.distance, all(walk.value == vec3f(0.0)));
            weight = walked_transmittance(walk);
        } else if (asked.flies) {
            weight = walk.value;
            if (walk.scattered) { distance = walk.distance; }
        } else {
            weight = walked_transmittance(walk);
        }
    }
    if (!writes) { return steps; }
    // Gathers nothing if the steps do not fit: the pass is rendered again.
    if (WORDS_OF_STEP * (place + steps) > arrayLength(&segment_steps)) { seen = 0.0; }
    let pixel = path.y * camera.width + path.x;
    segments[i] = PathSegment(
        path.origin, seen, path.dir, path.medium, pixel, WORDS_OF_STEP * place, steps,
        select(CROSSED, CROSSED | BY_A_FLIGHT, asked.flies),
    );
    tails[i] = Tail(weight, bitcast<u32>(distance));
    samplers[slot] = s;
    return steps;
}

@compute @workgroup_size(64)
fn count_steps(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    step_places[i] = cross(i, false, 0u);
}

@compute @workgroup_size(64)
fn go_through(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    _ = cross(i, true, step_places[i]);
    if (i == 0u) { rounds_taken[1] = max(rounds_taken[1], all_steps[0]); }
}
