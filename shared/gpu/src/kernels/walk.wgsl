// Random walks along a ray through a medium of varying density, as in the renderer's `medium/transmittance.rs` and
// `heterogeneous.rs`. They estimate the transmittance as a function of distance, or end where a photon scatters. A turn
// is a stretch between bounds, or an event. Goes after `volumes.wgsl` and `world.wgsl`.

// Kinds of walks. Free flights, the renderer's third estimator, become ratio tracking here: it has the same mean.
const NO_WALK: u32 = 0u;
const BY_RATIO: u32 = 1u;
const BY_RESIDUAL: u32 = 2u;
const BY_FLIGHT: u32 = 3u;

struct Walk {
    is: u32,
    // Offset of the medium's record in `volumes`.
    record: u32,
    sigma_t: vec3f,
    sigma_s: vec3f,
    // Ray in sample space; distances are those of render space.
    origin: vec3f,
    dir: vec3f,
    // Part inside the medium's box.
    range: vec2f,
    // Next stretch: its cell, the distances at which the ray leaves that, and those between planes.
    cell: vec3u,
    next: vec3f,
    step: vec3f,
    at: f32,
    // Current stretch.
    start: f32,
    end: f32,
    in_stretch: bool,
    rate: f32,
    // Optical depths: of the stretch, and from its start to the next event.
    depth_of_stretch: f32,
    left: f32,
    // How many times more often than necessary residual tracking samples the density.
    often: f32,
    // For BY_FLIGHT: flux.
    power: vec3f,
    // Transmittance at `reached` without the next two, or factor on the flux; density times length of the closed-form
    // part, and its density from there on.
    value: vec3f,
    depth: f32,
    decay: f32,
    reached: f32,
    events: u32,
    count: u32,
    // Set by the last turn: a step at `distance`, or a scattering there.
    has_step: bool,
    scattered: bool,
    distance: f32,
}

// Transmittance below which Russian roulette applies, so that walks end soon.
const ROULETTE_BELOW: f32 = 0.0625;
// From this many steps on, a walk continues with a chance of 1/16 per step.
const MANY_STEPS: u32 = 1024u;
// From this many events on, with 15/16.
const MANY_EVENTS: u32 = 4096u;
// Transmittance that counts as opaque.
const LEAST_SEEN: f32 = 1.523e-8f;
// Most optical depth kept in closed form, apart from `value`.
const MOST_DEPTH: f32 = 16.0;

fn min_of(a: f32, b: f32) -> f32 { return select(a, b, b < a); }

fn max_of(a: f32, b: f32) -> f32 { return select(a, b, b > a); }

fn max_channel(v: vec3f) -> f32 { return max_of(max_of(v.x, v.y), v.z); }

fn min_channel(v: vec3f) -> f32 { return min_of(min_of(v.x, v.y), v.z); }

fn sum_of_channels(v: vec3f) -> f32 { return v.x + v.y + v.z; }

fn exp_neg_of(sigma_t: vec3f, depth: f32) -> vec3f {
    return vec3f(exp_neg(-sigma_t.x * depth), exp_neg(-sigma_t.y * depth), exp_neg(-sigma_t.z * depth));
}

fn no_walk() -> Walk {
    var w: Walk;
    w.value = vec3f(1.0);
    return w;
}

// Optical distance to the next event.
fn free_depth(s: ptr<function, Sampler>) -> f32 { return -ln(1.0 - next_1d(s)); }

// Starts a walk over `length`, which may be infinite; NO_WALK if the ray misses the medium's box. `by_flight`: for a
// photon of flux `power`; otherwise it estimates the transmittance. `is_kept`: for many lookups.
fn walk_begins(
    medium: u32,
    ray_origin: vec3f,
    ray_dir: vec3f,
    length: f32,
    by_flight: bool,
    is_kept: bool,
    power: vec3f,
    s: ptr<function, Sampler>,
) -> Walk {
    var w = no_walk();
    let record = volumes[medium];
    w.record = record;
    w.sigma_t = media[medium].sigma_t;
    w.sigma_s = media[medium].sigma_s;
    w.power = power;
    w.origin = moved_by(record + TO_SAMPLES, ray_origin);
    w.dir = turned_by(record + TO_SAMPLES, ray_dir);
    let low = volume_vector(record + DENSITY + DOMAIN);
    let high = volume_vector(record + DENSITY + DOMAIN + 3u);
    w.range = vec2f(0.0, length);
    for (var axis = 0u; axis < 3u; axis++) {
        let o = w.origin[axis];
        let d = w.dir[axis];
        if (d == 0.0) {
            if (o < low[axis] || o > high[axis]) { return w; }
            continue;
        }
        let a = quotient(low[axis] - o, d);
        let b = quotient(high[axis] - o, d);
        w.range = vec2f(max_of(w.range.x, min_of(a, b)), min_of(w.range.y, max_of(a, b)));
    }
    if (!(w.range.x < w.range.y && w.range.y < of_bits(INFINITY))) { return w; }
    w.is = select(volumes[record + ESTIMATOR], BY_FLIGHT, by_flight);
    let side = volume_float(record + CELL_SIDE);
    let last = vec3u(volumes[record + CELLS], volumes[record + CELLS + 1u], volumes[record + CELLS + 2u]) - vec3u(1u);
    var first = quotients(w.origin + w.dir * w.range.x, side);
    // The domain may start half a sample before the first cell.
    first = select(vec3f(0.0), first, first > vec3f(0.0));
    first = select(first, vec3f(last), first > vec3f(last));
    w.cell = vec3u(first);
    let forward = w.dir > vec3f(0.0);
    let plane = vec3f(w.cell + select(vec3u(0u), vec3u(1u), forward));
    let far = of_bits(INFINITY);
    let ahead = plane * side - w.origin;
    w.next = vec3f(far);
    w.step = vec3f(far);
    if (!(w.dir.x == 0.0)) {
        w.next.x = quotient(ahead.x, w.dir.x);
        w.step.x = quotient(side, abs(w.dir.x));
    }
    if (!(w.dir.y == 0.0)) {
        w.next.y = quotient(ahead.y, w.dir.y);
        w.step.y = quotient(side, abs(w.dir.y));
    }
    if (!(w.dir.z == 0.0)) {
        w.next.z = quotient(ahead.z, w.dir.z);
        w.step.z = quotient(side, abs(w.dir.z));
    }
    w.at = w.range.x;
    w.often = 1.0;
    if (is_kept) {
        let expected = (w.range.y - w.range.x) * volume_float(record + DEVIATION) * max_channel(w.sigma_t);
        let often = quotient(3.0, expected);
        w.often = select(select(often, 64.0, often > 64.0), 1.0, often < 1.0);
    }
    w.left = free_depth(s);
    return w;
}

// Takes a turn. False: the walk has ended.
fn walk_on(w: ptr<function, Walk>, s: ptr<function, Sampler>) -> bool {
    (*w).has_step = false;
    if (!(*w).in_stretch) { return next_stretch(w); }
    if (!((*w).left < (*w).depth_of_stretch)) {
        (*w).left -= (*w).depth_of_stretch;
        (*w).in_stretch = false;
        return true;
    }
    return next_event(w, s);
}

// `value` grows to make up for the closed form's shortfall, by channel. Combines the two before either overflows.
fn put_together(w: ptr<function, Walk>) {
    if ((*w).depth * max_channel((*w).sigma_t) > MOST_DEPTH) {
        (*w).value *= exp_neg_of((*w).sigma_t, (*w).depth);
        (*w).depth = 0.0;
    }
}

fn next_stretch(w: ptr<function, Walk>) -> bool {
    if (!((*w).at < (*w).range.y)) {
        if (!((*w).decay == 0.0)) {
            (*w).depth += (*w).decay * ((*w).end - (*w).reached);
            (*w).decay = 0.0;
            (*w).reached = (*w).end;
            (*w).distance = (*w).end;
            (*w).has_step = true;
        }
        return false;
    }
    let record = (*w).record;
    let cell = (*w).cell;
    let count = vec3u(volumes[record + CELLS], volumes[record + CELLS + 1u], volumes[record + CELLS + 2u]);
    let range = volumes[record + RANGES] + 3u * (cell.x + count.x * (cell.y + count.y * cell.z));
    let next = (*w).next;
    let x_first = next.x <= next.y && next.x <= next.z;
    let y_first = !x_first && next.y <= next.z;
    let axis = vec3<bool>(x_first, y_first, !x_first && !y_first);
    let here = select(select(next.z, next.y, y_first), next.x, x_first);
    (*w).start = (*w).at;
    var end = select(here, (*w).start, here < (*w).start);
    end = select(end, (*w).range.y, end > (*w).range.y);
    let forward = (*w).dir > vec3f(0.0);
    // At the grid's edge, the last cell extends to the end of the domain.
    let is_last = select(cell == vec3u(0u), cell + vec3u(1u) >= count, forward);
    if (any(axis & is_last)) {
        (*w).next = select(next, vec3f(of_bits(INFINITY)), axis);
        if (min_channel((*w).next) >= (*w).range.y) { end = (*w).range.y; }
    } else {
        (*w).cell = select(cell, select(cell - vec3u(1u), cell + vec3u(1u), forward), axis);
        (*w).next = select(next, next + (*w).step, axis);
    }
    (*w).at = end;
    (*w).end = end;
    let low = volume_float(range);
    let high = volume_float(range + 1u);
    let top = max_channel((*w).sigma_t);
    (*w).rate = high * top;
    if ((*w).is == BY_RESIDUAL) {
        let mean = volume_float(range + 2u);
        let decay = (*w).decay;
        // No step where the previous density serves about as well as the mean.
        let is_near = abs(decay - mean) <= 0.3f * max_of(high - mean, mean - low) && decay >= low && decay <= high;
        if (!is_near && !(mean == decay)) {
            (*w).depth += decay * ((*w).start - (*w).reached);
            (*w).decay = mean;
            (*w).reached = (*w).start;
            put_together(w);
            let seen = max_channel((*w).value) * exp_neg(-min_channel((*w).sigma_t) * (*w).depth);
            if (seen < LEAST_SEEN) { (*w).value = vec3f(0.0); }
            (*w).has_step = true;
            (*w).distance = (*w).start;
            if (all((*w).value == vec3f(0.0))) { return false; }
        }
        (*w).rate = max_of(high - (*w).decay, (*w).decay - low) * top * (*w).often;
    }
    (*w).depth_of_stretch = (end - (*w).start) * (*w).rate;
    (*w).in_stretch = (*w).rate > 0.0;
    return true;
}

// Roulette factor for low values or many steps: one over the survival probability, or zero.
fn walk_roulette(value: vec3f, count: u32, s: ptr<function, Sampler>) -> f32 {
    var survival = 1.0;
    if (count >= MANY_STEPS) {
        survival = 0.0625;
    } else if (max_channel(value) < ROULETTE_BELOW) {
        survival = 0.5;
    }
    if (survival == 1.0) { return 1.0; }
    return select(0.0, quotient(1.0, survival), next_1d(s) < survival);
}

fn next_event(w: ptr<function, Walk>, s: ptr<function, Sampler>) -> bool {
    let rate = (*w).rate;
    let t = min_of((*w).start + quotient((*w).left, rate), (*w).end);
    let p = (*w).origin + (*w).dir * t;
    let density = density_at((*w).record, p);
    (*w).events += 1u;
    if ((*w).is == BY_FLIGHT) {
        if (density > 0.0) {
            let sigma = (*w).sigma_t * quotient(density, rate);
            let collides = select(sigma, vec3f(1.0), sigma > vec3f(1.0));
            // All channels decide together between a real and a null collision, in proportion to the flux left in each.
            let flux = (*w).power * (*w).value;
            let real = quotient(sum_of_channels(flux * collides), sum_of_channels(flux));
            if (next_1d(s) < real) {
                (*w).value *= (*w).sigma_s * quotient(density, rate * real);
                (*w).value *= albedo_at((*w).record, p);
                (*w).scattered = true;
                (*w).distance = t;
                return false;
            }
            (*w).value *= quotients(vec3f(1.0) - collides, 1.0 - real);
        }
    } else if (density > 0.0 || (*w).is == BY_RESIDUAL) {
        (*w).depth += (*w).decay * (t - (*w).reached);
        (*w).reached = t;
        let kept = vec3f(1.0) - (*w).sigma_t * quotient(density - (*w).decay, rate);
        (*w).value *= select(vec3f(0.0), kept, kept > vec3f(0.0));
        put_together(w);
        var seen = (*w).value;
        if ((*w).is == BY_RESIDUAL) { seen *= exp_neg(-min_channel((*w).sigma_t) * (*w).depth); }
        (*w).value *= walk_roulette(seen, (*w).count, s);
        (*w).count += 1u;
        (*w).has_step = true;
    }
    (*w).distance = t;
    // Majorants far above the density keep the walk from advancing.
    if ((*w).events > MANY_EVENTS) {
        (*w).value *= select(0.0, 1.0666667f, next_1d(s) < 0.9375);
        (*w).has_step = true;
    }
    if (all((*w).value == vec3f(0.0))) { return false; }
    (*w).left += free_depth(s);
    return true;
}

// Transmittance over the whole walk.
fn walked_transmittance(w: Walk) -> vec3f {
    if (w.depth > 0.0) { return w.value * exp_neg_of(w.sigma_t, w.depth); }
    return w.value;
}

// One estimate of the transmittance over `length`, which may be infinite.
fn varying_transmittance(medium: u32, origin: vec3f, dir: vec3f, length: f32, s: ptr<function, Sampler>) -> vec3f {
    var w = walk_begins(medium, origin, dir, length, false, false, vec3f(0.0), s);
    if (w.is == NO_WALK) { return vec3f(1.0); }
    loop {
        if (!walk_on(&w, s)) { break; }
    }
    return walked_transmittance(w);
}
