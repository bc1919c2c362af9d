// The state of a photon path between two ray queries.

// Next step of a photon. Those up to CROSS need a ray query: what the ray hits; what coincides with a medium boundary;
// whether a displaced beam starts in the medium; what is under a displaced surface photon, and what is between; which
// boundaries coincide.
const ENDED: u32 = 0u;
const FLY: u32 = 1u;
const LOOK_ACROSS: u32 = 2u;
const TRY_BEAM: u32 = 3u;
const LOOK_DOWN: u32 = 4u;
const LOOK_BETWEEN: u32 = 5u;
const CROSS: u32 = 6u;
const ARRIVE: u32 = 7u;
const LEAVE_BEAM: u32 = 8u;
const TRAVEL: u32 = 9u;
const MEET: u32 = 10u;
const LEAVE_PHOTON: u32 = 11u;
const SCATTER: u32 = 12u;

struct PhotonPath {
    origin: vec3f,
    step: u32,
    dir: vec3f,
    medium: u32,
    // Flux, W, divided by the number of emitted paths.
    power: vec3f,
    light: u32,
    footprint: Footprint,
    // Normal of what the ray starts on, and its kind, ENDS_NOWHERE to ENDS_ON_BOUNDARY.
    start: vec3f,
    start_is: u32,
    // Where on the light it started. For lights without a surface: the direction back.
    emitted_normal: vec3f,
    emitted_triangle: u32,
    arrival: u32,
    // Technique that finds what it leaves at the next surface; for BY_BOTH, the expected number of photons.
    found_by: u32,
    expected: f32,
    // The same for caustics that it brings.
    caustic_by: u32,
    caustic_expected: f32,
    // Distance since it was last scattered.
    flown: f32,
    depth: u32,
    // Least worth of its positions so far: see `far_worth`.
    worth: f32,
    // 1: no surface or medium has scattered it widely.
    is_pure: u32,
    // 1: only delta lobes have turned it.
    is_sharp: u32,
    // Material that it hit.
    material: u32,
    // Beams and surface photons that it has left, or the places of the next ones.
    beams: u32,
    photons: u32,
    // Position in its random numbers.
    square: u32,
    state: vec2u,
    crossed: u32,
    // Steps of its beams in media of varying density, likewise.
    steps: u32,
    // Wavelength, 1-based; 0: none. The power does not contain its weight.
    wave: u32,
    // Class bits of what its ray does not see.
    hides: u32,
    // Its hit.
    at: SurfacePoint,
    trials: Trials,
    // For coincident boundaries: the media before and behind each. In between, `near` is for a beam in a medium of
    // varying density: its first step, number of steps, and the bits of the distances where it starts and ends.
    near: vec4u,
    far: vec4u,
    others: vec2u,
}

// Random numbers of a path from its current position on.
fn path_sampler(path: u32, p: PhotonPath) -> Sampler {
    var s = first_sampler(path);
    s.state = p.state;
    s.square = p.square;
    return s;
}

fn first_sampler(path: u32) -> Sampler {
    if (trace_plan.is_even == 1u) { return sampler_of_paths(trace_plan.stream, path, trace_plan.paths); }
    return sampler_random(trace_plan.stream, vec2u(path, 0u));
}

fn mean_of(c: vec3f) -> f32 { return (c.x + c.y + c.z) * 0.33333334f; }

// The first light whose running sum exceeds u.
fn emitter_choice(u: f32) -> u32 {
    var low = 0u;
    var high = trace_plan.lights - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (traced_lights[middle].sum <= u) { low = middle + 1u; } else { high = middle; }
    }
    return low;
}

// A photon that starts at a light; ENDED if there is none.
fn started_path(path: u32) -> PhotonPath {
    var p: PhotonPath;
    p.step = ENDED;
    var s = first_sampler(path);
    let u = next_1d(&s);
    if (trace_plan.lights == 0u) { return p; }
    let number = emitter_choice(u);
    let light = lights[number];
    var pmf = traced_lights[number].sum;
    if (number > 0u) { pmf = pmf - traced_lights[number - 1u].sum; }
    let where_ = next_2d(&s);
    let whither = next_2d(&s);
    let uniforms = EmissionUniforms(where_, whither, next_1d(&s));
    var emission = emit(light, uniforms);
    if (is_aimed(number)) { emission = mixture_start(number, light, emission, uniforms, next_1d(&s)); }
    let paths = trace_plan.kernel_paths * pmf;
    let radius = root(quotient(1.0, 3.1415927f * emission.pdf_pos * paths));
    p.origin = emission.origin;
    p.dir = emission.dir;
    p.light = number;
    p.hides = traced_lights[number].hides;
    p.medium = light.medium;
    p.power = quotients(emission.power, f32(trace_plan.paths) * pmf);
    p.footprint = round_footprint(p.dir, radius, spread_of(emission.pdf_dir, paths), 0u);
    p.start_is = ENDS_NOWHERE;
    p.emitted_normal = -p.dir;
    p.emitted_triangle = emission.triangle;
    if (light.kind == AREA || light.kind == TWO_SIDED_AREA) {
        // Off the surface.
        let size = (extent(emission.origin) + trace_plan.bounds) * 4e-6f;
        p.origin = emission.origin + emission.normal * select(1e-30f, size, size > 1e-30f);
        p.start = emission.normal;
        p.start_is = ENDS_ON_SURFACE;
        p.emitted_normal = emission.normal;
    }
    p.arrival = ARRIVED_DIRECT;
    p.found_by = BY_PHOTONS;
    p.caustic_by = BY_PHOTONS;
    let in_caustic = traced_lights[number].in_caustic;
    if (!(in_caustic == 0.0)) {
        p.caustic_by = BY_BOTH;
        p.caustic_expected = in_caustic * emitted_density(number, p.dir, emission.triangle);
    }
    p.worth = 1.0;
    p.is_pure = 1u;
    p.is_sharp = 1u;
    p.state = s.state;
    p.square = s.square;
    p.step = select(ENDED, FLY, any(p.power > vec3f(0.0)));
    return p;
}

// Russian roulette: survivors have the flux that they had before the scattering, as far as probabilities allow.
fn path_survives(p: ptr<function, PhotonPath>, s: ptr<function, Sampler>, before: f32) -> bool {
    (*p).depth += 1u;
    var q = quotient(mean_of((*p).power), before);
    // Trapped light ends as well.
    if ((*p).depth > 1024u) { q = select(0.999f, q, q < 0.999f); }
    if (q >= 1.0) { return true; }
    if (!(q > 0.0) || next_1d(s) >= q) { return false; }
    (*p).power = quotients((*p).power, q);
    return true;
}

// Factor on the survival probability of a photon scattered beyond the scene's bounds, in endless fog: its worth there,
// over the least so far.
fn far_worth(p: ptr<function, PhotonPath>, point: vec3f) -> f32 {
    let beyond = length3(point - trace_plan.center) - trace_plan.bounds;
    if (!(beyond > 0.0)) { return 1.0; }
    let decayed = exp_neg(-0.5 * traced_media[(*p).medium].least_sigma_t * beyond);
    let worth = select(0.015625f, decayed, decayed > 0.015625f);
    let share = not_above_one(quotient(worth, (*p).worth));
    (*p).worth = select((*p).worth, worth, worth < (*p).worth);
    return share;
}
