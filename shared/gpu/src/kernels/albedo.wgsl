// Approximate albedo of a surface, reflection plus transmission, under uniform light. The renderer's `bsdf/albedo.rs`.

fn least_with_one(v: vec3f) -> vec3f { return select(vec3f(1.0), v, v < vec3f(1.0)); }

fn albedo_of(m: Material) -> vec3f {
    switch m.kind {
        case BLACK: { return vec3f(0.0); }
        case DIFFUSE, MIRROR: { return m.reflectance; }
        case CONDUCTOR, ROUGH_CONDUCTOR: { return m.reflectance * fresnel_conductor(1.0, m.eta, m.k); }
        case DIELECTRIC, THIN_DIELECTRIC, ROUGH_DIELECTRIC: { return m.transmittance; }
        case PLASTIC, ROUGH_PLASTIC: {
            var reflected = fresnel_dielectric(1.0, m.eta.x).x;
            if (HAS_ROUGH_PLASTIC && m.kind == ROUGH_PLASTIC) { reflected = 1.0 - coat_transmittance(m, 1.0); }
            let escape = (1.0 - m.metallic) * (m.eta.x * m.eta.x);
            return m.transmittance * reflected + m.reflectance * (escape * (1.0 - reflected));
        }
        case PRINCIPLED: {
            return least_with_one(m.reflectance * (1.0 - m.metallic) + principled_fresnel(m, 1.0));
        }
        case LAYERED: {
            let sum = m.reflectance * diffuse_weight(m) + transmission_tint(m) + layered_fresnel(m, 1.0);
            return least_with_one(sum + 0.04f * m.clearcoat);
        }
        default: { return vec3f(1.0); }
    }
}
