// Samples light at a point from a chosen light. Functions match the renderer's `world/light/` operation for operation.
//
//     let choice = light_choice(point, normal, has_normal, AIMED_AT);
//     var next = 0u;
//     loop {
//         let chosen = next_light(choice, &next, &sampler);
//         if (chosen.light == NONE) { break; }
//         let direct = sample_direct(chosen.light, point, draw_direct(chosen.light, &sampler));
//         if (direct.pdf > 0.0) { .. direct.weight over chosen.pmf .. }
//     }

// Light towards a point, for shadow rays.
struct DirectSample {
    // Towards the light.
    wi: vec3f,
    // Infinite for distant lights.
    distance: f32,
    // Normal of the light's surface; -wi if it has none.
    normal: vec3f,
    // Per solid angle; 1 for point and parallel lights. Zero: nothing arrives.
    pdf: f32,
    // Radiance over `pdf`; for point and parallel lights, the irradiance across `wi`.
    weight: vec3f,
    triangle: u32,
    // No ray can hit the light by chance.
    unmet: bool,
}

fn no_light() -> DirectSample {
    return DirectSample(vec3f(0.0), 0.0, vec3f(0.0), 0.0, vec3f(0.0), 0u, false);
}

// Where a ray hit a light; `distance` is infinite if it left the scene.
struct LightHit {
    // Geometric normal, outward.
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

// The cone that a ball subtends, seen from outside.
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

// How a spot is sampled from a point: as a point, by the cone of its ball if narrower than its beam, or by its beam.
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

// Light towards a point as if the whole spot emitted from `start`.
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
    // The ray's chord in the ball.
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

// Cosine to the surface's normal, positive on a side that emits.
fn facing(light: Light, cosine: f32) -> f32 { return select(cosine, abs(cosine), light.kind == TWO_SIDED_AREA); }

fn sides_of(light: Light) -> f32 { return select(1.0, 2.0, light.kind == TWO_SIDED_AREA); }

// Converts a density per area to one per solid angle; zero on the side that does not emit, and on overflow.
fn per_solid_angle(pdf_area: f32, cosine: f32, distance: f32) -> f32 {
    let pdf = quotient(pdf_area * distance * distance, cosine);
    return select(0.0, pdf, cosine > 0.0 && pdf > 0.0 && pdf < of_bits(INFINITY));
}

// The surface's cone, if it is a ball that emits only outwards.
fn cone_of_surface(light: Light, at: vec3f) -> BallCone {
    if (is_round(light) && light.kind == AREA && light.first == 0u) {
        return cone_of_ball(light.position, light.radius, at);
    }
    return BallCone(vec3f(0.0), 0.0, false);
}

// Uniform in the ball's cone; the weight is left to the caller.
fn from_ball(light: Light, cone: BallCone, at: vec3f, u: vec2f) -> DirectSample {
    let way = light.position - at;
    let far = root(dot3(way, way));
    let ratio = quotient(light.radius, far);
    let one_minus_cos = u.x * cone.one_minus_cos;
    let sin2 = one_minus_cos * (2.0 - one_minus_cos);
    // The nearer root of t^2 - 2 d cos t + d^2 - r^2 = 0: the product of both over the farther one.
    let half_chord = light.radius * root(not_below_zero(1.0 - quotient(sin2, ratio * ratio)));
    let product = (far - light.radius) * (far + light.radius);
    let distance = quotient(product, far * (1.0 - one_minus_cos) + half_chord);
    let wi = to_world(frame_around(cone.axis), uniform_cap(u, cone.one_minus_cos));
    let normal = quotients(wi * distance - cone.axis * far, light.radius);
    let pdf = cone_pdf(cone);
    return DirectSample(wi, distance, normal, pdf, vec3f(0.0), 0u, false);
}

// Radiance of a surface at these texture coordinates.
fn radiance_there(number: u32, uv: vec2f) -> vec3f {
    let emitted = light_sources[number].emitted;
    let texture = lights[number].texture;
    if (texture == NO_TEXTURE) { return emitted; }
    return texture_value(textures[texture], uv) * emitted;
}

// Texture coordinates at a ball's normal.
fn uv_of_ball(light: Light, normal: vec3f) -> vec2f {
    return sphere_uv(unit_vector(to_local(Frame(light.s, light.t, light.n), normal)));
}

fn from_area(number: u32, at: vec3f, u: vec3f) -> DirectSample {
    let light = lights[number];
    let cone = cone_of_surface(light, at);
    let rectangle = rectangle_from(light, at);
    var sample = no_light();
    var uv = vec2f(0.0);
    if (rectangle.solid_angle > 0.0) {
        let place = place_on_rectangle(rectangle, light.half, u.xy);
        let part = vec2f(quotient(place.x, light.half.x), quotient(place.y, light.half.y));
        let offset = light.position + light.s * place.x + light.t * place.y - at;
        sample.distance = root(dot3(offset, offset));
        sample.wi = quotients(offset, sample.distance);
        if (!(facing(light, -dot3(sample.wi, light.n)) > 0.0)) { return no_light(); }
        sample.pdf = quotient(1.0, rectangle.solid_angle);
        sample.normal = light.n;
        sample.triangle = u32(part.x + part.y > 1.0);
    } else if (cone.is_seen) {
        sample = from_ball(light, cone, at, u.xy);
        if (has_texture(light)) { uv = uv_of_ball(light, sample.normal); }
    } else {
        let on = on_surface(light, u.xy, u.z);
        let offset = on.point - at;
        sample.distance = root(dot3(offset, offset));
        sample.wi = quotients(offset, sample.distance);
        let cosine = facing(light, -dot3(sample.wi, on.normal));
        sample.pdf = per_solid_angle(pdf_on_surface(light, on.triangle), cosine, sample.distance);
        if (!(sample.pdf > 0.0)) { return no_light(); }
        sample.normal = on.normal;
        sample.triangle = on.triangle;
        uv = on.uv;
    }
    sample.weight = quotients(radiance_there(number, uv), sample.pdf);
    return sample;
}

fn from_projector(light: Light, at: vec3f) -> DirectSample {
    let intensity = projector_intensity(light, at - light.position);
    if (all(intensity == vec3f(0.0))) { return no_light(); }
    return from_point(light.position - at, intensity);
}

fn from_map(light: Light, u: vec2f) -> DirectSample {
    let towards = sample_map(light, u);
    let radiance = map_value(light, place_on_map(light, towards.dir)) * light.power;
    let weight = quotients(radiance, towards.pdf);
    return DirectSample(towards.dir, of_bits(INFINITY), -towards.dir, towards.pdf, weight, 0u, false);
}

fn is_environment(light: u32) -> bool {
    return lights[light].kind == ENVIRONMENT || lights[light].kind == ENVIRONMENT_MAP;
}

// `Light::draw_direct`: the random numbers for `sample_direct`.
fn draw_direct(number: u32, s: ptr<function, Sampler>) -> vec3f {
    let kind = lights[number].kind;
    let is_spot = kind == SPOT || kind == SMOOTH_SPOT;
    let is_ball = is_spot && lights[number].radius > 0.0;
    let is_area = kind == AREA || kind == TWO_SIDED_AREA;
    var u = vec3f(0.0);
    if (is_ball || is_area || kind == SUN || is_environment(number)) {
        u = vec3f(next_2d(s), 0.0);
    } else {
        sampler_skip(s, 2u);
    }
    let has_triangles = is_area && !is_round(lights[number]);
    if (is_ball || has_triangles) { u.z = next_1d(s); } else { sampler_skip(s, 1u); }
    return u;
}

// `Light::sample_direct`: samples a direction towards a light from a point. `u`: from `draw_direct`.
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
        case ENVIRONMENT_MAP: { return from_map(light, u.xy); }
        case PROJECTOR: { return from_projector(light, at); }
        default: { return from_point(light.position - at, emitted); }
    }
}

// `Light::pdf_direct`: density per solid angle with which `sample_direct` chooses `wi`, for a ray that hit the light by
// chance or left the scene.
fn pdf_direct(number: u32, at: vec3f, wi: vec3f, hit: LightHit) -> f32 {
    let light = lights[number];
    let is_met = hit.distance < of_bits(INFINITY);
    if (light.kind == AREA || light.kind == TWO_SIDED_AREA) {
        if (!is_met) { return 0.0; }
        let cone = cone_of_surface(light, at);
        if (cone.is_seen) { return cone_pdf(cone); }
        let cosine = facing(light, -dot3(wi, hit.normal));
        let rectangle = rectangle_from(light, at);
        if (rectangle.solid_angle > 0.0) {
            return select(0.0, quotient(1.0, rectangle.solid_angle), cosine > 0.0);
        }
        return per_solid_angle(pdf_on_surface(light, hit.triangle), cosine, hit.distance);
    }
    if (is_met) { return 0.0; }
    return environment_pdf(light, wi);
}

// Density of an environment's samples per solid angle; zero for other lights.
fn environment_pdf(light: Light, wi: vec3f) -> f32 {
    if (light.kind == ENVIRONMENT_MAP) { return map_pdf(light, place_on_map(light, wi)); }
    return select(0.0, light.pdf_dir, light.kind == ENVIRONMENT);
}

// `Light::photon_density`: density of emitted photons per area across `wi` at a point, over the density with which
// `sample_direct` chooses that light from there. `hit`: where the light is hit.
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
            let direct = pdf_direct(number, at, wi, hit);
            return quotient(pdf_on_surface(light, hit.triangle), sides_of(light) * 3.1415927f * direct);
        }
        case PROJECTOR: { return quotient(projector_pdf(light, -wi), distance2); }
        case DIRECTIONAL, SUN, ENVIRONMENT, ENVIRONMENT_MAP: { return light.pdf_pos; }
        default: { return quotient(0.25, 3.1415927f * distance2); }
    }
}

// `Light::emitted_density`: density of emitted photons, per area across their direction and solid angle. `triangle`: of
// an emitting surface. Zero for point and parallel lights.
fn emitted_density(number: u32, dir: vec3f, triangle: u32) -> f32 {
    let light = lights[number];
    switch light.kind {
        case AREA, TWO_SIDED_AREA: {
            return quotient(pdf_on_surface(light, triangle), sides_of(light) * 3.1415927f);
        }
        case ENVIRONMENT, ENVIRONMENT_MAP, SUN: {
            let pdf = select(environment_pdf(light, -dir), light.pdf_dir, light.kind == SUN);
            return quotient(pdf, 3.1415927f * light.radius * light.radius);
        }
        case SPOT, SMOOTH_SPOT: {
            if (light.radius > 0.0) { return quotient(spot_pdf(light, dir), spot_area(light)); }
            return 0.0;
        }
        default: { return 0.0; }
    }
}

// `Scene::emitted`: radiance that a ray of direction `dir` finds where it hits an object with geometric normal `ng`.
fn emitted_radiance(object: u32, ng: vec3f, uv: vec2f, dir: vec3f) -> vec3f {
    let light = surfaces[object].light;
    if (light == NONE) { return vec3f(0.0); }
    let shines = -dot3(ng, dir) > 0.0 || lights[light].kind == TWO_SIDED_AREA;
    if (!shines) { return vec3f(0.0); }
    return radiance_there(light, uv);
}

// `Scene::environment`: radiance that a ray of this direction finds; zero for lights other than environments.
fn environment_radiance(number: u32, dir: vec3f) -> vec3f {
    let light = lights[number];
    if (light.kind == ENVIRONMENT_MAP) { return map_value(light, place_on_map(light, dir)) * light.power; }
    return select(vec3f(0.0), light_sources[number].emitted, light.kind == ENVIRONMENT);
}

// Whether these class bits hide a light.
fn hides_light(hides: u32, light: u32) -> bool { return (light_sources[light].class_bit & hides) != 0u; }

// Whether they hide its surface, so that no ray hits it by chance.
fn hides_shape_of(hides: u32, light: u32) -> bool { return (light_sources[light].shape_class & hides) != 0u; }

// `Scene::only_sampled`.
fn only_sampled(light: u32) -> bool { return light_sources[light].only_sampled != 0u; }

// `Scene::only_sampled_by_paths`.
fn only_sampled_by_paths(light: u32) -> bool { return light_sources[light].only_sampled == 1u; }
