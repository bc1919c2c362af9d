// What paths find of light that has a wavelength. Wavelengths have numbers from 1 on, 0 is none; of a pass `key` has,
// after its first element, how many there are, and then the weight of each. In `gather.wgsl` and `photons.wgsl`; in
// scenes that split no light `no_waves.wgsl` stands for it.

// Whether a path finds such light: that of another wavelength is brought by paths of that one.
fn may_see(path: u32, light: u32) -> bool { return path == 0u || light == 0u || path == light; }

// The same light for a path, whose own weight is no part of it. Where both have drawn a wavelength, they agree once in
// as many times as there are.
fn as_found(brought: vec3f, path: u32, light: u32) -> vec3f {
    if (light == 0u) { return brought; }
    if (path > 0u) { return brought * f32(key[1].x); }
    let red_green = bitcast<vec2f>(key[2u * light]);
    return brought * vec3f(red_green, bitcast<f32>(key[2u * light + 1u].x));
}
