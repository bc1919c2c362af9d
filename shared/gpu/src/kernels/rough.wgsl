// Rough conductors and dielectrics (Walter et al. 2007, with the visible normals of Heitz & d'Eon 2014), and smooth or
// rough coats over a diffuse base. Step by step as in the renderer.

fn facets_of(m: Material) -> Facets { return Facets(m.roughness, has_bits(m, IS_BECKMANN)); }

fn mean_channel(c: vec3f) -> f32 { return (c.x + c.y + c.z) * 0.33333334f; }

// Whether it refracts what it transmits.
fn bends(m: Material) -> bool { return m.kind == DIELECTRIC || m.kind == ROUGH_DIELECTRIC || m.kind == LAYERED; }

// Sign that turns wo to the front.
fn front_of(wo: vec3f) -> f32 { return select(-1.0, 1.0, wo.z > 0.0); }

// Two directions and the microfacet between them, turned so that wo is on the front.
struct Facet {
    wo: vec3f,
    // Cosines with the microfacet, positive; zero if there is none.
    cos_o: f32,
    wi: vec3f,
    cos_i: f32,
    m: vec3f,
    reflectance: f32,
    // Index of refraction on the other side over that on the side of wo.
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

// Refraction: pdf of wi over that of the microfacet's normal.
fn refraction_jacobian(f: Facet) -> f32 {
    let h = quotient((1.0 - f.eta) * (1.0 + f.eta), f.cos_o + f.eta * f.cos_i);
    return quotient(f.eta * f.eta * f.cos_i, h * h);
}

// Refraction into relative index eta spreads radiance over another solid angle; flux stays.
fn refraction_scale(eta: f32, mode: u32) -> f32 {
    if (mode == RADIANCE) { return quotient(1.0, eta * eta); }
    return 1.0;
}

// pi times the value of the base under a coat, without the coat's transmittances.
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

fn value_of_plastic(m: Material, wo: vec3f, wi: vec3f) -> vec3f {
    let entered = (1.0 - coat_fresnel_at(m, wo)) * (1.0 - coat_fresnel_at(m, wi));
    return m.reflectance * (entered * 0.31830987f);
}

// Transmittance of a rough coat: 64 table entries, at equidistant cosines from 0 to 1.
fn coat_transmittance(m: Material, cos: f32) -> f32 {
    let x = cos * 63.0;
    let i = min(u32(x), 62u);
    let fraction = x - f32(i);
    return coat_table(m.table, i) * (1.0 - fraction) + coat_table(m.table, i + 1u) * fraction;
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
