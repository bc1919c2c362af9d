// What is in the way of light: `Scene::unoccluded`. On the texts of surfaces, whose classes of objects it looks at.

// Transmittance of a medium, or of VACUUM.
fn transmittance_in(medium: u32, distance: f32) -> vec3f {
    if (medium == VACUUM) { return vec3f(1.0); }
    return transmittance(media[medium], distance);
}

// Boundaries that a ray goes through, at most: the renderer has no end, and no scene as many.
const MOST_WALKED: u32 = 4096u;

// Transmittance of a shadow ray through boundaries of media; zero where a surface other than that of `light`, or NONE,
// blocks it. `distance`: of the light, which may be infinite. `medium`: where the ray starts.
fn unoccluded(ray: Ray, distance: f32, medium: u32, light: u32) -> vec3f {
    // Surfaces up to a little short of the light, which may hide itself; media go on all the way.
    var reach = distance * 0.9999f;
    var left = distance;
    var way = ray;
    var around = medium;
    var through = vec3f(1.0);
    var passed = Passed(Ignored(NOTHING, NULL_BOUNDARIES), vec2u(NOTHING));
    if (!(light == NONE)) { passed.ignored.object = light_sources[light].unshadowing; }
    // What blocks it at first, then boundaries one after the other: in a loop, since compilers copy all of a search to
    // each place where there is one.
    for (var turn = 0u; turn < MOST_WALKED; turn++) {
        let hit = search(way, reach, passed, turn == 0u);
        if (turn == 0u) {
            if (!(hit.object == NOTHING)) { return vec3f(0.0); }
            if (lighting.shadow_rays_walk == 0u) { break; }
            passed.ignored = Ignored(NOTHING, VISIBLE);
        } else {
            if (hit.object == NOTHING) { break; }
            let at = surface_point(hit, way);
            through *= transmittance_in(around, at.t);
            around = medium_beyond(at, way.dir, around);
            way = spawn_ray(at, way.dir);
            reach -= at.t;
            left -= at.t;
        }
    }
    return through * transmittance_in(around, left);
}
