// Principled surfaces (Burley 2012, 2015), in the form of Mitsuba 3: a diffuse lobe and a reflection; layered ones have
// all the other lobes too. Step by step as in the renderer.

const LEAST_FACET_COSINE: f32 = 1e-6;
const LEAST_ODDS: f32 = 0.1;

fn principled_facets(m: Material) -> Facets {
    let alpha = m.roughness * m.roughness;
    return Facets(select(0.001f, alpha, alpha > 0.001f), false);
}

// Fresnel reflectance: exact for the dielectric share, Schlick's for the metallic one.
fn principled_fresnel(m: Material, cos: f32) -> vec3f {
    let dielectric = fresnel_dielectric(not_above_one(cos), m.eta.x);
    let schlick = schlick_weight(select(cos, dielectric.y, m.eta.x < 1.0));
    let metal = m.reflectance * (1.0 - schlick) + schlick;
    return vec3f((1.0 - m.metallic) * dielectric.x) + metal * m.metallic;
}

// BSDF value. `d`: the microfacets' without Fresnel's reflectance; `lit`: factor on the diffuse lobe.
fn value_of_principled(m: Material, wo: vec3f, wi: vec3f, cos_d: f32, d: f32, lit: f32) -> vec3f {
    let base = select(0.0, 1.0, has_bits(m, BASE)) * lit;
    let specular = principled_fresnel(m, cos_d) * d;
    if (keeps_energy(m)) {
        let values = values_of(bounces_of(m), abs(wo.z), abs(wi.z));
        let more = select(0.0, 1.0, has_bits(m, BOUNCES));
        return specular + m.reflectance * (base * (1.0 - m.metallic) * values.w) + values.xyz * more;
    }
    let fo = schlick_weight(abs(wo.z));
    let fi = schlick_weight(abs(wi.z));
    let rr = 2.0 * m.roughness * cos_d * cos_d;
    let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi);
    let retro = rr * (fo + fi + fo * fi * (rr - 1.0));
    let diffuse = base * (1.0 - m.metallic) * (lambert + retro) * 0.31830987f;
    return specular + m.reflectance * diffuse;
}

// Probability of sampling the microfacets.
fn specular_of_principled(m: Material, wo: vec3f) -> f32 {
    let glossy = select(0.0, 1.0, has_bits(m, GLOSS));
    let base = select(0.0, 1.0, has_bits(m, BASE));
    let specular = glossy * mean_channel(principled_fresnel(m, abs(wo.z)));
    let diffuse = base * (1.0 - m.metallic) * mean_channel(m.reflectance);
    if (keeps_energy(m)) {
        if (!(specular > 0.0)) { return 0.0; }
        let albedos = albedos_of(bounces_of(m), abs(wo.z));
        let more = select(0.0, 1.0, has_bits(m, BOUNCES));
        let wide = diffuse * albedos.w + more * mean_channel(albedos.xyz);
        let p = quotient(specular, specular + wide);
        if (!(diffuse > 0.0)) { return p; }
        return select(select(p, 0.9f, p > 0.9f), 0.1f, p < 0.1f);
    }
    if (!(specular > 0.0)) { return 0.0; }
    if (!(diffuse > 0.0)) { return 1.0; }
    let p = quotient(specular, specular + diffuse);
    return select(select(p, 0.9f, p > 0.9f), 0.1f, p < 0.1f);
}

// Weights of diffuse reflection and of transmission.
fn diffuse_weight(m: Material) -> f32 { return (1.0 - m.metallic) * (1.0 - m.spec_trans); }

fn glass_weight(m: Material) -> f32 { return (1.0 - m.metallic) * m.spec_trans; }

// Hue of the base, with luminance one.
fn hue_of(m: Material) -> vec3f {
    let c = m.reflectance;
    let luminance = 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
    if (luminance > 0.0) { return quotients(c, luminance); }
    return vec3f(1.0);
}

// Reflectance of the microfacets for light from the front.
fn layered_fresnel(m: Material, given_cos: f32) -> vec3f {
    let plain = principled_fresnel(m, given_cos);
    if (m.spec_tint == 0.0) { return plain; }
    let eta = m.eta.x;
    let cos = not_above_one(given_cos);
    let dielectric = fresnel_dielectric(cos, eta);
    let r0 = quotient((eta - 1.0) * (eta - 1.0), (eta + 1.0) * (eta + 1.0));
    let schlick = schlick_weight(select(cos, dielectric.y, eta < 1.0));
    let tinted = hue_of(m) * (r0 * (1.0 - schlick)) + schlick;
    return plain + (tinted - dielectric.x) * ((1.0 - m.metallic) * m.spec_tint);
}

fn further_coat_fresnel(m: Material, given_cos: f32) -> f32 {
    var cos = given_cos;
    if (m.eta.x < 1.0) { cos = fresnel_dielectric(not_above_one(cos), m.eta.x).y; }
    let schlick = schlick_weight(cos);
    return 0.04f * (1.0 - schlick) + schlick;
}

fn transmission_tint(m: Material) -> vec3f {
    let c = m.reflectance;
    return vec3f(root(c.x), root(c.y), root(c.z)) * glass_weight(m);
}

// As rough glass: transmission from either side, and reflection inside.
fn as_boundary(m: Material) -> Material {
    var boundary = m;
    boundary.reflectance = vec3f(glass_weight(m));
    boundary.transmittance = transmission_tint(m);
    boundary.roughness = principled_facets(m).alpha;
    return boundary;
}

fn is_inside(m: Material, wo: vec3f) -> bool { return has_bits(m, LETS_THROUGH) && wo.z < 0.0; }

fn share_if(counts: bool, weight: f32) -> f32 { return select(0.0, weight, counts); }

// Probabilities of sampling the gloss, the clearcoat and the base.
fn layered_odds(m: Material, wo: vec3f) -> vec3f {
    let glass = glass_weight(m);
    if (is_inside(m, wo)) { return vec3f(share_if(has_bits(m, GLOSS) && glass > 0.0, 1.0), 0.0, 0.0); }
    let cos = not_above_one(abs(wo.z));
    let entered = 1.0 - fresnel_dielectric(cos, m.eta.x).x;
    let gloss = mean_channel(layered_fresnel(m, cos)) + entered * mean_channel(transmission_tint(m));
    let sheen = share_if(diffuse_weight(m) > 0.0, 0.1f * m.sheen * (1.0 - m.metallic));
    var diffuse = diffuse_weight(m) * mean_channel(m.reflectance);
    var more = 0.0;
    if (keeps_energy(m)) {
        let albedos = albedos_of(bounces_of(m), cos);
        diffuse *= albedos.w;
        more = share_if(has_bits(m, BOUNCES), mean_channel(albedos.xyz));
    }
    let shares = vec3f(
        share_if(has_bits(m, GLOSS), gloss),
        share_if(has_bits(m, COAT), m.clearcoat * further_coat_fresnel(m, cos)),
        share_if(has_bits(m, BASE), diffuse + sheen) + more,
    );
    let sum = shares.x + shares.y + shares.z;
    if (sum <= 0.0) { return vec3f(0.0); }
    let odds = vec3f(odds_of(shares.x, sum), odds_of(shares.y, sum), odds_of(shares.z, sum));
    return quotients(odds, odds.x + odds.y + odds.z);
}

fn odds_of(share: f32, sum: f32) -> f32 {
    if (!(share > 0.0)) { return 0.0; }
    let odds = quotient(share, sum);
    return select(LEAST_ODDS, odds, odds > LEAST_ODDS);
}

// Probability that a sampled microfacet reflects light from the front.
fn reflected_share(m: Material, cos: f32) -> f32 {
    let through = (1.0 - fresnel_dielectric(not_above_one(cos), m.eta.x).x) * mean_channel(transmission_tint(m));
    if (through <= 0.0) { return 1.0; }
    let reflected = mean_channel(layered_fresnel(m, cos));
    return quotient(reflected, reflected + through);
}

// Microfacet distribution of the clearcoat.
fn gtr1(alpha: f32, m: vec3f) -> f32 {
    let alpha2 = alpha * alpha;
    let t = m.x * m.x + m.y * m.y + alpha2 * m.z * m.z;
    return quotient(alpha2 - 1.0, FACET_PI * ln(alpha2) * t);
}

// Samples a normal with pdf `gtr1 cos`.
fn sample_gtr1(alpha: f32, u: vec2f) -> vec3f {
    let alpha2 = alpha * alpha;
    let cos2 = not_above_one(not_below_zero(
        quotient(1.0 - exponential(ln(alpha2) * (1.0 - u.y)), 1.0 - alpha2),
    ));
    let sine = root(1.0 - cos2);
    let turn = sin_cos(6.2831855f * u.x);
    return vec3f(sine * turn.y, sine * turn.x, root(cos2));
}

// `coupled`: pi times the value of a white base beneath the layer, for materials that keep their energy.
fn value_of_layered_base(m: Material, wo: vec3f, wi: vec3f, cos_d: f32, coupled: f32) -> vec3f {
    let fo = schlick_weight(wo.z);
    let fi = schlick_weight(wi.z);
    let rr = 2.0 * m.roughness * cos_d * cos_d;
    let lambert = (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi);
    let retro = rr * (fo + fi + fo * fi * (rr - 1.0));
    var shape = lambert + retro;
    if (keeps_energy(m)) { shape = coupled; }
    if (m.flatness > 0.0) {
        let towards = vec2f(1.0 + (0.5 * rr - 1.0) * fo, 1.0 + (0.5 * rr - 1.0) * fi);
        let fss = towards.x * towards.y;
        let tiny = of_bits(0x00800000u);
        let sum = wo.z + wi.z;
        let flat_ = 1.25 * (fss * (quotient(1.0, select(tiny, sum, sum > tiny)) - 0.5) + 0.5);
        shape += (flat_ - shape) * m.flatness;
    }
    var value = m.reflectance * (diffuse_weight(m) * shape * 0.31830987f);
    if (m.sheen > 0.0 && diffuse_weight(m) > 0.0) {
        let hue = vec3f(1.0) + (hue_of(m) - vec3f(1.0)) * m.sheen_tint;
        value += hue * (m.sheen * (1.0 - m.metallic) * schlick_weight(cos_d));
    }
    return value;
}

// BSDF value on the front. `h`: half vector; `glossy`: the microfacets' value; `lit`: factor on the base.
fn value_of_layered(m: Material, wo: vec3f, wi: vec3f, h: vec3f, glossy: vec3f, lit: f32) -> vec3f {
    let cos_d = abs(dot3(wo, h));
    var value = vec3f(0.0);
    if (has_bits(m, GLOSS)) { value += glossy; }
    if (has_bits(m, COAT) && m.clearcoat > 0.0) {
        let masking = Facets(0.25, false);
        let masked = facet_g1(masking, wo) * facet_g1(masking, wi);
        let weight = 0.25 * m.clearcoat * further_coat_fresnel(m, cos_d);
        value += weight * masked * gtr1(m.coat_alpha, h);
    }
    var coupled = 0.0;
    if (keeps_energy(m)) {
        let values = values_of(bounces_of(m), wo.z, wi.z);
        coupled = values.w * FACET_PI;
        if (has_bits(m, BOUNCES)) { value += values.xyz; }
    }
    if (has_bits(m, BASE)) { value += value_of_layered_base(m, wo, wi, cos_d, coupled) * lit; }
    return value;
}

// Pdf of wi on the front; `d`: the microfacets'.
fn pdf_of_layered(m: Material, wo: vec3f, wi: vec3f, h: vec3f, d: f32) -> f32 {
    let odds = layered_odds(m, wo);
    let cos_d = dot3(wo, h);
    var pdf = odds.z * cosine_hemisphere_pdf(wi.z);
    if (odds.x > 0.0) { pdf += odds.x * reflected_share(m, cos_d) * d; }
    if (odds.y > 0.0 && cos_d > LEAST_FACET_COSINE) {
        pdf += quotient(odds.y * gtr1(m.coat_alpha, h) * h.z, 4.0 * cos_d);
    }
    return pdf;
}

// Pdf of transmission, or reflection inside; `pdf`: the glass boundary's.
fn pdf_through_layered(m: Material, wo: vec3f, cos_o: f32, pdf: f32) -> f32 {
    if (!(pdf > 0.0) || !has_bits(m, GLOSS) || !(glass_weight(m) > 0.0)) { return 0.0; }
    if (wo.z < 0.0) { return pdf; }
    // The boundary's pdf, with another probability of transmission.
    let entered = 1.0 - fresnel_dielectric(cos_o, m.eta.x).x;
    if (!(entered > 0.0)) { return 0.0; }
    return layered_odds(m, wo).x * quotient(pdf * (1.0 - reflected_share(m, cos_o)), entered);
}
