// Walls near each beam, as planes that they are behind, step by step as in `beamfarm_render::cpu::beam::walls`. One
// invocation per beam; runs twice, to count planes and to write them.

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read_write> beams: array<Beam>;
@group(1) @binding(2) var<storage, read> ends: array<BeamEnds>;
// By beam: number of planes; then their prefix sum.
@group(1) @binding(3) var<storage, read_write> counts: array<u32>;
@group(1) @binding(4) var<storage, read_write> found_planes: array<Plane>;

// How far walls may rise above the plane that stands for them, in kernel radii.
const BUMP: f32 = 0.25;
// Most planes of a beam. If more walls crowd around it, look-ups as far away as these trace a ray.
const MOST_PLANES: u32 = 10u;
// Most stretches of a beam that have crowds.
const MOST_CROWDS: u32 = 3u;

// Planes of a beam as they are found, with the ranges of the walls.
struct PlaneList {
    planes: array<Plane, MOST_PLANES>,
    count: u32,
    // The plane that last covered a wall.
    last: u32,
    // Walls that no plane covers, by stretches of the beam.
    crowds: array<Plane, MOST_CROWDS>,
    crowd_count: u32,
}

fn of_crowd(range: vec2f, clear2: f32) -> Plane {
    return Plane(vec3f(0.0), of_bits(INFINITY), range, clear2, 0u);
}

fn is_zero(v: vec3f) -> bool { return all(v == vec3f(0.0)); }

fn radius_at(beam: Beam, s: f32) -> f32 { return beam.radius + beam.radius_slope * s; }

fn along_beam(beam: Beam, point: vec3f) -> f32 { return dot3(point - beam.origin, beam.dir); }

fn wider(range: vec2f, other: vec2f) -> vec2f { return vec2f(smaller(range.x, other.x), larger(range.y, other.y)); }

struct Stretch { range: vec2f, is_there: bool }

// Range along a beam in which the kernel reaches behind a plane, if any.
fn stretch_of(plane: Plane, beam: Beam) -> Stretch {
    // Beyond its ends, one sees the beam's end.
    var low = select(plane.range.x, -of_bits(INFINITY), plane.range.x <= 0.0);
    var high = select(plane.range.y, of_bits(INFINITY), plane.range.y >= beam.length);
    if (!is_zero(plane.n)) {
        // The kernel is behind the plane where that is nearer than its radius, as seen across the beam.
        let cosine = dot3(plane.n, beam.dir);
        let across = root(not_below_zero(1.0 - cosine * cosine));
        let above = dot3(plane.n, beam.origin) - plane.at - across * beam.radius;
        let slope = cosine - across * beam.radius_slope;
        if (slope > 0.0) {
            high = smaller(high, quotient(-above, slope));
        } else if (slope < 0.0) {
            low = larger(low, quotient(-above, slope));
        } else if (above >= 0.0) {
            return Stretch(vec2f(0.0), false);
        }
        if (low < 0.0 && high > beam.extent.x) {
            // Look-ups treat what is before the start as the start.
            high = larger(high, 1.17549435e-38f);
        }
    }
    return Stretch(vec2f(low, high), low < high && low < beam.extent.y && high > beam.extent.x);
}

fn is_before(plane: Plane, beam: Beam, s: f32) -> bool {
    return dot3(plane.n, beam.origin + beam.dir * s) - plane.at >= -BUMP * radius_at(beam, s);
}

// Whether the beam is in front of a plane wherever the kernel reaches behind it.
fn serves(plane: Plane, beam: Beam) -> bool {
    let stretch = stretch_of(plane, beam);
    if (!stretch.is_there) { return true; }
    let low = larger(stretch.range.x, 0.0);
    let high = smaller(stretch.range.y, beam.length);
    return !is_zero(plane.n) && (low > high || (is_before(plane, beam, low) && is_before(plane, beam, high)));
}

fn add_plane(list: ptr<function, PlaneList>, plane: Plane) {
    let number = (*list).count;
    (*list).planes[number] = plane;
    (*list).planes[number].clear2 = 0.0;
    (*list).last = number;
    (*list).count = number + 1u;
}

// Adds a wall to the crowd of its stretch of the beam, or to a new one if none is there and there is room.
fn add_to_crowd(list: ptr<function, PlaneList>, range: vec2f, clear2: f32) {
    var nearest = 0u;
    var gap = 0.0;
    for (var i = 0u; i < (*list).crowd_count; i++) {
        let other = (*list).crowds[i].range;
        let own = larger(other.x - range.y, range.x - other.y);
        if (i == 0u || own < gap) {
            nearest = i;
            gap = own;
        }
    }
    if ((*list).crowd_count == MOST_CROWDS || ((*list).crowd_count > 0u && gap <= 0.0)) {
        (*list).crowds[nearest].range = wider((*list).crowds[nearest].range, range);
        (*list).crowds[nearest].clear2 = smaller((*list).crowds[nearest].clear2, clear2);
    } else {
        (*list).crowds[(*list).crowd_count] = of_crowd(range, clear2);
        (*list).crowd_count += 1u;
    }
}

// Extends a plane along the beam over a wall behind it, if it then still serves.
fn covers(list: ptr<function, PlaneList>, number: u32, beam: Beam, range: vec2f) -> bool {
    var plane = (*list).planes[number];
    let before = plane.range;
    plane.range = wider(before, range);
    if (all(plane.range == before) || serves(plane, beam)) {
        (*list).planes[number] = plane;
        (*list).last = number;
        return true;
    }
    return false;
}

struct Triangle { a: vec3f, b: vec3f, c: vec3f }

fn is_behind(triangle: Triangle, plane: Plane, bump: f32) -> bool {
    return dot3(plane.n, triangle.a) - plane.at <= bump && dot3(plane.n, triangle.b) - plane.at <= bump
        && dot3(plane.n, triangle.c) - plane.at <= bump;
}

// Point of a triangle nearest to a line through the origin, seen along the line: a vector across it, zero if the line
// meets the triangle.
fn nearest_to_line(triangle: Triangle, dir: vec3f) -> vec3f {
    let a = triangle.a - dir * dot3(triangle.a, dir);
    let b = triangle.b - dir * dot3(triangle.b, dir);
    let c = triangle.c - dir * dot3(triangle.c, dir);
    let turns = vec3f(dot3(dir, cross3(a, b)), dot3(dir, cross3(b, c)), dot3(dir, cross3(c, a)));
    if (all(turns >= vec3f(0.0)) || all(turns <= vec3f(0.0))) { return vec3f(0.0); }
    var nearest = nearest_of_edge(a, b);
    let second = nearest_of_edge(b, c);
    if (dot3(second, second) < dot3(nearest, nearest)) { nearest = second; }
    let third = nearest_of_edge(c, a);
    if (dot3(third, third) < dot3(nearest, nearest)) { nearest = third; }
    return nearest;
}

fn add_triangle(list: ptr<function, PlaneList>, beam: Beam, triangle: Triangle, radius: f32) {
    let s = along_beam(beam, triangle.a);
    let t = along_beam(beam, triangle.b);
    let u = along_beam(beam, triangle.c);
    let range = vec2f(smaller(smaller(s, t), u), larger(larger(s, t), u));
    for (var i = 0u; i < (*list).crowd_count; i++) {
        let crowd = (*list).crowds[i].range;
        if ((*list).crowds[i].clear2 == 0.0 && crowd.x <= range.x && crowd.y >= range.y) { return; }
    }
    // Neighbours are mostly behind the same plane.
    let last = (*list).last;
    let bump = BUMP * radius;
    if (last < (*list).count && is_behind(triangle, (*list).planes[last], bump) && covers(list, last, beam, range)) {
        return;
    }
    var n = unit_or_zero(cross3(triangle.b - triangle.a, triangle.c - triangle.a));
    // The side that the beam is on where it is near.
    let near = 0.5 * (clamped(range.x, 0.0, beam.length) + clamped(range.y, 0.0, beam.length));
    n = n * signum(dot3(n, beam.origin + beam.dir * near - triangle.a));
    let own = Plane(n, dot3(n, triangle.a), range, 0.0, 0u);
    if (is_zero(n) || !stretch_of(own, beam).is_there) { return; }
    for (var i = 0u; i < (*list).count; i++) {
        if (i != last && is_behind(triangle, (*list).planes[i], bump) && covers(list, i, beam, range)) { return; }
    }
    if ((*list).count < MOST_PLANES && serves(own, beam)) {
        add_plane(list, own);
        return;
    }
    // A triangle is behind the plane through its point nearest to the beam's line, perpendicular to the way there.
    let from_origin = Triangle(triangle.a - beam.origin, triangle.b - beam.origin, triangle.c - beam.origin);
    let nearest = nearest_to_line(from_origin, beam.dir);
    let distance = root(dot3(nearest, nearest));
    if (distance >= radius) { return; }
    n = -unit_or_zero(nearest);
    if ((*list).count < MOST_PLANES && !is_zero(n)) {
        add_plane(list, Plane(n, dot3(n, beam.origin) - distance, range, 0.0, 0u));
    } else {
        add_to_crowd(list, range, distance * distance);
    }
}

fn add_round(list: ptr<function, PlaneList>, beam: Beam, object: u32, radius: f32) {
    let from_origin = dot3(beam.origin, beam.dir);
    let range = vec2f(-reach_of(object, -beam.dir) - from_origin, reach_of(object, beam.dir) - from_origin);
    for (var i = 0u; i < (*list).count; i++) {
        let plane = (*list).planes[i];
        if (reach_of(object, plane.n) - plane.at <= BUMP * radius && covers(list, i, beam, range)) { return; }
    }
    let middle = wall_shapes[object].middle;
    let nearest = beam.origin + beam.dir * clamped(along_beam(beam, middle), 0.0, beam.length);
    let n = unit_or_zero(nearest - middle);
    let own = Plane(n, reach_of(object, n), range, 0.0, 0u);
    if ((*list).count < MOST_PLANES && serves(own, beam)) {
        add_plane(list, own);
    } else {
        add_to_crowd(list, range, 0.0);
    }
}

// Adds the plane of what a beam starts or ends on. Returns it, raised, for the search.
fn add_end(list: ptr<function, PlaneList>, beam: Beam, normal: vec3f, is: u32, s: f32, radius: f32) -> vec4f {
    if (is == ENDS_NOWHERE) { return NO_PLANE; }
    let out = select(-beam.dir, beam.dir, s == 0.0);
    let n = normal * signum(dot3(normal, out));
    let at = dot3(n, beam.origin + beam.dir * s);
    if (is == ENDS_ON_SURFACE) {
        add_plane(list, Plane(n, at, vec2f(-of_bits(INFINITY), of_bits(INFINITY)), 0.0, 0u));
    }
    return vec4f(n, at + BUMP * radius);
}

fn find_planes(list: ptr<function, PlaneList>, beam: Beam, end: BeamEnds) {
    let radius = larger(radius_at(beam, beam.extent.x), radius_at(beam, beam.extent.y));
    (*list).count = 0u;
    (*list).last = 0u;
    (*list).crowd_count = 0u;
    var behind: array<vec4f, 2>;
    behind[0] = add_end(list, beam, end.start, end.start_is, 0.0, radius);
    behind[1] = add_end(list, beam, end.end, end.end_is, beam.length, radius);
    let start = beam.extent.x;
    let around = Around(beam.origin + beam.dir * start, beam.extent.y - start, beam.dir, radius, behind);
    var search: WallSearch;
    begin_walls(&search, around);
    loop {
        let found = next_wall(&search);
        if (found.is == NO_MORE_WALLS) { break; }
        if (found.is == WALL_TRIANGLE) {
            add_triangle(list, beam, Triangle(found.corners[0], found.corners[1], found.corners[2]), radius);
        } else {
            add_round(list, beam, found.object, radius);
        }
    }
}

// A plane as it applies to a beam; a crowd if it does not serve.
fn plane_of(plane: Plane, beam: Beam) -> Plane {
    if (serves(plane, beam)) { return plane; }
    return of_crowd(plane.range, plane.clear2);
}

@compute @workgroup_size(64)
fn count_planes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let beam = beams[i];
    var list: PlaneList;
    find_planes(&list, beam, ends[i]);
    var count = 0u;
    for (var k = 0u; k < list.count; k++) { count += u32(stretch_of(list.planes[k], beam).is_there); }
    for (var k = 0u; k < list.crowd_count; k++) { count += u32(stretch_of(list.crowds[k], beam).is_there); }
    counts[i] = count;
}

fn write_plane(plane: Plane, beam: Beam, place: u32) -> u32 {
    let stretch = stretch_of(plane, beam);
    if (!stretch.is_there) { return place; }
    var written = plane_of(plane, beam);
    written.is_outer = u32(hull.is_closed == 1u && is_outside(plane.n, plane.at));
    written.range = stretch.range;
    found_planes[place] = written;
    return place + 1u;
}

// Runs after the prefix sum.
@compute @workgroup_size(64)
fn write_planes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_number(group, groups) * 64u + thread;
    if (i >= sizes.count) { return; }
    let beam = beams[i];
    var list: PlaneList;
    find_planes(&list, beam, ends[i]);
    let first = counts[i];
    var place = first;
    for (var k = 0u; k < list.count; k++) { place = write_plane(list.planes[k], beam, place); }
    for (var k = 0u; k < list.crowd_count; k++) { place = write_plane(list.crowds[k], beam, place); }
    beams[i].walls = packed_walls(first, place - first);
}
