// Surface photons, laid out as in `photons/mod.rs`.

struct SurfacePhoton {
    point: vec3f,
    radius: f32,
    ng: vec3f,
    // For BY_BOTH: expected number of photons in its kernel, without the camera path's pdf.
    expected: f32,
    wi: vec3f,
    // How it arrived; which lobes see it; above WAVE_OF_PHOTON its wavelength, and above LIGHT_GROUP_OF_PHOTON its
    // light group, both 1-based, 0: none.
    arrival: u32,
    power: vec3f,
    // Technique that finds its light; from bit 8 on, that light's class bit.
    found_by: u32,
    // Walls cross the kernel only where the dot product of this with the offset is above 1; NaN: no such bound.
    beyond: vec3f,
    // Height above the surface at which to test for walls; zero if none crosses.
    height: f32,
}

// How photons arrived.
const ARRIVED_DIRECT: u32 = 0u;
const ARRIVED_CAUSTIC: u32 = 1u;
const ARRIVED_SCATTERED: u32 = 2u;
const ARRIVED_SURFACE: u32 = 3u;

// Seen by lobes that paths do not follow; by those that they follow.
const SEEN_BY_WIDE_LOBES: u32 = 0x100u;
const SEEN_BY_FOLLOWED_LOBES: u32 = 0x200u;

const WAVE_OF_PHOTON: u32 = 16u;
const LIGHT_GROUP_OF_PHOTON: u32 = 20u;

fn arrival_of(word: u32) -> u32 { return word & 0xffu; }

fn wave_of_photon(word: u32) -> u32 { return (word >> WAVE_OF_PHOTON) & 15u; }

// Technique that finds a photon's light.
const BY_PHOTONS: u32 = 0u;
const BY_PATHS: u32 = 1u;
const BY_BOTH: u32 = 2u;
// Paths from anywhere: rules keep the light off the photon's surface.
const BY_PATHS_BY_RULE: u32 = 3u;

fn technique_of(word: u32) -> u32 { return word & 0xffu; }
