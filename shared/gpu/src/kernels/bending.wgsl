// Light of single wavelengths at surfaces.

// Wavelengths of a pass have numbers from 1 on: one of them by a uniform number; 0 is none.
fn wave_by(u: f32, count: u32) -> u32 { return min(u32(u * f32(count)), count - 1u) + 1u; }

// The same surface with another index inside over the one outside, where light is bent.
fn bending(m: Material, eta: f32) -> Material {
    var bent = m;
    if (bends(m)) { bent.eta = vec3f(eta); }
    return bent;
}
