// Rays and round shapes, whose own spaces keep distances along a ray as they are in render space.

struct OwnRay { origin: vec3f, dir: vec3f }

fn own_ray(object: u32, origin: vec3f, dir: vec3f) -> OwnRay {
    let x = objects[object].x_axis;
    let y = objects[object].y_axis;
    let z = objects[object].z_axis;
    return OwnRay(
        x * origin.x + y * origin.y + z * origin.z + objects[object].translation,
        x * dir.x + y * dir.y + z * dir.z,
    );
}

// Two distances, nearer first; NaN if there are none.
fn crossings(a: f32, b: f32, c: f32, discriminant: f32) -> vec2f {
    let r = root(a * discriminant);
    let q = select(b - r, b + r, b >= 0.0);
    if (q == 0.0) { return vec2f(0.0); }
    let t0 = quotient(c, q);
    let t1 = quotient(q, a);
    return select(vec2f(t1, t0), vec2f(t0, t1), t0 < t1);
}

// A hit in (0, t_max), or t_max; on a disc, its x and y.
struct RoundHit { t: f32, uv: vec2f }

// Without cancellation (Haines, Günther, Akenine-Möller 2019, Precision improvements for ray/sphere intersection).
fn sphere_hit(ray: OwnRay, t_max: f32) -> RoundHit {
    let none = RoundHit(t_max, vec2f(0.0));
    let a = dot3(ray.dir, ray.dir);
    let b = -dot3(ray.origin, ray.dir);
    let nearest = ray.origin + ray.dir * quotient(b, a);
    let discriminant = 1.0 - dot3(nearest, nearest);
    if (discriminant < 0.0) { return none; }
    let both = crossings(a, b, dot3(ray.origin, ray.origin) - 1.0, discriminant);
    let t = select(both.y, both.x, both.x > 0.0);
    if (t > 0.0 && t < t_max) { return RoundHit(t, vec2f(0.0)); }
    return none;
}


// The same for the cylinder's circle, across its axis; the first crossing between its ends counts.
fn cylinder_hit(ray: OwnRay, t_max: f32) -> RoundHit {
    let none = RoundHit(t_max, vec2f(0.0));
    let o = ray.origin.xy;
    let d = ray.dir.xy;
    let a = dot2(d, d);
    if (a == 0.0) { return none; }
    let b = -dot2(o, d);
    let nearest = o + d * quotient(b, a);
    let discriminant = 1.0 - dot2(nearest, nearest);
    if (!(discriminant >= 0.0)) { return none; }
    let both = crossings(a, b, dot2(o, o) - 1.0, discriminant);
    for (var i = 0u; i < 2u; i++) {
        let t = both[i];
        let z = ray.origin.z + ray.dir.z * t;
        if (t > 0.0 && t < t_max && z >= 0.0 && z <= 1.0) { return RoundHit(t, vec2f(0.0)); }
    }
    return none;
}

fn disc_hit(ray: OwnRay, t_max: f32) -> RoundHit {
    if (ray.dir.z == 0.0) { return RoundHit(t_max, vec2f(0.0)); }
    let t = quotient(-ray.origin.z, ray.dir.z);
    let p = ray.origin.xy + ray.dir.xy * t;
    if (t > 0.0 && t < t_max && dot2(p, p) <= 1.0) { return RoundHit(t, p); }
    return RoundHit(t_max, vec2f(0.0));
}

fn round_hit(object: u32, ray: OwnRay, t_max: f32) -> RoundHit {
    switch objects[object].shape {
        case SPHERE: { return sphere_hit(ray, t_max); }
        case DISC: { return disc_hit(ray, t_max); }
        default: { return cylinder_hit(ray, t_max); }
    }
}
