// Sums over the 256 threads of a workgroup, which stay in `parts`.

var<workgroup> parts: array<u32, 256>;

// The sum of the threads' numbers up to a thread's own.
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
