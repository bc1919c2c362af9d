// Morton codes of the centres of boxes: 20 bits per axis, in two words of 30 bits, the low one first.

struct Bounds {
    low: vec3f,
    spare_low: u32,
    high: vec3f,
    spare_high: u32,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> boxes: array<Bounds>;
// The last one encloses all boxes.
@group(1) @binding(2) var<storage, read> nodes: array<Bounds>;
@group(1) @binding(3) var<storage, read_write> keys: array<vec2u>;

// Spreads ten bits, with two zeros after each.
fn spread(bits: u32) -> u32 {
    var x = bits;
    x = (x | (x << 16u)) & 0x030000ffu;
    x = (x | (x << 8u)) & 0x0300f00fu;
    x = (x | (x << 4u)) & 0x030c30c3u;
    return (x | (x << 2u)) & 0x09249249u;
}

fn interleaved(x: u32, y: u32, z: u32) -> u32 { return spread(x) | (spread(y) << 1u) | (spread(z) << 2u); }

// Centre of a range as a 20-bit fraction of the way from `least` to `most`; 0 if that is NaN.
fn quantized(low: f32, high: f32, least: f32, most: f32) -> u32 {
    let steps = ((low * 0.5 + high * 0.5) - least) * quotient(1048576.0, most - least);
    return u32(select(select(0.0, steps, steps > 0.0), 1048575.0, steps > 1048575.0));
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let all = nodes[arrayLength(&nodes) - 1u];
    let here = boxes[i];
    let x = quantized(here.low.x, here.high.x, all.low.x, all.high.x);
    let y = quantized(here.low.y, here.high.y, all.low.y, all.high.y);
    let z = quantized(here.low.z, here.high.z, all.low.z, all.high.z);
    keys[i] = vec2u(
        interleaved(x & 1023u, y & 1023u, z & 1023u),
        interleaved(x >> 10u, y >> 10u, z >> 10u),
    );
}
