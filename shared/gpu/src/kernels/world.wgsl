// A scene by its numbers, as `world/mod.rs` lays it out, which has the same struct. The triangles of lights are at
// binding 28, in `emission.wgsl`.

// No light, or a boundary that changes no medium.
const NONE: u32 = 0xffffffffu;
const VACUUM: u32 = 0xfffffffeu;
// Classes of objects: nothing but boundaries of media, and all others.
const NULL_BOUNDARIES: u32 = 1u;
const VISIBLE: u32 = 2u;
// What light may pass, if it has the same medium on both sides.
const CLEAR: u32 = 8u;
// What rays may go straight through as if it were not there, and all others.
const PASSABLE: u32 = 16u;
const OPAQUE: u32 = 32u;

// What an object is made of, what it emits, and what is on its sides.
struct Surface {
    material: u32,
    light: u32,
    // The medium on the side that the geometric normal points away from.
    interior: u32,
    exterior: u32,
}

@group(0) @binding(25) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(27) var<storage, read> lights: array<Light>;
@group(0) @binding(29) var<storage, read> media: array<Medium>;
@group(0) @binding(30) var<storage, read> camera: Camera;

// The medium that a ray is in once it has left a surface with a normal `ng` in a direction, `around` being what it was
// in when it came.
fn medium_towards(surface: Surface, ng: vec3f, dir: vec3f, around: u32) -> u32 {
    if (surface.interior == NONE) { return around; }
    return select(surface.exterior, surface.interior, dot3(ng, dir) < 0.0);
}
