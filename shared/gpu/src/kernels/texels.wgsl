// Image pixels, checkerboard colours, and tables of rough coats.

@group(0) @binding(39) var<storage, read> texels: array<array<f32, 3>>;

fn texel(number: u32) -> vec3f { return vec3f(texels[number][0], texels[number][1], texels[number][2]); }

// Entry of a table that starts at a texel.
fn coat_table(first: u32, i: u32) -> f32 { return texels[first + i / 3u][i % 3u]; }
