// Light at a point: from which light, from where on it, and with what density. What `world/choice.rs` lays out, which
// has the same structs; functions are the renderer's of `world/light/`, in its order.
//
//     let choice = light_choice(point, normal, has_normal, AIMED_AT);
//     var next = 0u;
//     loop {
//         let chosen = next_light(choice, &next, &sampler);
//         if (chosen.light == NONE) { break; }
//         let direct = sample_direct(chosen.light, point, draw_direct(chosen.light, &sampler));
//         if (direct.pdf > 0.0) { .. direct.weight over chosen.pmf .. }
//     }

// Where a light shines: from afar, from all around or in one direction; everywhere, in a cone, before a plane.
const ALL_AROUND: u32 = 0u;
const FROM_AFAR: u32 = 1u;
const EVERYWHERE: u32 = 2u;
const IN_CONE: u32 = 3u;
const BEFORE_PLANE: u32 = 4u;

// A light reduced to what matters for choosing it, and what it emits.
struct LightSource {
    // Middle of the light; of what is directional, the direction of travel.
    center: vec3f,
    region: u32,
    // Of a cone; or a point of the plane.
    apex: vec3f,
    // Square of its radius.
    softening: f32,
    // Of a cone; or the normal of the plane.
    axis: vec3f,
    // Mean channel of the flux per steradian, W/sr; of the irradiance of what comes from afar, W/m^2.
    intensity: f32,
    // W/sr of a point, and of a spot on its axis; W/m^2 of what is directional; W/(m^2 sr) of surfaces and of what is
    // all around.
    emitted: vec3f,
    // Cosine of a cone's half angle; the sine of that of a sun.
    width: f32,
    // The object that shadow rays to it pass through, or NONE.
    unshadowing: u32,
    // Rays may pass its surface unseen: all of its direct light is that of samples.
    only_sampled: u32,
}

// How lights are chosen, and what shadow rays look at.
struct Lighting {
    lights: u32,
    // How many lights there are to choose from, or none if none is ever chosen: among those that rays are aimed at
    // where scattered ones go on, and among all.
    choices: vec2u,
    // Lights are few enough to be weighed at each point.
    is_weighed: u32,
    // Shadow rays have to look at what they pass.
    shadow_rays_walk: u32,
}

@group(0) @binding(31) var<storage, read> light_sources: array<LightSource>;
// Running sums of the lights' powers, over their total: of those aimed at, then of all.
@group(0) @binding(32) var<storage, read> light_sums: array<f32>;
@group(0) @binding(33) var<storage, read> lighting: Lighting;

// Which lights are chosen from: where scattered rays go on that may meet the others (`Seen::First`, `Seen::Later`), or
// where a path ends, and on its segments (`Seen::Last`, `Seen::ByGatherRay`, `single_scattering`).
const AIMED_AT: u32 = 0u;
const ALL_LIGHTS: u32 = 1u;

// A chosen light, or NONE.
struct LightChoice {
    light: u32,
    // Probability of the choice, or how often it is expected.
    pmf: f32,
    // The uniform number again, within the choice.
    u: f32,
}

// Within [0, 1], or no number.
fn within_one(x: f32) -> f32 { return select(select(x, 1.0, x > 1.0), 0.0, x < 0.0); }

// Below one.
fn below_one(x: f32) -> f32 { return select(0.99999994f, x, x < 0.99999994f); }

fn sum_of_powers(among: u32, light: u32) -> f32 { return light_sums[among * lighting.lights + light]; }

// Probability of a light by power.
fn power_pmf(among: u32, light: u32) -> f32 {
    if (lighting.choices[among] == 0u) { return 0.0; }
    if (light == 0u) { return sum_of_powers(among, 0u); }
    return sum_of_powers(among, light) - sum_of_powers(among, light - 1u);
}

// Choose a light by power.
fn choose_by_power(among: u32, u: f32) -> LightChoice {
    let count = lighting.choices[among];
    if (count == 0u) { return LightChoice(NONE, 0.0, 0.0); }
    var low = 0u;
    var high = count - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (sum_of_powers(among, middle) <= u) { low = middle + 1u; } else { high = middle; }
    }
    var below = 0.0;
    if (low > 0u) { below = sum_of_powers(among, low - 1u); }
    let pmf = sum_of_powers(among, low) - below;
    return LightChoice(low, pmf, below_one(not_below_zero(quotient(u - below, pmf))));
}

// About the irradiance that a light brings to a point, W/m^2, on a surface that faces it or has a normal.
fn irradiance_at(light: u32, at: vec3f, normal: vec3f, has_normal: bool) -> f32 {
    let source = light_sources[light];
    if (source.region == ALL_AROUND) { return source.intensity * 0.25; }
    if (source.region == FROM_AFAR) {
        let high = not_below_zero(source.width - dot3(source.center, normal));
        return source.intensity * select(1.0, high, has_normal);
    }
    let offset = source.center - at;
    let length2 = dot3(offset, offset);
    let distance2 = select(source.softening, length2, length2 > source.softening);
    let distance = root(distance2);
    var at_light = 1.0;
    if (source.region == IN_CONE) {
        let away = at - source.apex;
        let along = dot3(away, source.axis);
        let is_in = along > 0.0 && along * along >= source.width * source.width * dot3(away, away);
        at_light = select(0.0, 1.0, is_in);
    } else if (source.region == BEFORE_PLANE) {
        let cosine = quotient(-dot3(offset, source.axis), distance);
        let is_before = dot3(at - source.apex, source.axis) > 0.0;
        at_light = select(0.0, 2.0 * select(0.05f, cosine, cosine > 0.05f), is_before);
    }
    var cosine = 1.0;
    if (has_normal) { cosine = within_one(quotient(dot3(offset, normal) + root(source.softening), distance)); }
    return quotient(source.intensity, distance2) * at_light * cosine;
}

// By power alone, by what each light brings, or not at all.
const BY_POWER: u32 = 0u;
const BY_IRRADIANCE: u32 = 1u;
const DARK: u32 = 2u;

// How likely lights are to be chosen at a point.
struct LocalChoice {
    point: vec3f,
    among: u32,
    normal: vec3f,
    way: u32,
    has_normal: bool,
    // Sums over the lights that shine there.
    irradiance: f32,
    power: f32,
}

// At a point. `normal`, if it has one: of a surface that is lit from that side only. `among`: AIMED_AT or ALL_LIGHTS.
fn light_choice(point: vec3f, normal: vec3f, has_normal: bool, among: u32) -> LocalChoice {
    var choice = LocalChoice(point, among, normal, BY_POWER, has_normal, 0.0, 0.0);
    if (lighting.is_weighed == 0u) { return choice; }
    for (var light = 0u; light < lighting.lights; light++) {
        let pmf = power_pmf(among, light);
        let irradiance = irradiance_at(light, point, normal, has_normal);
        if (pmf > 0.0 && irradiance > 0.0) {
            choice.irradiance += irradiance;
            choice.power += pmf;
        }
    }
    let is_finite = choice.irradiance > 0.0 && choice.irradiance < of_bits(INFINITY);
    if (is_finite && choice.power > 0.0) {
        choice.way = BY_IRRADIANCE;
    } else if (choice.irradiance == 0.0) {
        choice.way = DARK;
    }
    return choice;
}

// Probability of a light, if one is chosen.
fn light_pmf(choice: LocalChoice, light: u32) -> f32 {
    let pmf = power_pmf(choice.among, light);
    if (choice.way == BY_POWER) { return pmf; }
    if (choice.way == DARK) { return 0.0; }
    let irradiance = irradiance_at(light, choice.point, choice.normal, choice.has_normal);
    if (!(pmf > 0.0 && irradiance > 0.0)) { return 0.0; }
    return quotient(0.8f * irradiance, choice.irradiance) + quotient(0.2f * pmf, choice.power);
}

// Expected number of times that `next_light` names a light, at most 1: `LocalChoice::samples_of`.
fn samples_of(choice: LocalChoice, light: u32) -> f32 {
    let pmf = light_pmf(choice, light);
    if (choice.way == BY_POWER) { return pmf; }
    return not_above_one(2.0 * pmf);
}

// `LocalChoice::each`: the lights that it visits one after the other, and then NONE, once. `next` begins with 0. What
// is drawn for a light is drawn between the calls.
fn next_light(choice: LocalChoice, next: ptr<function, u32>, s: ptr<function, Sampler>) -> LightChoice {
    let count = lighting.choices[choice.among];
    if (choice.way == BY_POWER) {
        if (*next > 0u) { return LightChoice(NONE, 0.0, 0.0); }
        *next = 1u;
        var u = 0.0;
        if (count > 1u) { u = next_1d(s); } else { sampler_skip(s, 1u); }
        return choose_by_power(choice.among, u);
    }
    while (*next < count) {
        let light = *next;
        *next += 1u;
        sampler_align(s, 4u);
        let pmf = samples_of(choice, light);
        var is_chosen = pmf == 1.0;
        if (!is_chosen && pmf > 0.0) { is_chosen = next_1d(s) < pmf; }
        if (is_chosen) { return LightChoice(light, pmf, 0.0); }
    }
    sampler_align(s, 4u);
    return LightChoice(NONE, 0.0, 0.0);
}

// `LocalChoice::sample`: one light by `u` in [0, 1), or NONE where none shines.
fn sample_light(choice: LocalChoice, u: f32) -> LightChoice {
    if (choice.way == BY_POWER) { return choose_by_power(choice.among, u); }
    var chosen = LightChoice(NONE, 0.0, 0.0);
    var left = u;
    for (var light = 0u; light < lighting.choices[choice.among]; light++) {
        let pmf = light_pmf(choice, light);
        if (pmf > 0.0) {
            chosen = LightChoice(light, pmf, below_one(quotient(left, pmf)));
            left -= pmf;
            if (left < 0.0) { break; }
        }
    }
    return chosen;
}

// Light towards a point, for shadow rays.
struct DirectSample {
    // Towards the light.
    wi: vec3f,
    // Infinite for what comes from afar.
    distance: f32,
    // Of the light where it is met; the direction back, where it has none.
    normal: vec3f,
    // Density per solid angle; 1 for light of a point, or parallel. Zero: nothing arrives.
    pdf: f32,
    // Radiance over `pdf`: for light of a point, or parallel, the irradiance across `wi`.
    weight: vec3f,
    triangle: u32,
    // No ray can meet the light by chance.
    unmet: bool,
}

fn no_light() -> DirectSample {
    return DirectSample(vec3f(0.0), 0.0, vec3f(0.0), 0.0, vec3f(0.0), 0u, false);
}

// Where a ray met a light; where it left the scene, `distance` is infinite.
struct LightHit {
    // Geometric normal, pointing outside.
    normal: vec3f,
    distance: f32,
    triangle: u32,
}

fn no_hit() -> LightHit { return LightHit(vec3f(0.0), of_bits(INFINITY), 0u); }

// Light of a point source at `offset`.
fn from_point(offset: vec3f, intensity: vec3f) -> DirectSample {
    let distance = root(dot3(offset, offset));
    if (!(distance > 0.0)) { return no_light(); }
    let wi = quotients(offset, distance);
    let weight = quotients(quotients(intensity, distance), distance);
    return DirectSample(wi, distance, -wi, 1.0, weight, 0u, true);
}

// The cone that a ball fills, seen from a point outside of it.
struct BallCone {
    axis: vec3f,
    one_minus_cos: f32,
    is_seen: bool,
}

fn cone_of_ball(center: vec3f, radius: f32, at: vec3f) -> BallCone {
    let offset = center - at;
    let distance = root(dot3(offset, offset));
    if (distance <= radius) { return BallCone(vec3f(0.0), 0.0, false); }
    let ratio = quotient(radius, distance);
    let sin2 = ratio * ratio;
    return BallCone(quotients(offset, distance), quotient(sin2, 1.0 + root(1.0 - sin2)), true);
}

fn cone_pdf(cone: BallCone) -> f32 { return quotient(1.0, 6.2831855f * cone.one_minus_cos); }

// Angle from a spot's axis.
fn angle_from_axis(light: Light, dir: vec3f) -> f32 {
    let x = dot3(dir, light.s);
    let y = dot3(dir, light.t);
    return arc_tan2(root(x * x + y * y), dot3(dir, light.n));
}

// Density of `sample_spot` per solid angle.
fn spot_pdf(light: Light, dir: vec3f) -> f32 {
    let angle = angle_from_axis(light, dir);
    if (angle <= light.beam_width || light.cone <= light.plateau) {
        return quotient(select(0.0, 1.0, angle <= light.cutoff), light.solid_angle);
    }
    let width = light.cone - light.plateau;
    let side = not_below_zero(quotient(light.cone - one_minus_cos(angle), width));
    return quotient((1.0 - light.share) * side, 3.1415927f * width);
}

// What a spot is from a point: a point, a ball that fills a cone narrower than its beam, or else.
const AS_POINT: u32 = 0u;
const AS_BALL: u32 = 1u;
const AS_BEAM: u32 = 2u;

struct SpotView { way: u32, cone: BallCone }

fn view_of_spot(light: Light, at: vec3f) -> SpotView {
    let way = at - light.position;
    if (light.radius == 0.0 || light.radius <= 1e-9f * root(dot3(way, way))) {
        return SpotView(AS_POINT, BallCone(vec3f(0.0), 0.0, false));
    }
    let cone = cone_of_ball(light.position, light.radius, at);
    let is_narrower = cone.is_seen && 1.0 <= cone_pdf(cone) * light.solid_angle;
    return SpotView(select(AS_BEAM, AS_BALL, is_narrower), cone);
}

fn spot_view_pdf(light: Light, view: SpotView, wi: vec3f) -> f32 {
    if (view.way == AS_BALL) { return cone_pdf(view.cone); }
    return spot_pdf(light, -wi);
}

fn spot_area(light: Light) -> f32 { return 3.1415927f * light.radius * light.radius; }

// W/sr in a direction.
fn spot_intensity(light: Light, emitted: vec3f, dir: vec3f) -> vec3f {
    return emitted * spot_falloff(light, angle_from_axis(light, dir));
}

// Light towards a point of what starts at one point of a spot, as if all did.
fn from_spot_start(number: u32, start: vec3f, at: vec3f) -> DirectSample {
    let light = lights[number];
    let intensity = spot_intensity(light, light_sources[number].emitted, at - start);
    if (all(intensity == vec3f(0.0))) { return no_light(); }
    return from_point(start - at, intensity);
}

fn from_spot(number: u32, at: vec3f, u: vec3f) -> DirectSample {
    let light = lights[number];
    let view = view_of_spot(light, at);
    if (view.way == AS_POINT) { return from_spot_start(number, light.position, at); }
    let offset = light.position - at;
    var wi = vec3f(0.0);
    if (view.way == AS_BALL) {
        wi = to_world(frame_around(view.cone.axis), uniform_cap(u.xy, view.cone.one_minus_cos));
    } else {
        wi = -sample_spot(light, u.xy).dir;
    }
    // The line's chord in the ball.
    let across = vec3f(
        offset.y * wi.z - wi.y * offset.z,
        offset.z * wi.x - wi.z * offset.x,
        offset.x * wi.y - wi.x * offset.y,
    );
    let half2 = light.radius * light.radius - dot3(across, across);
    let along = sin_cos(3.1415927f * (u.z - 0.5)).x;
    let distance = dot3(offset, wi) + root(not_below_zero(half2)) * along;
    let pdf = spot_view_pdf(light, view, wi);
    let intensity = spot_intensity(light, light_sources[number].emitted, -wi);
    let misses = half2 < 0.0 && view.way == AS_BEAM;
    if (misses || !(distance > 0.0 && pdf > 0.0) || all(intensity == vec3f(0.0))) { return no_light(); }
    return DirectSample(wi, distance, -wi, pdf, quotients(intensity, spot_area(light) * pdf), 0u, true);
}

// Cosine of the angle to the normal of a surface, on a side that emits.
fn facing(light: Light, cosine: f32) -> f32 { return select(cosine, abs(cosine), light.kind == TWO_SIDED_AREA); }

fn sides_of(light: Light) -> f32 { return select(1.0, 2.0, light.kind == TWO_SIDED_AREA); }

// A density per area as one per solid angle; zero on the side that does not emit, and where it overflows.
fn per_solid_angle(pdf_area: f32, cosine: f32, distance: f32) -> f32 {
    let pdf = quotient(pdf_area * distance * distance, cosine);
    return select(0.0, pdf, cosine > 0.0 && pdf > 0.0 && pdf < of_bits(INFINITY));
}

// The cone that a surface fills, if it is a ball of which only the outside emits.
fn cone_of_surface(light: Light, at: vec3f) -> BallCone {
    if (is_round(light) && light.kind == AREA && light.first == 0u) {
        return cone_of_ball(light.position, light.radius, at);
    }
    return BallCone(vec3f(0.0), 0.0, false);
}

// Uniform in the cone, and where the ball is along that.
fn from_ball(number: u32, at: vec3f, cone: BallCone, u: vec2f) -> DirectSample {
    let light = lights[number];
    let way = light.position - at;
    let far = root(dot3(way, way));
    let ratio = quotient(light.radius, far);
    let one_minus_cos = u.x * cone.one_minus_cos;
    let sin2 = one_minus_cos * (2.0 - one_minus_cos);
    // The nearer root of t^2 - 2 d cos t + d^2 - r^2 = 0, as the product of both over the farther one.
    let half_chord = light.radius * root(not_below_zero(1.0 - quotient(sin2, ratio * ratio)));
    let product = (far - light.radius) * (far + light.radius);
    let distance = quotient(product, far * (1.0 - one_minus_cos) + half_chord);
    let wi = to_world(frame_around(cone.axis), uniform_cap(u, cone.one_minus_cos));
    let normal = quotients(wi * distance - cone.axis * far, light.radius);
    let pdf = cone_pdf(cone);
    return DirectSample(wi, distance, normal, pdf, quotients(light_sources[number].emitted, pdf), 0u, false);
}

fn from_area(number: u32, at: vec3f, u: vec3f) -> DirectSample {
    let light = lights[number];
    let cone = cone_of_surface(light, at);
    if (cone.is_seen) { return from_ball(number, at, cone, u.xy); }
    let on = on_surface(light, u.xy, u.z);
    let offset = on.point - at;
    let distance = root(dot3(offset, offset));
    let wi = quotients(offset, distance);
    let pdf = per_solid_angle(light.pdf_pos, facing(light, -dot3(wi, on.normal)), distance);
    if (!(pdf > 0.0)) { return no_light(); }
    let weight = quotients(light_sources[number].emitted, pdf);
    return DirectSample(wi, distance, on.normal, pdf, weight, on.triangle, false);
}

// `Light::draw_direct`: the numbers that `sample_direct` wants.
fn draw_direct(number: u32, s: ptr<function, Sampler>) -> vec3f {
    let kind = lights[number].kind;
    let is_spot = kind == SPOT || kind == SMOOTH_SPOT;
    let is_ball = is_spot && lights[number].radius > 0.0;
    let is_area = kind == AREA || kind == TWO_SIDED_AREA;
    var u = vec3f(0.0);
    if (is_ball || is_area || kind == SUN || kind == ENVIRONMENT) {
        u = vec3f(next_2d(s), 0.0);
    } else {
        sampler_skip(s, 2u);
    }
    let has_triangles = is_area && !is_round(lights[number]);
    if (is_ball || has_triangles) { u.z = next_1d(s); } else { sampler_skip(s, 1u); }
    return u;
}

// `Light::sample_direct`: a direction towards a light from a point, by numbers from `draw_direct`.
fn sample_direct(number: u32, at: vec3f, u: vec3f) -> DirectSample {
    let light = lights[number];
    let emitted = light_sources[number].emitted;
    let far = of_bits(INFINITY);
    switch light.kind {
        case SPOT, SMOOTH_SPOT: { return from_spot(number, at, u); }
        case AREA, TWO_SIDED_AREA: { return from_area(number, at, u); }
        case DIRECTIONAL: { return DirectSample(-light.n, far, light.n, 1.0, emitted, 0u, true); }
        case SUN: {
            let dir = to_world(frame_around(light.n), uniform_cap(u.xy, light.plateau));
            return DirectSample(-dir, far, dir, light.pdf_dir, emitted, 0u, true);
        }
        case ENVIRONMENT: {
            let wi = uniform_sphere(u.xy);
            return DirectSample(wi, far, -wi, light.pdf_dir, quotients(emitted, light.pdf_dir), 0u, false);
        }
        default: { return from_point(light.position - at, emitted); }
    }
}

// `Light::pdf_direct`: density per solid angle of `sample_direct` from a point choosing `wi`, for a ray that met the
// light by chance, or left the scene.
fn pdf_direct(number: u32, at: vec3f, wi: vec3f, hit: LightHit) -> f32 {
    let light = lights[number];
    let is_met = hit.distance < of_bits(INFINITY);
    if (light.kind == AREA || light.kind == TWO_SIDED_AREA) {
        if (!is_met) { return 0.0; }
        let cone = cone_of_surface(light, at);
        if (cone.is_seen) { return cone_pdf(cone); }
        return per_solid_angle(light.pdf_pos, facing(light, -dot3(wi, hit.normal)), hit.distance);
    }
    return select(0.0, light.pdf_dir, light.kind == ENVIRONMENT && !is_met);
}

// `Light::photon_density`: density of emitted photons per area across `wi` at a point, over the density with which
// `sample_direct` from there chooses that light. `hit`: where the light is met.
fn photon_density(number: u32, at: vec3f, wi: vec3f, hit: LightHit) -> f32 {
    let light = lights[number];
    let distance2 = hit.distance * hit.distance;
    switch light.kind {
        case SPOT, SMOOTH_SPOT: {
            let falloff = spot_falloff(light, angle_from_axis(light, -wi));
            let view = view_of_spot(light, at);
            var area = distance2;
            if (!(view.way == AS_POINT)) { area = spot_area(light) * spot_view_pdf(light, view, wi); }
            return quotient(falloff, light.solid_angle * area);
        }
        case AREA, TWO_SIDED_AREA: {
            return quotient(light.pdf_pos, sides_of(light) * 3.1415927f * pdf_direct(number, at, wi, hit));
        }
        case DIRECTIONAL, SUN, ENVIRONMENT: { return light.pdf_pos; }
        default: { return quotient(0.25, 3.1415927f * distance2); }
    }
}

// `Light::emitted_density`: density of photons, per area across their way and solid angle, where one is emitted in
// this direction. Zero for light that is parallel or comes from a point.
fn emitted_density(number: u32, dir: vec3f) -> f32 {
    let light = lights[number];
    switch light.kind {
        case AREA, TWO_SIDED_AREA: { return quotient(light.pdf_pos, sides_of(light) * 3.1415927f); }
        case ENVIRONMENT, SUN: { return quotient(light.pdf_dir, 3.1415927f * light.radius * light.radius); }
        case SPOT, SMOOTH_SPOT: {
            if (light.radius > 0.0) { return quotient(spot_pdf(light, dir), spot_area(light)); }
            return 0.0;
        }
        default: { return 0.0; }
    }
}

// `Scene::emitted`: radiance of an object's surface with a geometric normal `ng`, against the direction of a ray that
// meets it.
fn emitted_radiance(object: u32, ng: vec3f, dir: vec3f) -> vec3f {
    let light = surfaces[object].light;
    if (light == NONE) { return vec3f(0.0); }
    let shines = -dot3(ng, dir) > 0.0 || lights[light].kind == TWO_SIDED_AREA;
    return select(vec3f(0.0), light_sources[light].emitted, shines);
}

// `Scene::environment`: radiance of a light that is all around; zero of any other.
fn environment_radiance(light: u32) -> vec3f {
    return select(vec3f(0.0), light_sources[light].emitted, lights[light].kind == ENVIRONMENT);
}

// `Scene::only_sampled`.
fn only_sampled(light: u32) -> bool { return light_sources[light].only_sampled == 1u; }
