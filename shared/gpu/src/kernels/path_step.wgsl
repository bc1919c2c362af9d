// Advances a camera path to its ray's hit: through the medium before it, by the light that it meets, and by the
// surface's BSDF. Later kernels answer what it asks for. Follows `beamfarm_render::cpu::transport` term by term, but
// chance picks between going on and starting a walk, where processors do both.
//
// Where a path splits, at smooth glass and smooth coats, one branch waits until the other has ended.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> on_way: array<u32>;
@group(1) @binding(2) var<storage, read_write> paths: array<Path>;
@group(1) @binding(3) var<storage, read_write> samplers: array<Sampler>;
@group(1) @binding(4) var<storage, read_write> found: array<Found>;
@group(1) @binding(5) var<storage, read> met: array<SurfacePoint>;
@group(1) @binding(6) var<storage, read_write> path_vertices: array<PathVertex>;
@group(1) @binding(7) var<storage, read_write> segments: array<PathSegment>;
@group(1) @binding(8) var<storage, read_write> tails: array<Tail>;
@group(1) @binding(9) var<storage, read_write> requests: array<PhotonRequest>;
// Waiting branches: the first of each slot, then the second of each, and so on.
@group(1) @binding(10) var<storage, read_write> branches: array<Branch>;
// By vertex: the surface's lobes that ask for light.
@group(1) @binding(11) var<storage, read_write> asked_surfaces: array<Material>;
@group(1) @binding(45) var<storage, read> constants: PassConstants;
// By light, then by medium.
@group(1) @binding(46) var<storage, read> uses: array<Use>;

// Bounces from which on purely specular paths face Russian roulette.
const DEPTH_OF_DELTAS: u32 = 24u;
// Bounces from which on survival is at most MOST_TRAPPED.
const TRAPPED_DEPTH: u32 = 1024u;
const MOST_TRAPPED: f32 = 0.999f;
// Survival probability over throughput.
const ROULETTE_FACTOR: f32 = 2.0;
// Throughput from which on a path always goes on from its first surface.
const SURE_THROUGHPUT: f32 = 0.5;
// Whether camera paths split anywhere in the scene.
const MAY_SPLIT: bool = HAS_GLASS || HAS_PLASTIC;
// Share of a pixel's light below which a branch no longer splits, but goes one way by chance.
const MIN_SHARE: f32 = 0.001;
// Share from which on branches always look for everything.
const FULL_SHARE: f32 = 0.3;
const BELOW_ONE: f32 = 0.99999994;
// Optical depth that counts as opaque.
const OPAQUE_DEPTH: f32 = 18.0;

fn is_dark(v: vec3f) -> bool { return all(v == vec3f(0.0)); }

// Distance beyond which all scattering channels are opaque.
fn medium_reach(m: Medium) -> f32 {
    var smallest = of_bits(INFINITY);
    for (var c = 0u; c < 3u; c++) {
        if (m.sigma_s[c] > 0.0 && m.sigma_t[c] < smallest) { smallest = m.sigma_t[c]; }
    }
    return quotient(OPAQUE_DEPTH, smallest);
}

// Russian roulette: returns the survival probability, to divide the throughput by, or zero if the path ends.
fn survival(q_given: f32, depth: u32, s: ptr<function, Sampler>) -> f32 {
    var q = q_given;
    if (depth > TRAPPED_DEPTH && q > MOST_TRAPPED) { q = MOST_TRAPPED; }
    if (q >= 1.0) { return 1.0; }
    if (!(q > 0.0)) { return 0.0; }
    return select(0.0, q, next_1d(s) < q);
}

fn survive(path: ptr<function, Path>, q: f32, s: ptr<function, Sampler>) {
    let survived = survival(q, (*path).depth, s);
    if (survived == 0.0) {
        (*path).phase = ENDED;
        return;
    }
    (*path).beta = quotients((*path).beta, survived);
    (*path).track = quotients((*path).track, survived);
}

fn survive_walk(path: ptr<function, Path>, s: ptr<function, Sampler>) {
    survive(path, ROULETTE_FACTOR * constants.patience * largest_channel((*path).track), s);
}

fn weigh(path: ptr<function, Path>, weight: vec3f) {
    (*path).beta *= weight;
    (*path).track *= weight;
}

fn wave_of(path: Path) -> u32 { return (path.flags & OF_WAVE) >> WAVE_OF_PATH; }

// Throughput including the weight of the path's wavelength.
fn tinted(path: Path) -> vec3f {
    if (!DISPERSES) { return path.beta; }
    let wave = wave_of(path);
    if (wave == 0u) { return path.beta; }
    let weight = constants.weights[wave - 1u];
    return path.beta * vec3f(weight[0], weight[1], weight[2]);
}

// Part that a walk's light counts as.
fn part_or(path: Path, part: u32) -> u32 { return select(part, VOLUME_PART, (path.flags & IN_VOLUME) != 0u); }

fn part_of_met(path: Path) -> u32 {
    if (path.phase == FROM_CAMERA) { return DIRECT_PART; }
    return part_or(path, select(SURFACE_PART, DIRECT_PART, path.depth == 0u));
}

// Whether the direction was drawn at the first vertex, or by a lobe followed before it.
fn is_drawn_early(path: Path) -> bool { return path.phase == FROM_CAMERA || (path.flags & IS_FIRST) != 0u; }

// Whether rules keep a light off the vertex where the direction was drawn, or leave it to light sampling.
fn is_hidden_where_drawn(path: Path, light: u32) -> bool {
    if (!is_drawn_early(path)) { return hides_light(lighting.gather_hides, light); }
    let is_left = (path.flags & NO_DIRECT) != 0u || light_sources[light].hides != 0u;
    if ((path.flags & IS_GLOSS) != 0u) {
        let seen = hidden_in(path.surface, (path.flags & IS_REFRACTED) != 0u);
        if (hides_light(seen, light) || hides_shape_of(seen, light)) { return true; }
    }
    return is_left || hides_light(surfaces[path.surface].shadow, light);
}

// MIS weight of light that the path meets, against light sampling where its direction was drawn, or against photons.
fn share_of_met(path: Path, light: u32, at: LightHit) -> f32 {
    if ((path.flags & WAS_LIT) == 0u) {
        if (path.phase == FROM_CAMERA) { return 1.0; }
        // The light's photons would leave nothing either.
        if (lighting.has_rules == 1u && hides_light(lighting.gather_hides, light)) { return 0.0; }
        if (uses[light].way == CAUSTICS_BY_PATHS) { return 1.0; }
        let in_caustic = uses[light].in_caustic;
        if (in_caustic == 0.0 || (path.flags & IS_BEHIND) == 0u) { return 0.0; }
        return path_weight(in_caustic * emitted_density(light, -path.dir, at.triangle), path.behind);
    }
    var among = AIMED_AT;
    if (lighting.has_rules == 1u) {
        if (is_hidden_where_drawn(path, light)) { return 0.0; }
        if (is_drawn_early(path)) { among = surfaces[path.surface].lit_by; }
    }
    let samples = samples_of(light_choice(path.point, path.facing, (path.flags & FACES) != 0u, among), light);
    if (samples == 0.0) { return 1.0; }
    return power_heuristic(path.density, pdf_direct(light, path.point, path.dir, at) * samples);
}

// Emission of the environment, or of the surface hit.
fn met_light(path: Path, at: SurfacePoint, slot: u32) -> vec3f {
    var sum = vec3f(0.0);
    var light = 0u;
    var end = lighting.lights;
    let meets = at.object != NOTHING;
    if (meets) {
        light = surfaces[at.object].light;
        if (light == NONE) { return sum; }
        let was_lit = (path.flags & WAS_LIT) != 0u;
        let is_unseen = select(only_sampled(light), only_sampled_by_paths(light), was_lit);
        if (path.phase == WALKS && is_unseen) { return sum; }
        end = light + 1u;
    }
    while (light < end) {
        var hit = no_hit();
        var emitted = vec3f(0.0);
        if (meets) {
            hit = LightHit(at.ng, path.distance, at.triangle);
            emitted = emitted_radiance(at.object, at.ng, at.uv, path.dir);
        } else {
            let is_seen = path.phase == WALKS || !hides_light(hidden_from(path), light);
            if (is_seen) { emitted = environment_radiance(light, path.dir); }
        }
        if (!is_dark(emitted)) {
            let more = emitted * share_of_met(path, light, hit);
            if (HAS_LIGHT_GROUPS) { found_of_group(slot, uses[light].light_group, tinted(path) * more); }
            sum += more;
        }
        light += 1u;
    }
    return tinted(path) * sum;
}

// From here on, a camera path only looks for the rest: all light but what it meets.
fn look_for_rest(path: ptr<function, Path>) {
    (*path).beta *= (*path).rest;
    (*path).rest = 1.0;
}

// Crosses a medium up to `length`. Returns the distance of a scattering, or -1.
fn cross_medium(path: ptr<function, Path>, i: u32, length: f32, s: ptr<function, Sampler>) -> f32 {
    let id = (*path).medium;
    let medium = media[id];
    let is_served = uses[lighting.lights + id].way == 1u;
    let walks = (*path).phase == WALKS;
    if (VARIES) {
        if (is_crossed(i)) { return cross_varying(path, i); }
    }
    if (!medium_scatters(medium) || (walks && is_served) || (*path).rest == 0.0) {
        (*path).beta *= transmittance(medium, length);
        return -1.0;
    }
    let is_wanted = ((*path).flags & ONLY_DIRECT) == 0u;
    if (is_served || (constants.leave_beams == 1u && is_wanted)) {
        let reach = medium_reach(medium);
        let pixel = (*path).y * camera.width + (*path).x;
        segments[i] = PathSegment(
            (*path).origin, select(length, reach, reach < length), (*path).dir, id, pixel, 0u, 0u,
            wave_of(*path) << WAVE_OF_SEGMENT,
        );
        var part = VOLUME_PART;
        if (walks) { part = part_or(*path, SURFACE_PART); }
        tails[i] = Tail(tinted(*path) * (*path).rest, select(part, part | IS_SERVED, is_served));
    }
    if (is_served) {
        (*path).beta *= transmittance(medium, length);
        return -1.0;
    }
    return fly(path, sample_flight(medium, (*path).beta, length, next_2d(s)));
}

// The same for varying density, where `path_cross.wgsl` has decided what becomes of the path.
fn cross_varying(path: ptr<function, Path>, i: u32) -> f32 {
    let crossing = tails[i];
    let distance = bitcast<f32>(crossing.part);
    var part = VOLUME_PART;
    if ((*path).phase == WALKS) { part = part_or(*path, SURFACE_PART); }
    tails[i] = Tail(tinted(*path) * (*path).rest, part);
    if (DISPERSES) { segments[i].crossed |= wave_of(*path) << WAVE_OF_SEGMENT; }
    if ((segments[i].crossed & BY_A_FLIGHT) == 0u) {
        (*path).beta *= crossing.beta;
        return -1.0;
    }
    return fly(path, Flight(crossing.beta, distance, u32(distance >= 0.0)));
}

fn is_crossed(i: u32) -> bool { return !(segments[i].crossed == 0u); }

// Applies a flight: the path passes or scatters.
fn fly(path: ptr<function, Path>, flight: Flight) -> f32 {
    let walks = (*path).phase == WALKS;
    let is_wanted = ((*path).flags & ONLY_DIRECT) == 0u;
    if (flight.scattered == 1u && !walks) {
        (*path).phase = WALKS;
        (*path).track = vec3f(1.0);
        (*path).depth = 0u;
        (*path).flags = ((*path).flags & OF_WAVE) | IN_VOLUME;
        look_for_rest(path);
    }
    if (!is_wanted && flight.scattered == 1u) {
        (*path).phase = ENDED;
        return -1.0;
    }
    if (walks || flight.scattered == 1u) { weigh(path, flight.weight); } else { (*path).beta *= flight.weight; }
    return select(-1.0, flight.distance, flight.scattered == 1u);
}

// Scatters a path in a medium: asks for direct light and draws a new direction.
fn scatter(path: ptr<function, Path>, i: u32, distance: f32, s: ptr<function, Sampler>) {
    let point = (*path).origin + (*path).dir * distance;
    let dir = (*path).dir;
    let medium = media[(*path).medium];
    var y: PathVertex;
    y.point = point;
    y.kind = SCATTERS;
    y.wo = dir;
    y.medium = (*path).medium;
    y.beta = tinted(*path);
    y.part = part_or(*path, SURFACE_PART);
    path_vertices[i] = y;
    let new_dir = phase_sample(medium.phase, dir, next_2d(s));
    (*path).point = point;
    (*path).facing = vec3f(0.0);
    (*path).density = phase_eval_directions(medium.phase, dir, new_dir);
    (*path).distance = 0.0;
    (*path).flags = ((*path).flags & (IN_VOLUME | IS_BEHIND | OF_WAVE)) | WAS_LIT;
    (*path).origin = point;
    (*path).dir = new_dir;
    (*path).depth += 1u;
    survive_walk(path, s);
}

// Starts the path's ray off a surface.
fn leave(path: ptr<function, Path>, at: SurfacePoint, dir: vec3f) {
    let ray = spawn_ray(at, dir);
    (*path).origin = ray.origin;
    (*path).dir = ray.dir;
}

// Asks for photons at a surface. `value`: the throughput; without `by_bsdf` times the BSDF's value, which is constant
// on the side of wo.
fn ask_photons(i: u32, y: PathVertex, value: vec3f, by_bsdf: bool, photon_scale: f32) {
    var kind = ALL_COUNTED;
    var density = 0.0;
    var bits = y.wave << WAVE_OF_REQUEST;
    switch y.kind {
        case FIRST: {
            if ((y.part & SEES_LIGHTS_ALONE) != 0u) { bits |= NOT_BY_RULE; } else { kind = FIRST_COUNTED; }
            if ((y.part & OF_GLOSS) != 0u) { bits |= OFF_SURFACES; }
        }
        case LATER: { kind = LATER_COUNTED; }
        case LAST: {
            if (y.from_projected > 0.0) {
                kind = LAST_COUNTED;
                density = y.from_projected;
            }
        }
        default: {}
    }
    if (y.kind == ON_THE_WAY) { bits |= SEEN_BY_FOLLOWED; }
    if (by_bsdf) { bits |= BY_BSDF; }
    requests[i] = PhotonRequest(
        y.point, kind | lights_of(y.part), y.ng, density, y.ns, i, y.wo, bits, value, photon_scale, y.shadowing,
    );
}

// How a path leaves a surface.
struct Turn {
    sample: BsdfSample,
    // Index inside over outside, if light is refracted.
    eta: f32,
    // Factor on the photons seen here.
    photon_scale: f32,
    is_followed: bool,
    is_first: bool,
    // Gloss with rules of its own.
    is_gloss: bool,
    // The surface is lit from one side.
    faces: bool,
}

// A second branch, and what differs in it; share 0: none.
struct OtherWay {
    beta: vec3f,
    share: f32,
    track: vec3f,
    rest: f32,
    sample: BsdfSample,
}

const NO_OTHER_WAY: OtherWay =
    OtherWay(vec3f(0.0), 0.0, vec3f(0.0), 0.0, BsdfSample(vec3f(0.0), 0.0, vec3f(0.0), 0u));

// Whether the path may split once more.
fn may_split(path: Path) -> bool {
    return (path.splits & WAITING) < constants.branches && (path.splits >> SPLITS_OF_PATH) < constants.splits;
}

// One of two branches. It looks for the rest with a probability in proportion to its share, weighted by the inverse.
fn one_way(path: Path, sample: BsdfSample, s: ptr<function, Sampler>) -> OtherWay {
    let p = sample.pdf;
    let by_both = BsdfSample(sample.wi, p, sample.weight * p, sample.flags);
    var way = OtherWay(path.beta, path.share * p, quotients(path.track, p), path.rest, by_both);
    let had = quotient(1.0, path.rest);
    let has = not_above_one(quotient(way.share, FULL_SHARE));
    if (path.rest > 0.0 && has < had) {
        way.rest = select(0.0, quotient(1.0, has), next_1d(s) < quotient(has, had));
    }
    return way;
}

// Smooth glass: goes both ways, if both are worthwhile.
fn split_at_glass(
    path: ptr<function, Path>,
    m: Material,
    wo: vec3f,
    turn: ptr<function, Turn>,
    s: ptr<function, Sampler>,
) -> OtherWay {
    var strong = sample_glass(m, wo, 0.0);
    var weak = sample_glass(m, wo, BELOW_ONE);
    if (weak.pdf > strong.pdf) {
        let other = weak;
        weak = strong;
        strong = other;
    }
    // Both samples are the same if there is only one way.
    if (strong.pdf >= 1.0 || (*path).share * weak.pdf < MIN_SHARE || !may_split(*path)) { return NO_OTHER_WAY; }
    let other = one_way(*path, weak, s);
    let own = one_way(*path, strong, s);
    (*path).track = own.track;
    (*path).share = own.share;
    (*path).rest = own.rest;
    (*turn).sample = own.sample;
    return other;
}

// Smooth coat: chance decides whether the path follows the reflection, or only the base counts. The reflection is
// traced in either case, for the light that it meets.
fn split_at_coat(
    path: ptr<function, Path>,
    m: Material,
    wo: vec3f,
    lobe: ptr<function, OneLobe>,
) -> OtherWay {
    let p = mirror_probability(m, wo);
    if (p == 0.0) { return NO_OTHER_WAY; }
    let is_coat_alone = (*path).rest == 0.0;
    if (is_coat_alone && !(*lobe).is_followed) { *lobe = OneLobe(m, 1.0, 0.0, true, true); }
    if (!is_coat_alone && ((*path).share * p < MIN_SHARE || !may_split(*path))) { return NO_OTHER_WAY; }
    if ((*lobe).is_followed) {
        // Samples of the reflection contain its probability.
        (*path).beta *= p;
        (*path).share *= p;
        (*path).rest = quotient((*path).rest, p);
        return NO_OTHER_WAY;
    }
    let reflection = mirrored(wo, m.transmittance * coat_fresnel_at(m, wo), p);
    return OtherWay((*path).beta, (*path).share * p, quotients((*path).track, p), 0.0, reflection);
}

// Bits of the rules that an object's rays obey.
fn rules_of(object: u32) -> u32 {
    if (lighting.has_rules == 0u) { return ONE_RAY | GATHERS | IS_GATHERED; }
    return surfaces[object].bits;
}

// At a surface: asks for light where it is due and draws how the path goes on, unless it ends. Returns a second branch,
// if any.
fn meet_surface(
    path: ptr<function, Path>,
    i: u32,
    at: SurfacePoint,
    of_surface: Interaction,
    turn: ptr<function, Turn>,
    s: ptr<function, Sampler>,
) -> OtherWay {
    let walks = (*path).phase == WALKS;
    let local_wo = of_surface.local_wo;
    let wo = of_surface.wo;
    let shadowing = of_surface.shadowing;
    var other = NO_OTHER_WAY;
    let was_lit = ((*path).flags & WAS_LIT) != 0u;
    if (!walks && was_lit) {
        // A followed lobe sees the lights beyond it before roulette may end the path.
        survive(path, ROULETTE_FACTOR * largest_channel((*path).track), s);
        if ((*path).phase == ENDED) { return other; }
    }
    var lobe = one_lobe(of_surface.material, local_wo, next_1d(s));
    if (HAS_PLASTIC && !walks && of_surface.material.kind == PLASTIC) {
        other = split_at_coat(path, of_surface.material, local_wo, &lobe);
    }
    let is_first = !walks && !lobe.is_followed;
    let of_rules = rules_of(at.object);
    (*turn).is_gloss = false;
    if (is_first && (of_rules & IS_GLOSS_RULED) != 0u) {
        // Gloss and base obey different rules: take one of them.
        let one = gloss_or_base(lobe.material, local_wo, next_1d(s));
        (*turn).is_gloss = one.is_followed;
        lobe.material = one.material;
        lobe.p *= one.p;
    }
    let m = lobe.material;
    if (m.kind == BLACK || (walks && lobe.is_followed && constants.photons_go_on == 1u)) {
        // Photons bring light that arrives by followed lobes.
        (*path).phase = ENDED;
        return other;
    }
    if (lobe.p < 1.0) {
        (*path).beta = quotients((*path).beta, lobe.p);
        (*path).track = quotients((*path).track, lobe.p);
    }
    if (is_first) {
        if ((*path).rest == 0.0) {
            (*path).phase = ENDED;
            return other;
        }
        look_for_rest(path);
    }
    (*turn).photon_scale = 1.0;
    if (is_first && is_glossy(m)) { (*turn).photon_scale = constants.on_gloss; }
    // Only what a delta lobe reflects is left to the path alone.
    if (!lobe.is_followed || (!walks && !lobe.is_smooth && (*path).rest > 0.0)) {
        var y = PathVertex(
            at.point, ON_THE_WAY, at.ng, (*path).medium, of_surface.frame.n, DIRECT_PART, wo, 0.0,
            tinted(*path) * (*path).rest, wave_of(*path), shadowing,
        );
        let flown = select(0.0, (*path).distance, was_lit);
        if (is_first) {
            y.kind = select(FIRST, LAST, constants.ends == ENDS_AT_FIRST && !is_glossy(m));
            let sees_lights_alone = !(*turn).is_gloss && (of_rules & GATHERS) == 0u;
            y.part |= select(0u, OF_GLOSS, (*turn).is_gloss) | select(0u, SEES_LIGHTS_ALONE, sees_lights_alone);
        } else if (walks) {
            y.kind = LATER;
            y.part = part_or(*path, SURFACE_PART);
            let ends_here = constants.ends == ENDS_AT_SECOND || (constants.ends > 0u && !is_glossy(m));
            if (ends_here && flown >= constants.least_flight) {
                y.kind = LAST;
                let from_gloss = ((*path).flags & IS_GLOSS) != 0u;
                if (constants.ends == ENDS_AT_SECOND && !from_gloss && (of_rules & IS_GATHERED) == 0u) {
                    // Photons bring its light to where the path came from.
                    (*path).phase = ENDED;
                    return other;
                }
                if (((*path).flags & IS_FIRST) != 0u) {
                    if (!from_gloss) { y.from_projected = (*path).projected; }
                    if (lighting.has_rules == 1u) { y.part |= BY_GATHER_RAY | surfaces[(*path).surface].photon; }
                }
            }
        }
        if (m.kind == DIFFUSE && !is_lit(m, local_wo)) {
            (*path).phase = ENDED;
            return other;
        }
        path_vertices[i] = y;
        asked_surfaces[i] = m;
        let by_bsdf = m.kind != DIFFUSE || has_map(shadowing);
        var value = y.beta;
        if (!by_bsdf) { value = y.beta * (m.reflectance * 0.31830987f); }
        if (y.kind != ON_THE_WAY || constants.unmet_caustics == 1u) {
            ask_photons(i, y, value, by_bsdf, (*turn).photon_scale);
        }
        if (y.kind == LAST) {
            (*path).phase = ENDED;
            return other;
        }
    }
    if (is_first) {
        // Behind dense fog, the path is not worth following every time.
        let q = quotient(largest_channel((*path).beta), SURE_THROUGHPUT);
        if (q < 1.0) {
            if (!(next_1d(s) < q)) {
                (*path).phase = ENDED;
                return other;
            }
            (*path).beta = quotients((*path).beta, q);
        }
        (*path).track = vec3f(1.0);
    }
    (*turn).sample = bsdf_sample(m, local_wo, lobe.u, next_2d(s), RADIANCE, shadowing);
    (*turn).eta = select(1.0, m.eta.x, bends(m));
    (*turn).is_followed = lobe.is_followed;
    (*turn).is_first = is_first;
    (*turn).faces = m.kind == DIFFUSE;
    if (HAS_GLASS && !walks && is_glass(m)) { other = split_at_glass(path, m, local_wo, turn, s); }
    return other;
}

// Leaves a surface as drawn, unless the path ends. Returns whether it crosses the surface.
fn turn_at(
    path: ptr<function, Path>,
    at: SurfacePoint,
    of_surface: Interaction,
    turn: Turn,
    s: ptr<function, Sampler>,
) -> bool {
    let walks = (*path).phase == WALKS;
    let was_lit = ((*path).flags & WAS_LIT) != 0u;
    let shadowing = of_surface.shadowing;
    let sample = turn.sample;
    if ((sample.flags & SAMPLED) == 0u) {
        (*path).phase = ENDED;
        return false;
    }
    let wi = unit_vector(to_world(of_surface.frame, sample.wi));
    let cosine = dot3(at.ng, wi);
    let is_delta = (sample.flags & DELTA) != 0u;
    if ((!is_delta || has_map(shadowing)) && !(sample.wi.z * cosine > 0.0)) {
        (*path).phase = ENDED;
        return false;
    }
    weigh(path, sample.weight);
    let is_transmitted = (sample.flags & TRANSMITTED) != 0u;
    if (is_transmitted) {
        // Refraction's compression of radiance comes and goes along the path.
        var eta = turn.eta;
        if (!(dot3(at.ng, (*path).dir) > 0.0)) { eta = quotient(1.0, eta); }
        (*path).track = quotients((*path).track, eta * eta);
    }
    let side = dot3(at.ng, of_surface.wo);
    let crosses = select(cosine * side < 0.0, is_transmitted, turn.is_followed);
    let kept = (*path).flags & (IN_VOLUME | IS_BEHIND | IS_BLURRED | OF_WAVE);
    leave(path, at, wi);
    if (turn.is_followed && walks) {
        (*path).depth += 1u;
        if (was_lit) {
            (*path).behind = (*path).projected;
            (*path).flags = (kept & (IN_VOLUME | OF_WAVE)) | select(0u, IS_BEHIND, ((*path).flags & IS_SURFACE) != 0u);
        }
        survive_walk(path, s);
        return crosses;
    }
    (*path).point = at.point;
    (*path).facing = at.ng * with_sign(1.0, side);
    (*path).density = sample.pdf;
    (*path).projected = quotient(sample.pdf, abs(cosine) * turn.photon_scale);
    (*path).distance = 0.0;
    if (turn.is_followed) {
        (*path).depth += 1u;
        (*path).flags = kept & (IS_BLURRED | OF_WAVE);
        if (!is_delta) { (*path).flags |= WAS_LIT | IS_BLURRED; }
        (*path).flags |= select(0u, IS_REFRACTED, is_transmitted);
        (*path).surface = at.object;
        var q = 1.0;
        if (!is_delta) { return crosses; }
        if (((*path).flags & IS_BLURRED) != 0u) {
            q = ROULETTE_FACTOR * largest_channel((*path).track);
        } else if ((*path).depth > DEPTH_OF_DELTAS) {
            // Sharp paths have no noise but roulette's, which comes late and depends on the reflectance alone.
            q = largest_channel(sample.weight);
        }
        survive(path, q, s);
        return crosses;
    }
    (*path).flags = (kept & (IN_VOLUME | IS_BEHIND | OF_WAVE)) | WAS_LIT | IS_SURFACE | select(0u, FACES, turn.faces);
    if (turn.is_first) {
        (*path).phase = WALKS;
        (*path).depth = 0u;
        (*path).flags = (kept & OF_WAVE) | WAS_LIT | IS_SURFACE | IS_FIRST | select(0u, FACES, turn.faces);
        (*path).surface = at.object;
        let of_rules = rules_of(at.object);
        if (turn.is_gloss) { (*path).flags |= IS_GLOSS | select(0u, IS_REFRACTED, crosses); }
        if (!turn.is_gloss && (of_rules & GATHERS) == 0u) {
            (*path).flags |= ONLY_DIRECT;
        } else if (turn.is_gloss || (of_rules & ONE_RAY) == 0u) {
            // One of the two rays, with equal probability.
            (*path).flags |= select(NO_DIRECT, ONLY_DIRECT, next_1d(s) < 0.5);
            (*path).beta *= 2.0;
        }
    } else {
        (*path).depth += 1u;
        survive_walk(path, s);
    }
    return crosses;
}

fn goes_on(path: Path) -> bool { return path.phase > ENDED && largest_channel(path.beta) > 0.0; }

fn place_of_branch(slot: u32, number: u32) -> u32 { return number * constants.slots + slot; }

// Pushes a branch of the path.
fn wait(path: ptr<function, Path>, slot: u32, b: Path) {
    branches[place_of_branch(slot, (*path).splits & WAITING)] = Branch(
        b.origin, b.medium, b.dir, b.depth, b.beta, b.flags, b.track, b.surface, b.share, b.rest,
    );
    (*path).splits += 1u;
}

// Goes on with the last waiting branch.
fn take_up(path: ptr<function, Path>, slot: u32) {
    (*path).splits -= 1u;
    let b = branches[place_of_branch(slot, (*path).splits & WAITING)];
    (*path).phase = FROM_CAMERA;
    (*path).origin = b.origin;
    (*path).medium = b.medium;
    (*path).dir = b.dir;
    (*path).depth = b.depth;
    (*path).beta = b.beta;
    (*path).flags = b.flags;
    (*path).track = b.track;
    (*path).surface = b.surface;
    (*path).share = b.share;
    (*path).rest = b.rest;
    (*path).distance = 0.0;
}

@compute @workgroup_size(64)
fn go_on(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let slot = on_way[i];
    var path = paths[slot];
    var s = samplers[slot];
    let at = met[i];
    path_vertices[i].kind = NO_VERTEX;
    var is_aligned = false;
    if (VARIES) { is_aligned = is_crossed(i); }
    if (!is_aligned) { segments[i].length = 0.0; }
    requests[i].kind = NOTHING_ASKED;
    found[slot].rays += 1u;
    if (!is_aligned) { sampler_align(&s, SQUARES_OF_VERTEX); }
    var scattered = -1.0;
    if (path.medium < VACUUM) { scattered = cross_medium(&path, i, at.t, &s); }
    if (scattered >= 0.0) {
        scatter(&path, i, scattered, &s);
    } else {
        path.distance += at.t;
        let light = met_light(path, at, slot);
        if (!is_dark(light)) { found[slot] = found_more(found[slot], part_of_met(path), light); }
        if (at.object == NOTHING) {
            if (path.phase == FROM_CAMERA && path.depth == 0u) { found[slot].let_through = mean_channel(path.beta); }
            path.phase = ENDED;
        } else {
            let from_dir = path.dir;
            let number = met_material(surfaces[at.object].material, at, &s);
            let is_passed = number == PASSED;
            var of_surface: Interaction;
            var turn: Turn;
            var other = NO_OTHER_WAY;
            if (!is_passed && (path.flags & ONLY_DIRECT) != 0u) {
                path.phase = ENDED;
            } else if (!is_passed) {
                of_surface = bsdf_at(number, at, from_dir);
                if (DISPERSES) {
                    let row = row_of(number);
                    if (row > 0u && constants.waves > 0u) {
                        if (wave_of(path) == 0u) {
                            path.flags |= wave_by(next_1d(&s), constants.waves) << WAVE_OF_PATH;
                        }
                        let eta = constants.etas[row - 1u][wave_of(path) - 1u];
                        of_surface.material = bending(of_surface.material, eta);
                    }
                }
                other = meet_surface(&path, i, at, of_surface, &turn, &s);
            }
            // The second branch first, then the path itself.
            for (var way = select(1u, 0u, MAY_SPLIT && other.share > 0.0); way < 2u; way++) {
                var branch = path;
                if (MAY_SPLIT && way == 0u) {
                    branch.phase = FROM_CAMERA;
                    branch.beta = other.beta;
                    branch.track = other.track;
                    branch.share = other.share;
                    branch.rest = other.rest;
                }
                var this_turn = turn;
                if (MAY_SPLIT && way == 0u) {
                    this_turn.sample = other.sample;
                    this_turn.is_followed = true;
                    this_turn.is_first = false;
                }
                if (branch.phase == ENDED) { break; }
                var crosses = true;
                if (is_passed) {
                    leave(&branch, at, from_dir);
                } else {
                    crosses = turn_at(&branch, at, of_surface, this_turn, &s);
                }
                if (crosses && branch.phase != ENDED) { branch.medium = medium_beyond(at, branch.dir, branch.medium); }
                if (way == 1u) {
                    path = branch;
                } else {
                    path.splits += 1u << SPLITS_OF_PATH;
                    if (goes_on(branch)) { wait(&path, slot, branch); }
                }
            }
        }
    }
    if (!goes_on(path)) {
        path.phase = ENDED;
        if (MAY_SPLIT && (path.splits & WAITING) > 0u) { take_up(&path, slot); }
    }
    paths[slot] = path;
    samplers[slot] = s;
}
