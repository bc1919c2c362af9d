// Ray queries: `closest_hit` and `any_hit`, bitwise equal to the renderer's `Geometry::intersect` and `occluded`.

struct Ray { origin: vec3f, dir: vec3f }

// `object` is NOTHING if nothing is hit before t.
struct Hit {
    t: f32,
    object: u32,
    triangle: u32,
    // Weights of a triangle's second and third corner; on a disc, its own x and y.
    uv: vec2f,
}

// A ray, prepared for axis-aligned boxes and for triangles.
struct Space { origin: vec3f, dir: vec3f, inverse: vec3f, near: vec3u, sheared: ShearedRay }

fn space_of(origin: vec3f, dir: vec3f) -> Space {
    let inverse = inverse_direction(dir);
    let near = bitcast<vec3u>(inverse) >> vec3u(31u);
    return Space(origin, dir, inverse, near, sheared_ray(origin, dir));
}

fn enter(node: u32, space: Space, t_max: f32) -> Entered {
    var near = vec4f(0.0);
    var far = vec4f(0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let side = space.near[axis];
        let first = (nodes[node].bounds[axis][side] - space.origin[axis]) * space.inverse[axis];
        let second = (nodes[node].bounds[axis][1u - side] - space.origin[axis]) * space.inverse[axis];
        near = select(most(near, first), first, axis == 0u);
        far = select(least(far, second), second, axis == 0u);
    }
    near = most(near, vec4f(0.0));
    // Ize 2013, Robust BVH ray traversal: rounding loses no box.
    far = least(far * FARTHER, vec4f(t_max));
    return Entered(near, (near <= far) & (nodes[node].children != vec4u(NOTHING)));
}

// The closest hit in (0, t_max).
fn closest_hit(ray: Ray, t_max: f32, ignored: Ignored) -> Hit {
    return search(ray, t_max, Passed(ignored, vec2u(NOTHING)), false);
}

// The same, passing through more objects.
fn closest_hit_past(ray: Ray, t_max: f32, passed: Passed) -> Hit { return search(ray, t_max, passed, false); }

// Whether anything is hit in (0, t_max).
fn any_hit(ray: Ray, t_max: f32, ignored: Ignored) -> bool {
    return search(ray, t_max, Passed(ignored, vec2u(NOTHING)), true).object != NOTHING;
}

// `first_only`: any hit will do.
fn search(ray: Ray, t_max: f32, passed: Passed, first_only: bool) -> Hit {
    var best = Hit(t_max, NOTHING, 0u, vec2f(0.0));
    let render_space = space_of(ray.origin, ray.dir);
    var space = render_space;
    // Mesh whose own BVH is searched, and where its stack begins: entries below wait for the BVH around it.
    var within = NOTHING;
    var bottom = 0u;
    var stack: Stack;
    stack[0] = Waiting(0.0, 0u);
    var waiting = 1u;
    loop {
        if (waiting == bottom) {
            if (within == NOTHING) { break; }
            space = render_space;
            within = NOTHING;
            bottom = 0u;
            continue;
        }
        waiting -= 1u;
        let next = stack[waiting];
        if (next.t > best.t) { continue; }
        let number = next.child & ~OF_KIND;
        if ((next.child & LEAF) == 0u) {
            let met = enter(next.child, space, best.t);
            waiting = push_met(&stack, waiting, met, nodes[next.child].children);
        } else if ((next.child & OF_KIND) == OBJECT) {
            if (is_passed(number, passed)) { continue; }
            let own = own_ray(number, ray.origin, ray.dir);
            if (objects[number].shape == MESH) {
                within = number;
                bottom = waiting;
                space = space_of(own.origin, own.dir);
                stack[waiting] = Waiting(0.0, objects[number].root);
                waiting += 1u;
                continue;
            }
            let hit = round_hit(number, own, best.t);
            if (hit.t < best.t) { best = Hit(hit.t, number, 0u, hit.uv); }
        } else {
            var hit = TriangleHit(best.t, NOTHING, 0u, vec2f(0.0));
            let placed = within != NOTHING;
            if ((next.child & OF_KIND) == FOUR) {
                let of_four = four_hit(number, space.sheared, best.t, passed, placed);
                if (of_four.place < 4u) { hit = TriangleHit(of_four.t, number, of_four.place, of_four.uv); }
            } else {
                hit = slivers_hit(
                    number, space.origin, space.dir, space.sheared, best.t, passed, placed, first_only, &stack, waiting,
                );
            }
            if (hit.four != NOTHING) {
                let object = select(fours[hit.four].objects[hit.place], within, placed);
                best = Hit(hit.t, object, fours[hit.four].triangles[hit.place], hit.uv);
            }
        }
        if (first_only && best.object != NOTHING) { break; }
    }
    return best;
}
