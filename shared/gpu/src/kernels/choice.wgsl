// Choice of a light at a point. Same structs as in `world/choice.rs`; functions match the renderer's `world/light/`
// operation for operation.

// Where a light shines: environment, distant, everywhere, in a cone, in front of a plane, in front of four planes.
const ALL_AROUND: u32 = 0u;
const FROM_AFAR: u32 = 1u;
const EVERYWHERE: u32 = 2u;
const IN_CONE: u32 = 3u;
const BEFORE_PLANE: u32 = 4u;
const IN_PYRAMID: u32 = 5u;

// A light, reduced to what matters for the choice, and its emission.
struct LightSource {
    // Centre of the light; for directional lights, the direction of travel.
    center: vec3f,
    region: u32,
    // Apex of the cone or pyramid, or a point on the plane.
    apex: vec3f,
    // Squared radius.
    softening: f32,
    // Axis of the cone, or normal of the plane.
    axis: vec3f,
    // Mean channel of the flux per steradian, W/sr; for distant lights of the irradiance, W/m^2.
    intensity: f32,
    // W/sr of a point, and of a spot on its axis; W/m^2 of directional lights; W/(m^2 sr) of surfaces and environments.
    // With a texture, the value where the texture is one.
    emitted: vec3f,
    // Cosine of a cone's half angle; for a sun, the sine.
    width: f32,
    // The object that shadow rays to it ignore, or NONE.
    unshadowing: u32,
    // Not 0 if rays may pass its surface unseen: all its direct light comes from light sampling. 2 if paths that
    // continue from where lights were sampled test it nevertheless.
    only_sampled: u32,
    // Offset of a pyramid's inward plane normals in `light_tables`.
    table: u32,
    // Class bits: its own, its surface's, and those that shadow rays to it ignore wherever they start.
    class_bit: u32,
    shape_class: u32,
    hides: u32,
    // Class bits that its photons ignore.
    photon_hides: u32,
}

// How lights are chosen, and what shadow rays test.
struct Lighting {
    lights: u32,
    // There are several lights, but few enough to weigh each at every point.
    is_weighed: u32,
    // Shadow rays must inspect what they meet.
    shadow_rays_walk: u32,
    // There are visibility rules.
    has_rules: u32,
    // Class bits that camera rays ignore, and those that paths ignore from their second vertex on.
    camera_hides: u32,
    gather_hides: u32,
    // Offset in `light_tables` of flags by medium and light: 1 if none of its light arrives there unscattered. 0: no
    // flags.
    unlit: u32,
}

@group(0) @binding(31) var<storage, read> light_sources: array<LightSource>;
@group(0) @binding(33) var<storage, read> lighting: Lighting;

// Which lights to choose from: those aimed at, where scattered rays continue and may hit the others (`Seen::Later`); or
// all, where a path ends and on its segments (`Seen::Last`, `Seen::ByGatherRay`, `single_scattering`). At a first
// vertex (`Seen::First`) its surface decides: `lit_by`.
const AIMED_AT: u32 = 0u;
const ALL_LIGHTS: u32 = 1u;

struct LightChoice {
    light: u32,
    // Probability of the choice, or expected number of times it is made.
    pmf: f32,
    // The uniform number, rescaled to be uniform within the choice.
    u: f32,
}

// Clamps to [0, 1]; NaN stays.
fn within_one(x: f32) -> f32 { return select(select(x, 1.0, x > 1.0), 0.0, x < 0.0); }

// Number of lights to choose from, or 0 if none is ever chosen.
fn choices_among(among: u32) -> u32 {
    let count = lighting.lights;
    if (count == 0u) { return 0u; }
    return select(0u, count, light_tables[(among + 1u) * count - 1u] > 0.0);
}

fn power_pmf(among: u32, light: u32) -> f32 {
    if (lighting.lights == 0u) { return 0.0; }
    return pmf_in_table(among * lighting.lights, light);
}

fn choose_by_power(among: u32, u: f32) -> LightChoice {
    let count = choices_among(among);
    if (count == 0u) { return LightChoice(NONE, 0.0, 0.0); }
    let choice = choose_in_table(among * lighting.lights, count, u);
    return LightChoice(choice.index, choice.pmf, choice.u);
}

// An inward normal.
fn plane_of_pyramid(source: LightSource, plane: u32) -> vec3f {
    let first = source.table + 3u * plane;
    return vec3f(light_tables[first], light_tables[first + 1u], light_tables[first + 2u]);
}

// Approximate unoccluded irradiance at a point, W/m^2, on a surface that faces the light or has this normal.
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
    } else if (source.region == IN_PYRAMID) {
        let away = at - source.apex;
        for (var plane = 0u; plane < 4u; plane++) {
            if (!(dot3(away, plane_of_pyramid(source, plane)) >= 0.0)) { at_light = 0.0; }
        }
    } else if (source.region == BEFORE_PLANE) {
        let cosine = quotient(-dot3(offset, source.axis), distance);
        let is_before = dot3(at - source.apex, source.axis) > 0.0;
        at_light = select(0.0, 2.0 * select(0.05f, cosine, cosine > 0.05f), is_before);
    }
    var cosine = 1.0;
    if (has_normal) { cosine = within_one(quotient(dot3(offset, normal) + root(source.softening), distance)); }
    return quotient(source.intensity, distance2) * at_light * cosine;
}

// By power alone, by each light's irradiance, or none.
const BY_POWER: u32 = 0u;
const BY_IRRADIANCE: u32 = 1u;
const DARK: u32 = 2u;

// Light probabilities at a point.
struct LocalChoice {
    point: vec3f,
    among: u32,
    normal: vec3f,
    way: u32,
    has_normal: bool,
    // Sums over the lights that reach the point.
    irradiance: f32,
    power: f32,
}

// `normal`, if `has_normal`: of a surface that is lit from that side only. `among`: see AIMED_AT.
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

// Probability of a light, given that one is chosen.
fn light_pmf(choice: LocalChoice, light: u32) -> f32 {
    let pmf = power_pmf(choice.among, light);
    if (choice.way == BY_POWER) { return pmf; }
    if (choice.way == DARK) { return 0.0; }
    let irradiance = irradiance_at(light, choice.point, choice.normal, choice.has_normal);
    if (!(pmf > 0.0 && irradiance > 0.0)) { return 0.0; }
    return quotient(0.8f * irradiance, choice.irradiance) + quotient(0.2f * pmf, choice.power);
}

// Expected number of times that `next_light` returns a light, at most 1: `LocalChoice::samples_of`.
fn samples_of(choice: LocalChoice, light: u32) -> f32 {
    let pmf = light_pmf(choice, light);
    if (choice.way == BY_POWER) { return pmf; }
    return not_above_one(2.0 * pmf);
}

// `LocalChoice::each` as an iterator: returns the chosen lights one by one, then NONE once. `next` starts at 0; the
// caller draws a light's own numbers between calls.
fn next_light(choice: LocalChoice, next: ptr<function, u32>, s: ptr<function, Sampler>) -> LightChoice {
    let count = choices_among(choice.among);
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

// `LocalChoice::sample`: one light by `u` in [0, 1), or NONE if no light reaches the point.
fn sample_light(choice: LocalChoice, u: f32) -> LightChoice {
    if (choice.way == BY_POWER) { return choose_by_power(choice.among, u); }
    var chosen = LightChoice(NONE, 0.0, 0.0);
    var left = u;
    for (var light = 0u; light < choices_among(choice.among); light++) {
        let pmf = light_pmf(choice, light);
        if (pmf > 0.0) {
            chosen = LightChoice(light, pmf, below_one(quotient(left, pmf)));
            left -= pmf;
            if (left < 0.0) { break; }
        }
    }
    return chosen;
}
