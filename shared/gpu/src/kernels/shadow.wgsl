// What is in the way of light: `Scene::unoccluded`. On the texts of surfaces, whose classes of objects it looks at.

// Transmittance of a medium, or of VACUUM: an estimate where the density varies.
fn transmittance_in(medium: u32, ray: Ray, distance: f32, s: ptr<function, Sampler>) -> vec3f {
    if (medium == VACUUM) { return vec3f(1.0); }
    if (is_varying(medium)) { return varying_transmittance(medium, ray.origin, ray.dir, distance, s); }
    return transmittance(media[medium], distance);
}

// Turns of a walk, at most: the renderer has no end, and no scene as many boundaries.
const MOST_WALKED: u32 = 4096u;

fn no_surface(ray: Ray) -> SurfacePoint { return surface_point(Hit(0.0, NOTHING, 0u, vec2f(0.0)), ray); }

// What is looked for next: anything that blocks a shadow ray; the next surface that it may go through; the next of all
// surfaces; what lies where the boundary of a medium is.
const BLOCKED: u32 = 0u;
const BOUNDARY: u32 = 1u;
const SURFACE_OR_BOUNDARY: u32 = 2u;
const BESIDE_BOUNDARY: u32 = 3u;

// Where a ray ends that goes straight through boundaries of media.
struct Arrived {
    // The surface that it meets; NOTHING where it leaves the scene, or was to go to a light.
    at: SurfacePoint,
    distance: f32,
    // Zero where a shadow ray is blocked.
    transmittance: vec3f,
    // That it came through at last.
    medium: u32,
}

// `to_light`: as a shadow ray, `Scene::unoccluded`, at a distance which may be infinite, to a light or NONE: blocked by
// any surface but that of the light; or to the first surface.
// `across`: the surface that it starts from and crosses, coming through `medium`; of NOTHING where it crosses none.
// `hides`: objects that it passes, by bits of classes. All of it is one loop with one search and one walk through a
// medium, since compilers copy all of either to each place where there is one.
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
    // Surfaces up to a little short of the light, which may hide itself; media go on all the way.
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
            // Nothing is left between here and the light.
            let is_end = step == BLOCKED || (step == BOUNDARY && !is_met);
            at = nowhere;
            if (is_end) { at.t = left; } else { at = surface_point(hit, look.ray); }
            if (step == SURFACE_OR_BOUNDARY && is_met && is_null(at.object)) {
                // Surfaces that are something to see come before boundaries that are nothing else.
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
