// The material at a surface point: one part of each blend, with textures looked up, and the shading normal perturbed by
// bump and normal maps. Same structs as in `world/materials.rs`.

// The material parameter that a texture drives.
const REFLECTANCE_FIELD: u32 = 0u;
const TRANSMITTANCE_FIELD: u32 = 1u;
const ROUGHNESS_FIELD: u32 = 2u;
const METALLIC_FIELD: u32 = 3u;
const SPECULAR_FIELD: u32 = 4u;
const SPEC_TINT_FIELD: u32 = 5u;
const SPEC_TRANS_FIELD: u32 = 6u;
const FLATNESS_FIELD: u32 = 7u;
const SHEEN_FIELD: u32 = 8u;
const SHEEN_TINT_FIELD: u32 = 9u;
const CLEARCOAT_FIELD: u32 = 10u;
const COAT_GLOSS_FIELD: u32 = 11u;
const OPACITY_FIELD: u32 = 12u;
const WEIGHT_FIELD: u32 = 13u;
const MAP_FIELD: u32 = 14u;

// Material bits. HAS_OPACITY: rays pass through with some probability.
const HAS_OPACITY: u32 = 1u;
const IS_BLEND: u32 = 2u;
const HAS_BUMP_MAP: u32 = 4u;
const HAS_NORMAL_MAP: u32 = 8u;
// The shading normal is bent so that reflections stay above the surface.
const REFLECTS_UPWARDS: u32 = 16u;

const ROW_BITS: u32 = 8u;

// Some material of the scene has opacity or is a blend.
const ANY_CHANCE: bool = (SURFACES & 0x20000u) != 0u;

struct MaterialRecord {
    // Before texture look-up.
    surface: Material,
    // Index of its first texture, and their number.
    first_texture: u32,
    textures: u32,
    // Probability that a ray meets it, and that it then meets its second part.
    opacity: f32,
    weight: f32,
    // Materials of a blend.
    parts: vec2u,
    // Flags; from ROW_BITS on, its row of the pass's table of indices by wavelength, from 1 on; 0: no dispersion.
    bits: u32,
    // Factor on bump heights.
    scale: f32,
}

@group(0) @binding(26) var<storage, read> materials: array<MaterialRecord>;

// No material: the ray continues as if nothing were there.
const PASSED: u32 = 0xffffffffu;
// Most nested blends.
const MOST_BLENDS: u32 = 8u;

// Some texture uses vertex colours.
const LOOKS_AT_COLORS: bool = (SURFACES & 0x80000u) != 0u;

// The corners of a point's triangle, and the barycentric weights of the second and third. Recomputed from the position,
// so that `SurfacePoint` need not hold them.
struct Between {
    corners: array<u32, 3>,
    weights: vec2f,
}

fn between_corners(at: SurfacePoint) -> Between {
    let shape = placed_shapes[at.object];
    let corners = mesh_triangles[shape.first_triangle + at.triangle];
    var p = Three(vertices[corners[0]].position, vertices[corners[1]].position, vertices[corners[2]].position);
    if ((shape.bits & PLACED) != 0u) {
        p = Three(to_render(at.object, p.a), to_render(at.object, p.b), to_render(at.object, p.c));
    }
    let n = cross3(p.b - p.a, p.c - p.a);
    let area = dot3(n, n);
    var w = vec2f(0.0);
    if (area > 0.0) {
        let of_b = dot3(cross3(p.a - p.c, at.point - p.c), n);
        let of_c = dot3(cross3(p.b - p.a, at.point - p.a), n);
        // Rounding may move a point over the edge.
        w.x = not_above_one(not_below_zero(quotient(of_b, area)));
        w.y = not_above_one(not_below_zero(quotient(of_c, area)));
    }
    return Between(corners, w);
}

// Interpolated over the triangle.
fn vertex_color(at: SurfacePoint) -> vec3f {
    let shape = placed_shapes[at.object];
    if ((shape.bits & HAS_COLORS) == 0u) { return vec3f(0.0); }
    let between = between_corners(at);
    let w = between.weights;
    let a = texel(shape.first_color + between.corners[0]);
    let b = texel(shape.first_color + between.corners[1]);
    let c = texel(shape.first_color + between.corners[2]);
    return a * not_below_zero(1.0 - w.x - w.y) + b * w.x + c * w.y;
}

fn value_at(t: SurfaceTexture, at: SurfacePoint) -> vec3f {
    var value = texture_value(t, at.uv);
    if (LOOKS_AT_COLORS) {
        if ((t.kind & BY_COLORS) != 0u) { value *= vertex_color(at); }
    }
    return value;
}

// Luminance, exact for greys.
fn grey(c: vec3f) -> f32 {
    let sum = c.x + luminance_of(c - vec3f(c.x));
    return select(select(sum, 1.0, sum > 1.0), 0.0, sum < 0.0);
}

// Value of a parameter that is a probability: `otherwise` if it has no texture.
fn share_at(number: u32, field: u32, at: SurfacePoint, otherwise: f32) -> f32 {
    var share = otherwise;
    let first = materials[number].first_texture;
    for (var k = 0u; k < materials[number].textures; k++) {
        if (textures[first + k].field == field) { share = grey(value_at(textures[first + k], at)); }
    }
    return share;
}

// The material that a ray meets: opacity and blend parts are chosen at random. May be PASSED.
fn met_material(given: u32, at: SurfacePoint, s: ptr<function, Sampler>) -> u32 {
    if (!ANY_CHANCE) {
        return select(given, PASSED, materials[given].surface.kind == NULL_BOUNDARY);
    }
    var number = given;
    // First whether it is met, then which part of a blend.
    var field = OPACITY_FIELD;
    for (var turn = 0u; turn < 2u * MOST_BLENDS + 2u; turn++) {
        let bits = materials[number].bits;
        if (field == OPACITY_FIELD) {
            if ((bits & HAS_OPACITY) == 0u) {
                if (materials[number].surface.kind == NULL_BOUNDARY) { return PASSED; }
                field = WEIGHT_FIELD;
                continue;
            }
        } else if ((bits & IS_BLEND) == 0u) {
            break;
        }
        let is_weight = field == WEIGHT_FIELD;
        let constant = select(materials[number].opacity, materials[number].weight, is_weight);
        let share = share_at(number, field, at, constant);
        let u = next_1d(s);
        if (is_weight) {
            number = select(materials[number].parts.x, materials[number].parts.y, u < share);
            field = OPACITY_FIELD;
        } else {
            if (u >= share) { return PASSED; }
            field = WEIGHT_FIELD;
        }
    }
    return number;
}

// Expected share of light that goes straight through a material at a point.
fn transparency(given: u32, at: SurfacePoint) -> f32 {
    if (!ANY_CHANCE) { return select(0.0, 1.0, materials[given].surface.kind == NULL_BOUNDARY); }
    // Stack of blend parts to visit, and the probability of reaching each.
    var numbers: array<u32, MOST_BLENDS>;
    var shares: array<f32, MOST_BLENDS>;
    numbers[0] = given;
    shares[0] = 1.0;
    var waiting = 1u;
    var through = 0.0;
    for (var turn = 0u; turn < 128u && waiting > 0u; turn++) {
        waiting -= 1u;
        let number = numbers[waiting];
        let bits = materials[number].bits;
        var share = shares[waiting];
        if ((bits & HAS_OPACITY) != 0u) {
            let met = share_at(number, OPACITY_FIELD, at, materials[number].opacity);
            through += share * (1.0 - met);
            share *= met;
        } else if (materials[number].surface.kind == NULL_BOUNDARY) {
            through += share;
        }
        if ((bits & IS_BLEND) != 0u && waiting + 2u <= MOST_BLENDS) {
            let weight = share_at(number, WEIGHT_FIELD, at, materials[number].weight);
            numbers[waiting] = materials[number].parts.x;
            shares[waiting] = share * (1.0 - weight);
            numbers[waiting + 1u] = materials[number].parts.y;
            shares[waiting + 1u] = share * weight;
            waiting += 2u;
        }
    }
    return through;
}

// A material with its textures looked up.
fn surface_at(number: u32, at: SurfacePoint) -> Material {
    var m = materials[number].surface;
    let first = materials[number].first_texture;
    for (var k = 0u; k < materials[number].textures; k++) {
        let field = textures[first + k].field;
        if (field >= OPACITY_FIELD) { continue; }
        let value = value_at(textures[first + k], at);
        switch field {
            case REFLECTANCE_FIELD: { m.reflectance = value; }
            case TRANSMITTANCE_FIELD: { m.transmittance = value; }
            case ROUGHNESS_FIELD: { m.roughness = value.x; }
            case METALLIC_FIELD: { m.metallic = value.x; }
            case SPECULAR_FIELD: { m.eta = vec3f(value.x); }
            case SPEC_TINT_FIELD: { m.spec_tint = value.x; }
            case SPEC_TRANS_FIELD: { m.spec_trans = value.x; }
            case FLATNESS_FIELD: { m.flatness = value.x; }
            case SHEEN_FIELD: { m.sheen = value.x; }
            case SHEEN_TINT_FIELD: { m.sheen_tint = value.x; }
            case CLEARCOAT_FIELD: { m.clearcoat = value.x; }
            default: { m.coat_alpha = value.x; }
        }
    }
    return looked_up(m);
}

// The renderer's `SurfaceInteraction`, as `scatter.wgsl` takes it.
struct Interaction {
    material: Material,
    // Around the shading normal, which a map may have perturbed.
    frame: Frame,
    // Where the path comes from, in render space and in the frame.
    wo: vec3f,
    local_wo: vec3f,
    shadowing: Shadowing,
}

// Derivatives of the position by the texture coordinates.
struct Tangents {
    du: vec3f,
    dv: vec3f,
}

fn placed_vector(object: u32, v: vec3f) -> vec3f {
    return placed_shapes[object].x_axis * v.x + placed_shapes[object].y_axis * v.y + placed_shapes[object].z_axis * v.z;
}

fn any_tangents(at: SurfacePoint) -> Tangents {
    let frame = frame_around(at.ng);
    return Tangents(frame.s, frame.t);
}

fn tangents_at(at: SurfacePoint) -> Tangents {
    let object = at.object;
    let shape = objects[object].shape;
    var du = vec3f(0.0);
    var dv = vec3f(0.0);
    if (shape == MESH) {
        if ((placed_shapes[object].bits & HAS_OWN_UV) == 0u) { return any_tangents(at); }
        let number = placed_shapes[object].first_triangle + at.triangle;
        let a = vertices[mesh_triangles[number][0]];
        let b = vertices[mesh_triangles[number][1]];
        let c = vertices[mesh_triangles[number][2]];
        let p1 = b.position - a.position;
        let p2 = c.position - a.position;
        let uv1 = vec2f(b.u - a.u, b.v - a.v);
        let uv2 = vec2f(c.u - a.u, c.v - a.v);
        let inverse = quotient(1.0, uv1.x * uv2.y - uv1.y * uv2.x);
        if (!(abs(inverse) < of_bits(INFINITY))) { return any_tangents(at); }
        du = (p1 * uv2.y - p2 * uv1.y) * inverse;
        dv = (p2 * uv1.x - p1 * uv2.x) * inverse;
    } else {
        let p = own_ray(object, at.point, at.ng).origin;
        let r = root(dot2(p.xy, p.xy));
        if (shape == SPHERE) {
            var turn = vec2f(1.0, 0.0);
            du = vec3f(0.0, 1.0, 0.0);
            if (r > 0.0) {
                turn = vec2f(quotient(p.x, r), quotient(p.y, r));
                du = vec3f(-p.y, p.x, 0.0);
            }
            du *= 6.2831855f;
            dv = vec3f(p.z * turn.x, p.z * turn.y, -r) * 3.1415927f;
        } else if (shape == DISC) {
            du = unit_or(vec3f(p.xy, 0.0), vec3f(1.0, 0.0, 0.0));
            dv = cross3(vec3f(0.0, 0.0, 1.0), du);
        } else {
            du = vec3f(-p.y, p.x, 0.0) * 6.2831855f;
            dv = vec3f(0.0, 0.0, 1.0);
        }
    }
    return Tangents(placed_vector(object, du), placed_vector(object, dv));
}

// A mesh file's tangent. Twice the length means that the bitangent is flipped.
fn given_tangent(number: u32) -> vec4f {
    let t = texel(number);
    if (dot3(t, t) > 2.0) { return vec4f(t * 0.5, -1.0); }
    return vec4f(t, 1.0);
}

// Tangents that x and y of a normal map refer to: from the mesh file, or else from texture coordinates.
fn tangents_of_map(at: SurfacePoint) -> Tangents {
    let shape = placed_shapes[at.object];
    if ((shape.bits & HAS_TANGENTS) == 0u) { return tangents_at(at); }
    let between = between_corners(at);
    let w = between.weights;
    let a = given_tangent(shape.first_tangent + between.corners[0]);
    let b = given_tangent(shape.first_tangent + between.corners[1]);
    let c = given_tangent(shape.first_tangent + between.corners[2]);
    let own = a.xyz * not_below_zero(1.0 - w.x - w.y) + b.xyz * w.x + c.xyz * w.y;
    let along = placed_vector(at.object, own);
    let across = cross3(at.ns, along);
    if (!(dot3(across, across) > 1e-12f)) { return tangents_at(at); }
    return Tangents(along, across * a.w);
}

// Bends a shading normal towards the geometric one until the mirror reflection of wo stays above the surface.
fn reflecting_upwards(n: vec3f, ng: vec3f, wo: vec3f) -> vec3f {
    let up = ng * with_sign(1.0, dot3(ng, wo));
    let share = 0.9f * dot3(up, wo);
    let least = select(0.01f, share, share < 0.01f);
    let reflected = n * (2.0 * dot3(n, wo)) - wo;
    let height = dot3(up, reflected);
    if (height >= least) { return n; }
    let lifted = unit_or(reflected + up * (least - height), up);
    // On the side of the shading normal.
    let half_ = unit_or(wo + lifted, up);
    return half_ * with_sign(1.0, dot3(half_, n));
}

// The perturbed shading normal, and the shadowing by the map's slopes, in render space.
struct Mapped {
    ns: vec3f,
    shadowing: Shadowing,
}

fn mapped_normal(number: u32, at: SurfacePoint, wo: vec3f) -> Mapped {
    let bits = materials[number].bits;
    if (!ANY_MAP || (bits & (HAS_BUMP_MAP | HAS_NORMAL_MAP)) == 0u) { return Mapped(at.ns, NO_SHADOWING); }
    // The map is the last texture.
    let map = textures[materials[number].first_texture + materials[number].textures - 1u];
    let is_bump = (bits & HAS_BUMP_MAP) != 0u;
    var tangents: Tangents;
    if (is_bump) { tangents = tangents_at(at); } else { tangents = tangents_of_map(at); }
    let ns = at.ns;
    let s = unit_or(tangents.du - ns * dot3(ns, tangents.du), frame_around(ns).t);
    let t = cross3(ns, s);
    var n = vec3f(0.0);
    if (is_bump) {
        let slope = texture_gradient(map, at.uv) * materials[number].scale;
        let du = tangents.du + ns * (slope.x - dot3(ns, tangents.du));
        let dv = tangents.dv + ns * (slope.y - dot3(ns, tangents.dv));
        let across = cross3(du, dv);
        n = select(across, -across, dot3(across, at.ng) < 0.0);
        n = vec3f(dot3(n, s), dot3(n, t), dot3(n, ns));
    } else {
        n = texture_value(map, at.uv) * 2.0 - 1.0;
        // Along v, even if UVs are mirrored.
        if (objects[at.object].shape == MESH && dot3(t, tangents.dv) < 0.0) { n.y = -n.y; }
    }
    n = unit_or(n, vec3f(0.0, 0.0, 1.0));
    n.z = select(0.001f, n.z, n.z > 0.001f);
    // Flips a normal that faces away (Schüssler et al. 2017).
    let local_wo = vec3f(dot3(wo, s), dot3(wo, t), dot3(wo, ns));
    if (local_wo.z * dot3(local_wo, n) <= 0.0) { n = vec3f(-n.x, -n.y, n.z); }
    // Conty Estevez et al. 2019.
    let tan2 = quotient(n.x * n.x + n.y * n.y, n.z * n.z);
    let shadowing = Shadowing(ns, not_above_one(0.125f * tan2));
    var turned = unit_or(s * n.x + t * n.y + ns * n.z, ns);
    if ((bits & REFLECTS_UPWARDS) != 0u) { turned = reflecting_upwards(turned, at.ng, wo); }
    return Mapped(turned, shadowing);
}

// The surface that a ray of direction `dir` has hit, with the material that it met.
fn bsdf_at(number: u32, at: SurfacePoint, dir: vec3f) -> Interaction {
    let mapped = mapped_normal(number, at, -dir);
    let frame = frame_around(mapped.ns);
    let shadowing = Shadowing(to_local(frame, mapped.shadowing.normal), mapped.shadowing.alpha2);
    return Interaction(surface_at(number, at), frame, -dir, to_local(frame, -dir), shadowing);
}

// A material's row of the pass's table of indices, from 1 on; 0: no dispersion.
fn row_of(number: u32) -> u32 { return materials[number].bits >> ROW_BITS; }
