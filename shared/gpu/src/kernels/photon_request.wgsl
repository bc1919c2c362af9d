// What is asked of photons, as `photons/mod.rs` lays it out.

// A point of a surface that a camera path has come to, from which light is looked for: the processor's
// `photon_radiance`. Who fills these has one for each path; where a path asks for nothing, its kind is NOTHING_ASKED.
struct PhotonRequest {
    // Of the surface, render space.
    point: vec3f,
    // How photons count, and from bit 8 on lights whose photons do not, by bits of classes.
    kind: u32,
    // Unit geometric normal, as the ray has met it: on any side.
    ng: vec3f,
    // Where LAST_COUNTED: how densely the first vertex' direction was drawn, per projected solid angle there, over what
    // photons are worth there: the number of rays that it sent times the density of this one's direction, over |its
    // geometric normal * wo|.
    density: f32,
    // Unit shading normal; the same bits as ng where there is none of its own.
    ns: vec3f,
    // Which vector of the list of radiance gets it: no two requests have the same.
    slot: u32,
    // Unit direction to where the path comes from.
    wo: vec3f,
    // SEEN_BY_FOLLOWED, BY_BSDF, OFF_SURFACES, NOT_BY_RULE.
    bits: u32,
    // The throughput from the film, where BY_BSDF; or else times the BSDF's value, which is the same for all directions
    // on the side of wo. Zero where that side is black.
    value: vec3f,
    // On the photons that are expected.
    photon_scale: f32,
    shadowing: Shadowing,
}

// The lobes that ask are ones that paths follow.
const SEEN_BY_FOLLOWED: u32 = 1u;
// Value and density are those of the surface that belongs to the request.
const BY_BSDF: u32 = 2u;
// What surfaces send is left to paths, and what rules keep off the surface that photons are on.
const OFF_SURFACES: u32 = 4u;
const NOT_BY_RULE: u32 = 8u;
// Above these bits: the wavelength of the path, from 1 on, whose weight is part of the value; 0: none.
const WAVE_OF_REQUEST: u32 = 8u;

fn kind_of(word: u32) -> u32 { return word & 0xffu; }

fn lights_of(word: u32) -> u32 { return word & 0xffffff00u; }

const NOTHING_ASKED: u32 = 0u;
// All as they are: at a path's first vertex where it ends, and where a path ends that has not come there straight from
// its first vertex, but by a later one or a scattering in a medium, or by surfaces that it follows.
const ALL_COUNTED: u32 = 1u;
// Those that camera paths find too are balanced with the ray that goes on from here: at a first vertex from which a
// path goes on; the processor's `scattered_by`.
const FIRST_COUNTED: u32 = 2u;
// The same, without what surfaces send, which the path finds itself: `lit_later`.
const LATER_COUNTED: u32 = 3u;
// Balanced with photons that go from here to the first vertex, where the path has come straight from there and ends:
// `brought_by_photons`.
const LAST_COUNTED: u32 = 4u;

// Weight of a camera path by its density and that of photons; none where there is no path.
fn path_weight(of_photons: f32, of_paths: f32) -> f32 {
    let ratio = quotient(of_photons, of_paths);
    if (!(ratio == ratio)) { return 0.0; }
    return quotient(1.0, 1.0 + ratio);
}
