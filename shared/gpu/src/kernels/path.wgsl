// Camera paths, each in a slot of its own, as `pass/paths.rs` lays them out, which has the same structs.

// What a path does next. None: it has ended.
const ENDED: u32 = 0u;
// From the camera, straight or by specular surfaces.
const FROM_CAMERA: u32 = 1u;
// From the first surface that is not specular, or from a scattering in a medium whose light beams do not bring.
const WALKS: u32 = 2u;

// What is known of where the path's direction was drawn.
// Lights were sampled there as well.
const WAS_LIT: u32 = 1u;
// It is a surface that is lit from one side, `facing`.
const FACES: u32 = 2u;
// It is a surface, and `projected` is meant.
const IS_SURFACE: u32 = 4u;
// It is the first surface, to which photons bring light as well.
const IS_FIRST: u32 = 8u;
// `behind` is meant.
const IS_BEHIND: u32 = 16u;
// Everything is light that a medium scatters.
const IN_VOLUME: u32 = 32u;
// The path has followed a lobe that is not smooth.
const IS_BLURRED: u32 = 512u;
// From the first surface the ray looks for light straight from lights alone, or for all other light alone, where rules
// hide different things from the two.
const ONLY_DIRECT: u32 = 64u;
const NO_DIRECT: u32 = 128u;
// From the camera it has come through the surface that it left last.
const IS_REFRACTED: u32 = 256u;
// From gloss that obeys rules of its own, to the other side if IS_REFRACTED.
const IS_GLOSS: u32 = 4096u;
// The wavelength of its light, from 1 on, above so many bits; 0: none. Its weight is no part of the throughput.
const OF_WAVE: u32 = 0xf0000u;
const WAVE_OF_PATH: u32 = 16u;

struct Path {
    origin: vec3f,
    // Number of the medium.
    medium: u32,
    dir: vec3f,
    phase: u32,
    // Throughput from the film.
    beta: vec3f,
    // Turns since the camera, or scatterings since the walk began.
    depth: u32,
    // The same without what refraction compresses; of a walk, since that began.
    track: vec3f,
    flags: u32,
    // Where the direction was drawn.
    point: vec3f,
    // Per solid angle.
    density: f32,
    // Its normal on the side that is lit.
    facing: vec3f,
    // The density per projected solid angle.
    projected: f32,
    // Of a path from the camera that has split: how likely chance would have led it through all the branches it took.
    share: f32,
    // Factor on all but the light that it meets: one over the probability that it is looked for; zero when it is not.
    rest: f32,
    // How many of its branches wait, and above SPLITS_OF_PATH how often it has split.
    splits: u32,
    // From there to the start of the ray.
    distance: f32,
    // The projected density of what was drawn last but for specular surfaces.
    behind: f32,
    x: u32,
    y: u32,
    // The specular surface on its way from the camera that it left last, or the first surface of a walk; else NONE.
    surface: u32,
}

const SPLITS_OF_PATH: u32 = 16u;
const WAITING: u32 = 0xffffu;

// A branch of a path from the camera that waits until those before it have ended. `pass/paths.rs` has the same struct.
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

// What a path's ray does not see, by bits of classes.
fn hidden_from(path: Path) -> u32 {
    if (path.phase == FROM_CAMERA) {
        if (path.surface == NONE) { return lighting.camera_hides; }
        return hidden_in(path.surface, (path.flags & IS_REFRACTED) != 0u);
    }
    if ((path.flags & (IS_FIRST | NO_DIRECT)) == IS_FIRST) { return surfaces[path.surface].shadow; }
    if ((path.flags & IS_GLOSS) != 0u) { return hidden_in(path.surface, (path.flags & IS_REFRACTED) != 0u); }
    return lighting.gather_hides;
}

// What is not seen in an object, or through it.
fn hidden_in(object: u32, is_refracted: bool) -> u32 {
    return select(surfaces[object].reflected, surfaces[object].refracted, is_refracted);
}

// What a path has found, at the film.
struct Found {
    // Straight from lights.
    direct: vec3f,
    // Rays that were traced.
    rays: u32,
    // From surfaces and media.
    surface: vec3f,
    // Beams that brought some.
    beams: u32,
    // What a medium has scattered.
    volume: vec3f,
    // What of the light from all around gets through straight: of paths that meet no surface.
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

// Where a path asks for light.
const NO_VERTEX: u32 = 0u;
// The first surface that is not specular, and others.
const FIRST: u32 = 1u;
const LATER: u32 = 2u;
// Where the path ends by what photons bring there.
const LAST: u32 = 3u;
// Before the first surface that is not followed: a lobe that is, but not a smooth one.
const ON_THE_WAY: u32 = 4u;
// In a medium.
const SCATTERS: u32 = 5u;

// Bits above the part, of rules: it is gloss that obeys some of its own; no light of other surfaces is looked for
// from there; it was found by a ray from the first surface, and lights by whose photons that one is not lit are above
// bit 8.
const OF_PART: u32 = 3u;
const OF_GLOSS: u32 = 4u;
const SEES_LIGHTS_ALONE: u32 = 8u;
const BY_GATHER_RAY: u32 = 16u;

struct PathVertex {
    point: vec3f,
    kind: u32,
    // Normals of a surface.
    ng: vec3f,
    // Number of the medium that the path came through.
    medium: u32,
    ns: vec3f,
    // What its light counts as, and more bits.
    part: u32,
    // To where the path comes from; of a medium, the direction of travel.
    wo: vec3f,
    // Of a path that ends: how many rays the first surface has sent per projected solid angle, over what photons are
    // worth there; zero where the path has not come straight from there.
    from_projected: f32,
    // Throughput from the film, with the weight of the path's wavelength.
    beta: vec3f,
    // That wavelength, from 1 on; 0: none.
    wave: u32,
    // Of a surface whose normal is turned by a map.
    shadowing: Shadowing,
}

fn largest_channel(v: vec3f) -> f32 {
    let yz = select(v.z, v.y, v.y > v.z);
    return select(yz, v.x, v.x > yz);
}

fn medium_scatters(m: Medium) -> bool { return largest_channel(m.sigma_s) > 0.0; }

// A vertex of a path draws from so many squares of even numbers.
const SQUARES_OF_VERTEX: u32 = 16u;

// Of two ways to sample a direction, by their densities.
fn power_heuristic(a: f32, b: f32) -> f32 {
    let a2 = a * a;
    if (a2 == of_bits(INFINITY)) { return 1.0; }
    if (!(a2 > 0.0)) { return 0.0; }
    return quotient(a2, a2 + b * b);
}

// Of a path in a medium: `Segment` of `estimate.wgsl`, and its throughput. Where the density varies, `path_cross.wgsl`
// has written it, and left in the tail what the path is multiplied by and the bits of where it is scattered, or of -1.
struct PathSegment {
    origin: vec3f,
    length: f32,
    dir: vec3f,
    medium: u32,
    pixel: u32,
    steps: u32,
    step_count: u32,
    // Where the density varies, what has been done; and above WAVE_OF_SEGMENT the path's wavelength, from 1 on, or 0.
    crossed: u32,
}

const CROSSED: u32 = 1u;
const BY_A_FLIGHT: u32 = 2u;
const WAVE_OF_SEGMENT: u32 = 8u;

struct Tail {
    // With the weight of the path's wavelength.
    beta: vec3f,
    // What it brings counts as; with this bit, beams bring all the light of the medium but what is scattered once.
    part: u32,
}

const IS_SERVED: u32 = 4u;

// How photons and paths share the caustics of a light: `Caustics` of the plan's estimators.
const CAUSTICS_BY_PHOTONS: u32 = 0u;
const CAUSTICS_SHARED: u32 = 1u;
const CAUSTICS_BY_PATHS: u32 = 2u;

// Of a light, or of a medium.
struct Use {
    // Of a light as above; of a medium, 1 where beams bring all its light.
    way: u32,
    // Expected photons of a pass in a kernel of its caustics.
    in_caustic: f32,
    // Of a light, the group whose layer it belongs to, from 1 on; 0: none.
    light_group: u32,
}

const ENDS_AT_FIRST: u32 = 2u;
const ENDS_AT_SECOND: u32 = 3u;

// What a pass does. `pass/constants.rs` has the same struct.
struct PassConstants {
    camera_stream: Stream,
    lens_stream: Stream,
    // Where in their pixels samples are, if all are at the same place.
    offset: vec2f,
    has_offset: u32,
    // Parts of the lens are visited by tiles.
    by_parts: u32,
    // Of the weights between photons and paths.
    in_kernel: f32,
    least_flight: f32,
    // Factor on the probability that paths go on.
    patience: f32,
    // Photons go on from surface to surface, and bring what comes by way of specular ones.
    photons_go_on: u32,
    // 1: paths end by photons far enough away; 2: and at first surfaces; 3: all at their second surface.
    ends: u32,
    // Beams bring some of the light of media where paths are scattered.
    leave_beams: u32,
    // The slots of this launch: the first one's number, how many, and tiles a row.
    first: u32,
    slots: u32,
    columns: u32,
    // Photons bring caustics of lights that no path meets to lobes that paths follow.
    unmet_caustics: u32,
    // Factor on the photons that gloss sees.
    on_gloss: f32,
    // Wavelengths of the pass.
    waves: u32,
    // How often a path splits at most, and room for so many of its branches.
    splits: u32,
    branches: u32,
    // Of chords.
    chord_key: vec2u,
    // By wavelength: what light is multiplied by; by the row of a material and wavelength, indices inside over those
    // outside.
    weights: array<array<f32, 3>, 8>,
    etas: array<array<f32, 8>, 16>,
    // What a path finds are so many `Found`: of all light, and of three groups of lights each.
    records: u32,
}
