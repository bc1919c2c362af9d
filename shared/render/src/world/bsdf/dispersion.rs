//! Indices of refraction that depend on the wavelength.

use crate::world::spectrum::VISIBLE;

/// An index of refraction by wavelength, relative to vacuum (air is treated as vacuum).
#[derive(Clone, Debug, PartialEq)]
pub enum Index {
    /// The same for all wavelengths.
    Constant(f64),
    /// n = a + b / l², with the wavelength l in micrometres (Cauchy).
    Cauchy {
        /// Limit at long wavelengths.
        a: f64,
        /// Micrometres squared.
        b: f64,
    },
    /// n² - 1 = sum of b l² / (l² - c), with the wavelength l and the square root of c in micrometres (Sellmeier).
    Sellmeier(Vec<[f64; 2]>),
}

/// Wavelength of the helium d line, nm, at which indices are quoted.
pub const LINE_D: f64 = 587.561_8;
/// Wavelength of the hydrogen F line, nm.
pub const LINE_F: f64 = 486.132_7;
/// Wavelength of the hydrogen C line, nm.
pub const LINE_C: f64 = 656.281_6;

impl Index {
    /// At a wavelength in nm. NaN where the formula has no value.
    pub fn at(&self, nm: f64) -> f64 {
        let l2 = nm * nm * 1e-6;
        match self {
            Self::Constant(index) => *index,
            Self::Cauchy { a, b } => a + b / l2,
            Self::Sellmeier(terms) => {
                let sum: f64 = terms.iter().map(|[b, c]| b * l2 / (l2 - c)).sum();
                (1.0 + sum).sqrt()
            }
        }
    }

    /// From the index at the d line and the Abbe number (n_d - 1) / (n_F - n_C): Cauchy's formula through both.
    pub fn of_abbe(nd: f64, abbe: f64) -> Self {
        let per_b = |nm: f64| 1e6 / (nm * nm);
        let b = (nd - 1.0) / abbe / (per_b(LINE_F) - per_b(LINE_C));
        Self::Cauchy {
            a: nd - b * per_b(LINE_D),
            b,
        }
    }

    /// The index of a named substance.
    pub fn preset(name: &str) -> Option<Self> {
        let substance = SUBSTANCES.iter().find(|substance| substance.name == name)?;
        Some(Self::Sellmeier(substance.terms.to_vec()))
    }

    /// A visible wavelength, nm, at which the index is no number from 1e-3 to 1e3; `None` if there is none.
    pub fn flaw(&self) -> Option<f64> {
        let [first, last] = VISIBLE;
        let steps = (last - first) as u32;
        (0..=steps)
            .map(|step| first + f64::from(step))
            .find(|nm| !(1e-3..=1e3).contains(&self.at(*nm)))
    }
}

/// How a boundary between two substances bends light of each wavelength.
#[derive(Clone, Debug, PartialEq)]
pub struct Dispersion {
    /// On the side that the geometric normal points away from.
    pub inside: Index,
    /// On the side that it points to.
    pub outside: Index,
}

impl Dispersion {
    /// Index inside over the one outside at a wavelength in nm.
    pub fn eta(&self, nm: f64) -> f32 {
        (self.inside.at(nm) / self.outside.at(nm)) as f32
    }
}

struct Substance {
    name: &'static str,
    terms: &'static [[f64; 2]],
}

/// Sellmeier coefficients, ordered by name.
const SUBSTANCES: &[Substance] = &[
    // Sultanova, Kasarova, Nikolov 2009, Dispersion properties of optical polymers (20 °C).
    Substance {
        name: "acrylic",
        terms: &[[1.1819, 0.011_313]],
    },
    // Schott's catalogue of optical glass (N-BK7).
    Substance {
        name: "bk7",
        terms: &[
            [1.039_612_12, 0.006_000_698_67],
            [0.231_792_344, 0.020_017_914_4],
            [1.010_469_45, 103.560_653],
        ],
    },
    // Peter 1923, Über Brechungsindizes und Absorptionskonstanten des Diamanten.
    Substance {
        name: "diamond",
        terms: &[[0.3306, 0.175 * 0.175], [4.3356, 0.106 * 0.106]],
    },
    // Malitson 1965, Interspecimen comparison of the refractive index of fused silica.
    Substance {
        name: "fused silica",
        terms: &[
            [0.696_166_3, 0.068_404_3 * 0.068_404_3],
            [0.407_942_6, 0.116_241_4 * 0.116_241_4],
            [0.897_479_4, 9.896_161 * 9.896_161],
        ],
    },
    // Sultanova, Kasarova, Nikolov 2009.
    Substance {
        name: "polycarbonate",
        terms: &[[1.4182, 0.021_304]],
    },
    // Sultanova, Kasarova, Nikolov 2009.
    Substance {
        name: "polystyrene",
        terms: &[[1.4435, 0.020_216]],
    },
    // Malitson and Dodge 1972, Refractive index and birefringence of synthetic sapphire (the ordinary ray).
    Substance {
        name: "sapphire",
        terms: &[
            [1.431_349_3, 0.072_663_1 * 0.072_663_1],
            [0.650_547_13, 0.119_324_2 * 0.119_324_2],
            [5.341_402_1, 18.028_251 * 18.028_251],
        ],
    },
    // Schott's catalogue of optical glass.
    Substance {
        name: "sf10",
        terms: &[
            [1.616_259_77, 0.012_753_455_9],
            [0.259_229_334, 0.058_198_395_4],
            [1.077_623_17, 116.607_68],
        ],
    },
    // Schott's catalogue of optical glass.
    Substance {
        name: "sf11",
        terms: &[
            [1.737_596_95, 0.013_188_707],
            [0.313_747_346, 0.062_306_814_2],
            [1.898_781_01, 155.236_29],
        ],
    },
    // Daimon and Masumura 2007, Measurement of the refractive index of distilled water (20 °C).
    Substance {
        name: "water",
        terms: &[
            [0.568_402_756_5, 0.005_101_829_712],
            [0.172_617_739_1, 0.018_211_539_36],
            [0.020_861_895_78, 0.026_207_222_93],
            [0.113_074_868_8, 10.697_927_21],
        ],
    },
];

/// The names that [`Index::preset`] knows, in alphabetical order.
pub fn index_names() -> impl Iterator<Item = &'static str> {
    SUBSTANCES.iter().map(|substance| substance.name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Index at the d line and Abbe number, against the sources' own tables.
    #[test]
    fn substances_have_the_indices_of_catalogues() {
        for (name, nd, abbe) in [
            ("acrylic", 1.4906, 53.2),
            ("bk7", 1.5168, 64.17),
            ("diamond", 2.4175, 55.3),
            ("fused silica", 1.45846, 67.82),
            ("polycarbonate", 1.5848, 27.9),
            ("polystyrene", 1.5916, 29.5),
            ("sapphire", 1.76817, 72.3),
            ("sf10", 1.72825, 28.41),
            ("sf11", 1.78472, 25.68),
            ("water", 1.33340, 55.8),
        ] {
            let index = Index::preset(name).unwrap();
            let [d, f, c] = [LINE_D, LINE_F, LINE_C].map(|nm| index.at(nm));
            let found = (d - 1.0) / (f - c);
            assert!((d - nd).abs() < 3e-4, "{name}: {d}");
            assert!((found - abbe).abs() < 0.02 * abbe, "{name}: {found}");
            assert_eq!(index.flaw(), None);
        }
        assert_eq!(index_names().count(), SUBSTANCES.len());
        assert!(index_names().is_sorted());
    }

    #[test]
    fn an_abbe_number_gives_the_formula_that_has_it() {
        let index = Index::of_abbe(1.6, 40.0);
        let [d, f, c] = [LINE_D, LINE_F, LINE_C].map(|nm| index.at(nm));
        assert!((d - 1.6).abs() < 1e-12);
        assert!(((d - 1.0) / (f - c) - 40.0).abs() < 1e-9);
    }

    #[test]
    fn formulas_without_a_value_are_found() {
        assert!(Index::Sellmeier(vec![[1.0, 0.25]]).flaw().is_some());
        assert!(Index::Cauchy { a: 0.5, b: -0.1 }.flaw().is_some());
        assert_eq!(Index::Constant(1.5).flaw(), None);
    }
}
