// What lights are drawn by, one table after another: running sums of the lights' powers, over their total, for each
// that chooses among others; then by light what its `table` begins. `world/lights.rs` lays them out.

@group(0) @binding(32) var<storage, read> light_tables: array<f32>;

// Below one.
fn below_one(x: f32) -> f32 { return select(0.99999994f, x, x < 0.99999994f); }

// Probability of an entry of running sums that begin at `first`.
fn pmf_in_table(first: u32, index: u32) -> f32 {
    if (index == 0u) { return light_tables[first]; }
    return light_tables[first + index] - light_tables[first + index - 1u];
}

// A choice from running sums.
struct TableChoice {
    index: u32,
    pmf: f32,
    // The uniform number again, within the choice.
    u: f32,
}

// The first of `count` entries whose sum is beyond `u`, or the last.
fn choose_in_table(first: u32, count: u32, u: f32) -> TableChoice {
    var low = 0u;
    var high = count - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (light_tables[first + middle] <= u) { low = middle + 1u; } else { high = middle; }
    }
    var below = 0.0;
    if (low > 0u) { below = light_tables[first + low - 1u]; }
    let pmf = light_tables[first + low] - below;
    return TableChoice(low, pmf, below_one(not_below_zero(quotient(u - below, pmf))));
}
