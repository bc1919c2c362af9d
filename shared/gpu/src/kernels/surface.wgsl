// From a ray's hit to a point on a surface, bitwise equal to the renderer's `SurfaceHit`; the rays that start there,
// and the medium beyond. `world/shapes.rs` has the same structs.

// Flags of shapes.
// A round shape with its normal flipped.
const FLIPPED: u32 = 1u;
// The mesh's vertices are not in render space.
const PLACED: u32 = 2u;
// Texture coordinates are used.
const HAS_UV: u32 = 4u;
const HAS_NORMALS: u32 = 8u;
// The mesh has texture coordinates.
const HAS_OWN_UV: u32 = 16u;
// The scene has pure medium boundaries.
const AMONG_BOUNDARIES: u32 = 32u;
const HAS_COLORS: u32 = 64u;
// The file gives tangents.
const HAS_TANGENTS: u32 = 128u;

// Map from object space to render space, by columns.
struct PlacedShape {
    x_axis: vec3f,
    bits: u32,
    y_axis: vec3f,
    first_triangle: u32,
    z_axis: vec3f,
    // Largest absolute coordinate that a point of the unit cube may get.
    scale: f32,
    translation: vec3f,
    // If vertex colours are used: the texel that the first of all vertices would have.
    first_color: u32,
    // The same for tangents from files.
    first_tangent: u32,
}

struct Vertex { position: vec3f, u: f32, normal: vec3f, v: f32 }

@group(0) @binding(35) var<storage, read> placed_shapes: array<PlacedShape>;
@group(0) @binding(36) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(37) var<storage, read> mesh_triangles: array<array<u32, 3>>;

// The renderer's `SurfaceHit`.
struct SurfacePoint {
    // On the surface itself.
    point: vec3f,
    // NOTHING: no surface; all but t is zero.
    object: u32,
    // Unit normals on the outside; ns is in the hemisphere of ng.
    ng: vec3f,
    // Within its mesh.
    triangle: u32,
    ns: vec3f,
    // Change of the shading normal per displacement.
    curvature: f32,
    // Zero if unused.
    uv: vec2f,
    // Along the ray.
    t: f32,
    // How far off the surface rays from here start.
    clearance: f32,
}

struct Shading { point: vec3f, ng: vec3f, ns: vec3f, uv: vec2f, curvature: f32, scale: f32 }

fn to_render(object: u32, p: vec3f) -> vec3f {
    return placed_shapes[object].x_axis * p.x + placed_shapes[object].y_axis * p.y + placed_shapes[object].z_axis * p.z
        + placed_shapes[object].translation;
}

// Direction of a normal in render space, given one in object space.
fn placed_normal(object: u32, n: vec3f) -> vec3f {
    return vec3f(dot3(objects[object].x_axis, n), dot3(objects[object].y_axis, n), dot3(objects[object].z_axis, n));
}

fn greater(a: f32, b: f32) -> f32 { return select(b, a, a > b); }

fn greater_of_each(a: vec3f, b: vec3f) -> vec3f { return select(b, a, a > b); }

fn unit_circle(p: vec2f) -> vec2f { return p * quotient(1.0, root(dot2(p, p))); }

fn sphere_shading(object: u32, bits: u32, t: f32, own: OwnRay) -> Shading {
    let p = unit_vector(own.origin + own.dir * t);
    let sign = select(1.0, -1.0, (bits & FLIPPED) != 0u);
    let across = placed_normal(object, p);
    let curvature = root(dot3(across, across));
    let n = across * quotient(sign, curvature);
    var uv = vec2f(0.0);
    if ((bits & HAS_UV) != 0u) { uv = sphere_uv(p); }
    return Shading(to_render(object, p), n, n, uv, sign * curvature, placed_shapes[object].scale);
}

fn disc_shading(object: u32, bits: u32, p: vec2f) -> Shading {
    let up = unit_vector(placed_normal(object, vec3f(0.0, 0.0, 1.0)));
    let n = select(up, -up, (bits & FLIPPED) != 0u);
    var uv = vec2f(0.0);
    if ((bits & HAS_UV) != 0u) { uv = disc_uv(p); }
    return Shading(to_render(object, vec3f(p, 0.0)), n, n, uv, 0.0, placed_shapes[object].scale);
}

fn cylinder_shading(object: u32, bits: u32, t: f32, own: OwnRay) -> Shading {
    let met = own.origin + own.dir * t;
    let on_circle = unit_circle(met.xy);
    let z = select(select(met.z, 1.0, met.z > 1.0), 0.0, met.z < 0.0);
    let sign = select(1.0, -1.0, (bits & FLIPPED) != 0u);
    let across = placed_normal(object, vec3f(on_circle, 0.0));
    let length = root(dot3(across, across));
    let n = across * quotient(sign, length);
    var uv = vec2f(0.0);
    if ((bits & HAS_UV) != 0u) { uv = vec2f(turn_of(on_circle), z); }
    let point = to_render(object, vec3f(on_circle, z));
    return Shading(point, n, n, uv, sign * 0.5 * length, placed_shapes[object].scale);
}

struct Three { a: vec3f, b: vec3f, c: vec3f }

// `w`: weights of the second and third.
fn interpolated(p: Three, w: vec2f) -> vec3f { return p.a * (1.0 - w.x - w.y) + p.b * w.x + p.c * w.y; }

// How much the normal turns along an edge, per length.
fn edge_turn(edge: vec3f, by: vec3f) -> f32 {
    return quotient(dot3(by, edge), greater(dot3(edge, edge), of_bits(0x00800000u)));
}

// Mean over the edges.
fn edge_curvature(p: Three, n: Three) -> f32 {
    let sum = edge_turn(p.b - p.a, n.b - n.a) + edge_turn(p.c - p.b, n.c - n.b) + edge_turn(p.a - p.c, n.a - n.c);
    return quotient(sum, 3.0);
}

fn mesh_shading(object: u32, bits: u32, triangle: u32, w: vec2f) -> Shading {
    let number = placed_shapes[object].first_triangle + triangle;
    let a = vertices[mesh_triangles[number][0]];
    let b = vertices[mesh_triangles[number][1]];
    let c = vertices[mesh_triangles[number][2]];
    var p = Three(a.position, b.position, c.position);
    let reach = extent(greater_of_each(greater_of_each(abs(p.a), abs(p.b)), abs(p.c)));
    var point = interpolated(p, w);
    let facing = unit_or(cross3(p.b - p.a, p.c - p.a), vec3f(0.0));
    let is_placed = (bits & PLACED) != 0u;
    var scale = reach;
    var ng = facing;
    if (is_placed) {
        scale = placed_shapes[object].scale * greater(reach, 1.0);
        point = to_render(object, point);
        ng = placed_normal(object, facing);
    }
    ng = unit_vector(ng);
    var ns = ng;
    var curvature = 0.0;
    if ((bits & HAS_NORMALS) != 0u) {
        var n = Three(a.normal, b.normal, c.normal);
        if (is_placed) {
            n = Three(placed_normal(object, n.a), placed_normal(object, n.b), placed_normal(object, n.c));
            p = Three(to_render(object, p.a), to_render(object, p.b), to_render(object, p.c));
        }
        n = Three(unit_or(n.a, vec3f(0.0)), unit_or(n.b, vec3f(0.0)), unit_or(n.c, vec3f(0.0)));
        ns = unit_or(interpolated(n, w), ng);
        if (dot3(ns, ng) < 0.0) { ns = -ns; }
        curvature = edge_curvature(p, n);
    }
    var uv = vec2f(0.0);
    if ((bits & HAS_UV) != 0u) {
        uv = w;
        if ((bits & HAS_OWN_UV) != 0u) {
            uv = vec2f(a.u, a.v) * (1.0 - w.x - w.y) + vec2f(b.u, b.v) * w.x + vec2f(c.u, c.v) * w.y;
        }
    }
    return Shading(point, ng, ns, uv, curvature, scale);
}

fn shading_at(hit: Hit, ray: Ray) -> Shading {
    let bits = placed_shapes[hit.object].bits;
    let shape = objects[hit.object].shape;
    if (shape == MESH) { return mesh_shading(hit.object, bits, hit.triangle, hit.uv); }
    if (shape == DISC) { return disc_shading(hit.object, bits, hit.uv); }
    let own = own_ray(hit.object, ray.origin, ray.dir);
    if (shape == SPHERE) { return sphere_shading(hit.object, bits, hit.t, own); }
    return cylinder_shading(hit.object, bits, hit.t, own);
}

fn surface_point(hit: Hit, ray: Ray) -> SurfacePoint {
    if (hit.object == NOTHING) {
        return SurfacePoint(vec3f(0.0), NOTHING, vec3f(0.0), 0u, vec3f(0.0), 0.0, vec2f(0.0), hit.t, 0.0);
    }
    let at = shading_at(hit, ray);
    let clearance = greater(greater(extent(at.point), at.scale) * 4e-6f, 1e-30f);
    return SurfacePoint(
        at.point, hit.object, at.ng, hit.triangle, at.ns, at.curvature, at.uv, hit.t, clearance,
    );
}

// Ray that leaves the surface in the unit direction `dir`.
fn spawn_ray(at: SurfacePoint, dir: vec3f) -> Ray {
    let side = select(at.clearance, -at.clearance, dot3(at.ng, dir) < 0.0);
    return Ray(at.point + at.ng * side, dir);
}

// A ray and its length.
struct RayTo { ray: Ray, distance: f32 }

// Ray from the surface to the point at `distance`, which may be infinite, in direction `dir`, and its length.
fn ray_to(at: SurfacePoint, dir: vec3f, distance: f32) -> RayTo {
    let ray = spawn_ray(at, dir);
    let way = at.point + dir * distance - ray.origin;
    let length = root(dot3(way, way));
    if (!(length > 0.0 && length < of_bits(INFINITY))) { return RayTo(ray, distance); }
    let aimed = vec3f(quotient(way.x, length), quotient(way.y, length), quotient(way.z, length));
    return RayTo(Ray(ray.origin, aimed), length);
}

// Whether an object is a pure medium boundary.
fn is_null(object: u32) -> bool { return (objects[object].classes & NULL_BOUNDARIES) != 0u; }

// Short ray in roughly direction `dir` through all surfaces that coincide with a point.
fn probe(at: SurfacePoint, dir: vec3f) -> RayTo {
    let n = at.ng * with_sign(1.0, dot3(at.ng, dir));
    return RayTo(Ray(at.point - n * at.clearance, n), 2.0 * at.clearance);
}

// First surface that a ray hits. If that is a pure boundary, a visible surface at the same place comes first. Rays
// start off the surface that they leave, so it need not be ignored.
fn first_hit(ray: Ray, ignored: Ignored) -> SurfacePoint {
    var way = RayTo(ray, of_bits(INFINITY));
    var classes = ignored.classes;
    var met = surface_point(Hit(way.distance, NOTHING, 0u, vec2f(0.0)), ray);
    // A loop, since compilers inline each search.
    for (var turn = 0u; turn < 2u; turn++) {
        var found = surface_point(closest_hit(way.ray, way.distance, Ignored(ignored.object, classes)), way.ray);
        if (found.object == NOTHING) { break; }
        if (turn == 1u) { found.t = met.t; }
        met = found;
        if (!is_null(met.object)) { break; }
        way = probe(met, ray.dir);
        classes |= NULL_BOUNDARIES;
    }
    return met;
}

// Most boundaries at one place.
const MOST_CROSSED: u32 = 4u;

// Medium of a ray after crossing coincident boundaries. `near`, `far`: the media before and behind each, NONE if there
// is none; the first is the surface hit. `beyond`: the medium behind that. `current`: what the ray came through.
fn medium_across(is_null: bool, beyond: u32, current: u32, near: vec4u, far: vec4u) -> u32 {
    var left = near;
    var medium = current;
    // A visible surface is crossed from any medium; pure boundaries come in their turn.
    if (!(is_null && any(near == vec4u(current)))) {
        left.x = NONE;
        medium = beyond;
    }
    for (var count = 0u; count < MOST_CROSSED; count++) {
        // One by one: not every driver handles vector components indexed in a loop.
        if (left.x == medium) {
            medium = far.x;
            left.x = NONE;
        } else if (left.y == medium) {
            medium = far.y;
            left.y = NONE;
        } else if (left.z == medium) {
            medium = far.z;
            left.z = NONE;
        } else if (left.w == medium) {
            medium = far.w;
            left.w = NONE;
        } else {
            break;
        }
    }
    return medium;
}

// Medium beyond a surface, number or VACUUM, for a ray in direction `dir` that crosses it from `current`.
fn medium_beyond(at: SurfacePoint, dir: vec3f, current: u32) -> u32 {
    let beyond = medium_towards(surfaces[at.object], at.ng, dir, current);
    if ((placed_shapes[at.object].bits & AMONG_BOUNDARIES) == 0u) { return beyond; }
    // Arrays: software drivers lose vector components that are written by a dynamic index.
    // By boundary: the media before and behind it; NONE if there is none.
    var near = array<u32, MOST_CROSSED>(NONE, NONE, NONE, NONE);
    var far = array<u32, MOST_CROSSED>(NONE, NONE, NONE, NONE);
    let across = probe(at, dir);
    var passed = Passed(Ignored(at.object, VISIBLE), vec2u(NOTHING));
    var object = at.object;
    var ng = at.ng;
    for (var i = 0u; i < MOST_CROSSED; i++) {
        near[i] = medium_towards(surfaces[object], ng, -dir, NONE);
        far[i] = medium_towards(surfaces[object], ng, dir, NONE);
        if (i == 3u) { break; }
        if (i == 1u) { passed.others.x = object; }
        if (i == 2u) { passed.others.y = object; }
        let other = surface_point(closest_hit_past(across.ray, across.distance, passed), across.ray);
        if (other.object == NOTHING) { break; }
        object = other.object;
        ng = other.ng;
    }
    // A visible surface is crossed from any medium; pure boundaries come in their turn.
    var in_turn = false;
    if (is_null(at.object)) {
        for (var i = 0u; i < MOST_CROSSED; i++) { in_turn |= near[i] == current; }
    }
    var medium = current;
    if (!in_turn) {
        near[0] = NONE;
        medium = beyond;
    }
    for (var count = 0u; count < MOST_CROSSED; count++) {
        var next = 0u;
        while (next < MOST_CROSSED && near[next] != medium) { next++; }
        if (next == MOST_CROSSED) { break; }
        medium = far[next];
        near[next] = NONE;
    }
    return medium;
}
