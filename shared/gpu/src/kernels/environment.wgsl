// Lat-long environment images, as in the renderer's `world/light/environment.rs`: the first row is at the pole +y,
// columns go from -z by way of +x. Columns are sampled at pixel centres; the first and last row lie on the poles.
//
// The light's table holds running sums over rows of cells between pixels, running sums over the columns of each row,
// and a cell's solid angle by row.

fn bands_of(t: SurfaceTexture) -> u32 { return max(t.height, 2u) - 1u; }

// Position of a direction among the pixels.
struct MapPlace {
    // The pixel to the left and above, and the fractions of the way to the next, in [0, 1].
    column: u32,
    row: u32,
    across: f32,
    down: f32,
}

// `towards`: unit vector towards the environment.
fn place_on_map(light: Light, towards: vec3f) -> MapPlace {
    let t = textures[light.texture];
    let dir = to_local(Frame(light.s, light.t, light.n), towards);
    let theta = arc_tan2(root(dir.x * dir.x + dir.z * dir.z), dir.y);
    let phi = arc_tan2(dir.x, -dir.z);
    let x = phi * 0.159154937f * f32(t.width) - 0.5;
    let y = not_above_one(not_below_zero(theta * 0.31830987f)) * f32(t.height - 1u);
    let column = floor(x);
    let whole = floor(y);
    let last = f32(bands_of(t) - 1u);
    let row = select(last, whole, whole < last);
    // The column is at least -(width / 2 + 1).
    return MapPlace((u32(i32(column) + i32(t.width) + 1) + t.width - 1u) % t.width, u32(row), x - column, y - row);
}

// Radiance without the light's factor.
fn map_value(light: Light, at: MapPlace) -> vec3f {
    let t = textures[light.texture];
    let next = (at.column + 1u) % t.width;
    let upper = t.first + at.row * t.width;
    let lower = t.first + min(at.row + 1u, t.height - 1u) * t.width;
    return mixed(
        mixed_texels(upper + at.column, upper + next, at.across),
        mixed_texels(lower + at.column, lower + next, at.across),
        at.down,
    );
}

fn map_solid_angle(light: Light, row: u32) -> f32 {
    let t = textures[light.texture];
    return light_tables[light.table + bands_of(t) * (t.width + 1u) + row];
}

// Density of `sample_map` per solid angle.
fn map_pdf(light: Light, at: MapPlace) -> f32 {
    let t = textures[light.texture];
    let cells = light.table + bands_of(t) + at.row * t.width;
    let pmf = pmf_in_table(light.table, at.row) * pmf_in_table(cells, at.column);
    return quotient(pmf, map_solid_angle(light, at.row));
}

// A unit vector towards the environment, and its density per solid angle.
struct MapSample { dir: vec3f, pdf: f32 }

// Roughly proportional to the radiance.
fn sample_map(light: Light, u: vec2f) -> MapSample {
    let t = textures[light.texture];
    let bands = bands_of(t);
    let row = choose_in_table(light.table, bands, u.y);
    let column = choose_in_table(light.table + bands + row.index * t.width, t.width, u.x);
    let solid_angle = map_solid_angle(light, row.index);
    // Uniform per solid angle means uniform in 1 - |cos theta|, taken from the nearer pole for precision.
    let is_south = 2u * row.index >= bands;
    let pole_row = select(row.index, bands - 1u - row.index, is_south);
    let along = select(row.u, 1.0 - row.u, is_south);
    let step = quotient(3.1415927f, f32(bands));
    let half_sine = sin_cos(0.5 * step * f32(pole_row)).x;
    let height = solid_angle * (f32(t.width) * 0.159154937f);
    let one_minus_cos = 2.0 * half_sine * half_sine + along * height;
    let sine = root(not_below_zero(one_minus_cos * (2.0 - one_minus_cos)));
    let cosine = select(1.0 - one_minus_cos, one_minus_cos - 1.0, is_south);
    let turns = quotient(f32(column.index) + 0.5 + column.u, f32(t.width));
    let turn = sin_cos(6.2831855f * turns);
    let dir = unit_vector(vec3f(turn.x * sine, cosine, -turn.y * sine));
    return MapSample(
        to_world(Frame(light.s, light.t, light.n), dir),
        quotient(row.pmf * column.pmf, solid_angle),
    );
}
