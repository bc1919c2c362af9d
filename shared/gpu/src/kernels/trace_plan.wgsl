// What photon paths depend on besides the scene; `trace/plan.rs` describes it.

struct TracePlan {
    stream: Stream,
    center: vec3f,
    bounds: f32,
    view: array<vec4f, 5>,
    paths: u32,
    beam_paths: u32,
    is_even: u32,
    has_view: u32,
    goes_on: u32,
    ends_paths: u32,
    has_boundaries: u32,
    // KEEPS_BEAMS, KEEPS_PHOTONS.
    keeps: u32,
    lights: u32,
    kernel_paths: f32,
    surface_footprint: f32,
    radius_scale: f32,
    surface_scale: f32,
    floor: f32,
    ceiling: f32,
    smooth_ceiling: f32,
    in_kernel: f32,
    least_flight: f32,
    // Number of wavelengths. By dispersive material and wavelength: index inside over outside.
    waves: u32,
    etas: array<array<f32, 8>, 16>,
}

const KEEPS_BEAMS: u32 = 1u;
const KEEPS_PHOTONS: u32 = 2u;
// Of `ends_paths`. 1: camera paths may end at a surface's photons; 2: all end at their second surface.
const ENDS_PATHS_AT_SECOND: u32 = 2u;

struct TracedLight {
    sum: f32,
    in_caustic: f32,
    bits: u32,
    // Class bits: its own, and those of what its photons do not see.
    class_bit: u32,
    hides: u32,
    // Group whose layer it belongs to, 1-based; 0: none.
    light_group: u32,
}

// Photons bring its caustics; no path meets it.
const BRINGS_CAUSTICS: u32 = 1u;
const IS_UNMET: u32 = 2u;

struct TracedMedium {
    reach: f32,
    least_sigma_t: f32,
    // Widest base radius of a beam whose light has only met specular surfaces, and of scattered light.
    widest_sharp: f32,
    widest_smooth: f32,
    flags: u32,
    // Class bits of what photons that it scatters do not see, and of lights whose photons leave nothing in it.
    hides: u32,
}

const SCATTERS: u32 = 1u;
const IS_BY_BEAMS: u32 = 2u;

struct TracedObject {
    widest: f32,
    bits: u32,
    // Class bits of what photons that it scatters do not see, and of lights whose photons do not light it.
    hides: u32,
}

// It has lobes that paths do not follow; rough ones that they do; rules leave what it scatters to photons.
const IS_WIDE: u32 = 1u;
const IS_FOLLOWED: u32 = 2u;
const IS_NOT_GATHERED: u32 = 4u;

@group(1) @binding(45) var<storage, read> trace_plan: TracePlan;
@group(1) @binding(46) var<storage, read> traced_lights: array<TracedLight>;
@group(0) @binding(47) var<storage, read> traced_media: array<TracedMedium>;
@group(0) @binding(48) var<storage, read> traced_objects: array<TracedObject>;
