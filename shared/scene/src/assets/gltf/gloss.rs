//! KHR_materials_pbrSpecularGlossiness by the usual conversion: the metal that has the same colours where light comes
//! from in front.
//!
//! Source: the conversion in the Khronos Group's examples for that extension.

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC: f64 = 0.04;
/// Nothing is divided by less.
const LEAST: f64 = 1e-6;

/// How metallic a surface is, of its diffuse and specular colours.
pub fn metallic(diffuse: [f64; 3], specular: [f64; 3]) -> f64 {
    let [d, s] = [diffuse, specular].map(brightness);
    if s < DIELECTRIC {
        return 0.0;
    }
    let strength = specular.into_iter().fold(0.0, f64::max);
    let b = d * (1.0 - strength) / (1.0 - DIELECTRIC) + s - 2.0 * DIELECTRIC;
    let root = (b * b - 4.0 * DIELECTRIC * (DIELECTRIC - s)).max(0.0).sqrt();
    ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

/// Its base colour.
pub fn base_color(diffuse: [f64; 3], specular: [f64; 3], metallic: f64) -> [f64; 3] {
    let strength = specular.into_iter().fold(0.0, f64::max);
    let share = metallic * metallic;
    std::array::from_fn(|c| {
        let of_base = diffuse[c] * (1.0 - strength) / (1.0 - DIELECTRIC) / (1.0 - metallic).max(LEAST);
        let of_metal = (specular[c] - DIELECTRIC * (1.0 - metallic)) / metallic.max(LEAST);
        (of_base * (1.0 - share) + of_metal * share).clamp(0.0, 1.0)
    })
}

/// As bright as the eye takes a colour to be, of the squares of its channels.
fn brightness([r, g, b]: [f64; 3]) -> f64 {
    (0.299 * r * r + 0.587 * g * g + 0.114 * b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectrics_and_metals_come_back() {
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        // A dielectric has a diffuse colour, and reflects 4 %.
        let red = [0.6, 0.1, 0.2];
        assert_eq!(metallic(red, [0.04; 3]), 0.0);
        assert!(near(base_color(red, [0.04; 3], 0.0), red));
        // Gold has none.
        let gold = [1.0, 0.77, 0.34];
        assert!(metallic([0.0; 3], gold) > 0.999);
        assert!(near(base_color([0.0; 3], gold, 1.0), gold));
    }
}
