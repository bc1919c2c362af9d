// Walls that cross the kernel of a surface photon. Same operations, in the same order, as
// `beamfarm_render::cpu::beam::walls` on CPUs. Goes after `near.wgsl` and `hull.wgsl`.

// All crossing walls lie where dot(offset from the photon, `beyond`) > 1; NaN: they may be anywhere; zero: there are
// none. Rays that test them start at `height` above the surface.
struct Crossing { beyond: vec3f, height: f32 }

// Intersection of a triangle with a disc around the origin; NaN: it may be anywhere.
struct WallLine { p: vec3f, q: vec3f, is: u32 }

fn line_in_disc(corners: array<vec3f, 3>, n: vec3f, radius: f32) -> WallLine {
    let none = WallLine(vec3f(0.0), vec3f(0.0), NO_MORE_WALLS);
    let heights = vec3f(dot3(corners[0], n), dot3(corners[1], n), dot3(corners[2], n));
    if (all(heights > vec3f(0.0)) || all(heights < vec3f(0.0))) { return none; }
    // Where its edges cross the plane; the same point twice at a corner.
    var p = vec3f(0.0);
    var q = vec3f(0.0);
    var count = 0u;
    for (var i = 0u; i < 3u; i++) {
        let next = (i + 1u) % 3u;
        let a = heights[i];
        let b = heights[next];
        if ((a <= 0.0) != (b <= 0.0)) {
            let met = corners[i] + (corners[next] - corners[i]) * quotient(a, a - b);
            if (count == 0u) { p = met; } else { q = met; }
            count += 1u;
        }
    }
    // In the plane, or degenerate.
    if (count < 2u) {
        let nowhere = vec3f(of_bits(NOT_A_NUMBER));
        return WallLine(nowhere, nowhere, WALL_TRIANGLE);
    }
    let way = q - p;
    let length2 = dot3(way, way);
    let radius2 = radius * radius;
    if (length2 == 0.0) { return WallLine(p, q, select(NO_MORE_WALLS, WALL_TRIANGLE, dot3(p, p) < radius2)); }
    let middle = quotient(-dot3(p, way), length2);
    let nearest = p + way * middle;
    let off2 = dot3(nearest, nearest);
    let half = root(not_below_zero(quotient(radius2 - off2, length2)));
    let first = not_below_zero(middle - half);
    let last = not_above_one(middle + half);
    let is_there = off2 < radius2 && first <= last;
    return WallLine(p + way * first, p + way * last, select(NO_MORE_WALLS, WALL_TRIANGLE, is_there));
}

// Whether the whole scene is on the same side of a triangle as a point: such a wall separates no two surfaces.
fn is_outer_wall(corners: array<vec3f, 3>, point: vec3f) -> bool {
    var n = unit_or_zero(cross3(corners[1] - corners[0], corners[2] - corners[0]));
    n = n * signum(dot3(n, point - corners[0]));
    return is_outside(n, dot3(n, corners[0]));
}

// The next wall that crosses the disc: a line, something round, or NO_MORE_WALLS.
fn next_line(search: ptr<function, WallSearch>, middle: vec3f, n: vec3f, radius: f32) -> WallLine {
    let nowhere = vec3f(of_bits(NOT_A_NUMBER));
    loop {
        let found = next_wall(search);
        if (found.is == NO_MORE_WALLS) { break; }
        if (found.is == ROUND_WALL) {
            if (reach_of(found.object, n) >= dot3(n, middle) && reach_of(found.object, -n) >= dot3(-n, middle)) {
                return WallLine(nowhere, nowhere, ROUND_WALL);
            }
            continue;
        }
        var corners = found.corners;
        for (var i = 0u; i < 3u; i++) { corners[i] -= middle; }
        let line = line_in_disc(corners, n, radius);
        if (line.is == WALL_TRIANGLE && !is_outer_wall(found.corners, middle)) { return line; }
    }
    return WallLine(nowhere, nowhere, NO_MORE_WALLS);
}

fn is_number(v: vec3f) -> bool { return all(abs(v) < vec3f(of_bits(INFINITY))); }

// Searches the disc at this height above the surface. `n`: unit normal of both, upwards.
fn crossing_walls(point: vec3f, n: vec3f, radius: f32, height: f32) -> Crossing {
    let nowhere = vec3f(of_bits(NOT_A_NUMBER));
    let middle = point + n * height;
    let at = dot3(n, middle);
    var planes: array<vec4f, 2>;
    planes[0] = vec4f(n, at);
    planes[1] = vec4f(-n, -at);
    let around = Around(middle, 0.0, n, radius, planes);
    var search: WallSearch;
    // Pass 0 finds the nearest point of all lines; pass 1 their least distance in that direction.
    var least2 = of_bits(INFINITY);
    var nearest = vec3f(0.0);
    var count = 0u;
    var way = vec3f(0.0);
    var distance = of_bits(INFINITY);
    var are_numbers = true;
    for (var turn = 0u; turn < 2u; turn++) {
        begin_walls(&search, around);
        loop {
            let line = next_line(&search, middle, n, radius);
            if (line.is == NO_MORE_WALLS) { break; }
            if (line.is == ROUND_WALL) { return Crossing(nowhere, height); }
            if (turn == 0u) {
                let near = nearest_of_edge(line.p, line.q);
                let distance2 = dot3(near, near);
                if (count == 0u || distance2 < least2) {
                    least2 = distance2;
                    nearest = near;
                }
                count += 1u;
            } else {
                are_numbers = are_numbers && is_number(line.p) && is_number(line.q);
                let p = dot3(line.p, way);
                let q = dot3(line.q, way);
                distance = select(distance, p, p < distance);
                distance = select(distance, q, q < distance);
            }
        }
        if (count == 0u) { return Crossing(vec3f(0.0), 0.0); }
        way = unit_or_zero(nearest);
    }
    if (!(distance > 0.0) || !are_numbers) { return Crossing(nowhere, height); }
    // A little less, for rounding.
    let less = 0.999f * distance;
    return Crossing(vec3f(quotient(way.x, less), quotient(way.y, less), quotient(way.z, less)), height);
}
