// Walls near a segment: triangles by their corners and round objects by number, in the renderer's order
// (`Geometry::near`). Conservative: may return more walls than those. Goes after `shade.wgsl`.

// Object data that rays do not need.
struct WallShape {
    // Map from object space to render space, by columns.
    x_axis: vec3f,
    // Largest stretch of the inverse map.
    scale: f32,
    y_axis: vec3f,
    spare_y: u32,
    z_axis: vec3f,
    spare_z: u32,
    translation: vec3f,
    spare_translation: u32,
    // Centre of its box.
    middle: vec3f,
    spare_middle: u32,
}

@group(0) @binding(50) var<storage, read> wall_shapes: array<WallShape>;

// A region: within `radius` of the segment from `origin` over `length` times `dir`, and not behind either plane.
// Planes: a normal, and its product with any point of the plane.
struct Around {
    origin: vec3f,
    length: f32,
    dir: vec3f,
    radius: f32,
    planes: array<vec4f, 2>,
}

// A plane that nothing is behind.
const NO_PLANE: vec4f = vec4f(0.0, 0.0, 0.0, -1.0);

struct WallNear {
    is: u32,
    object: u32,
    corners: array<vec3f, 3>,
}

const NO_MORE_WALLS: u32 = 0u;
const WALL_TRIANGLE: u32 = 1u;
const ROUND_WALL: u32 = 2u;

// A region, prepared for tests against axis-aligned boxes.
struct AroundSpace { around: Around, inverse: vec3f, near: vec3u }

// State of a search.
struct WallSearch {
    around: Around,
    space: AroundSpace,
    // The object whose own BVH is being searched, or NOTHING; and the stack height at which the outer one resumes.
    within: u32,
    bottom: u32,
    // The sliver tree being searched, or NOTHING; and the stack height at which the outer tree resumes.
    slivers: u32,
    slivers_bottom: u32,
    turned: TurnedRay,
    // The current `Four`, and a bit mask of its near triangles that are not returned yet.
    four: u32,
    places: u32,
    waiting: u32,
    stack: array<u32, STACK>,
}

fn around_space(around: Around) -> AroundSpace {
    let inverse = inverse_direction(around.dir);
    let near = bitcast<vec3u>(inverse) >> vec3u(31u);
    return AroundSpace(around, inverse, near);
}

// The region in an object's space, slightly enlarged.
fn around_in(object: u32, around: Around) -> Around {
    let own = own_ray(object, around.origin, around.dir);
    var planes = around.planes;
    for (var i = 0u; i < 2u; i++) {
        let n = planes[i].xyz;
        planes[i] = vec4f(
            dot3(wall_shapes[object].x_axis, n),
            dot3(wall_shapes[object].y_axis, n),
            dot3(wall_shapes[object].z_axis, n),
            planes[i].w - dot3(wall_shapes[object].translation, n),
        );
    }
    return Around(own.origin, around.length, own.dir, around.radius * wall_shapes[object].scale, planes);
}

fn out_of(object: u32, p: vec3f) -> vec3f {
    return wall_shapes[object].x_axis * p.x + wall_shapes[object].y_axis * p.y + wall_shapes[object].z_axis * p.z
        + wall_shapes[object].translation;
}

// Which boxes of a node, grown by the radius, the segment meets and are not entirely behind a plane.
fn near_boxes(node: u32, space: AroundSpace) -> vec4<bool> {
    let radius = space.around.radius;
    var near = vec4f(0.0);
    var far = vec4f(0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let side = space.near[axis];
        let grown = select(radius, -radius, side == 0u);
        let first = (nodes[node].bounds[axis][side] - space.around.origin[axis] + grown) * space.inverse[axis];
        let second = (nodes[node].bounds[axis][1u - side] - space.around.origin[axis] - grown) * space.inverse[axis];
        near = select(most(near, first), first, axis == 0u);
        far = select(least(far, second), second, axis == 0u);
    }
    near = most(near, vec4f(0.0));
    far = least(far * FARTHER, vec4f(space.around.length));
    var is_met = (near <= far) & (nodes[node].children != vec4u(NOTHING));
    for (var i = 0u; i < 2u; i++) {
        let plane = space.around.planes[i];
        let x = most(nodes[node].bounds[0][0] * plane.x, nodes[node].bounds[0][1] * plane.x);
        let y = most(nodes[node].bounds[1][0] * plane.y, nodes[node].bounds[1][1] * plane.y);
        let z = most(nodes[node].bounds[2][0] * plane.z, nodes[node].bounds[2][1] * plane.z);
        is_met = is_met & (x + y + z > vec4f(plane.w));
    }
    return is_met;
}

// By axis.
struct Vectors4 { x: vec4f, y: vec4f, z: vec4f }

fn corner_of(four: u32, corner: u32) -> Vectors4 {
    return Vectors4(fours[four].corners[corner][0], fours[four].corners[corner][1], fours[four].corners[corner][2]);
}

fn dot4(v: Vectors4, n: vec3f) -> vec4f { return v.x * n.x + v.y * n.y + v.z * n.z; }

fn minus4(a: Vectors4, b: Vectors4) -> Vectors4 { return Vectors4(a.x - b.x, a.y - b.y, a.z - b.z); }

// Bit mask of the triangles of a `Four` that are not behind one of the planes, nor farther than the radius before,
// beyond or beside the segment, judging by their own planes.
fn near_triangles(four: u32, around: Around) -> u32 {
    let a = corner_of(four, 0u);
    let b = corner_of(four, 1u);
    let c = corner_of(four, 2u);
    let origin = Vectors4(vec4f(around.origin.x), vec4f(around.origin.y), vec4f(around.origin.z));
    let along_a = dot4(minus4(a, origin), around.dir);
    let along_b = dot4(minus4(b, origin), around.dir);
    let along_c = dot4(minus4(c, origin), around.dir);
    let length2 = dot3(around.dir, around.dir);
    let reach = around.radius * root(length2);
    let beyond = vec4f(around.length * length2 + reach);
    var near = (most(most(along_a, along_b), along_c) >= vec4f(-reach))
        & (least(least(along_a, along_b), along_c) <= beyond);
    for (var i = 0u; i < 2u; i++) {
        let n = around.planes[i].xyz;
        near = near & (most(most(dot4(a, n), dot4(b, n)), dot4(c, n)) > vec4f(around.planes[i].w));
    }
    let u = minus4(b, a);
    let v = minus4(c, a);
    let n = Vectors4(u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x);
    let offset = minus4(origin, a);
    let start = n.x * offset.x + n.y * offset.y + n.z * offset.z;
    let end = start + dot4(n, around.dir) * around.length;
    let apart = (n.x * n.x + n.y * n.y + n.z * n.z) * (around.radius * around.radius);
    let is_beside = (start * end > vec4f(0.0)) & (least(start * start, end * end) > apart);
    let found = near & !is_beside;
    return u32(found.x) | (u32(found.y) << 1u) | (u32(found.z) << 2u) | (u32(found.w) << 3u);
}

fn begin_walls(search: ptr<function, WallSearch>, around: Around) {
    (*search).around = around;
    (*search).space = around_space(around);
    (*search).within = NOTHING;
    (*search).bottom = 0u;
    (*search).slivers = NOTHING;
    (*search).slivers_bottom = 0u;
    (*search).places = 0u;
    (*search).stack[0] = 0u;
    (*search).waiting = 1u;
}

// Pushes nodes, the last on top, then leaves above them, the first on top.
fn push_walls(search: ptr<function, WallSearch>, is_met: vec4<bool>, children: vec4u) {
    for (var i = 0u; i < 4u; i++) {
        if (is_met[i] && (children[i] & LEAF) == 0u) {
            (*search).stack[(*search).waiting] = children[i];
            (*search).waiting += 1u;
        }
    }
    for (var k = 0u; k < 4u; k++) {
        let i = 3u - k;
        if (is_met[i] && (children[i] & LEAF) != 0u) {
            (*search).stack[(*search).waiting] = children[i];
            (*search).waiting += 1u;
        }
    }
}

fn next_wall(search: ptr<function, WallSearch>) -> WallNear {
    loop {
        if ((*search).places != 0u) {
            let place = countTrailingZeros((*search).places);
            (*search).places &= (*search).places - 1u;
            let four = (*search).four;
            let placed = (*search).within != NOTHING;
            let object = select(fours[four].objects[place], (*search).within, placed);
            if (!placed && !is_wall(object)) { continue; }
            var corners: array<vec3f, 3>;
            for (var i = 0u; i < 3u; i++) {
                let p = vec3f(
                    fours[four].corners[i][0][place],
                    fours[four].corners[i][1][place],
                    fours[four].corners[i][2][place],
                );
                if (placed) { corners[i] = out_of(object, p); } else { corners[i] = p; }
            }
            return WallNear(WALL_TRIANGLE, object, corners);
        }
        let is_in_slivers = (*search).slivers != NOTHING;
        if (is_in_slivers && (*search).waiting == (*search).slivers_bottom) { (*search).slivers = NOTHING; }
        if ((*search).waiting == (*search).bottom) {
            if ((*search).within == NOTHING) { break; }
            (*search).within = NOTHING;
            (*search).bottom = 0u;
            (*search).space = around_space((*search).around);
            continue;
        }
        (*search).waiting -= 1u;
        let child = (*search).stack[(*search).waiting];
        let number = child & ~OF_KIND;
        if ((child & LEAF) == 0u) {
            if ((*search).slivers != NOTHING) {
                let met = enter_turned(child, (*search).turned, (*search).space.around.length);
                push_walls(search, met.is_met, turned_nodes[child].children);
            } else {
                push_walls(search, near_boxes(child, (*search).space), nodes[child].children);
            }
        } else if ((child & OF_KIND) == FOUR) {
            (*search).four = number;
            (*search).places = near_triangles(number, (*search).space.around);
        } else if ((child & OF_KIND) == SLIVERS) {
            let around = (*search).space.around;
            var turned = turned_ray(number, around.origin, around.dir);
            turned.grown = around.radius + turned.grown;
            (*search).turned = turned;
            (*search).slivers = number;
            (*search).slivers_bottom = (*search).waiting;
            (*search).stack[(*search).waiting] = sliver_trees[number].root;
            (*search).waiting += 1u;
        } else if (is_wall(number)) {
            if (objects[number].shape != MESH) { return WallNear(ROUND_WALL, number, array<vec3f, 3>()); }
            (*search).within = number;
            (*search).bottom = (*search).waiting;
            (*search).space = around_space(around_in(number, (*search).around));
            (*search).stack[(*search).waiting] = objects[number].root;
            (*search).waiting += 1u;
        }
    }
    return WallNear(NO_MORE_WALLS, NOTHING, array<vec3f, 3>());
}

// Like Rust's `signum`: 1 or -1, also for zeros; NaN stays.
fn signum(x: f32) -> f32 { return select(x, with_sign(1.0, x), x == x); }

fn unit_or_zero(v: vec3f) -> vec3f {
    let inverse = quotient(1.0, root(dot3(v, v)));
    if (inverse > 0.0 && inverse < of_bits(INFINITY)) { return v * inverse; }
    return vec3f(0.0);
}

fn clamped(x: f32, low: f32, high: f32) -> f32 {
    if (x < low) { return low; }
    if (x > high) { return high; }
    return x;
}

fn nearest_of_edge(p: vec3f, q: vec3f) -> vec3f {
    let way = q - p;
    let t = quotient(-dot3(p, way), dot3(way, way));
    // NaN if both points coincide.
    if (!(t == t)) { return p; }
    return p + way * clamped(t, 0.0, 1.0);
}

// How far a round shape extends along a direction: the largest product of `dir` with any of its points.
fn reach_of(object: u32, dir: vec3f) -> f32 {
    let middle = dot3(wall_shapes[object].translation, dir);
    let x = dot3(wall_shapes[object].x_axis, dir);
    let y = dot3(wall_shapes[object].y_axis, dir);
    let z = dot3(wall_shapes[object].z_axis, dir);
    switch objects[object].shape {
        case SPHERE: { return middle + root(x * x + y * y + z * z); }
        case DISC: { return middle + root(x * x + y * y); }
        default: { return middle + root(x * x + y * y) + not_below_zero(z); }
    }
}
