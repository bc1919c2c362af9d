// Photon differentials, the share of the light that a photon stands for: the renderer's `plan/footprint.rs`, exactly.

// Two tangent displacements of a photon's position, and the matching changes of its direction.
struct Footprint {
    across_a: vec3f,
    // 1: the photon has been scattered, so its light has no sharp edges.
    scattered: u32,
    across_b: vec3f,
    turn_a: vec3f,
    turn_b: vec3f,
}

fn length3(v: vec3f) -> f32 { return root(dot3(v, v)); }

// Half angle of the cone that one of `paths` photons covers, for a density of directions `pdf` per steradian.
fn spread_of(pdf: f32, paths: f32) -> f32 {
    let spread = root(quotient(1.0, 3.1415927f * pdf * paths));
    return select(0.5, spread, spread < 0.5);
}

// `dir`: unit vector.
fn round_footprint(dir: vec3f, radius: f32, spread: f32, scattered: u32) -> Footprint {
    let frame = frame_around(dir);
    return Footprint(frame.s * radius, scattered, frame.t * radius, frame.s * spread, frame.t * spread);
}

// Root mean square of the two displacements.
fn footprint_radius(f: Footprint) -> f32 {
    return root(0.5 * (dot3(f.across_a, f.across_a) + dot3(f.across_b, f.across_b)));
}

// After a free flight of length `t`.
fn footprint_advanced(f: Footprint, t: f32) -> Footprint {
    var moved = f;
    moved.across_a = f.across_a + f.turn_a * t;
    moved.across_b = f.across_b + f.turn_b * t;
    return moved;
}

// Projects a displacement across a ray onto a surface, along the ray.
fn onto_surface(across: vec3f, dir: vec3f, n: vec3f) -> vec3f {
    let cosine = dot3(dir, n);
    // It grows without bound at grazing angles; clamping the cosine to a tenth limits it.
    let bounded = select(cosine, with_sign(0.1, cosine), abs(cosine) < 0.1);
    return across - dir * quotient(dot3(across, n), bounded);
}

fn bounded_turn(turn: vec3f) -> vec3f {
    let length = length3(turn);
    if (length > 1.0) { return quotients(turn, length); }
    if (!(length == length)) { return vec3f(0.0); }
    return turn;
}

// Displacements on a surface, seen across the outgoing ray `dir`: their parts along it do not count.
fn footprint_leaving(f: Footprint, a: vec3f, b: vec3f, turn_a: vec3f, turn_b: vec3f, dir: vec3f) -> Footprint {
    return Footprint(
        a - dir * dot3(a, dir),
        f.scattered,
        b - dir * dot3(b, dir),
        bounded_turn(turn_a),
        bounded_turn(turn_b),
    );
}

fn turn_reflected(position: vec3f, turn: vec3f, dir: vec3f, n: vec3f, curvature: f32) -> vec3f {
    let dn = position * curvature;
    let change = dot3(turn, n) + dot3(dir, dn);
    return turn - (dn * dot3(dir, n) + n * change) * 2.0;
}

// After a mirror reflection; `curvature`: by how much the normal turns per unit of length.
fn footprint_reflected(f: Footprint, dir: vec3f, n: vec3f, curvature: f32) -> Footprint {
    let a = onto_surface(f.across_a, dir, n);
    let b = onto_surface(f.across_b, dir, n);
    return footprint_leaving(
        f,
        a,
        b,
        turn_reflected(a, f.turn_a, dir, n, curvature),
        turn_reflected(b, f.turn_b, dir, n, curvature),
        dir - n * (2.0 * dot3(dir, n)),
    );
}

fn turn_refracted(position: vec3f, turn: vec3f, dir: vec3f, cos_t: f32, n: vec3f, curvature: f32, eta: f32) -> vec3f {
    let cos_i = dot3(dir, n);
    let mu = eta * cos_i - cos_t;
    let dn = position * curvature;
    let change = dot3(turn, n) + dot3(dir, dn);
    let dmu = (eta - quotient(eta * eta * cos_i, cos_t)) * change;
    return turn * eta - dn * mu - n * dmu;
}

// After a refraction; `eta`: index on the incoming side over the other.
fn footprint_refracted(f: Footprint, dir: vec3f, out: vec3f, n: vec3f, curvature: f32, eta: f32) -> Footprint {
    let a = onto_surface(f.across_a, dir, n);
    let b = onto_surface(f.across_b, dir, n);
    let flips = !(dot3(dir, n) < 0.0);
    let m = select(n, -n, flips);
    let bent = select(curvature, -curvature, flips);
    let cosine = dot3(out, m);
    let cos_t = select(-0.05f, cosine, cosine < -0.05f);
    return footprint_leaving(
        f,
        a,
        b,
        turn_refracted(a, f.turn_a, dir, cos_t, m, bent, eta),
        turn_refracted(b, f.turn_b, dir, cos_t, m, bent, eta),
        out,
    );
}

// After scattering into `dir` with this density per steradian, as one of `paths` photons.
fn footprint_scattered(f: Footprint, dir: vec3f, pdf: f32, paths: f32, widely: bool) -> Footprint {
    let scattered = select(f.scattered, 1u, widely);
    return round_footprint(dir, footprint_radius(f), spread_of(pdf, paths), scattered);
}
