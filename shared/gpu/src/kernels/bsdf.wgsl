// Surface scattering. Same struct as in `world/materials.rs`.
//
// Directions are unit vectors in the local frame of a hit, z the shading normal, and point away from the surface: wo to
// where the path comes from, wi to where it goes on. BSDF values are per steradian, without the cosine.

const BLACK: u32 = 0u;
const DIFFUSE: u32 = 1u;
const DIELECTRIC: u32 = 2u;
const THIN_DIELECTRIC: u32 = 3u;
const CONDUCTOR: u32 = 4u;
const MIRROR: u32 = 5u;
const NULL_BOUNDARY: u32 = 6u;
const ROUGH_CONDUCTOR: u32 = 7u;
const ROUGH_DIELECTRIC: u32 = 8u;
const PLASTIC: u32 = 9u;
const ROUGH_PLASTIC: u32 = 10u;
const PRINCIPLED: u32 = 11u;
const LAYERED: u32 = 12u;

// Kinds that the scene does not use are not compiled.
const HAS_ROUGH_CONDUCTOR: bool = (SURFACES & (1u << 7u)) != 0u;
const HAS_ROUGH_DIELECTRIC: bool = (SURFACES & (1u << 8u)) != 0u;
const HAS_GLASS: bool = (SURFACES & ((1u << 2u) | (1u << 3u))) != 0u;
const HAS_PLASTIC: bool = (SURFACES & (1u << 9u)) != 0u;
const HAS_ROUGH_PLASTIC: bool = (SURFACES & (1u << 10u)) != 0u;
const HAS_PRINCIPLED: bool = (SURFACES & (1u << 11u)) != 0u;
const HAS_LAYERED: bool = (SURFACES & (1u << 12u)) != 0u;

// Transport mode: radiance from the camera, or flux from lights.
const RADIANCE: u32 = 0u;
const FLUX: u32 = 1u;

// Material bits. Without TWO_SIDED, the side that z points away from is black.
const TWO_SIDED: u32 = 1u;
const IS_BECKMANN: u32 = 2u;
// Of coats: inter-reflections between base and coat take on the base's colour.
const IS_NONLINEAR: u32 = 4u;
// Of layered materials: transmission is possible somewhere.
const LETS_THROUGH: u32 = 8u;
// Active lobes: reflection and transmission; clearcoat; base.
const GLOSS: u32 = 16u;
const COAT: u32 = 32u;
const BASE: u32 = 64u;
// Of principled materials before texture look-up: eta holds the reflectance at normal incidence over 0.08.
const BY_SPECULAR: u32 = 128u;
// Another active lobe: multiple scattering among microfacets.
const BOUNCES: u32 = 256u;
// Of rough metal, glass and principled materials: multiple scattering is on.
const KEEPS_ENERGY: u32 = 512u;

struct Material {
    // Factor on reflection: the albedo of diffuse surfaces and principled bases; for coats, pi times the base's value
    // without the coat's transmittances.
    reflectance: vec3f,
    kind: u32,
    // Factor on transmission; for coats, on their reflection; for rough metal, its reflectance for diffuse light.
    transmittance: vec3f,
    bits: u32,
    // Real part of the index; for dielectrics and coats, inside over outside, in all three components.
    eta: vec3f,
    // Of the microfacets; for principled surfaces its square root.
    roughness: f32,
    // Imaginary part of the index.
    k: vec3f,
    // For rough coats: offset of their transmittances among the texels. With KEEPS_ENERGY: offset of the loss tables.
    table: u32,
    // From 0, dielectric, to 1, metal; for coats, the share of the base's light that they reflect back to it.
    metallic: f32,
    spec_tint: f32,
    spec_trans: f32,
    flatness: f32,
    sheen: f32,
    sheen_tint: f32,
    clearcoat: f32,
    // Clearcoat roughness; its gloss before texture look-up.
    coat_alpha: f32,
}

fn has_bits(m: Material, bits: u32) -> bool { return (m.bits & bits) != 0u; }

// Sample flags; 0: absorbed.
const SAMPLED: u32 = 1u;
const DELTA: u32 = 2u;
const TRANSMITTED: u32 = 4u;

struct BsdfSample {
    wi: vec3f,
    // Per solid angle; for a delta lobe, the probability of choosing it.
    pdf: f32,
    // f |cos(wi)| / pdf.
    weight: vec3f,
    flags: u32,
}

fn absorbed() -> BsdfSample { return BsdfSample(vec3f(0.0), 0.0, vec3f(0.0), 0u); }

// Fresnel reflectance between dielectrics, and the cosine of the refracted ray. `eta`: index behind the boundary over
// the one in front.
fn fresnel_dielectric(cos_i: f32, eta: f32) -> vec2f {
    if (eta == 1.0) { return vec2f(0.0, cos_i); }
    let cos2_t = 1.0 - quotient(1.0 - cos_i * cos_i, eta * eta);
    if (cos2_t <= 0.0) { return vec2f(1.0, 0.0); }
    let cos_t = root(cos2_t);
    if (cos_i <= 0.0) { return vec2f(1.0, cos_t); }
    let perpendicular = quotient(cos_i - eta * cos_t, cos_i + eta * cos_t);
    let parallel = quotient(eta * cos_i - cos_t, eta * cos_i + cos_t);
    let reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    return vec2f(not_above_one(reflectance), cos_t);
}

// One colour channel, from vacuum.
fn fresnel_conductor_channel(cos_i: f32, eta: f32, k: f32) -> f32 {
    // Avoids 0/0 for an index of zero.
    let tiny = of_bits(0x00800000u);
    let cos2 = cos_i * cos_i;
    let sin2 = not_below_zero(1.0 - cos2);
    let eta2 = eta * eta;
    let k2 = k * k;
    let t = eta2 - k2 - sin2;
    let a2_plus_b2 = root(not_below_zero(t * t + 4.0 * eta2 * k2));
    let a = root(not_below_zero(0.5 * (a2_plus_b2 + t)));
    let sum = a2_plus_b2 + cos2;
    let cross = 2.0 * cos_i * a;
    let below = sum + cross;
    let perpendicular = quotient(sum - cross, select(tiny, below, below > tiny));
    let sum_p = a2_plus_b2 * cos2 + sin2 * sin2;
    let cross_p = cross * sin2;
    let below_p = sum_p + cross_p;
    let parallel = quotient(perpendicular * (sum_p - cross_p), select(tiny, below_p, below_p > tiny));
    return not_above_one(not_below_zero(0.5 * (perpendicular + parallel)));
}

fn fresnel_conductor(cos_i: f32, eta: vec3f, k: vec3f) -> vec3f {
    return vec3f(
        fresnel_conductor_channel(cos_i, eta.x, k.x),
        fresnel_conductor_channel(cos_i, eta.y, k.y),
        fresnel_conductor_channel(cos_i, eta.z, k.z),
    );
}

fn cosine_hemisphere_pdf(cosine: f32) -> f32 { return not_below_zero(cosine) * 0.31830987f; }

fn mirrored(wo: vec3f, weight: vec3f, pdf: f32) -> BsdfSample {
    return BsdfSample(vec3f(-wo.x, -wo.y, wo.z), pdf, weight, SAMPLED | DELTA);
}

fn straight_on(wo: vec3f, weight: vec3f, pdf: f32) -> BsdfSample {
    return BsdfSample(-wo, pdf, weight, SAMPLED | DELTA | TRANSMITTED);
}

// Refraction into the side of relative index `eta`.
fn refracted(m: Material, wo: vec3f, eta: f32, cos_t: f32, pdf: f32, mode: u32) -> BsdfSample {
    let z = select(cos_t, -cos_t, wo.z > 0.0);
    // Refraction scales radiance by 1 / eta^2; flux stays.
    var scale = 1.0;
    if (mode == RADIANCE) { scale = quotient(1.0, eta * eta); }
    let wi = unit_vector(vec3f(quotient(-wo.x, eta), quotient(-wo.y, eta), z));
    return BsdfSample(wi, pdf, m.transmittance * scale, SAMPLED | DELTA | TRANSMITTED);
}

fn sample_boundary(m: Material, wo: vec3f, u_lobe: f32, mode: u32) -> BsdfSample {
    var eta = m.eta.x;
    if (!(wo.z > 0.0)) { eta = quotient(1.0, eta); }
    let fresnel = fresnel_dielectric(not_above_one(abs(wo.z)), eta);
    if (u_lobe < fresnel.x) { return mirrored(wo, m.reflectance, fresnel.x); }
    return refracted(m, wo, eta, fresnel.y, 1.0 - fresnel.x, mode);
}

// A thin sheet: light inter-reflected between its sides leaves where it entered.
fn sample_sheet(m: Material, wo: vec3f, u_lobe: f32) -> BsdfSample {
    let once = fresnel_dielectric(not_above_one(abs(wo.z)), m.eta.x).x;
    let reflectance = quotient(2.0 * once, 1.0 + once);
    if (u_lobe < reflectance) { return mirrored(wo, m.reflectance, reflectance); }
    return straight_on(wo, m.transmittance, 1.0 - reflectance);
}

// Smooth glass.
fn is_glass(m: Material) -> bool { return m.kind == DIELECTRIC || m.kind == THIN_DIELECTRIC; }

fn sample_glass(m: Material, wo: vec3f, u_lobe: f32) -> BsdfSample {
    if (m.kind == THIN_DIELECTRIC) { return sample_sheet(m, wo, u_lobe); }
    return sample_boundary(m, wo, u_lobe, RADIANCE);
}

// Whether the side of wo scatters light.
fn is_lit(m: Material, wo: vec3f) -> bool { return wo.z > 0.0 || (has_bits(m, TWO_SIDED) && wo.z < 0.0); }

// Whether both directions are on the same side, and that side reflects.
fn reflects(m: Material, wo: vec3f, wi: vec3f) -> bool {
    return (wo.z > 0.0 && wi.z > 0.0) || (has_bits(m, TWO_SIDED) && wo.z < 0.0 && wi.z < 0.0);
}

