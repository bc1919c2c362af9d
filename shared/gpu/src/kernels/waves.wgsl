// What paths find of light with a wavelength; wavelengths are 1-based, 0 is none. After its first element, `key` holds
// the pass's number of wavelengths, and then the weight of each. For `gather.wgsl` and `photons.wgsl`; scenes without
// dispersion use `no_waves.wgsl` instead.

// Whether a path finds such light: that of another wavelength is for paths of that one.
fn may_see(path: u32, light: u32) -> bool { return path == 0u || light == 0u || path == light; }

// The light as a path finds it, without the path's own weight. If both have drawn a wavelength, they agree once in as
// many times as there are.
fn as_found(brought: vec3f, path: u32, light: u32) -> vec3f {
    if (light == 0u) { return brought; }
    if (path > 0u) { return brought * f32(key[1].x); }
    let red_green = bitcast<vec2f>(key[2u * light]);
    return brought * vec3f(red_green, bitcast<f32>(key[2u * light + 1u].x));
}
