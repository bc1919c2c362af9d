// Direct light at vertices of camera paths: light sampling and shadow rays.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(3) var<storage, read_write> samplers: array<Sampler>;
@group(1) @binding(4) var<storage, read_write> found: array<Found>;
@group(1) @binding(5) var<storage, read> met: array<SurfacePoint>;
@group(1) @binding(6) var<storage, read> path_vertices: array<PathVertex>;
@group(1) @binding(11) var<storage, read> asked_surfaces: array<Material>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;
// By light.
@group(1) @binding(46) var<storage, read> uses: array<Use>;

// A light sample, MIS-weighted and unoccluded, without the path's throughput and the light's pmf. `hides`: class bits
// of what the shadow ray does not see.
fn light_at(
    i: u32,
    y: PathVertex,
    chosen: LightChoice,
    direct: DirectSample,
    frame: Frame,
    hides: u32,
) -> vec3f {
    // By a followed lobe, the path also sees emission of what it passes.
    var is_sampled_alone = direct.unmet || (only_sampled_by_paths(chosen.light) && y.kind != ON_THE_WAY);
    if (y.kind == FIRST || y.kind == ON_THE_WAY) {
        is_sampled_alone |= light_sources[chosen.light].hides != 0u || hides_shape_of(hides, chosen.light);
    }
    if (y.kind == SCATTERS) {
        let value = phase_eval_directions(media[y.medium].phase, y.wo, direct.wi);
        var share = 1.0;
        if (!is_sampled_alone) { share = power_heuristic(direct.pdf * chosen.pmf, value); }
        return direct.weight * (value * share);
    }
    let m = asked_surfaces[i];
    let local_wo = to_local(frame, y.wo);
    let wi = to_local(frame, direct.wi);
    let cosine = dot3(y.ng, direct.wi);
    if (wi.z * cosine <= 0.0) { return vec3f(0.0); }
    let is_last = y.kind == LAST;
    let scattered = bsdf_scatter(m, local_wo, wi, RADIANCE, is_last, y.shadowing);
    let pdf = scattered.pdf;
    let f = scattered.value;
    if (all(f == vec3f(0.0))) { return f; }
    var share = 1.0;
    if (is_last) {
        // Photons get from here to the first surface only if nothing here depends on the viewing side.
        let cos_out = dot3(y.ng, y.wo);
        if (y.from_projected > 0.0 && !has_map(y.shadowing) && local_wo.z * cos_out > 0.0) {
            let hit = LightHit(direct.normal, direct.distance, direct.triangle);
            let density = photon_density(chosen.light, y.point, direct.wi, hit);
            let arriving = constants.in_kernel * density * abs(cosine);
            share = path_weight(quotient(arriving * pdf, abs(cos_out)), y.from_projected);
        }
    } else if (!is_sampled_alone) {
        share = power_heuristic(direct.pdf * chosen.pmf, pdf);
    }
    return f * direct.weight * (abs(wi.z) * share);
}

@compute @workgroup_size(64)
fn lit(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let y = path_vertices[i];
    if (y.kind == NO_VERTEX) { return; }
    let slot = on_way[i];
    var s = samplers[slot];
    let is_surface = y.kind < SCATTERS;
    let at = met[i];
    let side = dot3(y.ng, y.wo);
    let frame = frame_around(y.ns);
    var among = select(AIMED_AT, ALL_LIGHTS, y.kind == LAST);
    var shadow = lighting.gather_hides;
    let is_early = y.kind == FIRST || y.kind == ON_THE_WAY;
    if (is_early) {
        among = surfaces[at.object].lit_by;
        shadow = surfaces[at.object].shadow;
    }
    var faces = false;
    if (is_surface) { faces = asked_surfaces[i].kind == DIFFUSE; }
    let choice = light_choice(y.point, y.ng * with_sign(1.0, side), faces, among);
    var sum = vec3f(0.0);
    var rays = 0u;
    var next = 0u;
    loop {
        let chosen = next_light(choice, &next, &s);
        if (chosen.light == NONE) { break; }
        let direct = sample_direct(chosen.light, y.point, draw_direct(chosen.light, &s));
        if (!(direct.pdf > 0.0)) { continue; }
        var hides = shadow;
        if ((y.part & BY_GATHER_RAY) != 0u) {
            // As the light's photons would bring it from here to the first surface.
            hides = light_sources[chosen.light].photon_hides;
            let is_passed = (objects[at.object].classes & hides) != 0u;
            if (is_passed || hides_light(lights_of(y.part), chosen.light)) { continue; }
        } else if (hides_light(shadow, chosen.light)) {
            continue;
        }
        if ((y.kind == ON_THE_WAY && lighting.has_rules == 1u) || (y.part & OF_GLOSS) != 0u) {
            // As the path sees it that goes on by the same lobe and may meet the light.
            let seen = hidden_in(at.object, dot3(y.ng, direct.wi) * side < 0.0);
            if (hides_light(seen, chosen.light) || hides_shape_of(seen, chosen.light)) { continue; }
            if (y.kind == ON_THE_WAY) { hides = seen; }
        }
        let radiance = light_at(i, y, chosen, direct, frame, hides);
        if (all(radiance == vec3f(0.0))) { continue; }
        var way = RayTo(Ray(y.point, direct.wi), direct.distance);
        var across = at;
        if (is_surface) { way = ray_to(at, direct.wi, direct.distance); }
        if (!is_surface || !(dot3(y.ng, direct.wi) * side < 0.0)) { across.object = NOTHING; }
        rays += 1u;
        let by_light = select(0u, light_sources[chosen.light].hides, is_early);
        let arrived = walk_straight(
            way.ray, way.distance, y.medium, across, chosen.light, hides | by_light, true, &s,
        );
        let more = quotients(y.beta * radiance * arrived.transmittance, chosen.pmf);
        if (HAS_LIGHT_GROUPS) { found_of_group(slot, uses[chosen.light].light_group, more); }
        sum += more;
    }
    found[slot] = found_more(found[slot], y.part & OF_PART, sum);
    found[slot].rays += rays;
    samplers[slot] = s;
}
