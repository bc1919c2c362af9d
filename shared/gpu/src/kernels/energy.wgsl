// Multiple scattering among microfacets, whose energy a single-bounce lobe loses, and the diffuse base beneath them.
// The renderer's `bsdf/energy/`, in the same order of operations.

// Some material of the scene keeps this energy.
const KEEPS_ANY_ENERGY: bool = (SURFACES & 0x100000u) != 0u;

// Losses of a distribution: rows by roughness, columns by cosine, then means.
const LOSS_ROWS: u32 = 32u;
const LOSS_COSINES: u32 = 24u;
const LOSS_MEANS: u32 = 125u;
// After those of GGX: layers by index of refraction, roughness and cosine, their means, then mean reflectances.
const LAYER_ETAS: u32 = 12u;
const LAYER_ROWS: u32 = 12u;
const LAYER_COSINES: u32 = 28u;
const FIRST_LAYER: u32 = LOSS_ROWS * LOSS_COSINES + LOSS_MEANS;
const FIRST_MEAN_LAYER: u32 = FIRST_LAYER + LAYER_ETAS * LAYER_ROWS * LAYER_COSINES;
const FIRST_MEAN_FRESNEL: u32 = FIRST_MEAN_LAYER + LAYER_ETAS * LAYER_ROWS;
const MOST_Z: f32 = 0.7;
// After all of those: single-bounce albedo of rough glass, by index of refraction, roughness, side and cosine.
const GLASS_ETAS: u32 = 8u;
const GLASS_ROWS: u32 = 12u;
const GLASS_COSINES: u32 = 14u;
// The mean for diffuse light follows the cosines.
const GLASS_SIDE: u32 = GLASS_COSINES + 1u;
const FIRST_GLASS: u32 = FIRST_MEAN_FRESNEL + LAYER_ETAS;

fn keeps_energy(m: Material) -> bool {
    return KEEPS_ANY_ENERGY && has_bits(m, KEEPS_ENERGY) && (m.kind == ROUGH_CONDUCTOR || m.eta.x >= 1.0);
}

// A position between two table entries.
struct TablePlace {
    first: u32,
    on: f32,
}

fn place_of(given: f32, count: u32) -> TablePlace {
    let x = given * f32(count - 1u);
    let first = min(u32(x), count - 2u);
    return TablePlace(first, x - f32(first));
}

fn between(place: TablePlace, a: f32, b: f32) -> f32 { return a * (1.0 - place.on) + b * place.on; }

fn between_in(table: u32, first: u32, place: TablePlace) -> f32 {
    let at = first + place.first;
    return between(place, coat_table(table, at), coat_table(table, at + 1u));
}

// Bilinear, in a table of this many columns.
fn between_rows(table: u32, first: u32, row: TablePlace, columns: u32, column: TablePlace) -> f32 {
    let at = first + row.first * columns;
    return between(row, between_in(table, at, column), between_in(table, at + columns, column));
}

struct Losses {
    table: u32,
    alpha: f32,
    // Square root of alpha, clamped to 1.
    root: f32,
    mean: f32,
}

fn losses_of(table: u32, given_alpha: f32) -> Losses {
    let alpha_root = not_above_one(root(given_alpha));
    let mean = between_in(table, LOSS_ROWS * LOSS_COSINES, place_of(alpha_root, LOSS_MEANS));
    return Losses(table, alpha_root * alpha_root, alpha_root, mean);
}

fn loss_at(l: Losses, given_cos: f32) -> f32 {
    let cos = not_above_one(given_cos);
    let column = place_of(quotient(cos * (1.0 + l.alpha), cos + l.alpha), LOSS_COSINES);
    return between_rows(l.table, 0u, place_of(l.root, LOSS_ROWS), LOSS_COSINES, column);
}

// Value of the lobe that restores the loss, if every bounce reflects everything.
fn returned(l: Losses, loss_o: f32, loss_i: f32) -> f32 {
    if (!(l.mean > 0.0)) { return 0.0; }
    return quotient(loss_o * loss_i, l.mean) * 0.31830987f;
}

// Share of light left on bounces after the first.
fn further_bounces(l: Losses, f: vec3f) -> vec3f {
    let above = f * f * (1.0 - l.mean);
    let below = vec3f(1.0) - f * l.mean;
    return vec3f(quotient(above.x, below.x), quotient(above.y, below.y), quotient(above.z, below.z));
}

fn mean_of_schlick(normal: vec3f) -> vec3f { return normal * 0.95238096f + 0.04761905f; }

// Total reflection of a dielectric's GGX facets over all bounces.
struct Layer {
    losses: Losses,
    normal: f32,
    mean_fresnel: f32,
    further: f32,
    mean_albedo: f32,
    row: TablePlace,
    eta: TablePlace,
}

fn above(low: f32, share: f32) -> f32 { return low + (1.0 - low) * share; }

fn layer_of(table: u32, alpha: f32, eta_inside: f32) -> Layer {
    var layer: Layer;
    layer.losses = losses_of(table, alpha);
    let r = quotient(eta_inside - 1.0, eta_inside + 1.0);
    layer.normal = r * r;
    layer.eta = place_of(not_above_one(quotient(root(r), MOST_Z)), LAYER_ETAS);
    layer.mean_fresnel = above(layer.normal, between_in(table, FIRST_MEAN_FRESNEL, layer.eta));
    layer.further = further_bounces(layer.losses, vec3f(layer.mean_fresnel)).x;
    layer.row = place_of(layer.losses.root, LAYER_ROWS);
    layer.mean_albedo =
        layer.mean_fresnel * between_rows(table, FIRST_MEAN_LAYER, layer.eta, LAYER_ROWS, layer.row);
    return layer;
}

fn layer_albedo(l: Layer, cos: f32, loss: f32) -> f32 {
    let column = place_of(root(not_above_one(cos)), LAYER_COSINES);
    let table = l.losses.table;
    let size = LAYER_ROWS * LAYER_COSINES;
    let at = FIRST_LAYER + l.eta.first * size;
    let share = between(
        l.eta,
        between_rows(table, at, l.row, LAYER_COSINES, column),
        between_rows(table, at + size, l.row, LAYER_COSINES, column),
    );
    return above(l.normal, share) * (1.0 - loss) + l.further * loss;
}

// Value of a white base beneath the layer.
fn base_beneath(l: Layer, albedo_o: f32, albedo_i: f32) -> f32 {
    let rest = 1.0 - l.mean_albedo;
    let tiny = of_bits(0x00800000u);
    return quotient((1.0 - albedo_o) * (1.0 - albedo_i), select(tiny, rest, rest > tiny)) * 0.31830987f;
}

// What the multiple-scattering and base lobes of principled materials share.
struct Bounces {
    layer: Layer,
    further: vec3f,
}

fn bounces_of(m: Material) -> Bounces {
    let layer = layer_of(m.table, principled_facets(m).alpha, m.eta.x);
    var dielectric = vec3f(layer.mean_fresnel);
    if (HAS_LAYERED && m.kind == LAYERED) {
        let eta = m.eta.x;
        let normal = quotient((eta - 1.0) * (eta - 1.0), (eta + 1.0) * (eta + 1.0));
        let tinted = mean_of_schlick(hue_of(m) * normal);
        dielectric = dielectric + (tinted - dielectric) * m.spec_tint;
    }
    var share = 1.0 - m.metallic;
    if (HAS_LAYERED && m.kind == LAYERED) { share *= 1.0 - m.spec_trans; }
    let further = further_bounces(layer.losses, dielectric) * share
        + further_bounces(layer.losses, mean_of_schlick(m.reflectance)) * m.metallic;
    return Bounces(layer, further);
}

// Albedo of the multiple-scattering lobe, RGB, and of the base if it were white.
fn albedos_of(b: Bounces, cos: f32) -> vec4f {
    let loss = loss_at(b.layer.losses, cos);
    return vec4f(b.further * loss, 1.0 - layer_albedo(b.layer, cos, loss));
}

// Values of the same two lobes.
fn values_of(b: Bounces, cos_o: f32, cos_i: f32) -> vec4f {
    let loss_o = loss_at(b.layer.losses, cos_o);
    let loss_i = loss_at(b.layer.losses, cos_i);
    let albedo_o = layer_albedo(b.layer, cos_o, loss_o);
    let albedo_i = layer_albedo(b.layer, cos_i, loss_i);
    let white = base_beneath(b.layer, albedo_o, albedo_i);
    return vec4f(b.further * returned(b.layer.losses, loss_o, loss_i), white);
}

// Rough metal: probability of sampling the single-bounce lobe.
fn specular_of_metal(m: Material, cos: f32) -> f32 {
    if (!keeps_energy(m)) { return 1.0; }
    let losses = losses_of(m.table, m.roughness);
    let loss = loss_at(losses, cos);
    let once = mean_channel(m.reflectance * fresnel_conductor(not_above_one(cos), m.eta, m.k)) * (1.0 - loss);
    let more = mean_channel(further_bounces(losses, m.reflectance * m.transmittance)) * loss;
    if (!(more > 0.0)) { return 1.0; }
    return quotient(once, once + more);
}

// Rough metal: value of the multiple-scattering lobe.
fn more_of_metal(m: Material, cos_o: f32, cos_i: f32) -> vec3f {
    let losses = losses_of(m.table, m.roughness);
    let back = returned(losses, loss_at(losses, cos_o), loss_at(losses, cos_i));
    return further_bounces(losses, m.reflectance * m.transmittance) * back;
}

// `keeps_energy` for glass, whichever side is denser.
fn is_glass_kept(m: Material) -> bool { return KEEPS_ANY_ENERGY && has_bits(m, KEEPS_ENERGY); }

// Share of light left after a bounce among the microfacets of glass.
fn color_of_glass(m: Material) -> vec3f {
    if (m.kind == ROUGH_DIELECTRIC) { return m.transmittance; }
    return vec3f(root(m.reflectance.x), root(m.reflectance.y), root(m.reflectance.z));
}

// Factor on the single-bounce value of rough glass that stands in for further bounces. `camera`: direction of view.
// `eta`: index on the side that z points away from over the other.
fn brightened_glass(m: Material, given_alpha: f32, eta: f32, camera: vec3f) -> vec3f {
    let alpha_root = not_above_one(root(given_alpha));
    let alpha = alpha_root * alpha_root;
    let contrast = abs(quotient(eta - 1.0, eta + 1.0));
    let index = place_of(not_above_one(quotient(root(contrast), MOST_Z)), GLASS_ETAS);
    let row = place_of(alpha_root, GLASS_ROWS);
    let cos = not_above_one(abs(camera.z));
    let column = place_of(quotient(cos * (1.0 + alpha), cos + alpha), GLASS_COSINES);
    // Beckmann tables have no layers.
    let first = select(FIRST_GLASS, FIRST_LAYER, has_bits(m, IS_BECKMANN));
    let side = select(0u, GLASS_SIDE, (camera.z > 0.0) != (eta >= 1.0));
    let columns = 2u * GLASS_SIDE;
    let size = GLASS_ROWS * columns;
    let at = first + index.first * size + side;
    let albedo = between(
        index,
        between_rows(m.table, at, row, columns, column),
        between_rows(m.table, at + size, row, columns, column),
    );
    let last = at + row.first * columns + GLASS_COSINES;
    let mean = between(
        index,
        between(row, coat_table(m.table, last), coat_table(m.table, last + columns)),
        between(row, coat_table(m.table, last + size), coat_table(m.table, last + size + columns)),
    );
    let color = color_of_glass(m);
    let above = color * mean;
    let below = vec3f(1.0) - color * (1.0 - mean);
    let further = vec3f(quotient(above.x, below.x), quotient(above.y, below.y), quotient(above.z, below.z));
    return vec3f(1.0) + further * quotient(1.0 - albedo, albedo);
}

// Of wo and wi, the direction towards the camera.
fn towards_camera(wo: vec3f, wi: vec3f, mode: u32) -> vec3f { return select(wi, wo, mode == RADIANCE); }
