// Distributions of microfacet normals, isotropic, with Smith's uncorrelated masking: GGX and Beckmann. Directions are in
// the local frame of a hit.

const HAS_BECKMANN: bool = (SURFACES & 0x10000u) != 0u;
const FACET_PI: f32 = 3.14159274;
const INV_SQRT_PI: f32 = 0.5641896;
// Where slopes end that single precision draws.
const MAX_SLOPE: f32 = 4.25;

struct Facets {
    // Roughness.
    alpha: f32,
    is_beckmann: bool,
}

// Per steradian, of a unit normal on either side.
fn facet_density(facets: Facets, m: vec3f) -> f32 {
    let across2 = m.x * m.x + m.y * m.y;
    let alpha2 = facets.alpha * facets.alpha;
    if (HAS_BECKMANN && facets.is_beckmann) {
        let cos2 = m.z * m.z;
        let exponent = quotient(across2, alpha2 * cos2);
        // Beyond, the density is nothing and cos^4 may be.
        if (!(exponent <= 80.0)) { return 0.0; }
        return quotient(exponential(-exponent), FACET_PI * alpha2 * cos2 * cos2);
    }
    let inv_alpha2 = quotient(1.0, alpha2);
    let x = across2 * inv_alpha2 + m.z * m.z;
    return quotient(inv_alpha2, FACET_PI * x * x);
}

// The number by which masking is 2 |z| over it.
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

// The normal of the microfacet that reflects one of two directions on the same side into the other.
fn half_vector(wo: vec3f, wi: vec3f) -> vec3f { return unit_or(wo + wi, vec3f(0.0, 0.0, 1.0)); }

// A number with the density e^(-x^2) / sqrt(pi).
fn gaussian(u: f32) -> f32 {
    let x = 2.0 * u - 1.0;
    let above = select(x, -0.9999999f, x < -0.9999999f);
    return error_function_inverse(select(above, 0.9999999f, above > 0.9999999f));
}

// A slope with the density (cos - sin x) e^(-x^2), up to a factor, below cos / sin.
fn visible_slope(cos: f32, sin: f32, u: f32) -> f32 {
    var low = -MAX_SLOPE;
    var high = MAX_SLOPE;
    if (cos < sin * MAX_SLOPE) { high = quotient(cos, sin); }
    var wanted = 0.0;
    var x = high;
    // The first turn is about the whole of the distribution.
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
        // Where Newton's step leaves the bracket, or there is none, the bracket is halved.
        let next = select(0.5 * (low + high), newton, newton >= low && newton <= high);
        let change = next - x;
        x = next;
        if (abs(change) < 1e-6f) { break; }
    }
    return x;
}

// A normal visible from wo, wo.z > 0.
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
    // The half of the disk that lies behind the visible hemisphere's rim is squeezed onto its projection.
    let s = 0.5 * (1.0 + v.z);
    let chord = root(not_below_zero(1.0 - disk.x * disk.x));
    let y = (1.0 - s) * chord + s * disk.y;
    let z = root(not_below_zero(1.0 - disk.x * disk.x - y * y));
    let n = t1 * disk.x + t2 * y + v * z;
    return unit_vector(vec3f(alpha * n.x, alpha * n.y, not_below_zero(n.z)));
}

// Density of the direction into which a visible normal m reflects wo.
fn reflection_pdf(facets: Facets, wo: vec3f, m: vec3f) -> f32 {
    return quotient(facet_density(facets, m), 2.0 * facet_extent(facets, wo));
}

// (1 - cos)^5.
fn schlick_weight(cos: f32) -> f32 {
    let x = not_above_one(not_below_zero(1.0 - cos));
    let x2 = x * x;
    return x2 * x2 * x;
}
