// Camera paths, each in a slot of its own. `pass/paths.rs` has the same structs.

// Phases of a path.
const ENDED: u32 = 0u;
// From the camera, so far only by surfaces that paths follow: specular ones and narrow lobes.
const FROM_CAMERA: u32 = 1u;
// Beyond the first surface that is not followed, or beyond a scattering in a medium without beams.
const WALKS: u32 = 2u;

// Flags of the vertex where the path's direction was drawn.
// Lights were sampled there as well.
const WAS_LIT: u32 = 1u;
// A surface lit from one side; `facing` is valid.
const FACES: u32 = 2u;
// A surface; `projected` is valid.
const IS_SURFACE: u32 = 4u;
// The path's first surface, where photons bring light as well.
const IS_FIRST: u32 = 8u;
// `behind` is valid.
const IS_BEHIND: u32 = 16u;
// All that the path finds is light scattered by a medium.
const IN_VOLUME: u32 = 32u;
// The path has followed a rough lobe.
const IS_BLURRED: u32 = 512u;
// If rules hide different things from the two, the first surface's ray looks only for direct light, or for all but
// that.
const ONLY_DIRECT: u32 = 64u;
const NO_DIRECT: u32 = 128u;
// From the camera: the path went through the surface that it left last.
const IS_REFRACTED: u32 = 256u;
// From gloss with rules of its own, to the other side if IS_REFRACTED.
const IS_GLOSS: u32 = 4096u;
// Wavelength, 1-based, 0: none; shifted by WAVE_OF_PATH. The throughput does not contain its weight.
const OF_WAVE: u32 = 0xf0000u;
const WAVE_OF_PATH: u32 = 16u;

struct Path {
    origin: vec3f,
    medium: u32,
    dir: vec3f,
    phase: u32,
    // Throughput from the film.
    beta: vec3f,
    // Bounces since the camera, or scatterings since the walk began.
    depth: u32,
    // `beta` without refraction's compression of radiance and without splits; of a walk, since it began.
    track: vec3f,
    flags: u32,
    // Vertex where the direction was drawn.
    point: vec3f,
    // Pdf of the direction, per solid angle.
    density: f32,
    // Normal there, on the lit side.
    facing: vec3f,
    // The pdf per projected solid angle, over `photon_scale`.
    projected: f32,
    // After splits: probability of all branches taken, had they been chosen by chance.
    share: f32,
    // Factor on all light but what the path meets: one over the probability of looking for it, or zero.
    rest: f32,
    // Number of waiting branches; above SPLITS_OF_PATH, number of splits so far.
    splits: u32,
    // From `point` to the ray's origin.
    distance: f32,
    // `projected` at the last vertex before the followed surfaces.
    behind: f32,
    x: u32,
    y: u32,
    // From the camera: the specular surface that it left last; of a walk: its first surface; else NONE.
    surface: u32,
}

const SPLITS_OF_PATH: u32 = 16u;
const WAITING: u32 = 0xffffu;

// A waiting branch of a camera path. `pass/paths.rs` has the same struct.
struct Branch {
    origin: vec3f,
    medium: u32,
    dir: vec3f,
    depth: u32,
    beta: vec3f,
    flags: u32,
    track: vec3f,
    surface: u32,
    share: f32,
    rest: f32,
}

// Class bits of what a path's ray does not see.
fn hidden_from(path: Path) -> u32 {
    if (path.phase == FROM_CAMERA) {
        if (path.surface == NONE) { return lighting.camera_hides; }
        return hidden_in(path.surface, (path.flags & IS_REFRACTED) != 0u);
    }
    if ((path.flags & (IS_FIRST | NO_DIRECT)) == IS_FIRST) { return surfaces[path.surface].shadow; }
    if ((path.flags & IS_GLOSS) != 0u) { return hidden_in(path.surface, (path.flags & IS_REFRACTED) != 0u); }
    return lighting.gather_hides;
}

// Class bits of what is hidden in an object's reflections, or in what it refracts.
fn hidden_in(object: u32, is_refracted: bool) -> u32 {
    return select(surfaces[object].reflected, surfaces[object].refracted, is_refracted);
}

// What a path has found, at the film.
struct Found {
    // Direct light.
    direct: vec3f,
    // Number of rays traced.
    rays: u32,
    surface: vec3f,
    // Number of contributing beams.
    beams: u32,
    // Light scattered by media.
    volume: vec3f,
    // Transmittance to the environment, for paths that meet no surface.
    let_through: f32,
}

const DIRECT_PART: u32 = 0u;
const SURFACE_PART: u32 = 1u;
const VOLUME_PART: u32 = 2u;

fn found_more(found: Found, part: u32, radiance: vec3f) -> Found {
    var sum = found;
    switch part {
        case DIRECT_PART: { sum.direct += radiance; }
        case SURFACE_PART: { sum.surface += radiance; }
        default: { sum.volume += radiance; }
    }
    return sum;
}

// Kinds of vertices, where a path asks for light.
const NO_VERTEX: u32 = 0u;
// The first surface that is not followed, and later ones.
const FIRST: u32 = 1u;
const LATER: u32 = 2u;
// A surface where photons end the path.
const LAST: u32 = 3u;
// A rough followed lobe before FIRST.
const ON_THE_WAY: u32 = 4u;
// A scattering in a medium.
const SCATTERS: u32 = 5u;

// Bits above the part, for rules: gloss with rules of its own; a surface that looks for no light of other surfaces;
// found by a ray from the first surface, with class bits of lights whose photons do not light that one above bit 8.
const OF_PART: u32 = 3u;
const OF_GLOSS: u32 = 4u;
const SEES_LIGHTS_ALONE: u32 = 8u;
const BY_GATHER_RAY: u32 = 16u;

struct PathVertex {
    point: vec3f,
    kind: u32,
    ng: vec3f,
    // Medium that the path came through.
    medium: u32,
    ns: vec3f,
    // Part that its light counts as, and the bits above.
    part: u32,
    // Towards where the path comes from; in a medium, the direction of travel.
    wo: vec3f,
    // Where a path ends that came straight from its first surface: `projected` of that; otherwise zero.
    from_projected: f32,
    // Throughput from the film, including the wavelength's weight.
    beta: vec3f,
    // The path's wavelength, 1-based; 0: none.
    wave: u32,
    // Of a surface with a bump or normal map.
    shadowing: Shadowing,
}

fn largest_channel(v: vec3f) -> f32 {
    let yz = select(v.z, v.y, v.y > v.z);
    return select(yz, v.x, v.x > yz);
}

fn medium_scatters(m: Medium) -> bool { return largest_channel(m.sigma_s) > 0.0; }

// Even squares reserved for each vertex of a path.
const SQUARES_OF_VERTEX: u32 = 16u;

// MIS weight of a direction sampled with pdf `a`, against pdf `b`.
fn power_heuristic(a: f32, b: f32) -> f32 {
    let a2 = a * a;
    if (a2 == of_bits(INFINITY)) { return 1.0; }
    if (!(a2 > 0.0)) { return 0.0; }
    return quotient(a2, a2 + b * b);
}

// A path's segment in a medium: `Segment` of `estimate.wgsl`. Where the density varies, `path_cross.wgsl` has written
// it, and left in the tail the factor on the throughput and the bits of the scattering's distance, or of -1.
struct PathSegment {
    origin: vec3f,
    length: f32,
    dir: vec3f,
    medium: u32,
    pixel: u32,
    steps: u32,
    step_count: u32,
    // CROSSED and BY_A_FLIGHT, if the density varies; above WAVE_OF_SEGMENT the path's wavelength, 1-based, or 0.
    crossed: u32,
}

const CROSSED: u32 = 1u;
const BY_A_FLIGHT: u32 = 2u;
const WAVE_OF_SEGMENT: u32 = 8u;

struct Tail {
    // Throughput, including the wavelength's weight.
    beta: vec3f,
    // What its light counts as. IS_SERVED: beams bring all of the medium's light but single scattering.
    part: u32,
}

const IS_SERVED: u32 = 4u;

// How photons and paths share a light's caustics: `Caustics` of the plan's estimators.
const CAUSTICS_BY_PHOTONS: u32 = 0u;
const CAUSTICS_SHARED: u32 = 1u;
const CAUSTICS_BY_PATHS: u32 = 2u;

// How the light of a light or a medium is found.
struct Use {
    // Light: one of the above. Medium: 1 if beams bring all its light.
    way: u32,
    // Light: expected photons of a pass in a kernel of its caustics.
    in_caustic: f32,
    // Light: group whose layer it belongs to, 1-based; 0: none.
    light_group: u32,
}

const ENDS_AT_FIRST: u32 = 2u;
const ENDS_AT_SECOND: u32 = 3u;

// Parameters of a pass. `pass/constants.rs` has the same struct.
struct PassConstants {
    camera_stream: Stream,
    lens_stream: Stream,
    // Position of samples in their pixels, if it is the same for all.
    offset: vec2f,
    has_offset: u32,
    // 1: tiles visit parts of the lens in turn.
    by_parts: u32,
    // Of the MIS weights between photons and paths.
    in_kernel: f32,
    least_flight: f32,
    // Factor on the survival probability of paths.
    patience: f32,
    // 1: photons go on from surface to surface, and bring all light that arrives by followed ones.
    photons_go_on: u32,
    // 1: photons end paths that have flown far enough; 2: also at first surfaces; 3: all end at their second surface.
    ends: u32,
    // 1: beams bring part of the light of media that scatter paths.
    leave_beams: u32,
    // This launch's first slot, number of slots, and tiles per row.
    first: u32,
    slots: u32,
    columns: u32,
    // 1: photons bring caustics of lights that no path meets to lobes that paths follow.
    unmet_caustics: u32,
    // Factor on the photons that gloss sees.
    on_gloss: f32,
    // Number of wavelengths.
    waves: u32,
    // Most splits of a path, and most branches that can wait.
    splits: u32,
    branches: u32,
    // Key of the chords' random numbers.
    chord_key: vec2u,
    // By wavelength: weight of its light. By dispersive material and wavelength: index inside over outside.
    weights: array<array<f32, 3>, 8>,
    etas: array<array<f32, 8>, 16>,
    // Number of `Found` per path: one for all light, and one for every three light groups.
    records: u32,
}
