// What a surface of any kind does: draw a direction, value and density of one, and which of its lobes a path takes.

// A surface whose textures are looked up, ready for the functions below.
fn looked_up(given: Material) -> Material {
    var m = given;
    switch m.kind {
        case DIFFUSE: {
            if (all(m.reflectance == vec3f(0.0))) {
                m.kind = BLACK;
                m.bits |= TWO_SIDED;
            }
        }
        case ROUGH_CONDUCTOR, ROUGH_DIELECTRIC: {
            m.roughness = select(0.001f, m.roughness, m.roughness > 0.001f);
        }
        case PLASTIC, ROUGH_PLASTIC: { m.reflectance = base_under_coat(m); }
        case PRINCIPLED, LAYERED: {
            if (has_bits(m, BY_SPECULAR)) {
                let r0 = not_below_zero(0.08f * m.eta.x);
                m.eta = vec3f(quotient(2.0, 1.0 - root(r0)) - 1.0);
            }
            m.coat_alpha = 0.1f * (1.0 - m.coat_alpha) + 0.001f * m.coat_alpha;
        }
        default: {}
    }
    return m;
}

// Draw wi: `u_lobe` chooses a lobe, `u` a direction in it; both uniform in [0, 1).
fn bsdf_sample(m: Material, wo: vec3f, u_lobe: f32, u: vec2f, mode: u32) -> BsdfSample {
    switch m.kind {
        case DIELECTRIC: { return sample_boundary(m, wo, u_lobe, mode); }
        case THIN_DIELECTRIC: { return sample_sheet(m, wo, u_lobe); }
        case NULL_BOUNDARY: { return straight_on(wo, vec3f(1.0), 1.0); }
        default: {}
    }
    let glass = HAS_LAYERED && m.kind == LAYERED && is_inside(m, wo);
    if (HAS_ROUGH_DIELECTRIC || HAS_LAYERED) {
        if (m.kind == ROUGH_DIELECTRIC || glass) {
            var boundary = m;
            if (glass) {
                if (!has_bits(m, GLOSS) || !(glass_weight(m) > 0.0)) { return absorbed(); }
                boundary = as_boundary(m);
            }
            return sample_rough_dielectric(boundary, wo, u_lobe, u, mode);
        }
    }
    if (HAS_LAYERED && m.kind == LAYERED) {
        if (!layered_is_lit(m, wo)) { return absorbed(); }
    } else if (m.kind == BLACK || !is_lit(m, wo)) {
        return absorbed();
    }
    let sign = front_of(wo);
    let front = wo * sign;
    var wi = vec3f(0.0);
    switch m.kind {
        case DIFFUSE: { return sample_diffuse(m, wo, u); }
        case CONDUCTOR: { return mirrored(wo, m.reflectance * fresnel_conductor(abs(wo.z), m.eta, m.k), 1.0); }
        case MIRROR: { return mirrored(wo, m.reflectance, 1.0); }
        case ROUGH_CONDUCTOR: { if (HAS_ROUGH_CONDUCTOR) { return sample_rough_conductor(m, wo, u); } }
        case PLASTIC: { if (HAS_PLASTIC) { return sample_plastic(m, wo, u_lobe, u); } }
        case LAYERED: { if (HAS_LAYERED) { wi = layered_direction(m, front, u_lobe, u); } }
        default: {
            if (HAS_ROUGH_PLASTIC || HAS_PRINCIPLED) {
                var p = 0.0;
                var facets = facets_of(m);
                if (HAS_PRINCIPLED && m.kind == PRINCIPLED) {
                    p = specular_of_principled(m, front);
                    facets = principled_facets(m);
                } else if (HAS_ROUGH_PLASTIC) {
                    p = specular_of_plastic(m, front);
                }
                if (u_lobe < p) { wi = sample_reflection(facets, front, u); } else { wi = cosine_hemisphere(u); }
            }
        }
    }
    if (!HAS_ROUGH_PLASTIC && !HAS_PRINCIPLED && !HAS_LAYERED) { return absorbed(); }
    if (wi.z == 0.0) { return absorbed(); }
    let pdf = bsdf_pdf(m, front, wi);
    if (!(pdf > 0.0)) { return absorbed(); }
    let weight = bsdf_eval(m, front, wi, mode) * quotient(abs(wi.z), pdf);
    return BsdfSample(wi * sign, pdf, weight, select(SAMPLED, SAMPLED | TRANSMITTED, wi.z < 0.0));
}

// Value in 1/sr; zero for delta lobes.
fn bsdf_eval(m: Material, wo: vec3f, wi: vec3f, mode: u32) -> vec3f {
    if (HAS_ROUGH_DIELECTRIC && m.kind == ROUGH_DIELECTRIC) { return eval_rough_dielectric(m, wo, wi, mode); }
    if (HAS_LAYERED && m.kind == LAYERED) { return eval_layered(m, wo, wi, mode); }
    if (!reflects(m, wo, wi)) { return vec3f(0.0); }
    switch m.kind {
        case DIFFUSE: { return m.reflectance * 0.31830987f; }
        case ROUGH_CONDUCTOR: { if (HAS_ROUGH_CONDUCTOR) { return eval_rough_conductor(m, wo, wi); } }
        case PLASTIC: { if (HAS_PLASTIC) { return eval_plastic(m, wo, wi); } }
        case ROUGH_PLASTIC: { if (HAS_ROUGH_PLASTIC) { return eval_rough_plastic(m, wo, wi); } }
        case PRINCIPLED: { if (HAS_PRINCIPLED) { return eval_principled(m, wo, wi); } }
        default: {}
    }
    return vec3f(0.0);
}

// Density in solid angle of drawing wi; zero for delta lobes.
fn bsdf_pdf(m: Material, wo: vec3f, wi: vec3f) -> f32 {
    if (HAS_ROUGH_DIELECTRIC && m.kind == ROUGH_DIELECTRIC) { return pdf_of_facet(m, facet_between(m, wo, wi)); }
    if (HAS_LAYERED && m.kind == LAYERED) { return pdf_layered(m, wo, wi); }
    if (!reflects(m, wo, wi)) { return 0.0; }
    let diffuse = cosine_hemisphere_pdf(abs(wi.z));
    switch m.kind {
        case DIFFUSE: { return diffuse; }
        case ROUGH_CONDUCTOR: { if (HAS_ROUGH_CONDUCTOR) { return pdf_rough_conductor(m, wo, wi); } }
        case PLASTIC: { if (HAS_PLASTIC) { return (1.0 - mirror_probability(m, wo)) * diffuse; } }
        case ROUGH_PLASTIC: {
            if (HAS_ROUGH_PLASTIC) {
                let p = specular_of_plastic(m, wo);
                return p * reflection_pdf(facets_of(m), wo, half_vector(wo, wi)) + (1.0 - p) * diffuse;
            }
        }
        case PRINCIPLED: {
            if (HAS_PRINCIPLED) {
                let p = specular_of_principled(m, wo);
                return p * reflection_pdf(principled_facets(m), wo, half_vector(wo, wi)) + (1.0 - p) * diffuse;
            }
        }
        default: {}
    }
    return 0.0;
}

// Lobes of less roughness are followed: hardly a photon is seen in them, and light sampling hardly hits them.
const FOLLOWED_BELOW: f32 = 0.1;

fn is_gloss(alpha: f32) -> bool { return alpha >= 0.02f && alpha <= 0.5f; }

// Whether it scatters in discrete directions alone.
fn is_smooth(m: Material) -> bool {
    switch m.kind {
        case DIELECTRIC, THIN_DIELECTRIC, CONDUCTOR, MIRROR, NULL_BOUNDARY: { return true; }
        default: { return false; }
    }
}

// Whether all that it scatters is a lobe that paths follow.
fn is_followed_alone(m: Material) -> bool {
    return (m.kind == ROUGH_CONDUCTOR || m.kind == ROUGH_DIELECTRIC) && m.roughness < FOLLOWED_BELOW;
}

// Whether it has a lobe that photons are seen in, and which is far from diffuse.
fn is_glossy(m: Material) -> bool {
    switch m.kind {
        case ROUGH_CONDUCTOR, ROUGH_DIELECTRIC, ROUGH_PLASTIC: { return is_gloss(m.roughness); }
        case PRINCIPLED: { return is_gloss(principled_facets(m).alpha); }
        case LAYERED: {
            return (has_bits(m, GLOSS) && is_gloss(principled_facets(m).alpha))
                || (has_bits(m, COAT) && m.clearcoat > 0.0 && is_gloss(m.coat_alpha));
        }
        default: { return false; }
    }
}

// One of the lobes of a surface, chosen by chance, or all of them.
struct OneLobe {
    material: Material,
    // Probability of the choice, where samples do not hold it.
    p: f32,
    // A uniform number to sample it by.
    u: f32,
    // A path follows it.
    is_followed: bool,
    // It scatters in discrete directions alone.
    is_smooth: bool,
}

fn this_lobe(m: Material, lobes: u32, p: f32, u: f32, is_followed: bool) -> OneLobe {
    var part = m;
    part.bits = (m.bits & ~(GLOSS | COAT | BASE)) | lobes;
    // Of a coat over a base, what is left is all that there is.
    if (HAS_ROUGH_PLASTIC && m.kind == ROUGH_PLASTIC) {
        if (is_followed) { part.reflectance = vec3f(0.0); } else { part.transmittance = vec3f(0.0); }
    }
    return OneLobe(part, p, u, is_followed, false);
}

// Choose between the rough lobes that paths follow and all others, where there are both.
fn narrow_or_wide(m: Material, wo: vec3f, u: f32) -> OneLobe {
    var p = -1.0;
    var narrow = GLOSS;
    if (HAS_ROUGH_PLASTIC && m.kind == ROUGH_PLASTIC && m.roughness < FOLLOWED_BELOW) {
        p = specular_of_plastic(m, wo);
    }
    if (HAS_PRINCIPLED && m.kind == PRINCIPLED && principled_facets(m).alpha < FOLLOWED_BELOW) {
        p = specular_of_principled(m, wo);
    }
    if (HAS_LAYERED && m.kind == LAYERED) {
        narrow = select(0u, GLOSS, principled_facets(m).alpha < FOLLOWED_BELOW)
            | select(0u, COAT, m.clearcoat > 0.0);
        if ((m.bits & narrow) != 0u) {
            let odds = layered_odds(m, wo);
            p = select(0.0, odds.x, (narrow & GLOSS) != 0u) + select(0.0, odds.y, (narrow & COAT) != 0u);
        }
    }
    if (p < 0.0) { return OneLobe(m, 1.0, u, is_smooth(m) || is_followed_alone(m), is_smooth(m)); }
    if (u < p) { return this_lobe(m, m.bits & narrow, p, quotient(u, p), true); }
    let others = m.bits & (GLOSS | COAT | BASE) & ~narrow;
    return this_lobe(m, others, 1.0 - p, quotient(u - p, 1.0 - p), false);
}

// The same, smooth ones among them.
fn one_lobe(m: Material, wo: vec3f, u: f32) -> OneLobe {
    if (HAS_PLASTIC && m.kind == PLASTIC) {
        let delta = mirror_probability(m, wo);
        // Samples of the smooth lobe hold its probability.
        if (delta > 0.0 && u < delta) { return OneLobe(m, 1.0, 0.0, true, true); }
        if (delta > 0.0) { return this_lobe(m, BASE, 1.0 - delta, quotient(u - delta, 1.0 - delta), false); }
    }
    return narrow_or_wide(m, wo, u);
}
