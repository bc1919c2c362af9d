//! What surfaces are made of, as `kernels/bsdf.wgsl` has it.

use super::reason::{Of, Reason, Why};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{
    self, Bsdf, BsdfFlags, MaterialDescription, MaterialKind, NormalPerturbation, Tint,
};
use beamfarm_render::world::geometry::Object;
use beamfarm_render::world::texture::{Texture, TexturePoint};
use bytemuck::{Pod, Zeroable};

const BLACK: u32 = 0;
const DIFFUSE: u32 = 1;
const DIELECTRIC: u32 = 2;
const THIN_DIELECTRIC: u32 = 3;
const CONDUCTOR: u32 = 4;
const MIRROR: u32 = 5;
const NULL: u32 = 6;

/// A material, of which all that is not used is zero.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Material {
    /// Factor on what is reflected: the albedo of diffuse ones. Where it varies, that at no place in particular.
    pub reflectance: [f32; 3],
    /// Black, diffuse, dielectric, thin dielectric, conductor, mirror, null: 0 to 6.
    pub kind: u32,
    /// Factor on what is transmitted.
    pub transmittance: [f32; 3],
    /// 1, or 0 where the side that the shading normal points away from is black.
    pub two_sided: u32,
    /// Real part of the index; of dielectrics the index inside over the one outside, three times.
    pub eta: [f32; 3],
    padding: u32,
    /// Imaginary part.
    pub k: [f32; 3],
    padding_2: u32,
}

impl Material {
    /// Of what the renderer finds at a hit; none where kernels have nothing like it.
    #[must_use]
    pub fn new(bsdf: &Bsdf<'_>) -> Option<Self> {
        let of = |kind: u32, reflectance: Rgb, two_sided: bool| Self {
            reflectance: reflectance.to_array(),
            kind,
            two_sided: two_sided.into(),
            ..Self::zeroed()
        };
        let dielectric = |kind: u32, b: &bsdf::Dielectric| Self {
            transmittance: b.transmittance.to_array(),
            eta: [b.eta; 3],
            ..of(kind, b.reflectance, true)
        };
        Some(match bsdf {
            Bsdf::Black => of(BLACK, Rgb::ZERO, true),
            Bsdf::Diffuse { reflectance, two_sided } => of(DIFFUSE, *reflectance, *two_sided),
            Bsdf::Dielectric(b) => dielectric(DIELECTRIC, b),
            Bsdf::ThinDielectric(b) => dielectric(THIN_DIELECTRIC, b),
            Bsdf::Conductor {
                eta,
                k,
                reflectance,
                two_sided,
            } => Self {
                eta: eta.to_array(),
                k: k.to_array(),
                ..of(CONDUCTOR, *reflectance, *two_sided)
            },
            Bsdf::Mirror { reflectance, two_sided } => of(MIRROR, *reflectance, *two_sided),
            Bsdf::Null => of(NULL, Rgb::ZERO, true),
            Bsdf::RoughConductor { .. }
            | Bsdf::RoughDielectric(_)
            | Bsdf::Plastic(_)
            | Bsdf::RoughPlastic(_)
            | Bsdf::Principled(_)
            | Bsdf::Layered(_) => return None,
        })
    }
}

/// A scene's materials by their numbers; what no object is made of is black. Reasons are added to the list.
pub(super) fn flatten(description: &SceneDescription, reasons: &mut Vec<Reason>) -> Vec<Material> {
    // By material: the first object that is made of it.
    let mut users = vec![None; description.materials.len()];
    for object in &description.objects {
        users[object.material as usize].get_or_insert(object);
    }
    let flat = |((number, material), user): ((u32, &bsdf::Material), &Option<&Object>)| {
        let Some(object) = user else {
            return Material::zeroed();
        };
        let of = match description.material_names.get(&number) {
            Some(name) => Of::Material(name.clone()),
            None => Of::Object(object.name.clone()),
        };
        let missing = missing(material);
        reasons.extend(missing.into_iter().map(|(field, what)| Reason {
            of: of.clone(),
            field,
            why: Why::Missing(what),
        }));
        let bsdf = match &material.kind {
            // What is black at one place is not so at all.
            MaterialKind::Diffuse { reflectance } if !matches!(reflectance, Texture::Constant(_)) => Bsdf::Diffuse {
                reflectance: Rgb::ONE,
                two_sided: material.two_sided,
            },
            _ => material.bsdf(&TexturePoint::default()),
        };
        Material::new(&bsdf).unwrap_or(Material::zeroed())
    };
    (0..).zip(&description.materials).zip(&users).map(flat).collect()
}

type Missing = (&'static str, &'static str);

/// Fields, and what of them kernels do not have.
fn missing(material: &bsdf::Material) -> Vec<Missing> {
    let MaterialDescription {
        kind,
        two_sided: _,
        opacity,
        normal_perturbation,
        dispersion,
        index_outside: _,
    } = &**material;
    let mut all = missing_of_kind(kind, material.has(BsdfFlags::REFRACTS));
    if opacity.is_some() {
        all.push(("opacity", "surfaces that are met by chance"));
    }
    match normal_perturbation {
        None => {}
        Some(NormalPerturbation::BumpMap { .. }) => all.push(("bump", "bump maps")),
        Some(NormalPerturbation::NormalMap(_)) => all.push(("normal_map", "normal maps")),
    }
    if dispersion.is_some() {
        all.push(("ior", "light of single wavelengths"));
    }
    all
}

fn missing_of_kind(kind: &MaterialKind, refracts: bool) -> Vec<Missing> {
    let reflected = |field: &'static str, texture: &Texture| match texture {
        Texture::Constant(_) | Texture::Image { .. } | Texture::Checkerboard { .. } => None,
        Texture::VertexColors(_) => Some((field, "colours of vertices")),
    };
    let transmitted = |field: &'static str, texture: &Texture| match texture {
        Texture::Constant(_) => None,
        Texture::Image { .. } => Some((field, "images of what surfaces let through")),
        Texture::Checkerboard { .. } => Some((field, "checkerboards of what surfaces let through")),
        Texture::VertexColors(_) => Some((field, "colours of vertices")),
    };
    let tinted = |tint: &Tint| {
        let Tint {
            reflectance,
            transmittance,
        } = tint;
        [
            reflected("specular_reflectance", reflectance),
            transmitted("specular_transmittance", transmittance),
        ]
    };
    let no = |what: &'static str| vec![("type", what)];
    match kind {
        MaterialKind::Diffuse { reflectance }
        | MaterialKind::Mirror { reflectance }
        | MaterialKind::Conductor {
            reflectance,
            eta: _,
            k: _,
        } => reflected("reflectance", reflectance).into_iter().collect(),
        MaterialKind::Dielectric { tint, eta: _ } | MaterialKind::ThinDielectric { tint, eta: _ } => {
            tinted(tint).into_iter().flatten().collect()
        }
        MaterialKind::Null => Vec::new(),
        MaterialKind::RoughConductor { .. } => no("rough conductors"),
        MaterialKind::RoughDielectric { .. } => no("rough dielectrics"),
        MaterialKind::Plastic { .. } => no("plastics"),
        MaterialKind::RoughPlastic { .. } => no("rough plastics"),
        MaterialKind::Principled { .. } if refracts => no("principled surfaces that light goes through"),
        MaterialKind::Principled { .. } => no("principled surfaces"),
        MaterialKind::Blend { .. } => no("blends"),
    }
}
