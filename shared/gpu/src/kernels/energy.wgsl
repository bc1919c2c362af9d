// Light that is scattered more than once among microfacets, which one bounce loses, and the base beneath them. The
// renderer's `bsdf/energy/`, step by step.

// Some surface does so.
const KEEPS_ANY_ENERGY: bool = (SURFACES & 0x100000u) != 0u;

// Losses of a distribution: rows by roughness, columns by cosine, and means.
const LOSS_ROWS: u32 = 32u;
const LOSS_COSINES: u32 = 24u;
const LOSS_MEANS: u32 = 125u;
// After those of GGX: layers by index of refraction, roughness and cosine, their means, and mean reflectances.
const LAYER_ETAS: u32 = 12u;
const LAYER_ROWS: u32 = 12u;
const LAYER_COSINES: u32 = 28u;
const FIRST_LAYER: u32 = LOSS_ROWS * LOSS_COSINES + LOSS_MEANS;
const FIRST_MEAN_LAYER: u32 = FIRST_LAYER + LAYER_ETAS * LAYER_ROWS * LAYER_COSINES;
const FIRST_MEAN_FRESNEL: u32 = FIRST_MEAN_LAYER + LAYER_ETAS * LAYER_ROWS;
const MOST_Z: f32 = 0.7;

fn keeps_energy(m: Material) -> bool {
    return KEEPS_ANY_ENERGY && has_bits(m, KEEPS_ENERGY) && (m.kind == ROUGH_CONDUCTOR || m.eta.x >= 1.0);
}

// A place between two numbers of a table.
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

// Between rows of so many columns.
fn between_rows(table: u32, first: u32, row: TablePlace, columns: u32, column: TablePlace) -> f32 {
    let at = first + row.first * columns;
    return between(row, between_in(table, at, column), between_in(table, at + columns, column));
}

struct Losses {
    table: u32,
    alpha: f32,
    // The root of alpha, at most 1.
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

// Value of the lobe that brings back what is lost, where all bounces reflect everything.
fn returned(l: Losses, loss_o: f32, loss_i: f32) -> f32 {
    if (!(l.mean > 0.0)) { return 0.0; }
    return quotient(loss_o * loss_i, l.mean) * 0.31830987f;
}

// What is left of light on its bounces after the first.
fn further_bounces(l: Losses, f: vec3f) -> vec3f {
    let above = f * f * (1.0 - l.mean);
    let below = vec3f(1.0) - f * l.mean;
    return vec3f(quotient(above.x, below.x), quotient(above.y, below.y), quotient(above.z, below.z));
}

fn mean_of_schlick(normal: vec3f) -> vec3f { return normal * 0.95238096f + 0.04761905f; }

// What GGX facets of a dielectric reflect in all.
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

// Value of a white base beneath it.
fn base_beneath(l: Layer, albedo_o: f32, albedo_i: f32) -> f32 {
    let rest = 1.0 - l.mean_albedo;
    let tiny = of_bits(0x00800000u);
    return quotient((1.0 - albedo_o) * (1.0 - albedo_i), select(tiny, rest, rest > tiny)) * 0.31830987f;
}

// Of principled surfaces: what both of their wide lobes are made of.
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
    let further = further_bounces(layer.losses, dielectric) * (1.0 - m.metallic)
        + further_bounces(layer.losses, mean_of_schlick(m.reflectance)) * m.metallic;
    return Bounces(layer, further);
}

// Albedos of the lobe of more than one bounce, and of the base if it were white.
fn albedos_of(b: Bounces, cos: f32) -> vec4f {
    let loss = loss_at(b.layer.losses, cos);
    return vec4f(b.further * loss, 1.0 - layer_albedo(b.layer, cos, loss));
}

// Values of both, likewise.
fn values_of(b: Bounces, cos_o: f32, cos_i: f32) -> vec4f {
    let loss_o = loss_at(b.layer.losses, cos_o);
    let loss_i = loss_at(b.layer.losses, cos_i);
    let albedo_o = layer_albedo(b.layer, cos_o, loss_o);
    let albedo_i = layer_albedo(b.layer, cos_i, loss_i);
    let white = base_beneath(b.layer, albedo_o, albedo_i);
    return vec4f(b.further * returned(b.layer.losses, loss_o, loss_i), white);
}

// Of rough metal: the probability of sampling one bounce.
fn specular_of_metal(m: Material, cos: f32) -> f32 {
    if (!keeps_energy(m)) { return 1.0; }
    let losses = losses_of(m.table, m.roughness);
    let loss = loss_at(losses, cos);
    let once = mean_channel(m.reflectance * fresnel_conductor(not_above_one(cos), m.eta, m.k)) * (1.0 - loss);
    let more = mean_channel(further_bounces(losses, m.reflectance * m.transmittance)) * loss;
    if (!(more > 0.0)) { return 1.0; }
    return quotient(once, once + more);
}

// Of rough metal: the value of more than one bounce.
fn more_of_metal(m: Material, cos_o: f32, cos_i: f32) -> vec3f {
    let losses = losses_of(m.table, m.roughness);
    let back = returned(losses, loss_at(losses, cos_o), loss_at(losses, cos_i));
    return further_bounces(losses, m.reflectance * m.transmittance) * back;
}
