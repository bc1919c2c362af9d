// In place of `attenuation.wgsl` in scenes whose media are all the same everywhere.

fn attenuation(segment: Segment, piece: Piece, medium: Scattering, t: f32, s: f32) -> vec3f {
    return transmitted_over(medium.sigma_t, t + s);
}
