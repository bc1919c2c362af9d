// Vectors and frames, as in the renderer's math.

fn dot3(a: vec3f, b: vec3f) -> f32 { return a.x * b.x + a.y * b.y + a.z * b.z; }

fn dot2(a: vec2f, b: vec2f) -> f32 { return a.x * b.x + a.y * b.y; }

fn quotients(v: vec3f, by: f32) -> vec3f { return vec3f(quotient(v.x, by), quotient(v.y, by), quotient(v.z, by)); }

fn unit_vector(v: vec3f) -> vec3f { return v * quotient(1.0, root(dot3(v, v))); }

// A right-handed orthonormal basis with n as its z axis.
struct Frame {
    s: vec3f,
    t: vec3f,
    n: vec3f,
}

// Around a unit vector: Duff et al. 2017.
fn frame_around(n: vec3f) -> Frame {
    let sign = select(-1.0, 1.0, n.z >= 0.0);
    let a = quotient(-1.0, sign + n.z);
    let b = n.x * n.y * a;
    return Frame(
        vec3f(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        vec3f(b, sign + n.y * n.y * a, -n.y),
        n,
    );
}

fn to_world(frame: Frame, v: vec3f) -> vec3f { return frame.s * v.x + frame.t * v.y + frame.n * v.z; }

fn to_local(frame: Frame, v: vec3f) -> vec3f { return vec3f(dot3(v, frame.s), dot3(v, frame.t), dot3(v, frame.n)); }

// NaN becomes zero.
fn not_below_zero(x: f32) -> f32 { return select(0.0, x, x > 0.0); }

// NaN becomes one.
fn not_above_one(x: f32) -> f32 { return select(1.0, x, x < 1.0); }

fn cross3(a: vec3f, b: vec3f) -> vec3f {
    return vec3f(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
}

// Normalised, or `otherwise` if that is impossible.
fn unit_or(v: vec3f, otherwise: vec3f) -> vec3f {
    let reciprocal = quotient(1.0, root(dot3(v, v)));
    let is_finite = reciprocal > 0.0 && reciprocal < of_bits(INFINITY);
    return select(otherwise, v * reciprocal, is_finite);
}
