// What `self_test.rs` compares with a processor: one row of results per operation, in its order.

@group(0) @binding(0) var<storage, read> operands: array<vec2u>;
@group(0) @binding(1) var<storage, read_write> results: array<u32>;

fn put(row: u32, i: u32, bits: u32) { results[row * arrayLength(&operands) + i] = bits; }

fn put_float(row: u32, i: u32, x: f32) { put(row, i, bitcast<u32>(x)); }

@compute @workgroup_size(64)
fn operations(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= arrayLength(&operands)) { return; }
    let u = operands[i].x;
    let v = operands[i].y;
    let a = of_bits(u);
    let b = of_bits(v);
    put_float(0u, i, native_quotient(a, b));
    put_float(1u, i, native_root(a));
    put_float(2u, i, own_quotient(a, b));
    put_float(3u, i, own_root(a));
    put_float(4u, i, a + b);
    put_float(5u, i, a - b);
    put_float(6u, i, a * b);
    put_float(7u, i, a * b + b);
    put_float(8u, i, a * a - b * b);
    put_float(9u, i, -a * b - a);
    put_float(10u, i, floor(a));
    put_float(11u, i, ceil(a));
    put_float(12u, i, trunc(a));
    put_float(13u, i, round(a));
    put(14u, i, u32(a < b) | (u32(a <= b) << 1u) | (u32(a == b) << 2u) | (u32(a >= b) << 3u));
    put_float(15u, i, select(-abs(a), b, a > b));
    put_float(16u, i, f32(u));
    put_float(17u, i, f32(bitcast<i32>(u)));
    // Conversions are defined within range only.
    let within = select(0.0, a, abs(a) < 2147483648.0);
    put(18u, i, bitcast<u32>(i32(within)));
    put(19u, i, u32(abs(within)));
    let product = wide_product(u, v);
    put(20u, i, product.x);
    put(21u, i, product.y);
    put(22u, i, countLeadingZeros(u));
    put(23u, i, reverseBits(u));
    put(24u, i, bitcast<u32>(bitcast<i32>(u) >> (v & 31u)) ^ (u / max(v, 1u)));
}

@compute @workgroup_size(64)
fn functions(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= arrayLength(&operands)) { return; }
    let a = of_bits(operands[i].x);
    let b = of_bits(operands[i].y);
    put_float(0u, i, quotient(a, b));
    put_float(1u, i, root(a));
    put_float(2u, i, exponential(a));
    put_float(3u, i, exp_neg(-abs(a)));
    put_float(4u, i, ln(a));
    let of_angle = sin_cos(a);
    put_float(5u, i, of_angle.x);
    put_float(6u, i, of_angle.y);
    put_float(7u, i, arc_cos(a));
    put_float(8u, i, arc_tan2(a, b));
    put_float(9u, i, power(a, b));
}
