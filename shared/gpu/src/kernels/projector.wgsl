// Point lamps that project an image, as in the renderer's `world/light/projector.rs`. The table holds the inward
// normals of the pyramid that contains all of the light.

// Intensity, W/sr; `dir` need not be a unit vector.
fn projector_intensity(light: Light, dir: vec3f) -> vec3f {
    let across = vec2f(dot3(dir, light.s), dot3(dir, light.t));
    let z = dot3(dir, light.n);
    if (z <= 0.0) { return vec3f(0.0); }
    let reach = light.half * z;
    let at = vec2f(quotient(across.x, reach.x), quotient(across.y, reach.y));
    if (abs(at.x) > 1.0 || abs(at.y) > 1.0) { return vec3f(0.0); }
    var factor = 0.0;
    if (light.cutoff > 0.0) {
        factor = spot_falloff(light, arc_tan2(root(dot2(across, across)), z));
    } else {
        // A screen across the axis is lit as the image is.
        let cosine = quotient(z, root(dot3(dir, dir)));
        factor = quotient(1.0, cosine * cosine * cosine);
    }
    return light.power * texture_value(textures[light.texture], 0.5 + 0.5 * at) * factor;
}

// Pdf per solid angle.
fn projector_pdf(light: Light, dir: vec3f) -> f32 {
    let z = dot3(dir, light.n);
    let reach = light.half * z;
    // What rounding takes over the edge was drawn within it.
    let slack = light.half * z * 1e-5f;
    let at = vec2f(dot3(dir, light.s), dot3(dir, light.t));
    let is_within = all(at >= light.lit.xy * reach - slack) && all(at <= light.lit.zw * reach + slack);
    if (!(z > 0.0 && is_within)) { return 0.0; }
    let side = light.lit.zw - light.lit.xy;
    let share = 0.25 * (side.x * side.y);
    let area = 4.0 * light.half.x * light.half.y;
    return quotient(1.0, share * area * z * z * z);
}

// Unit vector away from the lamp, uniform over the part of the image that may be bright.
fn sample_projector(light: Light, u: vec2f) -> vec3f {
    let at = (light.lit.xy + (light.lit.zw - light.lit.xy) * u) * light.half;
    return unit_vector(light.s * at.x + light.t * at.y + light.n);
}
