// Phase functions: isotropic (g = 0), Henyey-Greenstein, and blends of two. `world/media.rs` has the same structs.
//
// Cosines are between the old and the new direction of travel: 1 is straight on.

struct PhaseLobe {
    // (1 - g^2) / (4 pi).
    scale: f32,
    // (1 - |g|)^2.
    peak: f32,
    // 2 |g|.
    slope: f32,
    // 1 for a forward peak and for g = 0, -1 for a backward one.
    sign: f32,
}

// Sum of two lobes.
struct Phase {
    first: PhaseLobe,
    second: PhaseLobe,
    // Mean cosines.
    first_g: f32,
    second_g: f32,
    // Share of the second lobe; 0 if there is only one.
    weight: f32,
}

fn phase_lobe_value(lobe: PhaseLobe, x: f32) -> f32 { return quotient(lobe.scale, x * root(x)); }

fn phase_lobe_eval(lobe: PhaseLobe, cosine: f32) -> f32 {
    return phase_lobe_value(lobe, lobe.peak + lobe.slope * not_below_zero(1.0 - lobe.sign * cosine));
}

fn phase_lobe_eval_directions(lobe: PhaseLobe, old: vec3f, new_: vec3f) -> f32 {
    let way = old - lobe.sign * new_;
    return phase_lobe_value(lobe, lobe.peak + 0.5 * lobe.slope * dot3(way, way));
}

// Value, 1/sr; also the pdf of sampling it.
fn phase_eval(phase: Phase, cosine: f32) -> f32 {
    let value = phase_lobe_eval(phase.first, cosine);
    if (phase.weight > 0.0) { return value + phase_lobe_eval(phase.second, cosine); }
    return value;
}

// The same for two unit vectors, accurate even at the peak.
fn phase_eval_directions(phase: Phase, old: vec3f, new_: vec3f) -> f32 {
    let value = phase_lobe_eval_directions(phase.first, old, new_);
    if (phase.weight > 0.0) { return value + phase_lobe_eval_directions(phase.second, old, new_); }
    return value;
}

fn phase_peak(phase: Phase) -> f32 {
    let value = phase_lobe_value(phase.first, phase.first.peak);
    if (phase.weight > 0.0) { return value + phase_lobe_value(phase.second, phase.second.peak); }
    return value;
}

// Samples a new direction of travel, with weight 1.
fn phase_sample(phase: Phase, dir: vec3f, u: vec2f) -> vec3f {
    if (!(phase.weight > 0.0)) { return phase_lobe_sample(phase.first_g, dir, u); }
    // Within the chosen lobe, the number is uniform again.
    if (u.x < phase.weight) { return phase_lobe_sample(phase.second_g, dir, vec2f(quotient(u.x, phase.weight), u.y)); }
    return phase_lobe_sample(phase.first_g, dir, vec2f(quotient(u.x - phase.weight, 1.0 - phase.weight), u.y));
}

fn phase_lobe_sample(g: f32, dir: vec3f, u: vec2f) -> vec3f {
    let a = abs(g);
    // Inverse CDF, solved for v = 1 - s cos.
    let d = (1.0 - a) + 2.0 * a * (1.0 - u.x);
    let ratio = quotient(1.0 - a, d);
    let v = 2.0 * ratio * ratio * u.x * (1.0 + a * (1.0 - u.x));
    let sine = root(not_below_zero(v * (2.0 - v)));
    let turn = sin_cos(6.2831855f * u.y);
    let cosine = select(1.0 - v, v - 1.0, g < 0.0);
    // Long paths would drift off the unit sphere.
    return unit_vector(to_world(frame_around(dir), vec3f(sine * turn.y, sine * turn.x, cosine)));
}
