// Sampling tables of lights, laid out by `world/lights.rs`: running sums of the lights' shares of the power, for each
// set of lights to choose from, then each light's own part, at its `table`.

@group(0) @binding(32) var<storage, read> light_tables: array<f32>;

fn below_one(x: f32) -> f32 { return select(0.99999994f, x, x < 0.99999994f); }

// Probability of an entry of the running sums that begin at `first`.
fn pmf_in_table(first: u32, index: u32) -> f32 {
    if (index == 0u) { return light_tables[first]; }
    return light_tables[first + index] - light_tables[first + index - 1u];
}

struct TableChoice {
    index: u32,
    pmf: f32,
    // The uniform number, rescaled to be uniform within the choice.
    u: f32,
}

// The first of `count` entries whose sum exceeds `u`, or the last.
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
