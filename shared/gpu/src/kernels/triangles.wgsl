// Watertight ray/triangle tests, four at a time (Woop, Benthin, Wald 2013, Watertight ray/triangle intersection), step
// by step as in the renderer.

// A ray, sheared to run along +z.
struct ShearedRay {
    axes: vec3u,
    // In the order of `axes`.
    origin: vec3f,
    shear: vec3f,
}

fn sheared_ray(origin: vec3f, dir: vec3f) -> ShearedRay {
    let size = abs(dir);
    var z = 0u;
    if (size.y > size.x) { z = 1u; }
    if (size.z > select(size.x, size.y, z == 1u)) { z = 2u; }
    let next = (z + 1u) % 3u;
    let last = (z + 2u) % 3u;
    let flips = dir[z] < 0.0;
    let axes = vec3u(select(next, last, flips), select(last, next, flips), z);
    let along = dir[z];
    let shear = vec3f(quotient(dir[axes.x], along), quotient(dir[axes.y], along), quotient(1.0, along));
    return ShearedRay(axes, vec3f(origin[axes.x], origin[axes.y], origin[z]), shear);
}

struct Corner { x: vec4f, y: vec4f, z: vec4f }

fn projected(four: u32, corner: u32, ray: ShearedRay) -> Corner {
    let pz = fours[four].corners[corner][ray.axes.z] - ray.origin.z;
    return Corner(
        fours[four].corners[corner][ray.axes.x] - ray.origin.x - ray.shear.x * pz,
        fours[four].corners[corner][ray.axes.y] - ray.origin.y - ray.shear.y * pz,
        ray.shear.z * pz,
    );
}

// What a ray passes through: an object, and those of any of these classes.
struct Ignored { object: u32, classes: u32 }

// Two more objects, or NOTHING.
struct Passed { ignored: Ignored, others: vec2u }

fn is_passed(object: u32, passed: Passed) -> bool {
    return object == passed.ignored.object || any(vec2u(object) == passed.others)
        || (objects[object].classes & passed.ignored.classes) != 0u;
}

// `place` 4: no hit.
struct FourHit { t: f32, place: u32, uv: vec2f }

// Nearest hit in (0, t_max) among four triangles of objects that are not passed. `placed`: they are of a mesh with its
// own BVH, which is not passed.
fn four_hit(four: u32, ray: ShearedRay, t_max: f32, passed: Passed, placed: bool) -> FourHit {
    let a = projected(four, 0u, ray);
    let b = projected(four, 1u, ray);
    let c = projected(four, 2u, ray);
    var u = c.x * b.y - c.y * b.x;
    var v = a.x * c.y - a.y * c.x;
    var w = b.x * a.y - b.y * a.x;
    let zero = vec4f(0.0);
    let on_edge = (u == zero) | (v == zero) | (w == zero);
    if (any(on_edge)) {
        // On an edge, as far as single precision can tell.
        for (var i = 0u; i < 4u; i++) {
            if (on_edge[i]) {
                let here = vec4u(0u, 1u, 2u, 3u) == vec4u(i);
                u = select(u, vec4f(difference_of_products(c.x[i], b.y[i], c.y[i], b.x[i])), here);
                v = select(v, vec4f(difference_of_products(a.x[i], c.y[i], a.y[i], c.x[i])), here);
                w = select(w, vec4f(difference_of_products(b.x[i], a.y[i], b.y[i], a.x[i])), here);
            }
        }
    }
    let inside = ((u >= zero) & (v >= zero) & (w >= zero)) | ((u <= zero) & (v <= zero) & (w <= zero));
    var best = FourHit(t_max, 4u, vec2f(0.0));
    if (!any(inside)) { return best; }
    let det = u + v + w;
    let along = u * a.z + v * b.z + w * c.z;
    for (var i = 0u; i < 4u; i++) {
        if (inside[i]) {
            // NaN, so no hit, if the determinant is zero.
            let t = quotient(along[i], det[i]);
            if (t > 0.0 && t < best.t && (placed || !is_passed(fours[four].objects[i], passed))) {
                best.t = t;
                best.place = i;
            }
        }
    }
    if (best.place < 4u) {
        let i = best.place;
        best.uv = vec2f(quotient(v[i], det[i]), quotient(w[i], det[i]));
    }
    return best;
}
