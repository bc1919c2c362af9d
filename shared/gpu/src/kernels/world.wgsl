// A scene in kernel layout. `world/mod.rs` has the same struct. The triangles of lights are at binding 28, in
// `emission.wgsl`.

// No light; a boundary that changes no medium.
const NONE: u32 = 0xffffffffu;
const VACUUM: u32 = 0xfffffffeu;
// Classes of objects: pure medium boundaries, and all others.
const NULL_BOUNDARIES: u32 = 1u;
const VISIBLE: u32 = 2u;
// Light may pass, and the medium is the same on both sides; light may pass at all.
const CLEAR: u32 = 8u;
const TRANSMITTING: u32 = 64u;
// Rays may go straight through; all others.
const PASSABLE: u32 = 16u;
const OPAQUE: u32 = 32u;

// An object's material, light, and media on its sides.
struct Surface {
    material: u32,
    light: u32,
    // Medium on the side that the geometric normal points away from.
    interior: u32,
    exterior: u32,
    // Class bits of objects and lights that are not seen by rays that it reflects, refracts, or sends to lights.
    reflected: u32,
    refracted: u32,
    shadow: u32,
    // Lights that illuminate it at a path's first vertex: AIMED_AT, or another number of running sums.
    lit_by: u32,
    // ONE_RAY, GATHERS, IS_GATHERED, IS_GLOSS_RULED.
    bits: u32,
    // Class bits of what photons that it scatters do not see, and of lights whose photons do not light it.
    photon: u32,
}

// Shadow rays and surface rays see the same.
const ONE_RAY: u32 = 1u;
// Paths that start at it find the light of other surfaces; paths that come to it find its light.
const GATHERS: u32 = 2u;
const IS_GATHERED: u32 = 4u;
// Rules for reflected and refracted rays govern its gloss.
const IS_GLOSS_RULED: u32 = 8u;

@group(0) @binding(25) var<storage, read> surfaces: array<Surface>;
@group(0) @binding(27) var<storage, read> lights: array<Light>;
@group(0) @binding(29) var<storage, read> media: array<Medium>;
@group(0) @binding(30) var<storage, read> camera: Camera;

// Medium of a ray that leaves a surface of normal `ng` in direction `dir`; `around`: the medium that it came through.
fn medium_towards(surface: Surface, ng: vec3f, dir: vec3f, around: u32) -> u32 {
    if (surface.interior == NONE) { return around; }
    return select(surface.exterior, surface.interior, dot3(ng, dir) < 0.0);
}
