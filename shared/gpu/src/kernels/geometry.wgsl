// A scene's BVHs. Same structs and layout as in `world/geometry.rs`.

// Children of a node: LEAF is set if they are not nodes, OF_KIND masks the kind of leaf, the other bits are an index.
const LEAF: u32 = 0x80000000u;
const OF_KIND: u32 = 0xe0000000u;
const FOUR: u32 = 0x80000000u;
const OBJECT: u32 = 0xa0000000u;
const SLIVERS: u32 = 0xc0000000u;
// No child, no object.
const NOTHING: u32 = 0xffffffffu;

// Four boxes and their contents.
struct Node {
    // By axis; lower and upper sides. Inside out for missing children.
    bounds: array<array<vec4f, 2>, 3>,
    children: vec4u,
}

// Up to four triangles side by side.
struct Four {
    // By corner and axis; NaN for missing triangles, so that no ray meets them.
    corners: array<array<vec4f, 3>, 3>,
    objects: vec4u,
    triangles: vec4u,
}

// Four oriented boxes.
struct TurnedNode {
    // By axis and coordinate.
    axes: array<array<vec4f, 3>, 3>,
    // By axis: from and to, along it.
    bounds: array<array<vec4f, 2>, 3>,
    children: vec4u,
}

struct SliverTree {
    // Origin of its positions.
    center: vec3f,
    // The largest distance of a corner from it.
    radius: f32,
    root: u32,
}

const MESH: u32 = 0u;
const SPHERE: u32 = 1u;
const DISC: u32 = 2u;
const CYLINDER: u32 = 3u;

// Map from render space to object space, by columns.
struct ObjectShape {
    x_axis: vec3f,
    shape: u32,
    y_axis: vec3f,
    // Root of a mesh's own BVH.
    root: u32,
    z_axis: vec3f,
    // Class bits, by which rays pass through it.
    classes: u32,
    translation: vec3f,
}

@group(0) @binding(20) var<storage, read> nodes: array<Node>;
@group(0) @binding(21) var<storage, read> fours: array<Four>;
@group(0) @binding(22) var<storage, read> turned_nodes: array<TurnedNode>;
@group(0) @binding(23) var<storage, read> sliver_trees: array<SliverTree>;
@group(0) @binding(24) var<storage, read> objects: array<ObjectShape>;

fn least(a: vec4f, b: vec4f) -> vec4f { return select(b, a, a < b); }

fn most(a: vec4f, b: vec4f) -> vec4f { return select(b, a, a > b); }

// Largest absolute component.
fn extent(v: vec3f) -> f32 {
    let size = abs(v);
    let yz = select(size.z, size.y, size.y > size.z);
    return select(yz, size.x, size.x > yz);
}

// Components of `dir` smaller than this count as zero.
fn least_of(dir: vec3f) -> f32 {
    let size = extent(dir) * 1e-12f;
    return select(1e-30f, size, size > 1e-30f);
}

fn with_sign(size: f32, sign: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(size) | (bitcast<u32>(sign) & 0x80000000u));
}

// Reciprocal of a direction's component, which is replaced by +-`least` if smaller.
fn inverse_of(d: f32, least: f32) -> f32 {
    return quotient(1.0, select(d, with_sign(least, d), abs(d) < least));
}

// Reciprocal direction, finite so that 0 * infinity cannot occur.
fn inverse_direction(dir: vec3f) -> vec3f {
    let least = least_of(dir);
    return vec3f(inverse_of(dir.x, least), inverse_of(dir.y, least), inverse_of(dir.z, least));
}
