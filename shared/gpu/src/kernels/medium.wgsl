// Homogeneous media. Same struct as in `world/media.rs`. Distances in scene units; they may be infinite.

struct Medium {
    // Extinction.
    sigma_t: vec3f,
    // Mean cosine of the phase function.
    g: f32,
    // Scattering.
    sigma_s: vec3f,
    phase: Phase,
}

fn transmittance_of(sigma_t: f32, distance: f32) -> f32 {
    if (sigma_t > 0.0) { return exp_neg(-sigma_t * distance); }
    return 1.0;
}

fn transmittance(m: Medium, distance: f32) -> vec3f {
    return vec3f(
        transmittance_of(m.sigma_t.x, distance),
        transmittance_of(m.sigma_t.y, distance),
        transmittance_of(m.sigma_t.z, distance),
    );
}

struct Flight {
    // Transmittance, times sigma_s if it scattered, over the pdf or probability.
    weight: vec3f,
    // To the scattering event, or the whole length.
    distance: f32,
    scattered: u32,
}

// Samples where a photon of flux `power` scatters within a length. The distance is drawn for one channel, chosen in
// proportion to its flux, and weighted by the pdf over all channels.
fn sample_flight(m: Medium, power: vec3f, length: f32, u: vec2f) -> Flight {
    let all = power.x + power.y + power.z;
    let share = vec3f(quotient(power.x, all), quotient(power.y, all), quotient(power.z, all));
    var sigma = m.sigma_t.z;
    if (u.x < share.x) {
        sigma = m.sigma_t.x;
    } else if (u.x < share.x + share.y || share.z == 0.0) {
        sigma = m.sigma_t.y;
    }
    let distance = quotient(-ln(1.0 - u.y), sigma);
    if (distance < length) {
        let tr = transmittance(m, distance);
        let densities = share * m.sigma_t * tr;
        let pdf = densities.x + densities.y + densities.z;
        return Flight(tr * m.sigma_s * quotient(1.0, pdf), distance, 1u);
    }
    let tr = transmittance(m, length);
    let shares = share * tr;
    let probability = shares.x + shares.y + shares.z;
    if (probability > 0.0) { return Flight(tr * quotient(1.0, probability), length, 0u); }
    return Flight(vec3f(0.0), length, 0u);
}
