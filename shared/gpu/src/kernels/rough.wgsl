// Rough surfaces: conductors, boundaries between dielectrics (Walter et al. 2007, with the visible normals of Heitz &
// d'Eon 2014), and coats over a diffuse base, smooth or rough. The renderer's, step by step.

fn facets_of(m: Material) -> Facets { return Facets(m.roughness, has_bits(m, IS_BECKMANN)); }

fn mean_channel(c: vec3f) -> f32 { return (c.x + c.y + c.z) * 0.33333334f; }

// Whether light that it transmits is bent.
fn bends(m: Material) -> bool { return m.kind == DIELECTRIC || m.kind == ROUGH_DIELECTRIC || m.kind == LAYERED; }

// The sign that turns wo to the front.
fn front_of(wo: vec3f) -> f32 { return select(-1.0, 1.0, wo.z > 0.0); }

// A visible normal's reflection of wo, which is on the front; zero where light would need a second bounce.
fn sample_reflection(facets: Facets, wo: vec3f, u: vec2f) -> vec3f {
    let m = sample_visible(facets, wo, u);
    let cos_o = dot3(wo, m);
    let wi = unit_vector(m * (2.0 * cos_o) - wo);
    return select(vec3f(0.0), wi, cos_o > 0.0 && wi.z > 0.0);
}

fn eval_rough_conductor(m: Material, wo: vec3f, wi: vec3f) -> vec3f {
    let facets = facets_of(m);
    let h = half_vector(wo, wi);
    let d = quotient(facet_density(facets, h), facet_extent(facets, wo) * facet_extent(facets, wi));
    return m.reflectance * fresnel_conductor(abs(dot3(wo, h)), m.eta, m.k) * d;
}

fn pdf_rough_conductor(m: Material, wo: vec3f, wi: vec3f) -> f32 {
    return reflection_pdf(facets_of(m), wo, half_vector(wo, wi));
}

fn sample_rough_conductor(m: Material, wo: vec3f, u: vec2f) -> BsdfSample {
    let sign = front_of(wo);
    let facets = facets_of(m);
    let front = wo * sign;
    let h = sample_visible(facets, front, u);
    let cos_o = dot3(front, h);
    let wi = unit_vector(h * (2.0 * cos_o) - front);
    // Light that would need a second bounce among the facets is lost.
    if (!(cos_o > 0.0 && wi.z > 0.0)) { return absorbed(); }
    let weight = m.reflectance * fresnel_conductor(cos_o, m.eta, m.k) * facet_g1(facets, wi);
    return BsdfSample(wi * sign, reflection_pdf(facets, front, h), weight, SAMPLED);
}

// Two directions and the microfacet that takes one to the other, from the side of wo, which is turned to the front.
struct Facet {
    wo: vec3f,
    // Cosines to the microfacet, positive; zero where there is none.
    cos_o: f32,
    wi: vec3f,
    cos_i: f32,
    m: vec3f,
    reflectance: f32,
    // Index of refraction on the other side over the one on the side of wo.
    eta: f32,
    is_reflection: bool,
}

fn eta_from(m: Material, wo: vec3f) -> f32 {
    if (wo.z > 0.0) { return m.eta.x; }
    return quotient(1.0, m.eta.x);
}

fn facet_between(m: Material, given_wo: vec3f, given_wi: vec3f) -> Facet {
    var facet: Facet;
    let eta = eta_from(m, given_wo);
    let sign = front_of(given_wo);
    let wo = given_wo * sign;
    let wi = given_wi * sign;
    if (wo.z <= 0.0 || wi.z == 0.0) { return facet; }
    let is_reflection = wi.z > 0.0;
    let h = select(wo + wi * eta, wo + wi, is_reflection);
    let length2 = dot3(h, h);
    if (length2 <= 0.0) { return facet; }
    let length = root(length2);
    let n = quotients(h, select(length, -length, h.z < 0.0));
    let cos_o = dot3(wo, n);
    let along = dot3(wi, n);
    let cos_i = select(-along, along, is_reflection);
    // Neither direction sees the back of a microfacet.
    if (cos_o <= 0.0 || cos_i <= 0.0) { return facet; }
    return Facet(wo, cos_o, wi, cos_i, n, fresnel_dielectric(cos_o, eta).x, eta, is_reflection);
}

// Density of wi over that of the microfacet's normal, for refraction.
fn refraction_jacobian(f: Facet) -> f32 {
    let h = quotient((1.0 - f.eta) * (1.0 + f.eta), f.cos_o + f.eta * f.cos_i);
    return quotient(f.eta * f.eta * f.cos_i, h * h);
}

// What refraction into a side of relative index eta does: radiance is spread over fewer or more steradians, flux stays.
fn refraction_scale(eta: f32, mode: u32) -> f32 {
    if (mode == RADIANCE) { return quotient(1.0, eta * eta); }
    return 1.0;
}

fn eval_rough_dielectric(m: Material, wo: vec3f, wi: vec3f, mode: u32) -> vec3f {
    let f = facet_between(m, wo, wi);
    if (!(f.cos_o > 0.0)) { return vec3f(0.0); }
    let facets = facets_of(m);
    let d = quotient(facet_density(facets, f.m), facet_extent(facets, f.wo) * facet_extent(facets, f.wi));
    if (f.is_reflection) { return m.reflectance * (f.reflectance * d); }
    let scale = refraction_scale(f.eta, mode);
    return m.transmittance * (4.0 * scale * (1.0 - f.reflectance) * d * f.cos_o * refraction_jacobian(f));
}

// Density of the visible normal, times the probability of its lobe, times the Jacobian.
fn pdf_of_facet(m: Material, f: Facet) -> f32 {
    if (!(f.cos_o > 0.0)) { return 0.0; }
    let facets = facets_of(m);
    let d = quotient(facet_density(facets, f.m), facet_extent(facets, f.wo));
    if (f.is_reflection) { return 0.5 * f.reflectance * d; }
    return 2.0 * (1.0 - f.reflectance) * d * f.cos_o * refraction_jacobian(f);
}

fn sample_rough_dielectric(m: Material, given_wo: vec3f, u_lobe: f32, u: vec2f, mode: u32) -> BsdfSample {
    let eta = eta_from(m, given_wo);
    let sign = front_of(given_wo);
    let wo = given_wo * sign;
    if (wo.z <= 0.0) { return absorbed(); }
    let facets = facets_of(m);
    let h = sample_visible(facets, wo, u);
    let cos_o = dot3(wo, h);
    if (cos_o <= 0.0) { return absorbed(); }
    let fresnel = fresnel_dielectric(cos_o, eta);
    let is_reflection = u_lobe < fresnel.x;
    let reflected = h * (2.0 * cos_o) - wo;
    let refracted = h * (quotient(cos_o, eta) - fresnel.y) - quotients(wo, eta);
    let wi = unit_vector(select(refracted, reflected, is_reflection));
    // Light that would need a second bounce among the facets is lost.
    if (!((wi.z > 0.0) == is_reflection) || wi.z == 0.0) { return absorbed(); }
    let tint = select(m.transmittance * refraction_scale(eta, mode), m.reflectance, is_reflection);
    let facet = Facet(wo, cos_o, wi, select(fresnel.y, cos_o, is_reflection), h, fresnel.x, eta, is_reflection);
    let pdf = pdf_of_facet(m, facet);
    if (!(pdf > 0.0)) { return absorbed(); }
    let flags = select(SAMPLED | TRANSMITTED, SAMPLED, is_reflection);
    return BsdfSample(wi * sign, pdf, tint * facet_g1(facets, wi), flags);
}

// What the base under a coat adds but for the coat's transmittances: pi times its value.
fn base_under_coat(m: Material) -> vec3f {
    var returned = vec3f(m.metallic);
    if (has_bits(m, IS_NONLINEAR)) { returned = m.reflectance * m.metallic; }
    let below = (vec3f(1.0) - returned) * (m.eta.x * m.eta.x);
    return vec3f(
        quotient(m.reflectance.x, below.x),
        quotient(m.reflectance.y, below.y),
        quotient(m.reflectance.z, below.z),
    );
}

fn coat_fresnel_at(m: Material, v: vec3f) -> f32 { return fresnel_dielectric(not_above_one(abs(v.z)), m.eta.x).x; }

// Probability of sampling a smooth coat's reflection.
fn mirror_probability(m: Material, wo: vec3f) -> f32 {
    if (!has_bits(m, GLOSS) || !is_lit(m, wo)) { return 0.0; }
    let fresnel = coat_fresnel_at(m, wo);
    let escape = (1.0 - m.metallic) * (m.eta.x * m.eta.x);
    let specular = fresnel * mean_channel(m.transmittance);
    let diffuse = (1.0 - fresnel) * mean_channel(m.reflectance) * escape;
    if (specular > 0.0) { return quotient(specular, specular + diffuse); }
    return 0.0;
}

fn eval_plastic(m: Material, wo: vec3f, wi: vec3f) -> vec3f {
    let entered = (1.0 - coat_fresnel_at(m, wo)) * (1.0 - coat_fresnel_at(m, wi));
    return m.reflectance * (entered * 0.31830987f);
}

fn sample_plastic(m: Material, wo: vec3f, u_lobe: f32, u: vec2f) -> BsdfSample {
    let p = mirror_probability(m, wo);
    if (u_lobe < p) { return mirrored(wo, m.transmittance * quotient(coat_fresnel_at(m, wo), p), p); }
    let wi = cosine_hemisphere(u);
    let pdf = (1.0 - p) * cosine_hemisphere_pdf(wi.z);
    let entered = (1.0 - coat_fresnel_at(m, wo)) * (1.0 - coat_fresnel_at(m, wi));
    if (!(pdf > 0.0)) { return absorbed(); }
    return BsdfSample(wi * front_of(wo), pdf, m.reflectance * quotient(entered, 1.0 - p), SAMPLED);
}

// Of a rough coat by the cosine: numbers at 64 of them, equidistant from 0 to 1.
fn coat_transmittance(m: Material, cos: f32) -> f32 {
    let x = cos * 63.0;
    let i = min(u32(x), 62u);
    let fraction = x - f32(i);
    return coat_table(m.table, i) * (1.0 - fraction) + coat_table(m.table, i + 1u) * fraction;
}

fn eval_rough_plastic(m: Material, wo: vec3f, wi: vec3f) -> vec3f {
    let facets = facets_of(m);
    let h = half_vector(wo, wi);
    let fresnel = fresnel_dielectric(not_above_one(abs(dot3(wo, h))), m.eta.x).x;
    let d = quotient(facet_density(facets, h), facet_extent(facets, wo) * facet_extent(facets, wi));
    let entered = coat_transmittance(m, abs(wo.z)) * coat_transmittance(m, abs(wi.z));
    return m.transmittance * (fresnel * d) + m.reflectance * (entered * 0.31830987f);
}

// Probability of sampling a rough coat's reflection.
fn specular_of_plastic(m: Material, wo: vec3f) -> f32 {
    let transmitted = coat_transmittance(m, abs(wo.z));
    let specular = (1.0 - transmitted) * mean_channel(m.transmittance);
    let diffuse = transmitted * mean_channel(m.reflectance);
    if (!(specular > 0.0)) { return 0.0; }
    if (!(diffuse > 0.0)) { return 1.0; }
    return quotient(specular, specular + diffuse);
}
