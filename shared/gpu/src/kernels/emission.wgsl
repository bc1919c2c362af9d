// Where photons start, in render space. Same structs as in `world/lights.rs`.

const POINT: u32 = 0u;
// Falloff linear in the angle, or smooth in the cosine.
const SPOT: u32 = 1u;
const SMOOTH_SPOT: u32 = 2u;
const DIRECTIONAL: u32 = 3u;
const SUN: u32 = 4u;
const AREA: u32 = 5u;
const TWO_SIDED_AREA: u32 = 6u;
// Constant, or by an image.
const ENVIRONMENT: u32 = 7u;
const ENVIRONMENT_MAP: u32 = 8u;
const PROJECTOR: u32 = 9u;

const NO_TEXTURE: u32 = 0xffffffffu;

struct Light {
    // Position of a point, a spot, a projector or a round surface; for distant lights, the centre of the scene.
    position: vec3f,
    kind: u32,
    // Flux of every sample, W; for spots the intensity on the axis, W/sr. With a texture, the emission where that is
    // one: intensity, W/sr, or radiance, W/(m^2 sr).
    power: vec3f,
    // Radius of a spot or ball; for a disc, of a circle with its area; for distant lights, of the scene. Zero for other
    // surfaces. Scene units.
    radius: f32,
    // Axes s, t, n of a spot's frame; of a ball, as long as its radius; of a disc, n its unit normal; right, up and
    // away of a projector's image; of an environment image's space; a uniform rectangle's sides and normal. For
    // directional lights, n is the direction of travel.
    s: vec3f,
    // Density of the position per area.
    pdf_pos: f32,
    t: vec3f,
    // Density of the direction per solid angle, if constant.
    pdf_dir: f32,
    n: vec3f,
    // First triangle of a surface in `emitters`; for round ones, DISC_LIGHT and TURNED_LIGHT bits.
    first: u32,
    // A spot's plateau, or a sun's cone, as 1 - cos.
    plateau: f32,
    // A spot's cone, as 1 - cos.
    cone: f32,
    // Integral of a spot's falloff, sr.
    solid_angle: f32,
    // The plateau's share of it.
    share: f32,
    // A spot's half angles, radians: plateau and cone.
    beam_width: f32,
    cutoff: f32,
    // Number of a surface's triangles.
    count: u32,
    // Medium that photons start in.
    medium: u32,
    // Two corners of the lit part of a projector's image, which spans (-1, -1), the lower left, to (1, 1).
    lit: vec4f,
    // Half the width and height of an image at distance 1; or the sides of a uniform rectangle, from `position` along s
    // and t.
    half: vec2f,
    // Emission texture, or NO_TEXTURE.
    texture: u32,
    // Offset of its part of `light_tables`.
    table: u32,
}

// Bits of round surfaces: a disc, not a ball.
const DISC_LIGHT: u32 = 1u;
// Its normal is opposite to the shape's.
const TURNED_LIGHT: u32 = 2u;

// A triangle of an emitting surface.
struct Emitter {
    a: vec3f,
    // Uniform numbers from here on choose later triangles.
    end: f32,
    b: vec3f,
    c: vec3f,
    normal: vec3f,
    uv_a: vec2f,
    uv_b: vec2f,
    uv_c: vec2f,
}

@group(0) @binding(28) var<storage, read> emitters: array<Emitter>;

struct EmissionUniforms {
    // Place on the light.
    position: vec2f,
    direction: vec2f,
    // Triangle, or depth in a ball.
    primitive: f32,
}

struct Emission {
    origin: vec3f,
    // Per solid angle; infinite for parallel light.
    pdf_dir: f32,
    // Direction of travel.
    dir: vec3f,
    // Per area; infinite for point light.
    pdf_pos: f32,
    // Flux that the sample stands for as the only one, W.
    power: vec3f,
    // The emitting triangle.
    triangle: u32,
    // Its normal on the photon's side; zero for lights that are not surfaces.
    normal: vec3f,
}

fn one_minus_cos(angle: f32) -> f32 {
    let half = sin_cos(0.5 * angle).x;
    return 2.0 * half * half;
}

// Intensity relative to that on the axis.
fn spot_falloff(light: Light, angle: f32) -> f32 {
    if (angle <= light.beam_width) { return 1.0; }
    if (!(angle < light.cutoff)) { return 0.0; }
    if (light.kind == SMOOTH_SPOT) {
        let x = quotient(light.cone - one_minus_cos(angle), light.cone - light.plateau);
        let clamped = not_above_one(not_below_zero(x));
        return clamped * clamped * (3.0 - 2.0 * clamped);
    }
    return quotient(light.cutoff - angle, light.cutoff - light.beam_width);
}

// The point of a spot's ball that light starts from.
fn spot_start(light: Light, u: vec2f, depth: f32) -> vec3f {
    if (light.radius == 0.0) { return light.position; }
    let across = concentric_disk(u);
    let half_chord = root(not_below_zero(1.0 - (across.x * across.x + across.y * across.y)));
    let along = sin_cos(3.1415927f * (depth - 0.5)).x;
    let local = vec3f(across, half_chord * along);
    return light.position + to_world(Frame(light.s, light.t, light.n), local) * light.radius;
}

struct SpotSample {
    dir: vec3f,
    // From the axis.
    angle: f32,
    // Per solid angle.
    pdf: f32,
}

// Samples the plateau uniformly, with its share of the flux, else the ramp with a density linear in the cosine.
fn sample_spot(light: Light, u: vec2f) -> SpotSample {
    let width = light.cone - light.plateau;
    var h = 0.0;
    var pdf = 0.0;
    if (u.x < light.share || light.cone <= light.plateau) {
        h = not_above_one(quotient(u.x, light.share)) * light.plateau;
        pdf = quotient(1.0, light.solid_angle);
    } else {
        let left = quotient(1.0 - u.x, 1.0 - light.share);
        let side = root(not_above_one(left));
        pdf = quotient((1.0 - light.share) * side, 3.1415927f * width);
        h = light.cone - width * side;
    }
    let sine = root(not_below_zero(h * (2.0 - h)));
    let turn = sin_cos(6.2831855f * u.y);
    let local = vec3f(sine * turn.y, sine * turn.x, 1.0 - h);
    return SpotSample(to_world(Frame(light.s, light.t, light.n), local), arc_tan2(sine, 1.0 - h), pdf);
}

fn emit_spot(light: Light, u: EmissionUniforms) -> Emission {
    let sample = sample_spot(light, u.direction);
    return Emission(
        spot_start(light, u.position, u.primitive),
        sample.pdf,
        sample.dir,
        light.pdf_pos,
        light.power * quotient(spot_falloff(light, sample.angle), sample.pdf),
        0u,
        vec3f(0.0),
    );
}

// Distant light, through the disc that covers the scene, starting just outside of it.
fn emit_from_afar(light: Light, u: EmissionUniforms) -> Emission {
    var dir = light.n;
    var pdf_dir = light.pdf_dir;
    var power = light.power;
    switch light.kind {
        case SUN: { dir = to_world(frame_around(dir), uniform_cap(u.direction, light.plateau)); }
        case ENVIRONMENT: { dir = -uniform_sphere(u.direction); }
        case ENVIRONMENT_MAP: {
            let towards = sample_map(light, u.direction);
            dir = -towards.dir;
            pdf_dir = towards.pdf;
            let radiance = map_value(light, place_on_map(light, towards.dir)) * light.power;
            power = quotients(radiance, pdf_dir) * (3.1415927f * light.radius * light.radius);
        }
        default: {}
    }
    let disc = concentric_disk(u.position);
    let offset = to_world(frame_around(dir), vec3f(disc, -1.0));
    let origin = light.position + offset * light.radius;
    return Emission(origin, pdf_dir, dir, light.pdf_pos, power, 0u, vec3f(0.0));
}

fn emit_projector(light: Light, u: EmissionUniforms) -> Emission {
    let dir = sample_projector(light, u.direction);
    let pdf_dir = projector_pdf(light, dir);
    let power = quotients(projector_intensity(light, dir), pdf_dir);
    return Emission(light.position, pdf_dir, dir, light.pdf_pos, power, 0u, vec3f(0.0));
}

// Picks a triangle by a uniform number: the first whose `end` is beyond it.
fn emitter_of(light: Light, u: f32) -> u32 {
    var low = 0u;
    var high = light.count - 1u;
    while (low < high) {
        let middle = (low + high) / 2u;
        if (emitters[light.first + middle].end <= u) { low = middle + 1u; } else { high = middle; }
    }
    return low;
}

fn is_surface(light: Light) -> bool { return light.kind == AREA || light.kind == TWO_SIDED_AREA; }

fn is_round(light: Light) -> bool { return light.radius > 0.0; }

// Azimuth as a fraction of a turn, 0 to 1.
fn turn_of(p: vec2f) -> f32 {
    let phi = arc_tan2(p.y, p.x);
    return quotient(select(phi, phi + 6.2831855f, phi < 0.0), 6.2831855f);
}

// Texture coordinates on the unit sphere and the unit disc.
fn sphere_uv(p: vec3f) -> vec2f { return vec2f(turn_of(p.xy), quotient(arc_cos(p.z), 3.1415927f)); }

fn disc_uv(p: vec2f) -> vec2f { return vec2f(root(dot2(p, p)), turn_of(p)); }

// A point on an emitting surface.
struct OnLight { point: vec3f, normal: vec3f, triangle: u32, uv: vec2f }

fn has_texture(light: Light) -> bool { return light.texture != NO_TEXTURE; }

// Density per area of `on_surface`; for textured triangles it is in the light's table.
fn pdf_on_surface(light: Light, triangle: u32) -> f32 {
    if (has_texture(light) && !is_round(light)) { return light_tables[light.table + triangle]; }
    return light.pdf_pos;
}

// Samples a point: `shape.sample_area`, or `pattern.sample`.
fn on_surface(light: Light, u: vec2f, primitive: f32) -> OnLight {
    if (!is_round(light)) {
        let triangle = emitter_of(light, primitive);
        let emitter = emitters[light.first + triangle];
        let w = uniform_triangle(u);
        let point = emitter.a * (1.0 - w.x - w.y) + emitter.b * w.x + emitter.c * w.y;
        let uv = emitter.uv_a * (1.0 - w.x - w.y) + emitter.uv_b * w.x + emitter.uv_c * w.y;
        return OnLight(point, emitter.normal, triangle, uv);
    }
    var offset = vec3f(0.0);
    var normal = light.n;
    var uv = vec2f(0.0);
    if ((light.first & DISC_LIGHT) != 0u) {
        let p = concentric_disk(u);
        offset = light.s * p.x + light.t * p.y;
        if (has_texture(light)) { uv = disc_uv(p); }
    } else {
        let p = uniform_sphere(u);
        offset = light.s * p.x + light.t * p.y + light.n * p.z;
        normal = unit_vector(offset);
        if (has_texture(light)) { uv = sphere_uv(p); }
    }
    let is_turned = (light.first & TURNED_LIGHT) != 0u;
    return OnLight(offset + light.position, select(normal, -normal, is_turned), 0u, uv);
}

fn emit_area(light: Light, u: EmissionUniforms) -> Emission {
    let at = on_surface(light, u.position, u.primitive);
    var normal = at.normal;
    var direction = u.direction;
    var sides = 1.0;
    if (light.kind == TWO_SIDED_AREA) {
        // Each side with probability 1/2; the number is rescaled.
        sides = 2.0;
        direction.x = 2.0 * direction.x;
        if (!(direction.x < 1.0)) {
            normal = -normal;
            direction.x = direction.x - 1.0;
        }
    }
    let local = cosine_hemisphere(direction);
    let pdf_dir = quotient(not_below_zero(local.z) * 0.31830987f, sides);
    let dir = to_world(frame_around(normal), local);
    let pdf_pos = pdf_on_surface(light, at.triangle);
    var power = light.power;
    if (has_texture(light)) {
        power = texture_value(textures[light.texture], at.uv) * power * quotient(sides * 3.1415927f, pdf_pos);
    }
    return Emission(at.point, pdf_dir, dir, pdf_pos, power, at.triangle, normal);
}

fn emit(light: Light, u: EmissionUniforms) -> Emission {
    switch light.kind {
        case SPOT, SMOOTH_SPOT: { return emit_spot(light, u); }
        case AREA, TWO_SIDED_AREA: { return emit_area(light, u); }
        case DIRECTIONAL, SUN, ENVIRONMENT, ENVIRONMENT_MAP: { return emit_from_afar(light, u); }
        case PROJECTOR: { return emit_projector(light, u); }
        default: {
            let dir = uniform_sphere(u.direction);
            return Emission(light.position, light.pdf_dir, dir, light.pdf_pos, light.power, 0u, vec3f(0.0));
        }
    }
}
