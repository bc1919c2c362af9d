const ANY_MAP: bool = (SURFACES & 0x40000u) != 0u;

// Shadowing by a map's slopes: the normal before the map turned it, in the frame of the hit, and the squared roughness
// of a surface with such slopes; negative without a map.
struct Shadowing {
    normal: vec3f,
    alpha2: f32,
}

const NO_SHADOWING: Shadowing = Shadowing(vec3f(0.0), -1.0);

fn has_map(shadowing: Shadowing) -> bool { return ANY_MAP && shadowing.alpha2 >= 0.0; }

// Factor on diffuse light from a direction in the frame of the hit.
fn shadowing_factor(shadowing: Shadowing, wi: vec3f) -> f32 {
    if (!has_map(shadowing) || shadowing.alpha2 == 0.0) { return 1.0; }
    let cos = not_above_one(abs(dot3(wi, shadowing.normal)));
    let cos2 = cos * cos;
    let extent = cos + root(cos2 + shadowing.alpha2 * (1.0 - cos2));
    if (extent > 0.0) { return quotient(2.0 * cos, extent); }
    return 0.0;
}
