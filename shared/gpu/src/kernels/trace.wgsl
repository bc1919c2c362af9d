// Photon paths: the renderer's `beam/trace.rs`. A turn is one ray, whatever it is for, and what follows from its hit:
// kernels contain a single search, and a dispatch has few enough turns for software devices.

// Parameters of a dispatch.
struct Round {
    // Path of the first state.
    first: u32,
    // Number of states.
    count: u32,
    // 0: beams and photons are counted; 1: they are written.
    writes: u32,
    // Rays per path.
    turns: u32,
    // Capacities.
    beams: u32,
    photons: u32,
    steps: u32,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(0) @binding(1) var<storage, read> trace_round: Round;
@group(1) @binding(2) var<storage, read_write> paths: array<PhotonPath>;
// States of live paths, in order.
@group(1) @binding(3) var<storage, read_write> live: array<u32>;
// By state: number of live ones before it.
@group(1) @binding(4) var<storage, read_write> live_before: array<u32>;
// By path: beams and photons that it leaves; then their prefix sums.
@group(1) @binding(5) var<storage, read_write> beam_places: array<u32>;
@group(1) @binding(6) var<storage, read_write> photon_places: array<u32>;
@group(1) @binding(7) var<storage, read_write> beams: array<Beam>;
@group(1) @binding(8) var<storage, read_write> beam_ends: array<BeamEnds>;
@group(1) @binding(9) var<storage, read_write> surface_photons: array<SurfacePhoton>;

// Statistics for the host.
struct Told {
    beams: u32,
    photons: u32,
    unfinished: u32,
    steps: u32,
}

@group(1) @binding(10) var<storage, read> live_count: array<u32>;
@group(1) @binding(11) var<storage, read> all_beams: array<u32>;
@group(1) @binding(12) var<storage, read> all_photons: array<u32>;
@group(1) @binding(13) var<storage, read_write> beam_count: array<u32>;
@group(1) @binding(14) var<storage, read_write> photon_count: array<u32>;
@group(1) @binding(15) var<storage, read_write> told: Told;

fn clamped_radius(radius: f32, ceiling: f32) -> f32 {
    let least = select(radius, trace_plan.floor, radius < trace_plan.floor);
    return select(least, ceiling, least > ceiling);
}

fn ceiling_of(f: Footprint) -> f32 { return select(trace_plan.ceiling, trace_plan.smooth_ceiling, f.scattered == 1u); }

// Kernel radius of a beam.
fn beam_radius(f: Footprint, medium: u32) -> f32 {
    let radius = clamped_radius(footprint_radius(f) * 1.5, ceiling_of(f));
    let widest = select(traced_media[medium].widest_sharp, traced_media[medium].widest_smooth, f.scattered == 1u);
    return select(widest, radius, radius < widest) * trace_plan.radius_scale;
}

// Kernel radius of a surface photon, before edges narrow it.
fn photon_radius(f: Footprint, object: u32) -> f32 {
    let overlap = select(3.0, 7.5, f.scattered == 1u);
    let radius = clamped_radius(footprint_radius(f) * trace_plan.surface_footprint * overlap, ceiling_of(f));
    let widest = traced_objects[object].widest;
    return select(widest, radius, radius < widest) * trace_plan.surface_scale;
}

// How far beyond a surface some of a beam's width reaches, if it meets the surface at this cosine. Bounded for grazing
// angles, and so that the cone keeps half of its radius.
fn overhang(cosine: f32, radius: f32, slope: f32) -> f32 {
    let size = abs(cosine);
    let c = select(0.05f, size, size > 0.05f);
    let length = quotient(radius * root(not_below_zero(1.0 - c * c)), c);
    var limit = of_bits(INFINITY);
    if (!(slope == 0.0)) { limit = quotient(0.5 * radius, abs(slope)); }
    return smaller(smaller(length, 4.0 * radius), limit);
}

// ENDS_ON_SURFACE or ENDS_ON_BOUNDARY, for a ray that leaves an object.
fn surface_end(object: u32) -> u32 {
    let is_wall = (objects[object].classes & NO_WALL) == 0u;
    if (is_wall || surfaces[object].interior == NONE) { return ENDS_ON_SURFACE; }
    return ENDS_ON_BOUNDARY;
}

// Whether the camera may see something within a radius of a line segment. False is certain.
fn is_in_view(a: vec3f, b: vec3f, radius: f32) -> bool {
    let size_a = abs(a);
    let size_b = abs(b);
    let room_a = radius + 1e-4f * (size_a.x + size_a.y + size_a.z);
    let room_b = radius + 1e-4f * (size_b.x + size_b.y + size_b.z);
    for (var i = 0u; i < 5u; i++) {
        let plane = trace_plan.view[i];
        let is_behind = dot3(plane.xyz, a) + plane.w < -room_a && dot3(plane.xyz, b) + plane.w < -room_b;
        if (is_behind) { return false; }
    }
    return true;
}

// Whether the photon leaves a beam in its medium.
fn leaves_beam(p: ptr<function, PhotonPath>, path: u32) -> bool {
    let flags = traced_media[(*p).medium].flags;
    let is_by_beams = (flags & IS_BY_BEAMS) != 0u;
    // In a homogeneous medium, camera paths sample direct light.
    var counts = is_by_beams && (!((*p).arrival == ARRIVED_DIRECT) || is_varying((*p).medium));
    if ((*p).arrival == ARRIVED_CAUSTIC && (traced_lights[(*p).light].bits & BRINGS_CAUSTICS) != 0u) { counts = true; }
    if ((*p).arrival == ARRIVED_SCATTERED) { counts = true; }
    // Rules may keep the light off the medium.
    counts &= (traced_media[(*p).medium].hides & traced_lights[(*p).light].class_bit) == 0u;
    return counts && (flags & SCATTERS) != 0u && path < trace_plan.beam_paths;
}

// In a medium of varying density: the walk along the photon's beam, whose steps are stored, or its flight.
fn walked(p: ptr<function, PhotonPath>, path: u32, s: ptr<function, Sampler>) -> Walk {
    if (!((*p).step == ARRIVE || (*p).step == TRAVEL) || (*p).medium == VACUUM) { return no_walk(); }
    if (!is_varying((*p).medium)) { return no_walk(); }
    let of_beam = (*p).step == ARRIVE && leaves_beam(p, path);
    var walk = walk_begins((*p).medium, (*p).origin, (*p).dir, (*p).at.t, !of_beam, of_beam, (*p).power, s);
    // The ray misses the medium's box: the walk has already ended.
    if (walk.is == NO_WALK) {
        if (!of_beam) { walk.is = BY_FLIGHT; }
        return walk;
    }
    let first = (*p).steps;
    loop {
        let more = walk_on(&walk, s);
        if (of_beam && walk.has_step) {
            keep_step((*p).steps, walk);
            (*p).steps += 1u;
        }
        if (!more) { break; }
    }
    if (of_beam) {
        var end = walk.range.y;
        if (all(walk.value == vec3f(0.0))) { end = walk.distance; }
        (*p).near = vec4u(first, (*p).steps - first, bitcast<u32>(walk.range.x), bitcast<u32>(end));
    }
    return walk;
}

// The photon's ray is about to cross a medium, up to its hit.
fn arrive(p: ptr<function, PhotonPath>, path: u32, walk: Walk) {
    if ((*p).medium == VACUUM) {
        (*p).step = MEET;
        return;
    }
    (*p).step = TRAVEL;
    if (!leaves_beam(p, path)) { return; }
    // Kernels of unscattered light are narrow.
    var may_be_beside = (*p).footprint.scattered == 1u;
    if (VARIES) {
        if (is_varying((*p).medium)) {
            if (walk.is == NO_WALK) { return; }
            may_be_beside = may_be_beside && walk.range.x == 0.0;
        }
    }
    (*p).trials = trials_of(beam_radius((*p).footprint, (*p).medium));
    (*p).step = select(LEAVE_BEAM, TRY_BEAM, may_be_beside);
}

// Leaves a beam over the visible part of the photon's way to its hit.
fn leave_beam(p: ptr<function, PhotonPath>) {
    (*p).step = TRAVEL;
    let medium = traced_media[(*p).medium];
    var length = smaller((*p).at.t, medium.reach);
    // Where it enters the medium's box.
    var start_of_box = 0.0;
    if (VARIES) {
        if (is_varying((*p).medium)) {
            start_of_box = bitcast<f32>((*p).near.z);
            length = bitcast<f32>((*p).near.w);
        }
    }
    let radius = (*p).trials.radius;
    let radius_end = beam_radius(footprint_advanced((*p).footprint, length), (*p).medium);
    let slope = quotient(radius_end - radius, length);
    var ends = BeamEnds((*p).start, (*p).start_is, vec3f(0.0), ENDS_NOWHERE);
    var extents = vec2f(0.0, length);
    if (start_of_box > 0.0) {
        // All of its width enters there.
        ends.start_is = ENDS_NOWHERE;
        extents.x = start_of_box - smaller(start_of_box, 2.0 * radius);
    } else if (!(ends.start_is == ENDS_NOWHERE)) {
        extents.x = 0.0 - overhang(dot3((*p).dir, ends.start), radius, slope);
    }
    if (!((*p).at.object == NOTHING) && length == (*p).at.t) {
        ends.end = (*p).at.ng;
        ends.end_is = surface_end((*p).at.object);
        extents.y = length + overhang(dot3((*p).dir, ends.end), radius_end, slope);
    }
    // In other media, camera paths go on from their vertices and may gather beams anywhere.
    if (trace_plan.has_view == 1u && (medium.flags & IS_BY_BEAMS) != 0u) {
        let widest = larger(radius + slope * extents.x, radius + slope * extents.y);
        let start = (*p).origin + (*p).dir * extents.x;
        if (!is_in_view(start, (*p).origin + (*p).dir * extents.y, widest)) { return; }
    }
    if ((trace_plan.keeps & KEEPS_BEAMS) == 0u) { return; }
    let place = (*p).beams;
    (*p).beams += 1u;
    if (trace_round.writes == 0u || place >= trace_round.beams) { return; }
    let share = quotient((*p).trials.factor * f32(trace_plan.paths), f32(trace_plan.beam_paths));
    let light_group = traced_lights[(*p).light].light_group;
    let bits = (*p).medium | ((*p).wave << WAVE_BITS) | (light_group << LIGHT_GROUP_BITS);
    beams[place] = Beam((*p).origin, radius, (*p).dir, slope, (*p).power * share, length, extents, bits, 0u);
    beam_ends[place] = ends;
    if (VARIES) {
        if (is_varying((*p).medium)) { keep_function(place, (*p).near.x, (*p).near.y); }
    }
}

// Flies through the medium: the photon is scattered, or reaches its hit.
fn travel(p: ptr<function, PhotonPath>, s: ptr<function, Sampler>, walk: Walk) {
    let medium = media[(*p).medium];
    let is_by_beams = (traced_media[(*p).medium].flags & IS_BY_BEAMS) != 0u;
    let before = mean_of((*p).power);
    var flight: Flight;
    if (is_varying((*p).medium)) {
        // The walk was along a beam: the flight is still to come.
        if (!(walk.is == BY_FLIGHT)) { return; }
        flight = Flight(walk.value, walk.distance, u32(walk.scattered));
    } else {
        flight = sample_flight(medium, (*p).power, (*p).at.t, next_2d(s));
    }
    (*p).power *= flight.weight;
    (*p).step = MEET;
    if (flight.scattered == 0u) { return; }
    let point = (*p).origin + (*p).dir * flight.distance;
    let worth = far_worth(p, point);
    (*p).step = ENDED;
    if (!is_by_beams && trace_plan.goes_on == 0u) { return; }
    if (!path_survives(p, s, quotient(before, worth))) { return; }
    let old = (*p).dir;
    let dir = phase_sample(medium.phase, old, next_2d(s));
    let pdf = phase_eval(medium.phase, dot3(old, dir));
    let flown = footprint_advanced((*p).footprint, flight.distance);
    (*p).footprint = footprint_scattered(flown, dir, pdf, trace_plan.kernel_paths, true);
    (*p).origin = point;
    (*p).dir = dir;
    (*p).hides = traced_media[(*p).medium].hides;
    (*p).start_is = ENDS_NOWHERE;
    // Camera paths find what other media send on.
    (*p).arrival = select(ARRIVED_SURFACE, ARRIVED_SCATTERED, is_by_beams);
    (*p).found_by = select(BY_PATHS, BY_PHOTONS, is_by_beams);
    (*p).flown = 0.0;
    (*p).is_pure = 0u;
    (*p).is_sharp = 0u;
    (*p).step = FLY;
}

// Lobes of the hit surface that are to see the photon; none if it is not to be stored. In a blend, camera paths choose
// the part that sees it.
fn seen_by(p: PhotonPath) -> u32 {
    let object = traced_objects[p.at.object].bits;
    let light = traced_lights[p.light].bits;
    let brings = (light & BRINGS_CAUSTICS) != 0u;
    var by_wide = false;
    switch p.arrival {
        case ARRIVED_CAUSTIC: { by_wide = brings; }
        case ARRIVED_SCATTERED: { by_wide = true; }
        case ARRIVED_SURFACE: { by_wide = trace_plan.ends_paths > 0u; }
        default: {}
    }
    by_wide &= (object & IS_WIDE) != 0u;
    // After a rough lobe, camera paths look for the light from there.
    let by_followed = p.arrival == ARRIVED_CAUSTIC && p.is_sharp == 1u && (light & IS_UNMET) != 0u
        && (object & IS_FOLLOWED) != 0u;
    return select(0u, SEEN_BY_WIDE_LOBES, by_wide) | select(0u, SEEN_BY_FOLLOWED_LOBES, by_followed);
}

// The photon reaches its hit.
fn meet(p: ptr<function, PhotonPath>, s: ptr<function, Sampler>) {
    (*p).step = ENDED;
    let object = (*p).at.object;
    if (object == NOTHING) { return; }
    (*p).footprint = footprint_advanced((*p).footprint, (*p).at.t);
    (*p).flown += (*p).at.t;
    (*p).material = met_material(surfaces[object].material, (*p).at, s);
    if ((*p).material == PASSED) {
        leave_surface(p, (*p).dir, true);
        return;
    }
    if (DISPERSES) {
        if (trace_plan.waves > 0u && (*p).wave == 0u && row_of((*p).material) > 0u) {
            (*p).wave = wave_by(next_1d(s), trace_plan.waves);
        }
    }
    if (seen_by(*p) != 0u) {
        (*p).trials = trials_of(photon_radius((*p).footprint, object));
        (*p).step = LOOK_DOWN;
    } else {
        (*p).step = SCATTER;
    }
}

// Stores a surface photon. Walls near it are later looked for at its height.
fn leave_photon(p: ptr<function, PhotonPath>) {
    (*p).step = SCATTER;
    if ((trace_plan.keeps & KEEPS_PHOTONS) == 0u) { return; }
    let place = (*p).photons;
    (*p).photons += 1u;
    if (trace_round.writes == 0u || place >= trace_round.photons) { return; }
    // Camera paths do not end after so short a flight: they go on.
    let is_near = !((*p).arrival == ARRIVED_CAUSTIC) && (*p).flown < trace_plan.least_flight;
    let light = traced_lights[(*p).light].class_bit;
    var found_by = select((*p).found_by, BY_PATHS, !((*p).found_by == BY_PHOTONS) && is_near);
    if ((traced_objects[(*p).at.object].hides & light) != 0u) { found_by = BY_PATHS_BY_RULE; }
    surface_photons[place] = SurfacePhoton(
        (*p).at.point,
        (*p).trials.narrower,
        (*p).at.ng,
        select(0.0, (*p).expected, found_by == BY_BOTH),
        -(*p).dir,
        (*p).arrival | seen_by(*p) | ((*p).wave << WAVE_OF_PHOTON)
            | (traced_lights[(*p).light].light_group << LIGHT_GROUP_OF_PHOTON),
        (*p).power * (*p).trials.factor,
        found_by | light,
        vec3f(0.0),
        kernel_height((*p).at, (*p).trials.narrower),
    );
}

// Correction for interpolated normals (Veach 1997, section 5.3). Zero if shading and geometric normal disagree about
// the side.
fn adjoint_factor(ng: vec3f, ns: vec3f, wo: vec3f, wi: vec3f) -> f32 {
    let wo_g = dot3(wo, ng);
    let wo_s = dot3(wo, ns);
    let wi_g = dot3(wi, ng);
    let wi_s = dot3(wi, ns);
    if (wo_g * wo_s <= 0.0 || wi_g * wi_s <= 0.0) { return 0.0; }
    return abs(quotient(wo_s * wi_g, wo_g * wi_s));
}

// Expected photons of the light that this one brings to a surface, before the pdf of its next direction.
fn expected_photons(p: PhotonPath) -> f32 {
    // After more than one bounce, their density is unknown.
    if (!(p.arrival == ARRIVED_DIRECT)) { return 1.0; }
    let wo = -p.dir;
    let density = photon_density(p.light, p.at.point, wo, LightHit(p.emitted_normal, p.flown, p.emitted_triangle));
    return trace_plan.in_kernel * density * abs(dot3(wo, p.at.ng));
}

// Goes on from a surface in a sampled direction.
fn scatter(p: ptr<function, PhotonPath>, s: ptr<function, Sampler>) {
    (*p).step = ENDED;
    let at = (*p).at;
    let dir = (*p).dir;
    var met = bsdf_at((*p).material, at, dir);
    if (DISPERSES) {
        let row = row_of((*p).material);
        if ((*p).wave > 0u && row > 0u) {
            met.material = bending(met.material, trace_plan.etas[row - 1u][(*p).wave - 1u]);
        }
    }
    let ns = met.frame.n;
    let before = mean_of((*p).power);
    let lobe = narrow_or_wide(met.material, met.local_wo, next_1d(s));
    if (lobe.p < 1.0) { (*p).power = quotients((*p).power, lobe.p); }
    let sample = bsdf_sample(lobe.material, met.local_wo, lobe.u, next_2d(s), FLUX, met.shadowing);
    if (sample.flags == 0u) { return; }
    let is_delta = (sample.flags & DELTA) != 0u;
    let is_followed = is_delta || lobe.is_followed;
    if (!is_followed && trace_plan.goes_on == 0u) { return; }
    let wi = unit_vector(to_world(met.frame, sample.wi));
    (*p).power *= sample.weight * adjoint_factor(at.ng, ns, met.wo, wi);
    if (!path_survives(p, s, before)) { return; }
    let is_transmitted = (sample.flags & TRANSMITTED) != 0u;
    if (!is_delta) {
        (*p).footprint = footprint_scattered((*p).footprint, wi, sample.pdf, trace_plan.kernel_paths, !is_followed);
    } else if (is_transmitted) {
        var eta = 1.0;
        if (bends(met.material)) { eta = met.material.eta.x; }
        if (!(dot3(at.ng, dir) > 0.0)) { eta = quotient(1.0, eta); }
        (*p).footprint = footprint_refracted((*p).footprint, dir, wi, ns, at.curvature, eta);
    } else {
        (*p).footprint = footprint_reflected((*p).footprint, dir, ns, at.curvature);
    }
    if (!is_delta) { (*p).is_sharp = 0u; }
    if (is_followed || (traced_objects[at.object].bits & IS_NOT_GATHERED) != 0u) {
        (*p).found_by = BY_PHOTONS;
        if ((*p).is_pure == 1u) {
            (*p).found_by = (*p).caustic_by;
            (*p).expected = (*p).caustic_expected;
        }
    } else {
        (*p).found_by = BY_PATHS;
        // Mapped normals depend on the viewing side, and camera paths go on from gloss: both are left to paths.
        let ends = trace_plan.ends_paths;
        let ends_here = ends == ENDS_PATHS_AT_SECOND || (ends > 0u && !is_glossy(lobe.material));
        if (ends_here && !has_map(met.shadowing)) {
            (*p).found_by = BY_BOTH;
            (*p).expected = quotient(expected_photons(*p) * sample.pdf, abs(dot3(wi, at.ng)));
        }
    }
    if (!is_followed) {
        (*p).arrival = ARRIVED_SURFACE;
        (*p).is_pure = 0u;
    } else if ((*p).arrival == ARRIVED_DIRECT || ((*p).arrival == ARRIVED_SURFACE && trace_plan.goes_on == 1u)) {
        (*p).arrival = ARRIVED_CAUSTIC;
    }
    (*p).hides = traced_objects[at.object].hides;
    (*p).flown = 0.0;
    leave_surface(p, wi, is_transmitted);
}

// Starts a ray off the hit surface; if it crosses that, in the medium beyond.
fn leave_surface(p: ptr<function, PhotonPath>, dir: vec3f, crosses: bool) {
    let at = (*p).at;
    let ray = spawn_ray(at, dir);
    (*p).origin = ray.origin;
    (*p).dir = dir;
    (*p).start = at.ng;
    (*p).start_is = surface_end(at.object);
    (*p).step = FLY;
    if (!crosses) { return; }
    if (trace_plan.has_boundaries == 0u) {
        (*p).medium = medium_towards(surfaces[at.object], at.ng, dir, (*p).medium);
        return;
    }
    (*p).near = vec4u(NONE);
    (*p).far = vec4u(NONE);
    (*p).others = vec2u(NOTHING);
    (*p).crossed = 0u;
    cross_boundary(p, at.object, at.ng);
}

// Adds a coincident boundary; at most four are looked for.
fn cross_boundary(p: ptr<function, PhotonPath>, object: u32, ng: vec3f) {
    let i = (*p).crossed;
    // Not every driver writes vector components by dynamic index.
    let here = vec4u(i) == vec4u(0u, 1u, 2u, 3u);
    (*p).near = select((*p).near, vec4u(medium_towards(surfaces[object], ng, -(*p).dir, NONE)), here);
    (*p).far = select((*p).far, vec4u(medium_towards(surfaces[object], ng, (*p).dir, NONE)), here);
    if (i == 1u) { (*p).others.x = object; }
    if (i == 2u) { (*p).others.y = object; }
    (*p).crossed = i + 1u;
    (*p).step = CROSS;
    if (i == 3u) { follow_boundaries(p); }
}

// Once all coincident boundaries are known.
fn follow_boundaries(p: ptr<function, PhotonPath>) {
    let at = (*p).at;
    let beyond = medium_towards(surfaces[at.object], at.ng, (*p).dir, (*p).medium);
    (*p).medium = medium_across(is_null(at.object), beyond, (*p).medium, (*p).near, (*p).far);
    (*p).step = FLY;
}

// Ray query of the current step.
fn query_of(p: ptr<function, PhotonPath>, s: ptr<function, Sampler>) -> Query {
    let ray = Ray((*p).origin, (*p).dir);
    switch (*p).step {
        case LOOK_ACROSS: {
            let across = probe((*p).at, (*p).dir);
            return query_past(across.ray, across.distance, NULL_BOUNDARIES, false);
        }
        case CROSS: {
            let across = probe((*p).at, (*p).dir);
            let passed = Passed(Ignored((*p).at.object, VISIBLE), (*p).others);
            return Query(across.ray, across.distance, passed, false);
        }
        case TRY_BEAM: {
            return query_of_beam(ray, (*p).start, !((*p).start_is == ENDS_NOWHERE), (*p).trials.radius, s);
        }
        case LOOK_DOWN: {
            var trials = (*p).trials;
            let query = query_down((*p).at, towards_origin((*p).at, (*p).dir), &trials, s);
            (*p).trials = trials;
            return query;
        }
        case LOOK_BETWEEN: {
            return query_walls((*p).at, towards_origin((*p).at, (*p).dir), (*p).trials);
        }
        default: { return query_past(ray, of_bits(INFINITY), 0u, false); }
    }
}

// Whether the trial decides: no further one is needed.
fn is_last(p: ptr<function, PhotonPath>, is_there: bool, halves: bool) -> bool {
    var trials = (*p).trials;
    let result = is_last_trial(&trials, is_there, halves);
    (*p).trials = trials;
    return result;
}

// Traces a ray of a path, and goes on until it needs another.
fn turn(p: ptr<function, PhotonPath>, s: ptr<function, Sampler>, path: u32) {
    var query = query_of(p, s);
    // Photons pass what rules hide from them; coincident boundaries are crossed all the same.
    if (!((*p).step == CROSS)) { query.passed.ignored.classes |= (*p).hides; }
    let hit = search(query.ray, query.t_max, query.passed, query.first_only);
    var found = surface_point(hit, query.ray);
    let is_free = found.object == NOTHING;
    switch (*p).step {
        case FLY: {
            (*p).at = found;
            (*p).step = ARRIVE;
            if (trace_plan.has_boundaries == 1u && !is_free) {
                if (is_null(found.object)) { (*p).step = LOOK_ACROSS; }
            }
        }
        case LOOK_ACROSS: {
            found.t = (*p).at.t;
            if (!is_free) { (*p).at = found; }
            (*p).step = ARRIVE;
        }
        case TRY_BEAM: {
            if (is_last(p, is_free, false)) { (*p).step = LEAVE_BEAM; }
        }
        case LOOK_DOWN: {
            (*p).step = LOOK_BETWEEN;
            if (!is_like((*p).at, towards_origin((*p).at, (*p).dir), (*p).trials, found)) {
                (*p).step = select(LOOK_DOWN, LEAVE_PHOTON, is_last(p, false, true));
            }
        }
        case LOOK_BETWEEN: {
            (*p).step = select(LOOK_DOWN, LEAVE_PHOTON, is_last(p, is_free, true));
        }
        case CROSS: {
            if (is_free) { follow_boundaries(p); } else { cross_boundary(p, found.object, found.ng); }
        }
        default: {}
    }
    for (var k = 0u; k < MOST_WALKS; k++) {
        var walk = no_walk();
        if (VARIES) { walk = walked(p, path, s); }
        if ((*p).step == ARRIVE) { arrive(p, path, walk); }
        if ((*p).step == LEAVE_BEAM) { leave_beam(p); }
        if ((*p).step == TRAVEL) { travel(p, s, walk); }
    }
    if ((*p).step == MEET) { meet(p, s); }
    if ((*p).step == LEAVE_PHOTON) { leave_photon(p); }
    if ((*p).step == SCATTER) { scatter(p, s); }
    if ((*p).step == FLY && !any((*p).power > vec3f(0.0))) { (*p).step = ENDED; }
}

@compute @workgroup_size(64)
fn begin(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= trace_round.count) { return; }
    let path = trace_round.first + i;
    var p = started_path(path);
    if (trace_round.writes == 1u) {
        p.beams = beam_places[path];
        p.photons = photon_places[path];
        p.steps = first_step(path);
    }
    paths[i] = p;
    live[i] = i;
}

@compute @workgroup_size(64)
fn advance(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let state = live[i];
    if (paths[state].step == ENDED) { return; }
    let path = trace_round.first + state;
    var p = paths[state];
    var s = path_sampler(path, p);
    for (var k = 0u; k < trace_round.turns; k++) {
        if (p.step == ENDED) { break; }
        turn(&p, &s, path);
    }
    p.state = s.state;
    p.square = s.square;
    paths[state] = p;
}

// 1 for each live path.
@compute @workgroup_size(64)
fn look_for_live(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i < trace_round.count) { live_before[i] = u32(!(paths[i].step == ENDED)); }
}

// Runs after their prefix sum.
@compute @workgroup_size(64)
fn list_live(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i < trace_round.count && !(paths[i].step == ENDED)) { live[live_before[i]] = i; }
}

// Stores how much each path leaves, once all have ended.
@compute @workgroup_size(64)
fn count_left(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= trace_round.count) { return; }
    beam_places[trace_round.first + i] = paths[i].beams;
    photon_places[trace_round.first + i] = paths[i].photons;
    leave_steps(trace_round.first + i, paths[i].steps);
}

// Runs after each batch.
@compute @workgroup_size(1)
fn tell_live() {
    var before = told.unfinished;
    if (trace_round.first == 0u) { before = 0u; }
    told.unfinished = before + live_count[0];
}

// Runs at the end: how many there are, and how many are stored.
@compute @workgroup_size(1)
fn tell() {
    told.beams = all_beams[0];
    told.photons = all_photons[0];
    told.steps = told_steps();
    beam_count[0] = min(all_beams[0], trace_round.beams);
    photon_count[0] = min(all_photons[0], trace_round.photons);
}
