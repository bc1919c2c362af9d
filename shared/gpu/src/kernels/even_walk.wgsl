// Replaces `walk.wgsl` in scenes where no medium's density varies: there are no walks.

const NO_WALK: u32 = 0u;
const BY_FLIGHT: u32 = 3u;

struct Walk {
    is: u32,
    value: vec3f,
    depth: f32,
    decay: f32,
    range: vec2f,
    has_step: bool,
    scattered: bool,
    distance: f32,
}

fn no_walk() -> Walk {
    var w: Walk;
    return w;
}

fn walk_begins(
    medium: u32,
    ray_origin: vec3f,
    ray_dir: vec3f,
    length: f32,
    by_flight: bool,
    is_kept: bool,
    power: vec3f,
    s: ptr<function, Sampler>,
) -> Walk { return no_walk(); }

fn walk_on(w: ptr<function, Walk>, s: ptr<function, Sampler>) -> bool { return false; }

fn walked_transmittance(w: Walk) -> vec3f { return vec3f(1.0); }

fn varying_transmittance(medium: u32, origin: vec3f, dir: vec3f, length: f32, s: ptr<function, Sampler>) -> vec3f {
    return vec3f(1.0);
}
