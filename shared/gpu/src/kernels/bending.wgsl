// Dispersion at surfaces.

// Draws one of a pass's wavelengths, which are numbered from 1; 0 means none.
fn wave_by(u: f32, count: u32) -> u32 { return min(u32(u * f32(count)), count - 1u) + 1u; }

// The surface with another relative index of refraction, inside over outside, if it refracts.
fn bending(m: Material, eta: f32) -> Material {
    var bent = m;
    if (bends(m)) { bent.eta = vec3f(eta); }
    return bent;
}
