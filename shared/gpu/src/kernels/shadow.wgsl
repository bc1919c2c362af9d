// What is in the way of light: the renderer's `Scene::unoccluded`. Goes after `surface.wgsl` and `interaction.wgsl`.

// Transmittance of a medium or VACUUM; an estimate if the density varies.
fn transmittance_in(medium: u32, ray: Ray, distance: f32, s: ptr<function, Sampler>) -> vec3f {
    if (medium == VACUUM) { return vec3f(1.0); }
    if (is_varying(medium)) { return varying_transmittance(medium, ray.origin, ray.dir, distance, s); }
    return transmittance(media[medium], distance);
}

// Most turns of a walk. The renderer has no limit, but no scene has as many boundaries.
const MOST_WALKED: u32 = 4096u;

fn no_surface(ray: Ray) -> SurfacePoint { return surface_point(Hit(0.0, NOTHING, 0u, vec2f(0.0)), ray); }

// What is looked for next: anything that blocks a shadow ray; the next surface that it may pass; the next of all
// surfaces; what coincides with a medium boundary.
const BLOCKED: u32 = 0u;
const BOUNDARY: u32 = 1u;
const SURFACE_OR_BOUNDARY: u32 = 2u;
const BESIDE_BOUNDARY: u32 = 3u;

// Where a ray ends that goes straight through medium boundaries.
struct Arrived {
    // Surface hit; NOTHING if the ray leaves the scene or was sent to a light.
    at: SurfacePoint,
    distance: f32,
    // Zero if a shadow ray is blocked.
    transmittance: vec3f,
    // Last medium that it came through.
    medium: u32,
}

// `to_light`: a shadow ray over `distance`, which may be infinite, to a light or NONE: any surface but the light's
// blocks it. Otherwise, the ray goes to the first surface.
// `across`: surface that it starts on and crosses, coming through `medium`; of NOTHING if it crosses none.
// `hides`: class bits of objects that it passes. One loop with one search and one walk through a medium, since
// compilers inline each call.
fn walk_straight(
    ray: Ray,
    distance: f32,
    medium: u32,
    across: SurfacePoint,
    light: u32,
    hides: u32,
    to_light: bool,
    s: ptr<function, Sampler>,
) -> Arrived {
    var way = ray;
    // Surfaces up to a little short of the light, which may hide itself; media all the way.
    var look = RayTo(ray, select(of_bits(INFINITY), distance * 0.9999f, to_light));
    var left = distance;
    var step = SURFACE_OR_BOUNDARY;
    var passed = Passed(Ignored(NOTHING, hides), vec2u(NOTHING));
    if (to_light) {
        step = BLOCKED;
        passed.ignored.classes = PASSABLE | hides;
        if (!(light == NONE)) { passed.ignored.object = light_sources[light].unshadowing; }
    }
    let nowhere = no_surface(ray);
    var arrived = Arrived(nowhere, 0.0, vec3f(1.0), medium);
    var starts = !(across.object == NOTHING);
    for (var turn = 0u; turn < MOST_WALKED; turn++) {
        var at = across;
        if (!starts) {
            let hit = search(look.ray, look.distance, passed, step == BLOCKED);
            let is_met = !(hit.object == NOTHING);
            if (step == BLOCKED) {
                if (is_met) {
                    arrived.transmittance = vec3f(0.0);
                    break;
                }
                if (!(lighting.shadow_rays_walk == 0u)) {
                    step = BOUNDARY;
                    passed.ignored = Ignored(NOTHING, OPAQUE | hides);
                    continue;
                }
            }
            // Nothing is left before the light.
            let is_end = step == BLOCKED || (step == BOUNDARY && !is_met);
            at = nowhere;
            if (is_end) { at.t = left; } else { at = surface_point(hit, look.ray); }
            if (step == SURFACE_OR_BOUNDARY && is_met && is_null(at.object)) {
                // Visible surfaces come before pure medium boundaries.
                arrived.at = at;
                step = BESIDE_BOUNDARY;
                look = probe(at, way.dir);
                passed.ignored.classes = NULL_BOUNDARIES | hides;
                continue;
            }
            if (step == BESIDE_BOUNDARY) {
                step = SURFACE_OR_BOUNDARY;
                passed.ignored.classes = hides;
                at.t = arrived.at.t;
                if (!is_met) { at = arrived.at; }
            }
            if (step == BOUNDARY && !is_end) {
                arrived.transmittance *= transparency(surfaces[at.object].material, at);
                if (all(arrived.transmittance == vec3f(0.0))) { break; }
            }
            arrived.transmittance *= transmittance_in(arrived.medium, way, at.t, s);
            if (is_end) { break; }
            arrived.distance += at.t;
            if (step == SURFACE_OR_BOUNDARY) {
                arrived.at = at;
                if (at.object == NOTHING) { break; }
                if (met_material(surfaces[at.object].material, at, s) != PASSED) { break; }
            }
        }
        arrived.medium = medium_beyond(at, way.dir, arrived.medium);
        if (starts) {
            starts = false;
            continue;
        }
        way = spawn_ray(at, way.dir);
        look = RayTo(way, look.distance - at.t);
        if (step == SURFACE_OR_BOUNDARY) { look.distance = of_bits(INFINITY); }
        left -= at.t;
    }
    return arrived;
}
