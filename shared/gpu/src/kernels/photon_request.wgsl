// Requests to photons, laid out as in `photons/mod.rs`.

// A surface point where a camera path asks for photons: the processor's `photon_radiance`. Each path has one; if it
// asks for nothing, the kind is NOTHING_ASKED.
struct PhotonRequest {
    // Render space.
    point: vec3f,
    // How photons count; from bit 8 on, class bits of lights whose photons do not.
    kind: u32,
    // Unit geometric normal, on either side.
    ng: vec3f,
    // For LAST_COUNTED: number of rays from the first vertex times the pdf of this one, over |cos| with the geometric
    // normal there, and over what photons are worth there.
    density: f32,
    // Unit shading normal; bitwise equal to ng if there is none.
    ns: vec3f,
    // Index of the radiance that receives the result; unique.
    slot: u32,
    // Unit direction towards where the path comes from.
    wo: vec3f,
    // SEEN_BY_FOLLOWED to NOT_BY_RULE, and the wavelength.
    bits: u32,
    // Throughput from the film; without BY_BSDF, times the BSDF's value, which is constant on the side of wo. Zero if
    // that side is black.
    value: vec3f,
    // Factor on the expected photons.
    photon_scale: f32,
    shadowing: Shadowing,
}

// Paths follow the lobes that ask.
const SEEN_BY_FOLLOWED: u32 = 1u;
// Value and pdf are those of the request's material.
const BY_BSDF: u32 = 2u;
// Left to paths: light from surfaces; light that rules keep off the photons' surface.
const OFF_SURFACES: u32 = 4u;
const NOT_BY_RULE: u32 = 8u;
// Above these bits: the path's wavelength, 1-based, whose weight is in the value; 0: none.
const WAVE_OF_REQUEST: u32 = 8u;

fn kind_of(word: u32) -> u32 { return word & 0xffu; }

fn lights_of(word: u32) -> u32 { return word & 0xffffff00u; }

const NOTHING_ASKED: u32 = 0u;
// All with full weight: where a path ends at its first vertex, or where it comes not straight from there, but by a
// later vertex, a scattering in a medium, or surfaces that it follows.
const ALL_COUNTED: u32 = 1u;
// At a first vertex from which the path goes on: MIS weights, against that ray, for light that both find; the
// processor's `scattered_by`.
const FIRST_COUNTED: u32 = 2u;
// The same at later vertices, without light from surfaces, which the path itself finds: `lit_later`.
const LATER_COUNTED: u32 = 3u;
// Where a path ends straight after its first vertex: MIS weights against photons that go from here to that vertex:
// `brought_by_photons`.
const LAST_COUNTED: u32 = 4u;

// MIS weight of a camera path against photons, by the densities of both; zero if there is no path.
fn path_weight(of_photons: f32, of_paths: f32) -> f32 {
    let ratio = quotient(of_photons, of_paths);
    if (!(ratio == ratio)) { return 0.0; }
    return quotient(1.0, 1.0 + ratio);
}
