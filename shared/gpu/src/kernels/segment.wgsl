// Single scattering in a homogeneous medium: chooses a light, and a point of a ray segment where its light scatters.
// The renderer's `LightSources::sample` and `single_scattering`.
//
// Points follow the falloff of a source at distance D from the line, 1 / d^2 = 1 / (D^2 + s^2), with s the position
// from the foot of the perpendicular (equiangular sampling), and a forward-peaked phase function: psi, the angle by
// which light is turned, tan(psi / 2) = (s + d) / D, is drawn in proportion to Poisson's kernel.

struct FogSegment {
    // Starts at the ray's origin.
    ray: Ray,
    // Finite.
    length: f32,
    // Extinction by channel; channels that do not scatter take the least value of the others.
    sigma_t: vec3f,
    phase: Phase,
    // Mean cosine.
    g: f32,
    medium: u32,
}

// A chosen light and point; if `pdf` is zero, the light does not reach the segment.
struct SegmentSample {
    light: u32,
    // Distance along the ray.
    t: f32,
    // Pdf of the distance, times the light's pmf.
    pdf: f32,
    // Squared distance to the light, at least its squared radius; infinite for infinitely distant lights.
    distance2: f32,
    // Squared radius of the light.
    radius2: f32,
    // Probability of choosing the light.
    pmf: f32,
    // Point where the light starts, if one was drawn.
    has_start: bool,
    start: vec3f,
}

// A segment as seen by one light.
struct LitSegment {
    // False: unlit; all else is zero.
    is_lit: bool,
    is_near: bool,
    // Lit part.
    start: f32,
    end: f32,
    importance: f32,
    // Distance along the ray of the point nearest to the light.
    foot: f32,
    // Squared radius of the light, or a tiny value that keeps results finite.
    softening: f32,
    // Distance of the light from the line.
    height: f32,
    // (1 + g) / (1 - g).
    k: f32,
    // k tan(psi / 2) at the start of the lit part, and the angle from there to its end.
    tan_start: f32,
    angle: f32,
    // Probability of drawing the distance by transmittance.
    by_depth: f32,
}

fn least_of_channels(v: vec3f) -> f32 {
    let yz = select(v.z, v.y, v.y < v.z);
    return select(yz, v.x, v.x < yz);
}

// Clamps; NaN becomes the bound.
fn not_below(x: f32, least: f32) -> f32 { return select(least, x, x > least); }

fn not_above(x: f32, most: f32) -> f32 { return select(most, x, x < most); }

// Part of a segment in front of a plane; none if it ends before it starts.
fn clip_by_plane(source: LightSource, ray: Ray, length: f32) -> vec2f {
    let height = dot3(ray.origin - source.apex, source.axis);
    let slope = dot3(ray.dir, source.axis);
    let crossing = not_above(not_below(quotient(-height, slope), 0.0), length);
    if (height > 0.0) {
        if (slope >= 0.0) { return vec2f(0.0, length); }
        return vec2f(0.0, crossing);
    }
    if (slope > 0.0) { return vec2f(crossing, length); }
    return vec2f(0.0);
}

// Part in front of all planes of a pyramid.
fn clip_by_pyramid(source: LightSource, ray: Ray, length: f32) -> vec2f {
    let offset = ray.origin - source.apex;
    var range = vec2f(0.0, length);
    for (var i = 0u; i < 4u; i++) {
        let plane = plane_of_pyramid(source, i);
        let height = dot3(offset, plane);
        let slope = dot3(ray.dir, plane);
        let crossing = quotient(-height, slope);
        if (slope > 0.0) {
            range.x = not_below(crossing, range.x);
        } else if (slope < 0.0) {
            range.y = not_above(crossing, range.y);
        } else if (height <= 0.0) {
            return vec2f(0.0);
        }
    }
    return range;
}

fn is_in_cone(source: LightSource, x: vec3f) -> bool {
    let along = dot3(x, source.axis);
    return along > 0.0 && along * along >= source.width * source.width * dot3(x, x);
}

// Clamps to [0, length]; NaN becomes 0.
fn within(t: f32, length: f32) -> f32 { return select(0.0, not_above(t, length), t > 0.0); }

// A convex cone and a line share one interval: one of the three between the roots of (dot(x, axis))^2 = cos^2 |x|^2
// with x = offset + t dir.
fn clip_by_cone(source: LightSource, ray: Ray, length: f32) -> vec2f {
    let offset = ray.origin - source.apex;
    let along = dot3(offset, source.axis);
    let slope = dot3(ray.dir, source.axis);
    let cos2 = source.width * source.width;
    let a = slope * slope - cos2;
    let b = along * slope - cos2 * dot3(offset, ray.dir);
    let c = along * along - cos2 * dot3(offset, offset);
    let side = root(not_below_zero(b * b - a * c));
    let q = select(-b + side, -b - side, b >= 0.0);
    let first = within(quotient(q, a), length);
    let second = within(quotient(c, q), length);
    let ends = vec4f(0.0, not_above(first, second), not_below(first, second), length);
    for (var part = 0u; part < 3u; part++) {
        let start = ends[part];
        let end = ends[part + 1u];
        if (start < end && is_in_cone(source, offset + ray.dir * (0.5 * (start + end)))) { return vec2f(start, end); }
    }
    return vec2f(0.0);
}

// tan(psi / 2) = (s + d) / D, without cancellation.
fn tan_half(s: f32, height: f32) -> f32 {
    let d = root(s * s + height * height);
    if (s > 0.0) { return quotient(s + d, height); }
    return quotient(height, d - s);
}

// Least normal float; share of squared distances by which rounding keeps lines off point lights.
const LEAST: u32 = 0x00800000u;
const ROUNDED_OFF: f32 = 1e-12f;

fn view_from_afar(source: LightSource, segment: FogSegment) -> LitSegment {
    let sigma_t = least_of_channels(segment.sigma_t);
    var phase = 0.0795774683f;
    if (source.region == FROM_AFAR) { phase = phase_eval(segment.phase, -dot3(source.center, segment.ray.dir)); }
    let seen = quotient(one_minus_exp_neg(sigma_t * segment.length), sigma_t);
    let importance = not_below(source.intensity * phase * seen, of_bits(LEAST));
    return LitSegment(true, false, 0.0, segment.length, importance, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
}

fn view_of_segment(source: LightSource, segment: FogSegment) -> LitSegment {
    if (source.region == ALL_AROUND || source.region == FROM_AFAR) { return view_from_afar(source, segment); }
    var range = vec2f(0.0, segment.length);
    if (source.region == BEFORE_PLANE) { range = clip_by_plane(source, segment.ray, segment.length); }
    if (source.region == IN_PYRAMID) { range = clip_by_pyramid(source, segment.ray, segment.length); }
    if (source.region == IN_CONE) { range = clip_by_cone(source, segment.ray, segment.length); }
    if (!(range.x < range.y)) {
        return LitSegment(false, false, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    }
    let sigma_t = least_of_channels(segment.sigma_t);
    let offset = source.center - segment.ray.origin;
    let foot = dot3(offset, segment.ray.dir);
    let across = offset - segment.ray.dir * foot;
    let s0 = range.x - foot;
    let s1 = range.y - foot;
    let softening = not_below(source.softening, ROUNDED_OFF * (s0 * s0 + s1 * s1) + of_bits(LEAST));
    let height = root(dot3(across, across) + softening);
    let k = quotient(1.0 + segment.g, 1.0 - segment.g);
    let a = k * tan_half(s0, height);
    let b = k * tan_half(s1, height);
    let angle = arc_tan2(b - a, 1.0 + a * b);
    // Along the segment to the origin. How much of the light's way lies in the medium is unknown.
    let way = not_above(not_below(foot, range.x), range.y);
    let depth = sigma_t * (range.y - range.x);
    let importance = quotient(source.intensity * angle, height) * 0.159154937f * exp_neg(-sigma_t * way);
    let by_depth = not_above(not_below_zero((depth - 2.0) * 0.125), 0.5);
    return LitSegment(
        true, true, range.x, range.y, not_below(importance, of_bits(LEAST)), foot, softening, height, k, a, angle,
        by_depth,
    );
}

fn is_grey(v: vec3f) -> bool { return v.x == v.y && v.y == v.z; }

// Distance drawn by the transmittance of a channel.
fn distance_by_depth(view: LitSegment, sigma_t: vec3f, number: f32) -> f32 {
    var sigma = sigma_t.x;
    var u = number;
    if (!is_grey(sigma_t)) {
        let channel = min(u32(3.0 * number), 2u);
        sigma = sigma_t[channel];
        u = within_one(3.0 * number - f32(channel));
    }
    let stopped = u * one_minus_exp_neg(sigma * (view.end - view.start));
    return view.start - quotient(ln_of_one_minus(stopped), sigma);
}

fn distance_by_angle(view: LitSegment, u: f32) -> f32 {
    let turn = sin_cos(u * view.angle);
    let more = quotient(turn.x, turn.y);
    let left = 1.0 - view.tan_start * more;
    var tangent = of_bits(INFINITY);
    // Rounding may move it beyond a right angle.
    if (left > 0.0) { tangent = quotient(view.tan_start + more, left * view.k); }
    return view.foot + 0.5 * view.height * (tangent - quotient(1.0, tangent));
}

fn distance_in_segment(view: LitSegment, sigma_t: vec3f, u: f32) -> f32 {
    var t = 0.0;
    if (!view.is_near) {
        t = distance_by_depth(view, sigma_t, u);
    } else if (u < view.by_depth) {
        t = distance_by_depth(view, sigma_t, quotient(u, view.by_depth));
    } else {
        t = distance_by_angle(view, quotient(u - view.by_depth, 1.0 - view.by_depth));
    }
    return select(view.start, not_above(t, view.end), t > view.start);
}

fn pdf_of_channel(view: LitSegment, sigma_t: f32, t: f32) -> f32 {
    let stopped = one_minus_exp_neg(sigma_t * (view.end - view.start));
    return quotient(sigma_t * exp_neg(-sigma_t * (t - view.start)), stopped);
}

fn pdf_by_depth(view: LitSegment, sigma_t: vec3f, t: f32) -> f32 {
    let x = pdf_of_channel(view, sigma_t.x, t);
    if (is_grey(sigma_t)) { return x; }
    return quotient(x + pdf_of_channel(view, sigma_t.y, t) + pdf_of_channel(view, sigma_t.z, t), 3.0);
}

fn pdf_by_angle(view: LitSegment, t: f32) -> f32 {
    let s = t - view.foot;
    let d = root(s * s + view.height * view.height);
    let tangent = tan_half(s, view.height);
    let scaled_up = view.k * tangent;
    var by_angle = quotient(scaled_up, 1.0 + scaled_up * scaled_up);
    // Two factors, as the square may overflow.
    if (tangent > 1.0) {
        by_angle = quotient(quotient(view.k, tangent), quotient(1.0, tangent * tangent) + view.k * view.k);
    }
    return quotient(by_angle, d * view.angle);
}

// Pdf of `distance_in_segment`.
fn pdf_in_segment(view: LitSegment, sigma_t: vec3f, t: f32) -> f32 {
    if (!view.is_near) { return pdf_by_depth(view, sigma_t, t); }
    let by_angle = pdf_by_angle(view, t);
    if (view.by_depth > 0.0) {
        return view.by_depth * pdf_by_depth(view, sigma_t, t) + (1.0 - view.by_depth) * by_angle;
    }
    return by_angle;
}

// Purposes of a light's view: summing over lights, choosing one, testing one chosen by power, placing points.
const FOR_SUMS: u32 = 0u;
const FOR_CHOICE: u32 = 1u;
const FOR_LIGHT: u32 = 2u;
const FOR_POINTS: u32 = 3u;

// Chooses a light and a point. For a ball, points follow the light of one of its points, drawn from `s`, as if that
// were all. Views are computed in one place, since compilers inline each call.
fn sample_segment(segment: FogSegment, u_light: f32, u: f32, s: ptr<function, Sampler>) -> SegmentSample {
    var sample = SegmentSample(NONE, 0.0, 0.0, of_bits(INFINITY), 0.0, 0.0, false, vec3f(0.0));
    if (lighting.lights == 0u) { return sample; }
    var light = 0u;
    var use_of = FOR_SUMS;
    if (lighting.is_weighed == 0u && lighting.lights > 1u) {
        let choice = choose_by_power(ALL_LIGHTS, u_light);
        if (choice.light == NONE) { return sample; }
        use_of = FOR_LIGHT;
        light = choice.light;
        sample.light = light;
        sample.pmf = choice.pmf;
    }
    var total = 0.0;
    var power = 0.0;
    var left = u_light;
    var view: LitSegment;
    loop {
        var source = light_sources[light];
        if (sample.has_start) {
            source.center = sample.start;
            source.softening = 0.0;
            source.apex = sample.start;
        }
        view = view_of_segment(source, segment);
        if (use_of == FOR_POINTS) { break; }
        // Rules keep the light off the medium.
        if (is_unlit(segment.medium, light)) { view.is_lit = false; }
        if (use_of == FOR_LIGHT && !view.is_lit) { return sample; }
        if (view.is_lit && use_of == FOR_SUMS) {
            total += view.importance;
            power += power_pmf(ALL_LIGHTS, light);
        }
        if (view.is_lit && use_of == FOR_CHOICE) {
            var pmf = quotient(view.importance, total);
            if (power > 0.0) { pmf = 0.9f * pmf + 0.1f * quotient(power_pmf(ALL_LIGHTS, light), power); }
            sample.light = light;
            sample.pmf = pmf;
            left -= pmf;
        }
        light += 1u;
        let is_last = light == lighting.lights;
        if (use_of == FOR_SUMS && is_last) {
            light = 0u;
            use_of = FOR_CHOICE;
        } else if (use_of == FOR_LIGHT || (use_of == FOR_CHOICE && (is_last || left < 0.0))) {
            if (sample.light == NONE) { return sample; }
            light = sample.light;
            use_of = FOR_POINTS;
            let chosen = lights[light];
            if ((chosen.kind == SPOT || chosen.kind == SMOOTH_SPOT) && chosen.radius > 0.0) {
                let place = next_2d(s);
                sample.has_start = true;
                sample.start = spot_start(chosen, place, next_1d(s));
            }
        }
    }
    if (!view.is_lit) { return sample; }
    sample.t = distance_in_segment(view, segment.sigma_t, u);
    let pdf = pdf_in_segment(view, segment.sigma_t, sample.t);
    if (!(pdf > 0.0)) { return sample; }
    sample.pdf = pdf * sample.pmf;
    if (view.is_near) {
        let beside = sample.t - view.foot;
        sample.distance2 = beside * beside + view.height * view.height;
        sample.radius2 = view.softening;
    }
    return sample;
}

// `FogSegment.sigma_t` of a medium.
fn scattering_sigma_t(m: Medium) -> vec3f {
    var smallest = of_bits(INFINITY);
    for (var channel = 0u; channel < 3u; channel++) {
        if (m.sigma_s[channel] > 0.0) { smallest = not_above(m.sigma_t[channel], smallest); }
    }
    return select(vec3f(smallest), m.sigma_t, m.sigma_s > vec3f(0.0));
}

// A ray to a light, scattered once on a segment, before its occlusion test.
struct ScatteredRay {
    // No light arrives.
    is_dark: bool,
    // Drawn by the phase function; counts if it meets the light.
    by_phase: bool,
    light: u32,
    ray: Ray,
    // Of the light, if the ray was drawn to it.
    distance: f32,
    // Radiance over the pdf, if the ray was drawn to the light.
    weight: vec3f,
    // Value of the phase function, and the probability of drawing rays by it.
    value: f32,
    share: f32,
    // Pdf of rays drawn to the light.
    pdf: f32,
    // Factor and divisor of the result.
    factor: vec3f,
    density: f32,
}

// Whether rules keep a light's direct light off a medium.
fn is_unlit(medium: u32, light: u32) -> bool {
    if (lighting.unlit == 0u) { return hides_light(lighting.gather_hides, light); }
    return light_tables[lighting.unlit + medium * lighting.lights + light] == 1.0;
}

// Whether no ray meets the light; rays to it pass what its photons pass.
fn is_never_met(light: u32) -> bool {
    return only_sampled(light) || hides_shape_of(light_sources[light].photon_hides, light);
}

// First part of `single_scattering`, up to its ray. `medium`: number of a medium that scatters.
fn scattered_ray(ray: Ray, length: f32, medium: u32, beta: vec3f, s: ptr<function, Sampler>) -> ScatteredRay {
    let m = media[medium];
    let segment = FogSegment(ray, length, scattering_sigma_t(m), m.phase, m.g, medium);
    let u_light = next_1d(s);
    let sample = sample_segment(segment, u_light, next_1d(s), s);
    var found = ScatteredRay(
        true, false, sample.light, ray, 0.0, vec3f(0.0), 0.0, 0.0, 0.0, vec3f(0.0), sample.pdf,
    );
    if (!(sample.pdf > 0.0)) { return found; }
    let at = ray.origin + ray.dir * sample.t;
    found.factor = beta * m.sigma_s * transmittance(m, sample.t);
    let kind = lights[sample.light].kind;
    if (is_environment(sample.light)) { found.share = 0.5; }
    if ((kind == AREA || kind == TWO_SIDED_AREA) && !is_never_met(sample.light)) {
        let x = quotient(3.1415927f * sample.radius2, sample.distance2) * phase_peak(m.phase);
        // For fainter lights, the phase function's peak does not matter.
        if (!(x < 0.02f)) { found.share = quotient(0.5 * x, 1.0 + x); }
    }
    if (found.share > 0.0) { found.by_phase = next_1d(s) < found.share; }
    if (found.by_phase) {
        let dir = phase_sample(m.phase, ray.dir, next_2d(s));
        found.value = phase_eval_directions(m.phase, ray.dir, dir);
        found.ray = Ray(at, dir);
        found.is_dark = false;
        return found;
    }
    var direct = no_light();
    if (sample.has_start) {
        direct = from_spot_start(sample.light, sample.start, at);
    } else {
        direct = sample_direct(sample.light, at, draw_direct(sample.light, s));
    }
    if (!(direct.pdf > 0.0)) { return found; }
    found.is_dark = false;
    found.ray = Ray(at, direct.wi);
    found.distance = direct.distance;
    found.weight = direct.weight;
    found.pdf = direct.pdf;
    found.value = phase_eval_directions(m.phase, ray.dir, direct.wi);
    return found;
}

// Light found by a ray drawn by the phase function, if it arrived at its light.
fn met_by_phase(found: ScatteredRay, arrived: Arrived) -> vec3f {
    var emitted = vec3f(0.0);
    var hit = no_hit();
    if (arrived.at.object == NOTHING) {
        emitted = environment_radiance(found.light, found.ray.dir);
    } else if (surfaces[arrived.at.object].light == found.light) {
        emitted = emitted_radiance(arrived.at.object, arrived.at.ng, arrived.at.uv, found.ray.dir);
        hit = LightHit(arrived.at.ng, arrived.distance, arrived.at.triangle);
    }
    if (all(emitted == vec3f(0.0))) { return vec3f(0.0); }
    let pdf = pdf_direct(found.light, found.ray.origin, found.ray.dir, hit);
    let mixture = (1.0 - found.share) * pdf + found.share * found.value;
    return emitted * arrived.transmittance * quotient(found.value, mixture);
}

// Light found by a ray drawn to the light, given the transmittance.
fn found_at_light(found: ScatteredRay, transmittance: vec3f) -> vec3f {
    let scattered = found.weight * transmittance * found.value;
    if (!(found.share > 0.0)) { return scattered; }
    let mixture = (1.0 - found.share) * found.pdf + found.share * found.value;
    return scattered * quotient(found.pdf, mixture);
}

// Singly scattered light, and the light that it comes from.
struct ScatteredOnce {
    radiance: vec3f,
    light: u32,
}

// Direct light that a segment from the ray's origin scatters once; `beta`: throughput before that. `medium`: number of
// a medium that scatters; `length` is finite. Kernels that trace rays on their own use `scattered_ray` and, unless it
// is dark, `walk_straight` and `scattered_light`.
fn single_scattering(ray: Ray, length: f32, medium: u32, beta: vec3f, s: ptr<function, Sampler>) -> ScatteredOnce {
    let found = scattered_ray(ray, length, medium, beta, s);
    if (found.is_dark) { return ScatteredOnce(vec3f(0.0), 0u); }
    let hides = light_sources[found.light].photon_hides;
    let across = no_surface(found.ray);
    let arrived = walk_straight(found.ray, found.distance, medium, across, found.light, hides, !found.by_phase, s);
    return ScatteredOnce(scattered_light(found, arrived), found.light);
}

// Last part of `single_scattering`, for a ray that is not dark.
fn scattered_light(found: ScatteredRay, arrived: Arrived) -> vec3f {
    var arriving = vec3f(0.0);
    if (found.by_phase) {
        arriving = met_by_phase(found, arrived);
    } else {
        arriving = found_at_light(found, arrived.transmittance);
    }
    return quotients(found.factor * arriving, found.density);
}
