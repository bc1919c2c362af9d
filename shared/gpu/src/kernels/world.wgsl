// A scene by its numbers, as `world/mod.rs` lays it out, which has the same struct. The triangles of lights are at
// binding 28, in `emission.wgsl`.

// No light, or a boundary that changes no medium.
const NONE: u32 = 0xffffffffu;
const VACUUM: u32 = 0xfffffffeu;
// Classes of objects: nothing but boundaries of media, and all others.
const NULL_BOUNDARIES: u32 = 1u;
const VISIBLE: u32 = 2u;
// What light may pass, if it has the same medium on both sides; and whatever is there.
const CLEAR: u32 = 8u;
const TRANSMITTING: u32 = 64u;
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
    // What rays do not see, by bits of classes of objects and lights: those that it reflects, refracts, sends to
    // lights.
    reflected: u32,
    refracted: u32,
    shadow: u32,
    // Which lights it is lit by at a path's first vertex: AIMED_AT, or another number of running sums.
    lit_by: u32,
    // ONE_RAY, GATHERS, IS_GATHERED, IS_GLOSS_RULED.
    bits: u32,
    // What photons do not see that it sends on, and lights whose photons do not light it.
    photon: u32,
}

// Rays to lights and those to surfaces see the same.
const ONE_RAY: u32 = 1u;
// Rays of paths that start at it find the light of other surfaces; rays of paths that come to it find its light.
const GATHERS: u32 = 2u;
const IS_GATHERED: u32 = 4u;
// What is seen in its gloss is for rules of reflected and refracted rays to say.
const IS_GLOSS_RULED: u32 = 8u;

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
