// Starts camera paths, one per slot; 64 slots are a tile of 8 x 8 pixels.

@group(1) @binding(0) var<storage, read_write> paths: array<Path>;
@group(1) @binding(1) var<storage, read_write> samplers: array<Sampler>;
@group(1) @binding(2) var<storage, read_write> found: array<Found>;
@group(1) @binding(3) var<storage, read_write> on_way: array<u32>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;

// Parts per side of the lens, and per side of a part.
const LENS_PARTS: f32 = 4.0;

// Gathers every second bit, from the lowest on.
fn every_second(i: u32) -> u32 {
    return (i & 1u) | ((i >> 1u) & 2u) | ((i >> 2u) & 4u) | ((i >> 3u) & 8u) | ((i >> 4u) & 16u);
}

// The inverse.
fn spread(i: u32) -> u32 {
    return (i & 1u) | ((i & 2u) << 1u) | ((i & 4u) << 2u) | ((i & 8u) << 3u) | ((i & 16u) << 4u);
}

fn part_of_lens(u: vec2f) -> vec2f { return floor(u * LENS_PARTS); }

// Where a ray goes through the unit square that is mapped to the lens: each tile of 32 x 32 pixels has a part of it,
// and each block of 4 x 4 a part of that.
fn on_lens(pixel: vec2u, u: vec2f) -> vec2f {
    if (constants.by_parts == 0u) { return u; }
    let tile = pixel / 32u * 32u;
    let inside = pixel - tile;
    // In Morton order.
    let block = (spread(inside.x) | (spread(inside.y) << 1u)) / 16u;
    var cells = sampler_even(constants.lens_stream, tile);
    let of_tile = part_of_lens(next_2d(&cells)) * 0.25;
    cells.square += block;
    let corner = of_tile + part_of_lens(next_2d(&cells)) * 0.0625;
    return corner + u * 0.0625;
}

@compute @workgroup_size(64)
fn start(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let slot = group_number(group, groups) * 64u + thread;
    if (slot >= constants.slots) { return; }
    let tile = (constants.first + slot) / 64u;
    let inside = slot % 64u;
    let corner = vec2u(tile % constants.columns, tile / constants.columns) * 8u;
    let pixel = corner + vec2u(every_second(inside), every_second(inside >> 1u));
    var path: Path;
    path.x = pixel.x;
    path.y = pixel.y;
    path.phase = ENDED;
    var s: Sampler;
    if (pixel.x < camera.width && pixel.y < camera.height) {
        s = sampler_even(constants.camera_stream, wide_add(wide_product(pixel.y, camera.width), vec2u(pixel.x, 0u)));
        var within = next_2d(&s);
        if (constants.has_offset != 0u) { within = constants.offset; }
        let ray = camera_ray(camera, vec2f(pixel) + within, on_lens(pixel, next_2d(&s)));
        path.origin = ray.origin;
        path.dir = ray.dir;
        path.medium = camera.medium;
        path.phase = FROM_CAMERA;
        path.beta = vec3f(1.0);
        path.track = vec3f(1.0);
        path.share = 1.0;
        path.rest = 1.0;
        path.surface = NONE;
    }
    paths[slot] = path;
    samplers[slot] = s;
    for (var k = 0u; k < constants.records; k++) {
        found[k * constants.slots + slot] = Found(vec3f(0.0), 0u, vec3f(0.0), 0u, vec3f(0.0), 0.0);
    }
    on_way[slot] = slot;
}
