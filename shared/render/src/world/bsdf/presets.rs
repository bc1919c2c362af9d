//! Named conductors.

use crate::math::Rgb;

struct Preset {
    name: &'static str,
    /// Mitsuba's name for the same values.
    symbol: &'static str,
    eta: [f32; 3],
    k: [f32; 3],
}

const fn preset(name: &'static str, symbol: &'static str, eta: [f32; 3], k: [f32; 3]) -> Preset {
    Preset { name, symbol, eta, k }
}

/// Measured spectra (luxpop.com, and Palik 1985 via SOPRA), projected onto linear sRGB with the CIE 1931 observer. The
/// values are those that Mitsuba 3 derives from its tables in its RGB variants, to four digits.
const PRESETS: &[Preset] = &[
    preset("aluminium", "Al", [1.6575, 0.8804, 0.5212], [9.2238, 6.2695, 4.8370]),
    preset("beryllium", "Be", [4.1850, 3.1850, 2.7841], [3.8355, 3.0101, 2.8690]),
    preset("chromium", "Cr", [4.3697, 2.9165, 1.6549], [5.2065, 4.2313, 3.7547]),
    preset("copper", "Cu", [0.2010, 0.9237, 1.1022], [3.9133, 2.4530, 2.1421]),
    preset("gold", "Au", [0.1430, 0.3753, 1.4420], [3.9830, 2.3856, 1.6034]),
    preset("iridium", "Ir", [3.0863, 2.0822, 1.6179], [5.5922, 4.0671, 3.2673]),
    preset("lithium", "Li", [0.2658, 0.1956, 0.2209], [3.5402, 2.3111, 1.6686]),
    preset("mercury", "Hg", [2.3989, 1.4400, 0.9096], [6.3276, 4.3719, 3.4218]),
    preset("molybdenum", "Mo", [4.4840, 3.5251, 2.7763], [4.1114, 3.4208, 3.1506]),
    preset("nickel", "Ni_palik", [2.3673, 1.6634, 1.4671], [4.4988, 3.0502, 2.3454]),
    preset("niobium", "Nb", [3.4201, 2.7901, 2.3956], [3.4414, 2.7377, 2.5797]),
    preset("potassium", "K", [0.0640, 0.0464, 0.0382], [2.1042, 1.3489, 0.9131]),
    preset("rhodium", "Rh", [2.5858, 1.8602, 1.5543], [6.7823, 4.7030, 3.9761]),
    preset("silver", "Ag", [0.1553, 0.1167, 0.1384], [4.8284, 3.1222, 2.1469]),
    preset("sodium", "Na_palik", [0.0603, 0.0561, 0.0620], [3.1793, 2.1125, 1.5790]),
    preset("tantalum", "Ta", [2.0627, 2.3929, 2.6279], [2.4084, 1.7415, 1.9470]),
    preset(
        "titanium nitride",
        "TiN",
        [1.6484, 1.1505, 1.3798],
        [3.3683, 1.9435, 1.1021],
    ),
    preset("tungsten", "W", [4.3708, 3.3002, 2.9984], [3.5006, 2.6049, 2.2732]),
    preset(
        "vanadium",
        "V_palik",
        [4.2776, 3.5129, 2.7611],
        [3.4913, 2.8895, 3.1115],
    ),
];

/// Complex index of refraction `(eta, k)` of a conductor for linear sRGB, by its English name or by Mitsuba's (the
/// chemical symbol).
pub fn conductor_preset(name: &str) -> Option<(Rgb, Rgb)> {
    PRESETS
        .iter()
        .find(|p| p.name == name || p.symbol == name)
        .map(|p| (Rgb::from(p.eta), Rgb::from(p.k)))
}

/// The English names that [`conductor_preset`] knows, in alphabetical order.
pub fn conductor_names() -> impl Iterator<Item = &'static str> {
    PRESETS.iter().map(|p| p.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::bsdf::fresnel_conductor;

    #[test]
    fn every_name_is_known_and_sorted() {
        let names: Vec<_> = conductor_names().collect();
        assert!(names.is_sorted());
        for name in names {
            assert!(conductor_preset(name).is_some());
        }
        assert_eq!(conductor_preset("Au"), conductor_preset("gold"));
        assert_eq!(conductor_preset("unobtainium"), None);
    }

    #[test]
    fn metals_have_their_colours() {
        let reflectance = |name| {
            let (eta, k) = conductor_preset(name).unwrap();
            fresnel_conductor(1.0, eta, k)
        };
        let gold = reflectance("gold");
        assert!(gold.x > 0.93 && gold.y < 0.85 && gold.z < 0.45);
        assert!(reflectance("silver").min_element() > 0.88);
        let aluminium = reflectance("aluminium");
        assert!(aluminium.min_element() > 0.91 && aluminium.max_element() < 0.93);
        let copper = reflectance("copper");
        assert!(copper.x > 0.9 && copper.y < 0.7 && copper.z < 0.6);
    }
}
