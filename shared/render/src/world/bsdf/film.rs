//! A film as thin as the wavelengths of light, whose colours depend on the angle: L. Belcour, P. Barla, A practical
//! extension to microfacet theory for the modeling of varying iridescence, 2017. Reflectances are for unpolarised
//! light.

use super::BsdfFlags;
use crate::math::Rgb;
use crate::world::fresnel::fresnel_dielectric;
use crate::world::scalar::Scalar;
use crate::world::spectrum::observer::{FIRST, OBSERVER, STEP};
use crate::world::texture::TexturePoint;
use std::sync::OnceLock;

/// A film over a surface.
#[derive(Clone, Debug)]
pub struct ThinFilm {
    /// Share of the surface that has the film, from 0 to 1.
    pub weight: Scalar,
    /// Micrometres.
    pub thickness: Scalar,
    /// Index of refraction over the one outside, at least 1.
    pub eta: f32,
}

impl ThinFilm {
    pub(super) fn reads(&self) -> BsdfFlags {
        BsdfFlags::reading([self.weight.texture(), self.thickness.texture()])
    }

    pub(super) fn at(&self, at: &TexturePoint) -> Film {
        Film {
            weight: self.weight.eval(at),
            thickness: 1000.0 * self.thickness.eval(at).max(0.0),
            eta: self.eta,
        }
    }
}

/// A film, looked up at a hit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Film {
    pub weight: f32,
    /// Nanometres.
    thickness: f32,
    eta: f32,
}

/// Orders of interference that are summed. Higher ones add less than 0.006 of white, on strong reflectors at grazing
/// angles.
const ORDERS: u32 = 6;
/// Above this reflectance a surface is no dielectric.
const MOST: f32 = 0.9999;

impl Film {
    /// Reflectance of a surface with the film over it, for light at this cosine, from 0 to 1. `normal`: its reflectance
    /// at normal incidence without the film, as if it were a dielectric.
    pub fn reflectance(&self, cos: f32, normal: Rgb) -> Rgb {
        let cos = cos.clamp(0.0, 1.0);
        let eta = self.eta;
        let (first, within) = fresnel_dielectric(cos, eta);
        let path = 2.0 * eta * self.thickness * within;
        let of_base = |normal: f32| {
            let root = normal.clamp(0.0, MOST).sqrt();
            let base = (1.0 + root) / (1.0 - root);
            let second = fresnel_dielectric(within, base / eta).0;
            // Reflection at a denser medium inverts the wave; reflection back from within the film never does.
            interfered([first, second], path, base > eta)
        };
        if normal.x == normal.y && normal.y == normal.z {
            return of_base(normal.x);
        }
        Rgb::new(of_base(normal.x).x, of_base(normal.y).y, of_base(normal.z).z)
    }
}

/// Reflectance of both sides of a film together, for a white source. `path`: extra path length of the second
/// reflection, nanometres.
fn interfered([first, second]: [f32; 2], path: f32, is_turned: bool) -> Rgb {
    let both = (first * second).min(MOST);
    let through = (1.0 - first) * (1.0 - first);
    let further = through * second / (1.0 - both);
    let mut light = Rgb::splat(first + further);
    // At the first side, seen from within, a wave keeps its sign; at the second, denser one it is inverted.
    let root = both.sqrt();
    let mut amplitude = further - (1.0 - first);
    for order in 1..=ORDERS {
        amplitude *= root;
        let turned = is_turned && order % 2 == 1;
        let sign = if turned { -1.0 } else { 1.0 };
        light += in_step(order as f32 * path) * (2.0 * amplitude * sign);
    }
    light.clamp(Rgb::ZERO, Rgb::ONE)
}

/// Step of the tabulated path lengths, nanometres, and their number: beyond the last, no wave is in phase.
const WAY: f64 = 5.0;
const WAYS: usize = 2001;

/// Coherence of daylight's red, green and blue after a path of this many nanometres: the Fourier transforms of the CIE
/// 1931 observer's response, one at zero path.
fn in_step(path: f32) -> Rgb {
    static TABLE: OnceLock<Vec<Rgb>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let white = rgb_after(0.0);
        let of_way = |i: usize| {
            let rgb = rgb_after(WAY * i as f64);
            Rgb::from_array(std::array::from_fn(|c| (rgb[c] / white[c]) as f32))
        };
        (0..WAYS).map(of_way).collect()
    });
    let x = path / WAY as f32;
    let first = x as usize;
    match (table.get(first), table.get(first + 1)) {
        (Some(here), Some(next)) => *here + (*next - *here) * (x - first as f32),
        _ => Rgb::ZERO,
    }
}

/// Daylight in linear sRGB, each wave times the cosine of its phase after a path.
fn rgb_after(path: f64) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    for (i, row) in OBSERVER.iter().enumerate() {
        let phase = 2.0 * std::f64::consts::PI * path / (FIRST + STEP * i as f64);
        let light = row[3] * libm::cos(phase);
        for (sum, matching) in xyz.iter_mut().zip(row) {
            *sum += matching * light;
        }
    }
    linear_srgb(xyz)
}

/// IEC 61966-2-1.
fn linear_srgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Interfering daylight of all wavelengths, seen by the CIE 1931 observer, in linear sRGB.
    fn by_waves(film: &Film, cos: f64, normal: f64) -> [f64; 3] {
        let (eta, thickness) = (f64::from(film.eta), f64::from(film.thickness));
        let fresnel = |cos: f64, eta: f64| {
            let within = (1.0 - (1.0 - cos * cos) / (eta * eta)).sqrt();
            let s = (cos - eta * within) / (cos + eta * within);
            let p = (eta * cos - within) / (eta * cos + within);
            (0.5 * (s * s + p * p), within)
        };
        let (first, within) = fresnel(cos, eta);
        let base = (1.0 + normal.sqrt()) / (1.0 - normal.sqrt());
        let second = fresnel(within, base / eta).0;
        let sign = if base > eta { 1.0 } else { -1.0 };
        let (mut xyz, mut white) = ([0.0; 3], 0.0);
        for (i, row) in OBSERVER.iter().enumerate() {
            let wavelength = FIRST + STEP * i as f64;
            let phase = TAU * 2.0 * eta * thickness * within / wavelength;
            let a = sign * (first * second).sqrt();
            // Airy's sum for waves whose squared amplitudes are the reflectances.
            let crossed = 2.0 * a * libm::cos(phase);
            let reflectance = (first + second + crossed) / (1.0 + first * second + crossed);
            for (sum, matching) in xyz.iter_mut().zip(row) {
                *sum += reflectance * matching * row[3];
            }
            white += row[1] * row[3];
        }
        linear_srgb(xyz.map(|sum| sum / white))
    }

    #[test]
    fn films_have_the_colours_of_their_waves() {
        for normal in [0.02f32, 0.04, 0.3, 0.9] {
            for thickness in [20.0f32, 100.0, 200.0, 350.0, 500.0, 800.0, 1500.0] {
                for cos in [0.2f32, 0.5, 1.0] {
                    let film = Film {
                        weight: 1.0,
                        thickness,
                        eta: 1.33,
                    };
                    let expected = by_waves(&film, f64::from(cos), f64::from(normal));
                    let found = film.reflectance(cos, Rgb::splat(normal)).to_array().map(f64::from);
                    // Colours outside the gamut are clamped.
                    for (a, b) in found.iter().zip(expected.map(|x| x.clamp(0.0, 1.0))) {
                        assert!(
                            (a - b).abs() < 6e-3,
                            "{normal} {thickness} {cos}: {found:?} {expected:?}"
                        );
                    }
                }
            }
        }
    }
}
