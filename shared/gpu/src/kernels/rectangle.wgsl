// Samples rectangular lights uniformly over the solid angle that they subtend, step by step as in the renderer's
// `world/geometry/rectangle.rs`.

struct SphericalRectangle {
    // Zero: points are drawn by area.
    solid_angle: f32,
    depth: f32,
    low: vec2f,
    high: vec2f,
    start: vec2f,
    slopes: vec2f,
}

// Solid angle below which points are drawn by area.
const LEAST_SOLID_ANGLE: f32 = 0.03f;

const LEAST_POSITIVE: f32 = 1.1754944e-38f;

fn positive(x: f32) -> f32 { return select(LEAST_POSITIVE, x, x > LEAST_POSITIVE); }

fn complex_product(a: vec2f, b: vec2f) -> vec2f { return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x); }

// cos + i sin of the angle at a corner.
fn corner_angle(depth: f32, product: f32, x2: f32, y2: f32, scale: f32) -> vec2f {
    return vec2f(quotient(product, scale), quotient(depth * root(x2 + y2 + depth * depth), scale));
}

fn rectangle_from(light: Light, at: vec3f) -> SphericalRectangle {
    if (is_round(light) || light.half.x == 0.0) {
        return SphericalRectangle(0.0, 0.0, vec2f(0.0), vec2f(0.0), vec2f(0.0), vec2f(0.0));
    }
    let offset = light.position - at;
    let low = vec2f(dot3(offset, light.s), dot3(offset, light.t));
    let high = low + light.half;
    let depth = abs(dot3(offset, light.n));
    let depth2 = depth * depth;
    let low2 = low * low;
    let high2 = high * high;
    let x0 = root(low2.x + depth2);
    let x1 = root(high2.x + depth2);
    let y0 = root(low2.y + depth2);
    let y1 = root(high2.y + depth2);
    let near = complex_product(
        corner_angle(depth, low.y * high.x, high2.x, low2.y, x1 * y0),
        corner_angle(depth, -high.x * high.y, high2.x, high2.y, x1 * y1),
    );
    let far = complex_product(
        corner_angle(depth, low.x * high.y, low2.x, high2.y, x0 * y1),
        corner_angle(depth, -low.x * low.y, low2.x, low2.y, x0 * y0),
    );
    let whole = complex_product(near, far);
    let excess = arc_tan2(whole.y, whole.x);
    let solid_angle = select(excess, excess + 6.2831855f, excess < 0.0);
    return SphericalRectangle(
        select(0.0, solid_angle, solid_angle > LEAST_SOLID_ANGLE),
        depth,
        low,
        high,
        vec2f(far.x, -far.y),
        vec2f(quotient(-low.y, y0), quotient(high.y, y1)),
    );
}

fn sine_across(y: f32, across2: f32) -> f32 { return quotient(y, root(across2 + y * y)); }

fn on_side(x: f32, low: f32, high: f32) -> f32 {
    let above = select(x, low, x < low);
    return select(above, high, above > high);
}

// Point on the rectangle for uniform numbers, along its sides from its corner.
fn place_on_rectangle(seen: SphericalRectangle, sides: vec2f, u: vec2f) -> vec2f {
    let turned = sin_cos(u.x * seen.solid_angle);
    let angle = complex_product(vec2f(turned.y, turned.x), seen.start);
    let sine = angle.y;
    let rise = angle.x * seen.slopes.x - seen.slopes.y;
    let run = seen.slopes.x * sine;
    let size = not_above_one(quotient(abs(sine), positive(root(rise * rise + run * run))));
    let tilt = select(size, -size, sine * rise < 0.0);
    let depth = seen.depth;
    let x = on_side(quotient(depth * tilt, positive(root(1.0 - tilt * tilt))), seen.low.x, seen.high.x);
    let across2 = x * x + depth * depth;
    let first = sine_across(seen.low.y, across2);
    let last = sine_across(seen.high.y, across2);
    let up = first + u.y * (last - first);
    let y = on_side(quotient(up * root(across2), positive(root(1.0 - up * up))), seen.low.y, seen.high.y);
    let place = vec2f(x, y) - seen.low;
    return vec2f(on_side(place.x, 0.0, sides.x), on_side(place.y, 0.0, sides.y));
}
