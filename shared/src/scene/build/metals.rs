//! Complex indices of refraction of metals.

use crate::math::Rgb;

/// Name, eta and k for linear sRGB, from Tungsten's table (Bitterli), which weighs measured spectra, those of Palik's
/// handbook among them, by the CIE 1931 observer.
const METALS: [(&str, [f32; 3], [f32; 3]); 10] = [
    (
        "aluminium",
        [1.6575, 0.8804, 0.5212],
        [9.2239, 6.2695, 4.8370],
    ),
    (
        "chromium",
        [4.3697, 2.9167, 1.6547],
        [5.2064, 4.2314, 3.7549],
    ),
    ("copper", [0.2004, 0.9240, 1.1022], [3.9129, 2.4528, 2.1422]),
    ("gold", [0.1431, 0.3750, 1.4425], [3.9832, 2.3857, 1.6032]),
    (
        "iridium",
        [3.0864, 2.0822, 1.6179],
        [5.5922, 4.0672, 3.2673],
    ),
    (
        "mercury",
        [2.3989, 1.4400, 0.9096],
        [6.3276, 4.3719, 3.4218],
    ),
    ("nickel", [2.3673, 1.6634, 1.4671], [4.4988, 3.0502, 2.3454]),
    (
        "rhodium",
        [2.5858, 1.8602, 1.5544],
        [6.7823, 4.7030, 3.9761],
    ),
    ("silver", [0.1553, 0.1167, 0.1384], [4.8283, 3.1222, 2.1470]),
    (
        "tungsten",
        [4.3707, 3.3003, 2.9983],
        [3.5007, 2.6049, 2.2732],
    ),
];

/// eta and k of a metal.
pub fn find(name: &str) -> Option<(Rgb, Rgb)> {
    let (_, eta, k) = METALS.iter().find(|metal| metal.0 == name)?;
    Some((Rgb::from_array(*eta), Rgb::from_array(*k)))
}

/// The names that [`find`] knows.
pub fn names() -> impl Iterator<Item = &'static str> {
    METALS.iter().map(|metal| metal.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reflectance at normal incidence against handbook colours of the polished metals.
    #[test]
    fn metals_have_their_colours() {
        let reflectance = |name| {
            let (eta, k) = find(name).unwrap();
            ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k)
        };
        for (name, expected) in [
            ("gold", [0.97, 0.80, 0.37]),
            ("silver", [0.97, 0.96, 0.91]),
            ("copper", [0.95, 0.62, 0.52]),
            ("aluminium", [0.93, 0.92, 0.92]),
        ] {
            let difference = (reflectance(name) - Rgb::from_array(expected))
                .abs()
                .max_element();
            assert!(difference < 0.05, "{name}: {}", reflectance(name));
        }
    }
}
