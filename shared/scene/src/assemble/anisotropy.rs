//! Microfacets that are rougher in one direction than in the other.

use super::texture::scalar;
use super::{Assets, Problem};
use crate::parse::{Fault, MaterialRecord, TangentName};
use crate::values::Spanned;
use beamfarm_render::world::bsdf::{Anisotropy, Stretch, Tangent};
use beamfarm_render::world::scalar::Scalar;

/// A material's anisotropy; `None` when all directions are alike.
pub(super) fn anisotropy(record: &MaterialRecord, assets: &mut Assets<'_>) -> Result<Option<Anisotropy>, Problem> {
    let [along, across] = [&record.alpha_u, &record.alpha_v];
    let stretch = match (along, across, &record.anisotropic, &record.anisotropy_strength) {
        (Some(along), Some(across), _, _) => {
            if let Some(alpha) = &record.alpha {
                let message = "the roughness is given by `alpha`, or by `alpha_u` and `alpha_v`: one of the two ways";
                return Err(Fault::new(alpha.span(), message).into());
            }
            let [along, across] = [scalar(along.get_ref(), assets)?, scalar(across.get_ref(), assets)?];
            let is_even = !along.varies() && !across.varies() && along.range() == across.range();
            (!is_even).then_some(Stretch::Across(across))
        }
        (Some(one), None, _, _) | (None, Some(one), _, _) => {
            let message = "expected both of `alpha_u` and `alpha_v`";
            return Err(Fault::new(one.span(), message).into());
        }
        (_, _, Some(_), Some(strength)) => {
            let message = "expected `anisotropic` or `anisotropy_strength`, not both";
            return Err(Fault::new(strength.span(), message).into());
        }
        (_, _, Some(anisotropic), None) => of_some(scalar(anisotropic.get_ref(), assets)?, Stretch::Burley),
        (_, _, None, Some(strength)) => of_some(scalar(strength.get_ref(), assets)?, Stretch::Strength),
        (None, None, None, None) => {
            let places = [
                record.anisotropic_rotation.as_ref().map(Spanned::span),
                record.tangent.as_ref().map(Spanned::span),
            ];
            return match places.into_iter().flatten().next() {
                None => Ok(None),
                Some(place) => {
                    let message = "it goes with a roughness that differs by direction, which is missing";
                    Err(Fault::new(place, message).into())
                }
            };
        }
    };
    let rotation = match &record.anisotropic_rotation {
        None => Scalar::constant(0.0),
        Some(rotation) => scalar(rotation.get_ref(), assets)?,
    };
    let tangent = match record.tangent.as_ref().map(Spanned::get_ref) {
        None | Some(TangentName::U) => Tangent::U,
        Some(TangentName::AroundX) => Tangent::Around(0),
        Some(TangentName::AroundY) => Tangent::Around(1),
        Some(TangentName::AroundZ) => Tangent::Around(2),
    };
    Ok(stretch.map(|stretch| Anisotropy {
        stretch,
        rotation,
        tangent,
    }))
}

fn of_some(scalar: Scalar, stretch: impl Fn(Scalar) -> Stretch) -> Option<Stretch> {
    (!scalar.is_zero()).then(|| stretch(scalar))
}

#[cfg(test)]
mod tests {
    use beamfarm_image::bundle::Bundle;
    use beamfarm_render::world::bsdf::{Anisotropy, BsdfFlags, Material, MaterialKind, Stretch, Tangent};

    fn load(material: &str) -> Result<Material, String> {
        let text = format!(
            "image = {{ width = 8, height = 6 }}\n\
             camera = {{ origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }}\n\
             [materials.m]\n{material}\n\
             [[lights]]\ntype = \"point\"\nposition = [0, 9, 0]\npower = 1\n\
             [[shapes]]\ntype = \"sphere\"\nmaterial = \"m\"\n"
        );
        let mut bundle = Bundle {
            scene: "a.toml".into(),
            ..Bundle::default()
        };
        bundle.files.insert("a.toml".into(), text.into());
        match crate::load(&bundle) {
            Ok(scene) => Ok(scene.materials[scene.objects[0].material as usize].clone()),
            Err(error) => Err(error.to_string()),
        }
    }

    fn metal(fields: &str) -> String {
        format!("type = \"rough_conductor\"\npreset = \"gold\"\n{fields}")
    }

    fn anisotropy(material: &str) -> Option<Anisotropy> {
        load(material).unwrap().anisotropy.clone().map(|found| *found)
    }

    #[test]
    fn all_ways_to_say_it() {
        let brushed = load(&metal("alpha_u = 0.4\nalpha_v = 0.05\nanisotropic_rotation = 0.25")).unwrap();
        let MaterialKind::RoughConductor { alpha, .. } = &brushed.kind else {
            panic!("{brushed:?}");
        };
        assert_eq!(alpha.range(), [0.4; 2]);
        // The mean alpha, 0.14, is wide enough for photons to be looked up.
        assert!(brushed.has(BsdfFlags::WIDE) && brushed.has(BsdfFlags::ALONG_U) && !brushed.has(BsdfFlags::FOLLOWED));
        let found = brushed.anisotropy.as_ref().unwrap();
        assert!(matches!(&found.stretch, Stretch::Across(alpha) if alpha.range() == [0.05; 2]));
        assert_eq!((found.rotation.range(), found.tangent), ([0.25; 2], Tangent::U));
        // A kind of surface that no other field marks as anisotropic.
        let principled = |fields: &str| anisotropy(&format!("type = \"principled\"\n{fields}"));
        let found = principled("anisotropic = 0.6\ntangent = \"around_y\"").unwrap();
        assert!(matches!(found.stretch, Stretch::Burley(x) if x.range() == [0.6; 2]));
        assert_eq!(found.tangent, Tangent::Around(1));
        let found = principled("anisotropy_strength = { checkerboard = [0.0, 0.6] }").unwrap();
        assert!(matches!(found.stretch, Stretch::Strength(x) if x.range() == [0.0, 0.6]));
        assert!(principled("anisotropic = 0").is_none() && principled("").is_none());
        assert!(anisotropy(&metal("alpha_u = 0.3\nalpha_v = 0.3\ntangent = \"u\"")).is_none());
        assert!(load(&metal("alpha_u = 3.0\nalpha_v = 0.3")).is_ok());
        assert!(load("type = \"rough_dielectric\"\nior = 1.5\nalpha_u = 0.1\nalpha_v = 0.3").is_ok());
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        let principled = |fields: &str| format!("type = \"principled\"\n{fields}");
        for (material, words) in [
            (metal("alpha_u = 0.1"), "both of `alpha_u` and `alpha_v`"),
            (
                metal("alpha = 0.1\nalpha_u = 0.1\nalpha_v = 0.2"),
                "one of the two ways",
            ),
            (metal("alpha = 0.1\ntangent = \"u\""), "which is missing"),
            (metal("alpha_u = 0.1\nalpha_v = 0"), "a roughness from 0.001 to 100"),
            (metal("alpha = 0.1\nanisotropic = 0.1"), "anisotropic"),
            (principled("anisotropic = 1.5"), "a number from 0 to 1"),
            (principled("anisotropic = 0.5\nanisotropy_strength = 0.5"), "not both"),
            (principled("anisotropic_rotation = 0.5"), "which is missing"),
            (principled("anisotropic = 0.5\ntangent = \"v\""), "around_z"),
        ] {
            let error = load(&material).unwrap_err();
            assert!(
                error.contains(words) && error.contains("a.toml:"),
                "{material}: {error}"
            );
        }
    }
}
