// Maps from uniform numbers in [0, 1)^2 to distributions: the renderer's, with the kernels' sine and cosine.

// Unit vector, uniform over the sphere.
fn uniform_sphere(u: vec2f) -> vec3f {
    let r = 2.0 * root(u.x * (1.0 - u.x));
    let turn = sin_cos(6.2831855f * u.y);
    return vec3f(r * turn.y, r * turn.x, 1.0 - 2.0 * u.x);
}

// Radius in [-1, 1] and angle of a uniform point in the unit disk.
fn concentric_polar(u: vec2f) -> vec2f {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    if (a == 0.0 && b == 0.0) { return vec2f(0.0, 0.0); }
    if (abs(a) > abs(b)) { return vec2f(a, 0.7853982f * quotient(b, a)); }
    return vec2f(b, 1.5707964f - 0.7853982f * quotient(a, b));
}

// Uniform point in the unit disk.
fn concentric_disk(u: vec2f) -> vec2f {
    let polar = concentric_polar(u);
    let turn = sin_cos(polar.y);
    return vec2f(polar.x * turn.y, polar.x * turn.x);
}

// Unit vector with z >= 0, pdf proportional to z.
fn cosine_hemisphere(u: vec2f) -> vec3f {
    let polar = concentric_polar(u);
    let turn = sin_cos(polar.y);
    let r = polar.x;
    return vec3f(r * turn.y, r * turn.x, root((1.0 - r) * (1.0 + r)));
}

// Unit vector, uniform over the cone around +z, given one minus the cosine of its half angle.
fn uniform_cap(u: vec2f, one_minus_cos_max: f32) -> vec3f {
    let one_minus_cos = u.x * one_minus_cos_max;
    let square = one_minus_cos * (2.0 - one_minus_cos);
    let sine = root(select(0.0, square, square > 0.0));
    let turn = sin_cos(6.2831855f * u.y);
    return vec3f(sine * turn.y, sine * turn.x, 1.0 - one_minus_cos);
}

// Barycentric coordinates (b1, b2) of a uniform point in a triangle.
fn uniform_triangle(u: vec2f) -> vec2f {
    if (u.y > u.x) {
        let x = 0.5 * u.x;
        return vec2f(x, u.y - x);
    }
    let y = 0.5 * u.y;
    return vec2f(u.x - y, y);
}
