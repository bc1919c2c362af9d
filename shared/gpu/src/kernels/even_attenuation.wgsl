// Replaces `attenuation.wgsl` in scenes where no medium's density varies.

fn attenuation(segment: Segment, piece: Piece, medium: Scattering, t: f32, s: f32) -> vec3f {
    return transmitted_over(medium.sigma_t, t + s);
}
