// Rays in BVHs of slivers, long thin triangles, whose boxes have axes of their own.

// Entry of a traversal's stack: where the ray enters, and the child. The program's text defines STACK, the number of
// entries that the scene needs.
struct Waiting { t: f32, child: u32 }
alias Stack = array<Waiting, STACK>;

// A ray, prepared for oriented boxes.
struct TurnedRay { origin: vec3f, dir: vec3f, least: f32, grown: f32 }

fn turned_ray(tree: u32, origin: vec3f, dir: vec3f) -> TurnedRay {
    let from_center = origin - sliver_trees[tree].center;
    // How far rounding moves triangles and boxes as the ray sees them: eight ulps.
    let rounding = 9.5367431640625e-7f * (root(dot3(from_center, from_center)) + 2.0 * sliver_trees[tree].radius);
    return TurnedRay(from_center, dir, least_of(dir), rounding);
}

// Where the ray enters a node's boxes, and which of them it hits before t_max.
struct Entered { near: vec4f, is_met: vec4<bool> }

const FARTHER: f32 = 1.00000047683715820312f;

fn enter_turned(node: u32, ray: TurnedRay, t_max: f32) -> Entered {
    var near = vec4f(0.0);
    var far = vec4f(of_bits(INFINITY));
    for (var axis = 0u; axis < 3u; axis++) {
        let x = turned_nodes[node].axes[axis][0];
        let y = turned_nodes[node].axes[axis][1];
        let z = turned_nodes[node].axes[axis][2];
        let at = x * ray.origin.x + y * ray.origin.y + z * ray.origin.z;
        let dir = x * ray.dir.x + y * ray.dir.y + z * ray.dir.z;
        let inverse = vec4f(
            inverse_of(dir.x, ray.least),
            inverse_of(dir.y, ray.least),
            inverse_of(dir.z, ray.least),
            inverse_of(dir.w, ray.least),
        );
        let low = (turned_nodes[node].bounds[axis][0] - ray.grown - at) * inverse;
        let high = (turned_nodes[node].bounds[axis][1] + ray.grown - at) * inverse;
        near = most(near, least(low, high));
        far = least(far, most(low, high));
    }
    far = least(far * FARTHER, vec4f(t_max));
    return Entered(near, (near <= far) & (turned_nodes[node].children != vec4u(NOTHING)));
}

// Pushes hit children above `bottom`, the nearest on top. Returns the stack's new size.
fn push_met(stack: ptr<function, Stack>, bottom: u32, met: Entered, children: vec4u) -> u32 {
    var waiting = bottom;
    for (var i = 0u; i < 4u; i++) {
        if (met.is_met[i]) {
            let t = met.near[i];
            var at = waiting;
            while (at > bottom) {
                let below = (*stack)[at - 1u];
                if (!(below.t < t)) { break; }
                (*stack)[at] = below;
                at -= 1u;
            }
            (*stack)[at] = Waiting(t, children[i]);
            waiting += 1u;
        }
    }
    return waiting;
}

// `four`: the triangle's group, or NOTHING.
struct TriangleHit { t: f32, four: u32, place: u32, uv: vec2f }

// Nearest hit in (0, t_max) among a BVH's slivers; of equally near ones the first found. `first_only`: any hit will do.
// The stack is free from `bottom` on.
fn slivers_hit(
    tree: u32,
    origin: vec3f,
    dir: vec3f,
    sheared: ShearedRay,
    t_max: f32,
    passed: Passed,
    placed: bool,
    first_only: bool,
    stack: ptr<function, Stack>,
    bottom: u32,
) -> TriangleHit {
    let ray = turned_ray(tree, origin, dir);
    var best = TriangleHit(t_max, NOTHING, 0u, vec2f(0.0));
    (*stack)[bottom] = Waiting(0.0, sliver_trees[tree].root);
    var waiting = bottom + 1u;
    while (waiting > bottom) {
        waiting -= 1u;
        let next = (*stack)[waiting];
        if (next.t > best.t) { continue; }
        if ((next.child & LEAF) != 0u) {
            let four = next.child ^ FOUR;
            let hit = four_hit(four, sheared, best.t, passed, placed);
            if (hit.place < 4u) {
                best = TriangleHit(hit.t, four, hit.place, hit.uv);
                if (first_only) { return best; }
            }
            continue;
        }
        let met = enter_turned(next.child, ray, best.t);
        waiting = push_met(stack, waiting, met, turned_nodes[next.child].children);
    }
    return best;
}
