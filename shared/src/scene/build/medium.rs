//! Media and their names.

use super::unknown_name;
use crate::math::Rgb;
use crate::medium::{Homogeneous, MediumId};
use crate::phase::Phase;
use crate::scene::parse::{Fault, MediumKind, MediumRecord, PhaseRecord};
use std::collections::BTreeMap;
use toml::Spanned;

/// The scene's media, in the order of their names.
pub struct Media {
    pub list: Vec<Homogeneous>,
    names: Vec<String>,
}

impl Media {
    pub fn new(records: &BTreeMap<Spanned<String>, MediumRecord>) -> Result<Self, Fault> {
        let mut media = Self {
            list: Vec::new(),
            names: Vec::new(),
        };
        for (name, record) in records {
            if name.get_ref() == "none" {
                return Err(Fault::new(
                    name.span(),
                    "the name \"none\" stands for vacuum; choose another",
                ));
            }
            if media.list.len() == usize::from(u16::MAX) {
                return Err(Fault::new(name.span(), "more than 65535 media"));
            }
            media.list.push(match record.kind.get_ref() {
                MediumKind::Homogeneous => homogeneous(record)?,
            });
            media.names.push(name.get_ref().clone());
        }
        Ok(media)
    }

    /// The medium of a name; "none" is vacuum.
    pub fn resolve(&self, name: &Spanned<String>) -> Result<MediumId, Fault> {
        if name.get_ref() == "none" {
            return Ok(None);
        }
        match self.names.binary_search(name.get_ref()) {
            Ok(index) => Ok(Some(index as u16)),
            Err(_) => {
                let known = self.names.iter().map(String::as_str).chain(["none"]);
                Err(unknown_name("medium", name, known))
            }
        }
    }

    /// The medium of a name, or another where there is no name.
    pub fn resolve_or(
        &self,
        name: Option<&Spanned<String>>,
        default: MediumId,
    ) -> Result<MediumId, Fault> {
        name.map_or(Ok(default), |name| self.resolve(name))
    }

    /// For messages.
    pub fn name(&self, medium: MediumId) -> &str {
        medium.map_or("none", |index| &self.names[usize::from(index)])
    }
}

fn homogeneous(record: &MediumRecord) -> Result<Homogeneous, Fault> {
    let (sigma_a, sigma_s) = match (
        &record.sigma_a,
        &record.sigma_s,
        &record.sigma_t,
        &record.albedo,
    ) {
        (Some(sigma_a), Some(sigma_s), None, None) => (sigma_a.get_ref().0, sigma_s.get_ref().0),
        (None, None, Some(sigma_t), Some(albedo)) => {
            let (sigma_t, albedo) = (sigma_t.get_ref().0, albedo.get_ref().0);
            let scattered = std::array::from_fn(|c| sigma_t[c] * albedo[c]);
            (
                std::array::from_fn(|c| sigma_t[c] - scattered[c]),
                scattered,
            )
        }
        (sigma_a, sigma_s, sigma_t, albedo) => {
            let spans = [sigma_t, sigma_a, sigma_s].map(|f| f.as_ref().map(|f| f.span()));
            let first = spans
                .into_iter()
                .flatten()
                .next()
                .or(albedo.as_ref().map(|f| f.span()));
            return Err(Fault::new(
                first.unwrap_or(record.kind.span()),
                "a medium is given by `sigma_a` and `sigma_s`, or by `sigma_t` and `albedo`: both of a pair, and never mixed",
            ));
        }
    };
    let single = |sigma: [f64; 3]| Rgb::from_array(sigma.map(|x| x as f32));
    let medium = Homogeneous {
        sigma_a: single(sigma_a),
        sigma_s: single(sigma_s),
        phase: match record.phase {
            PhaseRecord::Isotropic => Phase::Isotropic,
            PhaseRecord::HenyeyGreenstein(g) => Phase::HenyeyGreenstein { g: g.f32() },
        },
    };
    if !medium.sigma_t().is_finite() {
        return Err(Fault::new(
            record.kind.span(),
            "its extinction is too large for single precision",
        ));
    }
    Ok(medium)
}
