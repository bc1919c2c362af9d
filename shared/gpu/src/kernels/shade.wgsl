// Walls in the way of light. Goes after `rays.wgsl`.

// Class of objects that are no walls.
const NO_WALL: u32 = 4u;

fn is_wall(object: u32) -> bool { return (objects[object].classes & NO_WALL) == 0u; }

fn walls_stand_between(start: vec3f, way: vec3f) -> bool {
    let length = root(dot3(way, way));
    let dir = vec3f(quotient(way.x, length), quotient(way.y, length), quotient(way.z, length));
    return length > 0.0 && any_hit(Ray(start, dir), length, Ignored(NOTHING, NO_WALL));
}
