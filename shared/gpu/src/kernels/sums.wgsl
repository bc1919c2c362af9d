// Prefix sums over a workgroup of 256 invocations, which stay in `parts`.

var<workgroup> parts: array<u32, 256>;

// Inclusive.
fn sum_up_to(thread: u32, number: u32) -> u32 {
    parts[thread] = number;
    workgroupBarrier();
    for (var apart = 1u; apart < 256u; apart = apart << 1u) {
        var other = 0u;
        if (thread >= apart) { other = parts[thread - apart]; }
        workgroupBarrier();
        parts[thread] += other;
        workgroupBarrier();
    }
    return parts[thread];
}
