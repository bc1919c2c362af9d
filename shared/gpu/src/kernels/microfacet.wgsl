// Isotropic microfacet distributions with Smith's uncorrelated masking: GGX and Beckmann. Directions are in the local
// frame of a hit.

const HAS_BECKMANN: bool = (SURFACES & 0x10000u) != 0u;
const FACET_PI: f32 = 3.14159274;
const INV_SQRT_PI: f32 = 0.5641896;
// Slopes sampled in single precision end here.
const MAX_SLOPE: f32 = 4.25;

struct Facets {
    alpha: f32,
    is_beckmann: bool,
}

// Normal distribution D, per steradian; the unit normal may point to either side.
fn facet_density(facets: Facets, m: vec3f) -> f32 {
    let across2 = m.x * m.x + m.y * m.y;
    let alpha2 = facets.alpha * facets.alpha;
    if (HAS_BECKMANN && facets.is_beckmann) {
        let cos2 = m.z * m.z;
        let exponent = quotient(across2, alpha2 * cos2);
        // Beyond, the density is zero and cos^4 may underflow.
        if (!(exponent <= 80.0)) { return 0.0; }
        return quotient(exponential(-exponent), FACET_PI * alpha2 * cos2 * cos2);
    }
    let inv_alpha2 = quotient(1.0, alpha2);
    let x = across2 * inv_alpha2 + m.z * m.z;
    return quotient(inv_alpha2, FACET_PI * x * x);
}

// Masking G1 is 2 |z| over this.
fn facet_extent(facets: Facets, v: vec3f) -> f32 {
    let across2 = v.x * v.x + v.y * v.y;
    let z = abs(v.z);
    if (HAS_BECKMANN && facets.is_beckmann) {
        let t = facets.alpha * root(across2);
        if (t == 0.0) { return 2.0 * z; }
        let a = quotient(z, t);
        return z * (1.0 + error_function(a)) + t * exponential((-a) * a) * INV_SQRT_PI;
    }
    return z + root(v.z * v.z + facets.alpha * facets.alpha * across2);
}

fn facet_g1(facets: Facets, v: vec3f) -> f32 { return quotient(2.0 * abs(v.z), facet_extent(facets, v)); }

// The microfacet normal that reflects one direction into another on the same side.
fn half_vector(wo: vec3f, wi: vec3f) -> vec3f { return unit_or(wo + wi, vec3f(0.0, 0.0, 1.0)); }

// Samples the density e^(-x^2) / sqrt(pi).
fn gaussian(u: f32) -> f32 {
    let x = 2.0 * u - 1.0;
    let above = select(x, -0.9999999f, x < -0.9999999f);
    return error_function_inverse(select(above, 0.9999999f, above > 0.9999999f));
}

// Samples a slope below cos / sin with density proportional to (cos - sin x) e^(-x^2).
fn visible_slope(cos: f32, sin: f32, u: f32) -> f32 {
    var low = -MAX_SLOPE;
    var high = MAX_SLOPE;
    if (cos < sin * MAX_SLOPE) { high = quotient(cos, sin); }
    var wanted = 0.0;
    var x = high;
    // Iteration 0 evaluates the whole integral.
    for (var turn = 0u; turn < 21u; turn++) {
        let bell = exponential((-x) * x);
        let cumulative = cos * error_function_rest(-x) + sin * bell * INV_SQRT_PI;
        if (turn == 0u) {
            wanted = u * cumulative;
            x = gaussian(u);
            x = select(x, low, x < low);
            x = select(x, high, x > high);
            continue;
        }
        let error = cumulative - wanted;
        if (error > 0.0) { high = x; } else { low = x; }
        let slope = 2.0 * INV_SQRT_PI * (cos - sin * x) * bell;
        let newton = x - quotient(error, slope);
        // Bisect if Newton's step leaves the bracket or is NaN.
        let next = select(0.5 * (low + high), newton, newton >= low && newton <= high);
        let change = next - x;
        x = next;
        if (abs(change) < 1e-6f) { break; }
    }
    return x;
}

// Samples a normal visible from wo, wo.z > 0.
fn sample_visible(facets: Facets, wo: vec3f, u: vec2f) -> vec3f {
    let alpha = facets.alpha;
    let v = unit_vector(vec3f(alpha * wo.x, alpha * wo.y, wo.z));
    let length2 = v.x * v.x + v.y * v.y;
    if (HAS_BECKMANN && facets.is_beckmann) {
        let sine = root(length2);
        var along = vec2f(1.0, 0.0);
        if (sine > 0.0) { along = vec2f(quotient(v.x, sine), quotient(v.y, sine)); }
        let x = visible_slope(v.z, sine, u.x);
        let y = gaussian(u.y);
        let slope = (along * x + vec2f(-along.y, along.x) * y) * alpha;
        return unit_vector(vec3f(-slope.x, -slope.y, 1.0));
    }
    var t1 = vec3f(1.0, 0.0, 0.0);
    if (length2 > 0.0) { t1 = quotients(vec3f(-v.y, v.x, 0.0), root(length2)); }
    let t2 = cross3(v, t1);
    let disk = concentric_disk(u);
    // The half of the disk behind the rim of the visible hemisphere is squeezed onto its projection.
    let s = 0.5 * (1.0 + v.z);
    let chord = root(not_below_zero(1.0 - disk.x * disk.x));
    let y = (1.0 - s) * chord + s * disk.y;
    let z = root(not_below_zero(1.0 - disk.x * disk.x - y * y));
    let n = t1 * disk.x + t2 * y + v * z;
    return unit_vector(vec3f(alpha * n.x, alpha * n.y, not_below_zero(n.z)));
}

// Pdf of the direction into which a sampled visible normal m reflects wo.
fn reflection_pdf(facets: Facets, wo: vec3f, m: vec3f) -> f32 {
    return quotient(facet_density(facets, m), 2.0 * facet_extent(facets, wo));
}

// (1 - cos)^5.
fn schlick_weight(cos: f32) -> f32 {
    let x = not_above_one(not_below_zero(1.0 - cos));
    let x2 = x * x;
    return x2 * x2 * x;
}
