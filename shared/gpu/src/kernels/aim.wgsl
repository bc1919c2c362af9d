// Photons aimed at discs where camera paths found their light. Matches the renderer's `plan/targeting` operation for
// operation; same structs as in `world/aims.rs`.

struct Aim {
    // Share of photons that start as the light emits them.
    plain: f32,
    // The light's discs; count 0: its photons are not aimed.
    first: u32,
    count: u32,
    // Root of the discs' BVH in `nodes`.
    root: u32,
    // W/sr of a point light, and of a spot on its axis; for light from one direction, its fluence times its density;
    // radiance of surfaces and environments.
    emitted: vec3f,
    // Density of directions per solid angle, if constant.
    own_pdf: f32,
    // Share of an environment's aimed photons that use the light's own directions.
    own_directions: f32,
}

struct AimDisc {
    center: vec3f,
    radius: f32,
    // Unit vector towards the light.
    normal: vec3f,
    // Cosine of the half angle of the cone of directions to a distant light.
    cos_spread: f32,
    // Probability of choosing the disc, over its area.
    density: f32,
    // Probability of this disc and those before it.
    sum: f32,
    // The cone as 1 - cos; its density per solid angle, times the share of directions drawn from it.
    cone: f32,
    cone_pdf: f32,
}

@group(0) @binding(60) var<storage, read> aims: array<Aim>;
@group(0) @binding(61) var<storage, read> aim_discs: array<AimDisc>;

// Share of directions drawn from the whole hemisphere.
const WIDE_DIRECTIONS: f32 = 0.3f;

fn is_aimed(light: u32) -> bool { return aims[light].count > 0u; }

// The disc that a ray was drawn through, or NOTHING; and whether its direction came from the disc's cone.
struct Drawn { disc: u32, is_in_cone: bool }

// Distance at which a ray meets the disc's plane, and the cosine to its normal, positive in front.
fn disc_crossing(disc: u32, ray: Ray) -> vec2f {
    let normal = aim_discs[disc].normal;
    let cosine = -dot3(normal, ray.dir);
    return vec2f(quotient(dot3(normal, ray.origin - aim_discs[disc].center), cosine), cosine);
}

// Sums over the discs whose fronts a ray meets.
struct AimDensity {
    // Per solid angle from the ray's origin.
    from_point: f32,
    // Per area across the ray; `of_line` also per solid angle, with directions drawn at the disc.
    of_point: f32,
    of_line: f32,
}

fn add_disc(sums: ptr<function, AimDensity>, disc: u32, t: f32, cosine: f32, is_in_cone: bool) {
    let density = quotient(aim_discs[disc].density, cosine);
    var directions = quotient(WIDE_DIRECTIONS, 6.2831855f);
    if (is_in_cone || cosine >= aim_discs[disc].cos_spread) { directions += aim_discs[disc].cone_pdf; }
    (*sums).from_point += aim_discs[disc].density * quotient(t * t, cosine);
    (*sums).of_point += density;
    (*sums).of_line += density * directions;
}

// The disc that the ray was drawn through is added unconditionally, and last: rounding may make the ray miss it.
fn density_along(aim: Aim, ray: Ray, drawn: Drawn) -> AimDensity {
    var sums = AimDensity(0.0, 0.0, 0.0);
    let space = space_of(ray.origin, ray.dir);
    let far = of_bits(INFINITY);
    var stack: Stack;
    stack[0] = Waiting(0.0, aim.root);
    var waiting = 1u;
    while (waiting > 0u) {
        waiting -= 1u;
        let next = stack[waiting].child;
        if ((next & LEAF) == 0u) {
            waiting = push_met(&stack, waiting, enter(next, space, far), nodes[next].children);
            continue;
        }
        let disc = next & ~OF_KIND;
        if (disc == drawn.disc) { continue; }
        let met = disc_crossing(disc, ray);
        if (met.y > 0.0 && met.x > 0.0) {
            let off = ray.origin + ray.dir * met.x - aim_discs[disc].center;
            let radius = aim_discs[disc].radius;
            if (dot3(off, off) <= radius * radius) { add_disc(&sums, disc, met.x, met.y, false); }
        }
    }
    if (!(drawn.disc == NOTHING)) {
        let met = disc_crossing(drawn.disc, ray);
        if (met.y > 0.0) { add_disc(&sums, drawn.disc, met.x, met.y, drawn.is_in_cone); }
    }
    return sums;
}

fn is_from_afar(light: Light) -> bool {
    return light.kind == DIRECTIONAL || light.kind == SUN || light.kind == ENVIRONMENT || light.kind == ENVIRONMENT_MAP;
}

// Cosine to a surface's normal, zero on a side that does not emit.
fn cosine_at(light: Light, start: Emission) -> f32 {
    let cosine = dot3(start.normal, start.dir);
    return select(not_below_zero(cosine), abs(cosine), light.kind == TWO_SIDED_AREA);
}

// An image environment's own density for a direction of travel.
fn own_map_pdf(light: Light, dir: vec3f) -> f32 { return map_pdf(light, place_on_map(light, -dir)); }

// Density of a start: per solid angle, and for distant light also per area across the ray; then the latter alone.
fn mixture_density(number: u32, light: Light, start: Emission, drawn: Drawn) -> vec2f {
    let aim = aims[number];
    var ray = Ray(start.origin, start.dir);
    var own_pdf = aim.own_pdf;
    var own_point = 0.0;
    let is_afar = is_from_afar(light);
    if (is_afar) {
        // Discs may reach out of the bounds, so the line starts before them.
        ray.origin = ray.origin + ray.dir * (-2.0 * light.radius);
        own_point = light.pdf_pos;
        if (light.kind == ENVIRONMENT_MAP) { own_pdf = own_map_pdf(light, start.dir); }
        own_pdf = own_pdf * own_point;
    } else if (is_surface(light)) {
        own_pdf = quotient(cosine_at(light, start), select(1.0, 2.0, light.kind == TWO_SIDED_AREA) * 3.1415927f);
    } else if (light.kind == SPOT || light.kind == SMOOTH_SPOT) {
        own_pdf = spot_pdf(light, start.dir);
    } else if (light.kind == PROJECTOR) {
        own_pdf = projector_pdf(light, start.dir);
    }
    let sums = density_along(aim, ray, drawn);
    var aimed_pdf = sums.from_point;
    var aimed_point = 0.0;
    if (is_afar) {
        aimed_point = sums.of_point;
        aimed_pdf = aim.own_pdf * aimed_point;
        if (light.kind == ENVIRONMENT || light.kind == ENVIRONMENT_MAP) {
            var by_itself = 0.0;
            if (aim.own_directions > 0.0 && aimed_point > 0.0) {
                by_itself = aim.own_directions * own_map_pdf(light, start.dir) * aimed_point;
            }
            aimed_pdf = by_itself + (1.0 - aim.own_directions) * sums.of_line;
        }
    }
    let share = 1.0 - aim.plain;
    return vec2f(aim.plain * own_pdf + share * aimed_pdf, aim.plain * own_point + share * aimed_point);
}

// A photon's power times the density it was drawn with; for surfaces, over the density of the point.
fn emitted_along(aim: Aim, light: Light, start: Emission) -> vec3f {
    switch light.kind {
        case SPOT, SMOOTH_SPOT: { return spot_intensity(light, aim.emitted, start.dir); }
        case PROJECTOR: { return projector_intensity(light, start.dir); }
        case AREA, TWO_SIDED_AREA: {
            let cosine = cosine_at(light, start);
            if (!has_texture(light)) { return aim.emitted * quotient(cosine, start.pdf_pos); }
            // From the power it was drawn with: radiance times pi over the density, for each side.
            return start.power * quotient(cosine, select(1.0, 2.0, light.kind == TWO_SIDED_AREA) * 3.1415927f);
        }
        case ENVIRONMENT_MAP: { return map_value(light, place_on_map(light, -start.dir)) * light.power; }
        default: { return aim.emitted; }
    }
}

// Picks a disc by a uniform number: the first whose running sum exceeds it, or the last.
fn chosen_disc(aim: Aim, u: f32) -> u32 {
    var low = aim.first;
    var high = aim.first + aim.count - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (aim_discs[middle].sum <= u) { low = middle + 1u; } else { high = middle; }
    }
    return low;
}

// A start through a disc; `is_there` is false if the light does not shine there.
struct AimedStart { start: Emission, drawn: Drawn, is_there: bool }

// `choice`: uniform in [0, 1).
fn aimed_start(aim: Aim, light: Light, plain: Emission, u: EmissionUniforms, choice: f32) -> AimedStart {
    let disc = chosen_disc(aim, choice);
    var below = 0.0;
    if (disc > aim.first) { below = aim_discs[disc - 1u].sum; }
    let left = below_one(not_below_zero(quotient(choice - below, aim_discs[disc].sum - below)));
    let frame = frame_around(aim_discs[disc].normal);
    let is_afar = is_from_afar(light);
    let on_disc = concentric_disk(select(u.direction, u.position, is_afar)) * aim_discs[disc].radius;
    let point = aim_discs[disc].center + to_world(frame, vec3f(on_disc, 0.0));
    var drawn = Drawn(disc, false);
    var start = plain;
    var is_there = true;
    if (is_afar) {
        let is_all_around = light.kind == ENVIRONMENT || light.kind == ENVIRONMENT_MAP;
        if (is_all_around && !(left < aim.own_directions)) {
            let x = u.direction.x;
            drawn.is_in_cone = x >= WIDE_DIRECTIONS;
            let wide = quotient(x, WIDE_DIRECTIONS);
            let narrow = quotient(x - WIDE_DIRECTIONS, 1.0 - WIDE_DIRECTIONS);
            let square = vec2f(select(wide, narrow, drawn.is_in_cone), u.direction.y);
            start.dir = -to_world(frame, uniform_cap(square, select(1.0, aim_discs[disc].cone, drawn.is_in_cone)));
        }
        let off = point - light.position;
        let across = off - start.dir * dot3(off, start.dir);
        is_there = dot3(across, across) <= light.radius * light.radius;
        start.origin = light.position + across - start.dir * light.radius;
    } else {
        start.dir = unit_or(point - start.origin, vec3f(0.0));
        if (light.kind == TWO_SIDED_AREA && dot3(start.normal, start.dir) < 0.0) { start.normal = -start.normal; }
    }
    return AimedStart(start, drawn, is_there && dot3(aim_discs[disc].normal, start.dir) < 0.0);
}

// Samples the mixture of plain and aimed emission; power 0: no photon starts. `plain`: a start as the light emits it.
// `choice`: uniform in [0, 1).
fn mixture_start(number: u32, light: Light, plain: Emission, u: EmissionUniforms, choice: f32) -> Emission {
    let aim = aims[number];
    var aimed = AimedStart(plain, Drawn(NOTHING, false), true);
    if (!(choice < aim.plain)) {
        let left = quotient(choice - aim.plain, 1.0 - aim.plain);
        aimed = aimed_start(aim, light, plain, u, select(0.9999999f, left, left < 0.9999999f));
    }
    var start = aimed.start;
    let density = mixture_density(number, light, start, aimed.drawn);
    let power = quotients(emitted_along(aim, light, start), density.x);
    if (light.kind == DIRECTIONAL) {
        start.pdf_pos = density.x;
    } else if (is_from_afar(light)) {
        start.pdf_pos = density.y;
        start.pdf_dir = quotient(density.x, density.y);
    } else {
        start.pdf_dir = density.x;
    }
    let is_finite = all(abs(power) < vec3f(of_bits(INFINITY)));
    start.power = select(vec3f(0.0), power, aimed.is_there && density.x > 0.0 && is_finite);
    return start;
}
