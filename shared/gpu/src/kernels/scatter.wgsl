// BSDFs of all kinds: value, pdf, sampling, and the choice of a lobe for a path.

// Prepares a material for the functions below, once its textures are looked up.
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

// Whether the scene has microfacets, and rough glass.
const HAS_FACETS: bool =
    HAS_ROUGH_CONDUCTOR || HAS_ROUGH_DIELECTRIC || HAS_ROUGH_PLASTIC || HAS_PRINCIPLED || HAS_LAYERED;
const HAS_ROUGH_GLASS: bool = HAS_ROUGH_DIELECTRIC || HAS_LAYERED;

fn is_principled(m: Material) -> bool { return m.kind == PRINCIPLED || m.kind == LAYERED; }

fn any_facets_of(m: Material) -> Facets {
    if ((HAS_PRINCIPLED || HAS_LAYERED) && is_principled(m)) { return principled_facets(m); }
    return facets_of(m);
}

// Whether this is scattering by a rough glass boundary. Layered surfaces have one inside, and for light that crosses.
fn is_by_rough_glass(m: Material, wo: vec3f, crosses: bool) -> bool {
    return m.kind == ROUGH_DIELECTRIC
        || (m.kind == LAYERED && has_bits(m, LETS_THROUGH) && (crosses || wo.z < 0.0));
}

// Value, 1/sr, and pdf per solid angle; both zero for delta lobes.
struct Scattered {
    value: vec3f,
    pdf: f32,
}

const UNSCATTERED: Scattered = Scattered(vec3f(0.0), 0.0);

// `D G / (4 cos cos)` with height-correlated masking and shadowing.
fn correlated(density: f32, extents: vec2f, wo: vec3f, wi: vec3f) -> f32 {
    let o = abs(wo.z);
    let i = abs(wi.z);
    let below = 2.0 * (extents.x * i + extents.y * o - 2.0 * o * i);
    return quotient(density, select(1e-12f, below, below > 1e-12f));
}

// Value and pdf of scattering from wo to wi. `backwards`: the pdf is that of sampling wo given wi. `bumps` shadow
// diffuse lobes. One function for all, since compilers inline each call.
fn bsdf_scatter(m: Material, wo: vec3f, wi: vec3f, mode: u32, backwards: bool, bumps: Shadowing) -> Scattered {
    if (HAS_ROUGH_GLASS && is_by_rough_glass(m, wo, wo.z * wi.z < 0.0)) {
        return scattered_by_rough_glass(m, wo, wi, mode, backwards);
    }
    if (!reflects(m, wo, wi)) { return UNSCATTERED; }
    // Direction that lobes are chosen by.
    let from_dir = select(wo, wi, backwards);
    let diffuse = cosine_hemisphere_pdf(select(abs(wi.z), abs(wo.z), backwards));
    let lit = shadowing_factor(bumps, towards_camera(wi, wo, mode));
    if (m.kind == DIFFUSE) { return Scattered(m.reflectance * 0.31830987f * lit, diffuse); }
    if (HAS_PLASTIC && m.kind == PLASTIC) {
        return Scattered(value_of_plastic(m, wo, wi) * lit, (1.0 - mirror_probability(m, from_dir)) * diffuse);
    }
    if (!HAS_FACETS || is_smooth(m) || m.kind == BLACK) { return UNSCATTERED; }
    let facets = any_facets_of(m);
    let h = half_vector(wo, wi);
    let density = facet_density(facets, h);
    let extents = vec2f(facet_extent(facets, wo), facet_extent(facets, wi));
    var d = quotient(density, extents.x * extents.y);
    // Materials that keep their energy use height-correlated masking.
    if ((m.kind == ROUGH_CONDUCTOR || is_principled(m)) && keeps_energy(m)) {
        d = correlated(density, extents, wo, wi);
    }
    let drawn = quotient(density, 2.0 * select(extents.x, extents.y, backwards));
    let cos_d = abs(dot3(wo, h));
    if (HAS_ROUGH_CONDUCTOR && m.kind == ROUGH_CONDUCTOR) {
        let once = m.reflectance * fresnel_conductor(cos_d, m.eta, m.k) * d;
        if (!keeps_energy(m)) { return Scattered(once, drawn); }
        let of_once = specular_of_metal(m, abs(from_dir.z));
        let all_bounces = once + more_of_metal(m, abs(wo.z), abs(wi.z));
        return Scattered(all_bounces, of_once * drawn + (1.0 - of_once) * diffuse);
    }
    if (HAS_LAYERED && m.kind == LAYERED) {
        // Turns both to the front.
        let sign = front_of(wo);
        let to_dir = select(wi, wo, backwards);
        var glossy = layered_fresnel(m, cos_d) * d;
        if (is_glass_kept(m) && glass_weight(m) > 0.0) {
            let camera = towards_camera(wo, wi, mode) * sign;
            let brightened = brightened_glass(m, facets.alpha, m.eta.x, camera);
            let of_glass = layered_fresnel(m, cos_d) * brightened * correlated(density, extents, wo, wi);
            glossy += (of_glass - glossy) * glass_weight(m);
        }
        let value = value_of_layered(m, wo * sign, wi * sign, h * sign, glossy, lit);
        return Scattered(value, pdf_of_layered(m, from_dir * sign, to_dir * sign, h * sign, drawn));
    }
    var value = vec3f(0.0);
    var p = 0.0;
    if (HAS_PRINCIPLED && m.kind == PRINCIPLED) {
        if (!has_bits(m, GLOSS)) { d = 0.0; }
        value = value_of_principled(m, wo, wi, cos_d, d, lit);
        p = specular_of_principled(m, from_dir);
    } else if (HAS_ROUGH_PLASTIC) {
        let fresnel = fresnel_dielectric(not_above_one(cos_d), m.eta.x).x;
        let entered = coat_transmittance(m, abs(wo.z)) * coat_transmittance(m, abs(wi.z));
        value = m.transmittance * (fresnel * d) + m.reflectance * lit * (entered * 0.31830987f);
        p = specular_of_plastic(m, from_dir);
    }
    return Scattered(value, p * drawn + (1.0 - p) * diffuse);
}

fn scattered_by_rough_glass(m: Material, wo: vec3f, wi: vec3f, mode: u32, backwards: bool) -> Scattered {
    var boundary = m;
    if (HAS_LAYERED && m.kind == LAYERED) {
        if (!has_bits(m, GLOSS) || !(glass_weight(m) > 0.0)) { return UNSCATTERED; }
        boundary = as_boundary(m);
    }
    let facets = facets_of(boundary);
    var scattered = UNSCATTERED;
    // The first way gives the value; `backwards`, the second gives the pdf.
    for (var way = 0u; way < 2u; way++) {
        let turned = way == 1u;
        let f = facet_between(boundary, select(wo, wi, turned), select(wi, wo, turned));
        var pdf = 0.0;
        if (f.cos_o > 0.0) {
            let extents = vec2f(facet_extent(facets, f.wo), facet_extent(facets, f.wi));
            let density = facet_density(facets, f.m);
            var d = quotient(density, extents.x * extents.y);
            var brightened = vec3f(1.0);
            if (is_glass_kept(m)) {
                d = correlated(density, extents, f.wo, f.wi);
                brightened = brightened_glass(m, facets.alpha, f.eta, towards_camera(f.wo, f.wi, mode));
            }
            let visible = quotient(density, extents.x);
            var value = boundary.reflectance * brightened * (f.reflectance * d);
            pdf = 0.5 * f.reflectance * visible;
            if (!f.is_reflection) {
                let jacobian = refraction_jacobian(f);
                let scale = refraction_scale(f.eta, mode);
                let through = 4.0 * scale * (1.0 - f.reflectance) * d * f.cos_o * jacobian;
                value = boundary.transmittance * brightened * through;
                pdf = 2.0 * (1.0 - f.reflectance) * visible * f.cos_o * jacobian;
            }
            if (!turned) { scattered.value = value; }
        }
        if (HAS_LAYERED && m.kind == LAYERED) {
            // Other lobes reflect on the front.
            let from_dir = select(wo, wi, turned);
            if (!f.is_reflection || from_dir.z < 0.0) { pdf = pdf_through_layered(m, from_dir, f.cos_o, pdf); }
        }
        scattered.pdf = pdf;
        if (!backwards) { break; }
    }
    return scattered;
}

fn bsdf_eval(m: Material, wo: vec3f, wi: vec3f, mode: u32) -> vec3f {
    return bsdf_scatter(m, wo, wi, mode, false, NO_SHADOWING).value;
}

fn bsdf_pdf(m: Material, wo: vec3f, wi: vec3f) -> f32 { return bsdf_scatter(m, wo, wi, FLUX, false, NO_SHADOWING).pdf; }

// Samples wi: `u_lobe` chooses a lobe, `u` a direction in it; both uniform in [0, 1). `bumps` shadow diffuse lobes.
fn bsdf_sample(m: Material, wo: vec3f, u_lobe: f32, u: vec2f, mode: u32, bumps: Shadowing) -> BsdfSample {
    switch m.kind {
        case DIELECTRIC: { return sample_boundary(m, wo, u_lobe, mode); }
        case THIN_DIELECTRIC: { return sample_sheet(m, wo, u_lobe); }
        case NULL_BOUNDARY: { return straight_on(wo, vec3f(1.0), 1.0); }
        default: {}
    }
    let by_glass = HAS_ROUGH_GLASS && is_by_rough_glass(m, wo, false);
    if (!by_glass && (m.kind == BLACK || !is_lit(m, wo))) { return absorbed(); }
    switch m.kind {
        case CONDUCTOR: { return mirrored(wo, m.reflectance * fresnel_conductor(abs(wo.z), m.eta, m.k), 1.0); }
        case MIRROR: { return mirrored(wo, m.reflectance, 1.0); }
        default: {}
    }
    let sign = front_of(wo);
    let front = wo * sign;
    if (front.z <= 0.0) { return absorbed(); }
    // Probability of the microfacets, or of a smooth coat's reflection.
    var p = 0.0;
    var odds = vec3f(0.0);
    if (HAS_PLASTIC && m.kind == PLASTIC) {
        p = mirror_probability(m, wo);
        if (u_lobe < p) { return mirrored(wo, m.transmittance * quotient(coat_fresnel_at(m, wo), p), p); }
        p = 0.0;
    }
    if (HAS_ROUGH_PLASTIC && m.kind == ROUGH_PLASTIC) { p = specular_of_plastic(m, front); }
    if (HAS_PRINCIPLED && m.kind == PRINCIPLED) { p = specular_of_principled(m, front); }
    if (HAS_ROUGH_CONDUCTOR && m.kind == ROUGH_CONDUCTOR) { p = specular_of_metal(m, front.z); }
    if (HAS_LAYERED && m.kind == LAYERED) {
        odds = layered_odds(m, wo);
        p = odds.x;
    }
    if (by_glass) {
        if (m.kind == LAYERED && odds.x == 0.0) { return absorbed(); }
        p = 1.0;
    }
    var wi = vec3f(0.0);
    var eta = m.eta.x;
    if (HAS_ROUGH_GLASS && by_glass) { eta = eta_from(m, wo); }
    var fresnel = vec2f(0.0);
    var cos_o = 0.0;
    var h = vec3f(0.0);
    var is_reflection = true;
    if (HAS_FACETS && u_lobe < p) {
        h = sample_visible(any_facets_of(m), front, u);
        cos_o = dot3(front, h);
        if (cos_o <= 0.0) { return absorbed(); }
        if (HAS_ROUGH_GLASS && (by_glass || m.kind == LAYERED)) {
            fresnel = fresnel_dielectric(select(not_above_one(cos_o), cos_o, by_glass), eta);
            is_reflection = u_lobe < fresnel.x;
            if (!by_glass) { is_reflection = quotient(u_lobe, odds.x) < reflected_share(m, cos_o); }
        }
        wi = h * (2.0 * cos_o) - front;
        if (!is_reflection) { wi = h * (quotient(cos_o, eta) - fresnel.y) - quotients(front, eta); }
        wi = unit_vector(wi);
    } else if (HAS_LAYERED && m.kind == LAYERED && u_lobe < odds.x + odds.y) {
        h = sample_gtr1(m.coat_alpha, u);
        cos_o = dot3(front, h);
        if (cos_o <= LEAST_FACET_COSINE) { return absorbed(); }
        wi = unit_vector(h * (2.0 * cos_o) - front);
    } else {
        if (HAS_LAYERED && m.kind == LAYERED && !(odds.z > 0.0)) { return absorbed(); }
        wi = cosine_hemisphere(u);
    }
    // Light that would need a second bounce among the facets is lost.
    if (wi.z == 0.0 || !((wi.z > 0.0) == is_reflection)) { return absorbed(); }
    let flags = select(SAMPLED | TRANSMITTED, SAMPLED, is_reflection);
    if (m.kind == DIFFUSE || (HAS_PLASTIC && m.kind == PLASTIC)) {
        let cosine_pdf = cosine_hemisphere_pdf(wi.z);
        let lit = shadowing_factor(bumps, towards_camera(wi * sign, wo, mode));
        if (m.kind == DIFFUSE) { return BsdfSample(wi * sign, cosine_pdf, m.reflectance * lit, flags); }
        let delta = mirror_probability(m, wo);
        let entered = (1.0 - coat_fresnel_at(m, wo)) * (1.0 - coat_fresnel_at(m, wi));
        let weight = m.reflectance * quotient(entered, 1.0 - delta) * lit;
        return BsdfSample(wi * sign, (1.0 - delta) * cosine_pdf, weight, flags);
    }
    if (!HAS_FACETS) { return absorbed(); }
    // A single microfacet lobe leaves only the masking. The facet is known here; directions alone would not tell it.
    if ((m.kind == ROUGH_CONDUCTOR && !keeps_energy(m)) || by_glass) {
        let facets = any_facets_of(m);
        let visible = quotient(facet_density(facets, h), facet_extent(facets, front));
        var pdf = 0.5 * visible;
        var tint = m.reflectance;
        if (HAS_ROUGH_CONDUCTOR && m.kind == ROUGH_CONDUCTOR) { tint *= fresnel_conductor(cos_o, m.eta, m.k); }
        if (HAS_ROUGH_GLASS && by_glass) {
            var boundary = m;
            if (HAS_LAYERED && m.kind == LAYERED) { boundary = as_boundary(m); }
            let f = Facet(front, cos_o, wi, fresnel.y, h, fresnel.x, eta, is_reflection);
            tint = boundary.reflectance;
            pdf = 0.5 * fresnel.x * visible;
            if (!is_reflection) {
                tint = boundary.transmittance * refraction_scale(eta, mode);
                pdf = 2.0 * (1.0 - fresnel.x) * visible * cos_o * refraction_jacobian(f);
            }
        }
        if (!(pdf > 0.0)) { return absorbed(); }
        var left = vec3f(facet_g1(facets, wi));
        if (HAS_ROUGH_GLASS && by_glass && is_glass_kept(m)) {
            let density = facet_density(facets, h);
            let extents = vec2f(facet_extent(facets, front), facet_extent(facets, wi));
            let brightened = brightened_glass(m, facets.alpha, eta, towards_camera(front, wi, mode));
            let masked = correlated(density, extents, front, wi);
            let drawn = quotient(density, 2.0 * extents.x);
            let tiny = of_bits(0x00800000u);
            left = brightened * quotient(masked * abs(wi.z), select(tiny, drawn, drawn > tiny));
        }
        return BsdfSample(wi * sign, pdf, tint * left, flags);
    }
    // Bumps shadow both sides alike.
    let scattered = bsdf_scatter(m, front, wi, mode, false, bumps);
    if (!(scattered.pdf > 0.0)) { return absorbed(); }
    return BsdfSample(wi * sign, scattered.pdf, scattered.value * quotient(abs(wi.z), scattered.pdf), flags);
}

// Paths follow lobes of less roughness: hardly a photon is seen in them, and light sampling hardly hits them.
const FOLLOWED_BELOW: f32 = 0.1;

fn is_gloss(alpha: f32) -> bool { return alpha >= 0.02f && alpha <= 0.5f; }

// Whether it has delta lobes only.
fn is_smooth(m: Material) -> bool {
    switch m.kind {
        case DIELECTRIC, THIN_DIELECTRIC, CONDUCTOR, MIRROR, NULL_BOUNDARY: { return true; }
        default: { return false; }
    }
}

// Whether it is a single rough lobe that paths follow.
fn is_followed_alone(m: Material) -> bool {
    return (m.kind == ROUGH_CONDUCTOR || m.kind == ROUGH_DIELECTRIC) && m.roughness < FOLLOWED_BELOW;
}

// Whether it has a lobe that sees photons and is far from diffuse.
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

// One lobe of a surface, chosen by chance, or all of them.
struct OneLobe {
    material: Material,
    // Probability of the choice, unless samples contain it.
    p: f32,
    // Uniform number for sampling it.
    u: f32,
    // Paths follow it.
    is_followed: bool,
    // It has delta lobes only.
    is_smooth: bool,
}

fn this_lobe(m: Material, lobes: u32, p: f32, u: f32, is_followed: bool) -> OneLobe {
    var part = m;
    part.bits = (m.bits & ~(GLOSS | COAT | BASE | BOUNCES)) | lobes;
    // Rough coats and their bases ignore lobe bits: zeroes the other part.
    if (HAS_ROUGH_PLASTIC && m.kind == ROUGH_PLASTIC) {
        if (is_followed) { part.reflectance = vec3f(0.0); } else { part.transmittance = vec3f(0.0); }
    }
    return OneLobe(part, p, u, is_followed, false);
}

// Chooses between the rough lobes that paths follow and all others, if there are both.
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
    let others = m.bits & (GLOSS | COAT | BASE | BOUNCES) & ~narrow;
    return this_lobe(m, others, 1.0 - p, quotient(u - p, 1.0 - p), false);
}

// The same, including delta lobes.
fn one_lobe(m: Material, wo: vec3f, u: f32) -> OneLobe {
    if (HAS_PLASTIC && m.kind == PLASTIC) {
        let delta = mirror_probability(m, wo);
        // Samples of the delta lobe contain its probability.
        if (delta > 0.0 && u < delta) { return OneLobe(m, 1.0, 0.0, true, true); }
        if (delta > 0.0) { return this_lobe(m, BASE, 1.0 - delta, quotient(u - delta, 1.0 - delta), false); }
    }
    return narrow_or_wide(m, wo, u);
}

// For gloss with rules of its own: chooses it, as if paths followed it, or the base, if there are both.
fn gloss_or_base(m: Material, wo: vec3f, u: f32) -> OneLobe {
    var p = -1.0;
    var gloss = m.bits & (GLOSS | BOUNCES);
    if (HAS_ROUGH_PLASTIC && m.kind == ROUGH_PLASTIC && !all(m.transmittance == vec3f(0.0))) {
        p = specular_of_plastic(m, wo);
    }
    if (HAS_PRINCIPLED && m.kind == PRINCIPLED && has_bits(m, GLOSS | BOUNCES)) { p = specular_of_principled(m, wo); }
    if (HAS_LAYERED && m.kind == LAYERED && has_bits(m, GLOSS | COAT | BOUNCES)) {
        gloss = m.bits & (GLOSS | COAT | BOUNCES);
        let odds = layered_odds(m, wo);
        p = odds.x + odds.y;
    }
    if (p < 0.0) { return OneLobe(m, 1.0, u, m.kind == ROUGH_CONDUCTOR || m.kind == ROUGH_DIELECTRIC, false); }
    // Lights may be seen by either, however rarely its directions are drawn.
    p = select(select(0.75f, p, p < 0.75f), 0.25f, !(p > 0.25f));
    if (u < p) { return this_lobe(m, gloss, p, u, true); }
    return this_lobe(m, BASE, 1.0 - p, u, false);
}
