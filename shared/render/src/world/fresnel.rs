//! Unpolarised reflectance of smooth boundaries.

use crate::math::Rgb;

/// Reflectance of a boundary between dielectrics, and the cosine of the refracted ray (0 at total internal reflection).
///
/// `cos_i` in [0, 1] is the cosine of incidence, `eta` > 0 the index of refraction behind the boundary over the one in
/// front of it. Born & Wolf 1999, section 1.5.2.
#[inline]
pub fn fresnel_dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    if eta == 1.0 {
        return (0.0, cos_i);
    }
    let cos2_t = 1.0 - (1.0 - cos_i * cos_i) / (eta * eta);
    if cos2_t <= 0.0 {
        return (1.0, 0.0);
    }
    let cos_t = cos2_t.sqrt();
    if cos_i <= 0.0 {
        return (1.0, cos_t);
    }
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    (reflectance.min(1.0), cos_t)
}

/// `(1 - cos)^5`.
#[inline]
pub(crate) fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

/// Reflectance of a boundary between dielectrics, averaged over diffuse light. `eta` as in [`fresnel_dielectric`]. Uses
/// quadrature: the common fits (Egan & Hilgeman 1973, d'Eon & Irving 2011) misstate the transmission by 0.1 % up to an
/// index of 2, and by much more beyond.
pub(crate) fn mean_fresnel(eta: f32) -> f32 {
    const N: u32 = 1024;
    if eta < 1.0 {
        // As much diffuse light enters as leaves, and on this side the integrand is smooth.
        return 1.0 - (1.0 - mean_fresnel(1.0 / eta)) * eta * eta;
    }
    let term = |i| {
        let cos = (i as f32 + 0.5) / N as f32;
        f64::from(fresnel_dielectric(cos, eta).0 * cos)
    };
    ((0..N).map(term).sum::<f64>() * 2.0 / f64::from(N)) as f32
}

/// Reflectance of a conductor in vacuum, per channel.
///
/// `cos_i` in [0, 1] is the cosine of incidence, `eta + i k` the complex index of refraction, each part in [0, 1e6].
/// Born & Wolf 1999, section 14.2, in the real form of Lagarde 2013.
#[inline]
pub fn fresnel_conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    let cos2 = cos_i * cos_i;
    let sin2 = (1.0 - cos2).max(0.0);
    let (eta2, k2) = (eta * eta, k * k);
    let t = eta2 - k2 - sin2;
    let a2_plus_b2 = sqrt(t * t + 4.0 * eta2 * k2);
    let a = sqrt(0.5 * (a2_plus_b2 + t));
    let sum = a2_plus_b2 + cos2;
    let cross = 2.0 * cos_i * a;
    let perpendicular = (sum - cross) / (sum + cross).max(TINY);
    let sum = a2_plus_b2 * cos2 + sin2 * sin2;
    let cross = cross * sin2;
    let parallel = perpendicular * (sum - cross) / (sum + cross).max(TINY);
    (0.5 * (perpendicular + parallel)).clamp(Rgb::ZERO, Rgb::ONE)
}

/// Keeps the 0/0 of a zero index finite.
const TINY: Rgb = Rgb::splat(f32::MIN_POSITIVE);

#[inline]
fn sqrt(c: Rgb) -> Rgb {
    let c = c.max(Rgb::ZERO);
    Rgb::new(c.x.sqrt(), c.y.sqrt(), c.z.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_is_the_textbook_value() {
        for eta in [0.5f32, 1.0 / 1.5, 1.0, 1.0003, 1.33, 1.5, 2.417] {
            let r = (eta - 1.0) / (eta + 1.0);
            let (value, cos_t) = fresnel_dielectric(1.0, eta);
            assert!((value - r * r).abs() < 1e-6);
            assert!((cos_t - 1.0).abs() < 1e-6);
            let conductor = fresnel_conductor(1.0, Rgb::splat(eta), Rgb::ZERO);
            assert!((conductor - Rgb::splat(r * r)).abs().max_element() < 1e-6);
        }
        let (eta, k) = (0.2f32, 3.0f32);
        let expected = ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k);
        let value = fresnel_conductor(1.0, Rgb::splat(eta), Rgb::splat(k)).x;
        assert!((value - expected).abs() < 1e-6);
    }

    #[test]
    fn means_are_the_integrals_over_the_hemisphere() {
        for eta in [0.1f32, 0.5, 1.0 / 1.5, 0.9, 1.0, 1.2, 1.49, 2.4, 10.0] {
            let n = 1_000_000;
            let cos = |i: u32| (i as f32 + 0.5) / n as f32;
            let term = |i| f64::from(fresnel_dielectric(cos(i), eta).0 * 2.0 * cos(i));
            let integral = (0..n).map(term).sum::<f64>() / f64::from(n);
            let mean = f64::from(mean_fresnel(eta));
            assert!((mean - integral).abs() < 1e-4, "{eta}: {mean} {integral}");
        }
    }

    #[test]
    fn brewster_angle_has_no_parallel_reflection() {
        // At tan(theta) = eta only the perpendicular part remains: ((eta^2 - 1) / (eta^2 + 1))^2 / 2.
        for eta in [1.33f32, 1.5, 2.0] {
            let cos_i = 1.0 / (1.0 + eta * eta).sqrt();
            let r = (eta * eta - 1.0) / (eta * eta + 1.0);
            assert!((fresnel_dielectric(cos_i, eta).0 - 0.5 * r * r).abs() < 1e-6);
        }
    }

    #[test]
    fn total_internal_reflection_beyond_the_critical_angle() {
        let eta = 1.0 / 1.5;
        let critical = (1.0f32 - eta * eta).sqrt();
        assert_eq!(fresnel_dielectric(critical - 1e-4, eta), (1.0, 0.0));
        assert_eq!(fresnel_dielectric(0.0, eta), (1.0, 0.0));
        let (r, cos_t) = fresnel_dielectric(critical + 1e-4, eta);
        assert!(r < 1.0 && cos_t > 0.0);
    }

    #[test]
    fn both_sides_reflect_the_same_light() {
        // Stokes: a ray and its refracted ray from the other side have the same reflectance.
        for i in 1..=100 {
            let cos_i = i as f32 / 100.0;
            let (r, cos_t) = fresnel_dielectric(cos_i, 1.5);
            let (back, cos_back) = fresnel_dielectric(cos_t, 1.0 / 1.5);
            // Next to the critical angle an ulp of cos_t is 1e-5 of cos_i.
            assert!((r - back).abs() < 1e-4, "{cos_i}: {r} {back}");
            assert!((cos_i - cos_back).abs() < 2e-5);
        }
    }

    #[test]
    fn amplitudes_of_reflection_and_transmission_conserve_energy() {
        // T from the transmitted amplitudes of Fresnel's equations, independent of R.
        for eta in [1.0f64 / 1.5, 1.1, 1.5, 2.4] {
            for i in 1..=1000 {
                let ci = i as f64 / 1000.0;
                let ct2 = 1.0 - (1.0 - ci * ci) / (eta * eta);
                if ct2 <= 1e-6 {
                    continue;
                }
                let ct = ct2.sqrt();
                let ts = 2.0 * ci / (ci + eta * ct);
                let tp = 2.0 * ci / (eta * ci + ct);
                let t = 0.5 * eta * ct / ci * (ts * ts + tp * tp);
                let r = f64::from(fresnel_dielectric(ci as f32, eta as f32).0);
                assert!((r + t - 1.0).abs() < 2e-5, "eta {eta}, cos {ci}: {r} + {t}");
            }
        }
    }

    /// |r|^2 by complex arithmetic: an independent form of the conductor's equations.
    fn conductor_reference(ci: f64, eta: f64, k: f64) -> f64 {
        // n^2 - sin^2, and its principal root p + i q.
        let (re, im) = (eta * eta - k * k - (1.0 - ci * ci), 2.0 * eta * k);
        let modulus = re.hypot(im);
        let (p, q) = ((0.5 * (modulus + re)).sqrt(), (0.5 * (modulus - re)).sqrt());
        let ratio = |a: f64, b: f64, p: f64, q: f64| {
            ((a - p) * (a - p) + (b - q) * (b - q)) / ((a + p) * (a + p) + (b + q) * (b + q))
        };
        let s = ratio(ci, 0.0, p, q);
        let (nr, ni) = (eta * eta - k * k, 2.0 * eta * k);
        0.5 * (s + ratio(nr * ci, ni * ci, p, q))
    }

    #[test]
    fn conductor_matches_complex_arithmetic() {
        for (eta, k) in [(0.143, 3.98), (1.44, 1.6), (4.37, 5.2), (0.05, 4.0), (1.5, 0.0)] {
            for i in 0..=200 {
                let ci = i as f64 / 200.0;
                let value = fresnel_conductor(ci as f32, Rgb::splat(eta as f32), Rgb::splat(k as f32)).x;
                let expected = conductor_reference(ci, eta, k);
                assert!(
                    (f64::from(value) - expected).abs() < 3e-6,
                    "{eta} {k} {ci}: {value} {expected}"
                );
            }
        }
    }

    #[test]
    fn extreme_indices_are_finite_and_in_range() {
        for eta in [0.0, 1e-6, 1.0, 1.000_000_1, 100.0, 1e6] {
            for k in [0.0, 1e-6, 1.0, 1e6] {
                for cos in [0.0, 1e-20, 1e-4, 0.5, 0.999_999_94, 1.0] {
                    let c = fresnel_conductor(cos, Rgb::splat(eta), Rgb::splat(k)).x;
                    assert!((0.0..=1.0).contains(&c), "{eta} {k} {cos}: {c}");
                    if eta > 0.0 {
                        let (r, t) = fresnel_dielectric(cos, eta);
                        assert!((0.0..=1.0).contains(&r) && (0.0..=1.0).contains(&t));
                    }
                }
            }
        }
    }
}
