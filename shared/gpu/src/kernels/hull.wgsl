// The scene's bounding box.

struct Hull {
    low: vec3f,
    // 1: camera paths seem never to leave it.
    is_closed: u32,
    high: vec3f,
    spare: u32,
}

@group(0) @binding(51) var<storage, read> hull: Hull;

// Largest absolute coordinate.
fn hull_size() -> f32 {
    let low = abs(hull.low);
    let high = abs(hull.high);
    return extent(select(low, high, high > low));
}

// Whether the whole box is in front of a plane, up to rounding.
fn is_outside(n: vec3f, at: f32) -> bool {
    let low = n * hull.low;
    let high = n * hull.high;
    let least = select(high, low, low < high);
    return !all(n == vec3f(0.0)) && least.x + least.y + least.z >= at - 1e-5f * hull_size();
}
