// Surface photons, as `photons/mod.rs` lays them out.

struct SurfacePhoton {
    point: vec3f,
    radius: f32,
    ng: vec3f,
    // Photons of its path in its kernel, where BY_BOTH.
    expected: f32,
    wi: vec3f,
    // How it arrived, by which lobes it is seen, above WAVE_OF_PHOTON the wavelength of its light, from 1 on, or 0, and
    // above LIGHT_GROUP_OF_PHOTON the group of its light, likewise.
    arrival: u32,
    power: vec3f,
    // Which technique finds its light, and the bit of that light's class.
    found_by: u32,
    // Walls that cross the kernel: all are where the offset from the photon times this is above 1, if it is a number.
    beyond: vec3f,
    // How high above the surface they are asked for; zero where none crosses.
    height: f32,
}

// How photons arrived.
const ARRIVED_DIRECT: u32 = 0u;
const ARRIVED_CAUSTIC: u32 = 1u;
const ARRIVED_SCATTERED: u32 = 2u;
const ARRIVED_SURFACE: u32 = 3u;

// With these: by lobes that paths follow, or by others.
const SEEN_BY_WIDE_LOBES: u32 = 0x100u;
const SEEN_BY_FOLLOWED_LOBES: u32 = 0x200u;

const WAVE_OF_PHOTON: u32 = 16u;
const LIGHT_GROUP_OF_PHOTON: u32 = 20u;

fn arrival_of(word: u32) -> u32 { return word & 0xffu; }

fn wave_of_photon(word: u32) -> u32 { return (word >> WAVE_OF_PHOTON) & 15u; }

// Which technique finds a photon's light.
const BY_PHOTONS: u32 = 0u;
const BY_PATHS: u32 = 1u;
const BY_BOTH: u32 = 2u;
// Paths from everywhere: rules keep it off the surface that the photon is on.
const BY_PATHS_BY_RULE: u32 = 3u;

fn technique_of(word: u32) -> u32 { return word & 0xffu; }
