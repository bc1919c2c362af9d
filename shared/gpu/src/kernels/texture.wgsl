// Surface textures, images and checkerboards, as in the renderer. `world/textures.rs` has the same struct. Goes after
// `texels.wgsl`.

// Bits of `kind`: one of these two.
const IMAGE: u32 = 1u;
const CHECKERBOARD: u32 = 2u;
// No interpolation.
const NEAREST: u32 = 4u;
// Beyond the edges; with neither bit, the image repeats.
const MIRRORS: u32 = 8u;
const CLAMPS: u32 = 16u;
// Multiplied by vertex colours, in `interaction.wgsl`.
const BY_COLORS: u32 = 32u;

struct SurfaceTexture {
    // Map that is first applied to the surface's coordinates, by columns.
    x_axis: vec2f,
    y_axis: vec2f,
    translation: vec2f,
    kind: u32,
    // First pixel or colour.
    first: u32,
    width: u32,
    height: u32,
    // Property of the material that it controls.
    field: u32,
    padding: u32,
}

// By light: its emission. Then those of materials, one material after another.
@group(0) @binding(38) var<storage, read> textures: array<SurfaceTexture>;

fn by_map(t: SurfaceTexture, uv: vec2f) -> vec2f {
    let mapped = t.x_axis * uv.x + t.y_axis * uv.y + t.translation;
    // From here on there are no fractions. Infinity and NaN become finite.
    let most = vec2f(8388608.0);
    let above = select(-most, mapped, mapped > -most);
    return select(most, above, above < most);
}

// In [0, 1]: rounding may yield 1.
fn fraction_of(t: f32) -> f32 { return t - floor(t); }

// Triangle wave; t itself on [0, 1].
fn triangle_wave(t: f32) -> f32 {
    let within = 2.0 * fraction_of(0.5 * t);
    return select(within, 2.0 - within, within > 1.0);
}

fn wrapped(t: f32, kind: u32) -> f32 {
    if ((kind & MIRRORS) != 0u) { return triangle_wave(t); }
    if ((kind & CLAMPS) != 0u) { return select(select(t, 1.0, t > 1.0), 0.0, t < 0.0); }
    return fraction_of(t);
}

// Two pixels of a row whose centres enclose a coordinate, and the fraction of the way to the second.
struct Neighbours { first: u32, second: u32, fraction: f32 }

// Of `t`, in [0, 1], in a row of `n`. Beyond the first and last pixel is the one at the other end, or the same again.
fn neighbours_of(t: f32, n: u32, repeats: bool) -> Neighbours {
    let x = t * f32(n) - 0.5;
    let whole = floor(x);
    let last = n - 1u;
    if (whole < 0.0) { return Neighbours(select(0u, last, repeats), 0u, x - whole); }
    let first = min(u32(whole), last);
    return Neighbours(first, select(first + 1u, select(last, 0u, repeats), first == last), x - whole);
}

fn mixed(a: vec3f, b: vec3f, t: f32) -> vec3f { return a * (1.0 - t) + b * t; }

fn mixed_texels(a: u32, b: u32, t: f32) -> vec3f { return mixed(texel(a), texel(b), t); }

fn image_value(t: SurfaceTexture, uv: vec2f) -> vec3f {
    let x = wrapped(uv.x, t.kind);
    // Rows count from the top, v from the bottom.
    let y = 1.0 - wrapped(uv.y, t.kind);
    if ((t.kind & NEAREST) != 0u) {
        let column = min(u32(x * f32(t.width)), t.width - 1u);
        let row = min(u32(y * f32(t.height)), t.height - 1u);
        return texel(t.first + row * t.width + column);
    }
    let repeats = (t.kind & (MIRRORS | CLAMPS)) == 0u;
    let columns = neighbours_of(x, t.width, repeats);
    let rows = neighbours_of(y, t.height, repeats);
    let upper = t.first + rows.first * t.width;
    let lower = t.first + rows.second * t.width;
    let top = mixed_texels(upper + columns.first, upper + columns.second, columns.fraction);
    let bottom = mixed_texels(lower + columns.first, lower + columns.second, columns.fraction);
    return mixed(top, bottom, rows.fraction);
}

fn is_upper(t: f32) -> bool { return t - floor(t) > 0.5; }

// Value of an image or a checkerboard at a surface's texture coordinates.
fn texture_value(t: SurfaceTexture, uv: vec2f) -> vec3f {
    let mapped = by_map(t, uv);
    if ((t.kind & IMAGE) != 0u) { return image_value(t, mapped); }
    return texel(t.first + u32(is_upper(mapped.x) != is_upper(mapped.y)));
}

fn luminance_of(c: vec3f) -> f32 { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

// Gradient of the luminance in the surface's coordinates; zero for step functions.
fn texture_gradient(t: SurfaceTexture, uv: vec2f) -> vec2f {
    if ((t.kind & (IMAGE | NEAREST)) != IMAGE) { return vec2f(0.0); }
    let at = by_map(t, uv);
    let x = wrapped(at.x, t.kind);
    let y = 1.0 - wrapped(at.y, t.kind);
    var turned = vec2f(1.0);
    if ((t.kind & MIRRORS) != 0u) {
        turned.x = select(1.0, -1.0, fraction_of(0.5 * at.x) > 0.5);
        turned.y = select(1.0, -1.0, fraction_of(0.5 * at.y) > 0.5);
    }
    let repeats = (t.kind & (MIRRORS | CLAMPS)) == 0u;
    let columns = neighbours_of(x, t.width, repeats);
    let rows = neighbours_of(y, t.height, repeats);
    let upper = t.first + rows.first * t.width;
    let lower = t.first + rows.second * t.width;
    let a = luminance_of(texel(upper + columns.first));
    let b = luminance_of(texel(upper + columns.second));
    let c = luminance_of(texel(lower + columns.first));
    let d = luminance_of(texel(lower + columns.second));
    let by_column = (b - a) * (1.0 - rows.fraction) + (d - c) * rows.fraction;
    let by_row = (c - a) * (1.0 - columns.fraction) + (d - b) * columns.fraction;
    let slope = vec2f(by_column * turned.x * f32(t.width), -by_row * turned.y * f32(t.height));
    return vec2f(
        t.x_axis.x * slope.x + t.x_axis.y * slope.y,
        t.y_axis.x * slope.x + t.y_axis.y * slope.y,
    );
}
