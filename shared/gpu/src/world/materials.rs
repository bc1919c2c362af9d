//! Materials of surfaces, as in `kernels/bsdf.wgsl` and `kernels/interaction.wgsl`.

use super::reason::{Of, Reason, Why};
use super::textures::{Field, FlatTextures};
use super::used::{used, users, with_parts};
use super::waves;
use crate::kernels::{NEEDS_COLORS, Needs};
use beamfarm_render::math::Rgb;
use beamfarm_render::world::SceneDescription;
use beamfarm_render::world::bsdf::{
    self, Bsdf, Dispersion, Distribution, Extras, Interface, MAX_INDEX, MaterialDescription, MaterialKind,
    NormalPerturbation, Stretch, Tint,
};
use beamfarm_render::world::scalar::Scalar;
use beamfarm_render::world::texture::{Texture, TexturePoint};
use bytemuck::{Pod, Zeroable};

const BLACK: u32 = 0;
const DIFFUSE: u32 = 1;
const DIELECTRIC: u32 = 2;
const THIN_DIELECTRIC: u32 = 3;
const CONDUCTOR: u32 = 4;
const MIRROR: u32 = 5;
const NULL: u32 = 6;
const ROUGH_CONDUCTOR: u32 = 7;
const ROUGH_DIELECTRIC: u32 = 8;
const PLASTIC: u32 = 9;
const ROUGH_PLASTIC: u32 = 10;
const PRINCIPLED: u32 = 11;
const LAYERED: u32 = 12;

const TWO_SIDED: u32 = 1;
const IS_BECKMANN: u32 = 1 << 1;
const IS_NONLINEAR: u32 = 1 << 2;
const LETS_THROUGH: u32 = 1 << 3;
const ALL_LOBES: u32 = 0b111 << 4;
const BY_SPECULAR: u32 = 1 << 7;
const BOUNCES: u32 = 1 << 8;
const KEEPS_ENERGY: u32 = 1 << 9;

const HAS_OPACITY: u32 = 1;
const IS_BLEND: u32 = 1 << 1;
const HAS_BUMP_MAP: u32 = 1 << 2;
const HAS_NORMAL_MAP: u32 = 1 << 3;
const REFLECTS_UPWARDS: u32 = 1 << 4;
const ROW_BITS: u32 = 8;

const NEEDS_BECKMANN: u32 = 1 << 16;
const NEEDS_CHANCE: u32 = 1 << 17;
const NEEDS_MAPS: u32 = 1 << 18;
/// Bit 19 is [`NEEDS_COLORS`].
const NEEDS_ENERGY: u32 = 1 << 20;

/// Most nested blends: `kernels/interaction.wgsl` has room for this many.
const MOST_BLENDS: u32 = 6;

/// Dielectric, thin dielectric, plastic: camera paths split there.
pub(crate) const SPLIT_PATHS: u32 = 1 << 2 | 1 << 3 | 1 << 9;
/// Black to null.
const NEEDS_OF_PLAIN: u32 = 0b111_1111;

/// Needs that kernels are compiled for where compilers are slow: all plain kinds, or everything, so that few kernels
/// serve all scenes.
pub(super) fn class_of_needs(needs: u32) -> u32 {
    match needs & !NEEDS_OF_PLAIN {
        0 => NEEDS_OF_PLAIN,
        _ => Needs::ALL.surfaces | needs & NEEDS_COLORS,
    }
}

/// A surface; fields that its kind does not use are zero.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Material {
    /// Factor on the reflection: the albedo of diffuse surfaces, of coats' bases and of principled ones. If it varies,
    /// the value at an arbitrary place.
    pub reflectance: [f32; 3],
    /// Black, diffuse, dielectric, thin dielectric, conductor, mirror, null, rough conductor, rough dielectric,
    /// plastic, rough plastic, principled, layered: 0 to 12.
    pub kind: u32,
    /// Factor on the transmission; for coats, on their reflection; for rough conductors, their reflectance for diffuse
    /// light.
    pub transmittance: [f32; 3],
    /// Two-sided 1, Beckmann facets 2, nonlinear coats 4, may transmit 8, active lobes 16 to 64, eta is the reflectance
    /// at normal incidence over 0.08: 128, the multiple-scattering lobe is active 256, multiple scattering is on 512.
    pub bits: u32,
    /// Real part of the index; for dielectrics and coats, the index inside over the one outside, three times.
    pub eta: [f32; 3],
    /// Roughness of the microfacets; for principled surfaces its square root.
    pub roughness: f32,
    /// Imaginary part.
    pub k: [f32; 3],
    /// For rough coats: offset of their transmittances among the texels. For multiple scattering: offset of the losses.
    pub table: u32,
    /// From 0, dielectric, to 1, metal; for coats, the share of the base's light that they send back to it.
    pub metallic: f32,
    /// See [`Extras`].
    pub spec_tint: f32,
    /// See [`Extras`].
    pub spec_trans: f32,
    /// See [`Extras`].
    pub flatness: f32,
    /// See [`Extras`].
    pub sheen: f32,
    /// See [`Extras`].
    pub sheen_tint: f32,
    /// See [`Extras`].
    pub clearcoat: f32,
    /// Gloss of that coat; in kernels, its roughness.
    pub coat_alpha: f32,
}

/// A material: its surface, and further data.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MaterialRecord {
    /// Before textures are looked up.
    pub surface: Material,
    /// Its first texture.
    pub first_texture: u32,
    /// Number of textures.
    pub textures: u32,
    /// Share of rays that meet it.
    pub opacity: f32,
    /// Share of these that meet its second part.
    pub weight: f32,
    /// For a blend: numbers of its materials.
    pub parts: [u32; 2],
    /// Not opaque 1, blend 2, bump map 4, normal map 8, reflections stay above the surface 16; above eight bits its row
    /// of [`Etas`](super::waves::Etas), from 1 on, or 0 without dispersion.
    pub bits: u32,
    /// Factor on heights.
    pub scale: f32,
}

/// A scene's materials in the kernels' layout.
#[derive(Debug, Default)]
pub struct FlatMaterials {
    /// By material number, and then parts of blends. Unused materials are black.
    pub records: Vec<MaterialRecord>,
    /// Their textures, and tables of rough coats.
    pub textures: FlatTextures,
    /// Dispersion data, by row.
    pub rows: Vec<Dispersion>,
}

impl FlatMaterials {
    /// The materials of a scene that passes [`reasons`].
    pub(super) fn new(description: &SceneDescription) -> Self {
        let users = users(description);
        let used = description.materials.iter().zip(&users);
        let used = used.map(|(material, user)| user.map(|_| material));
        Self::after(FlatTextures::of_lights(&description.lights), used)
    }

    /// By number; unused ones are black.
    #[cfg(test)]
    pub(crate) fn of<'a>(materials: impl ExactSizeIterator<Item = Option<&'a bsdf::Material>>) -> Self {
        Self::after(FlatTextures::default(), materials)
    }

    fn after<'a>(textures: FlatTextures, materials: impl ExactSizeIterator<Item = Option<&'a bsdf::Material>>) -> Self {
        let materials: Vec<_> = materials.collect();
        let rows = waves::rows(materials.iter().copied().flatten());
        let mut flat = Self {
            records: vec![MaterialRecord::zeroed(); materials.len()],
            textures,
            rows: rows.into_iter().cloned().collect(),
        };
        for (number, material) in materials.into_iter().enumerate() {
            if let Some(material) = material {
                flat.records[number] = flat.record(material);
            }
        }
        flat
    }

    /// Their needs: `SURFACES` in kernel texts.
    #[must_use]
    pub fn needs(&self) -> u32 {
        let of = |record: &MaterialRecord| {
            let when = |bit: u32, holds: bool| u32::from(holds) * bit;
            let has = |bits: u32| record.bits & bits != 0;
            // Layered surfaces transmit like rough glass.
            (1 << record.surface.kind)
                | when(NEEDS_BECKMANN, record.surface.bits & IS_BECKMANN != 0)
                | when(NEEDS_ENERGY, record.surface.bits & KEEPS_ENERGY != 0)
                | when(NEEDS_CHANCE, has(HAS_OPACITY | IS_BLEND))
                | when(NEEDS_MAPS, has(HAS_BUMP_MAP | HAS_NORMAL_MAP))
        };
        let colors = u32::from(self.textures.reads_colors()) * NEEDS_COLORS;
        self.records.iter().map(of).fold(colors, |all, of| all | of)
    }

    fn record(&mut self, material: &bsdf::Material) -> MaterialRecord {
        let mut record = MaterialRecord {
            surface: self.surface(material),
            first_texture: self.textures.textures.len() as u32,
            ..MaterialRecord::zeroed()
        };
        if let Some(Texture::Constant(opacity)) = &material.opacity {
            record.opacity = grey(*opacity);
        }
        if material.opacity.is_some() {
            record.bits |= HAS_OPACITY;
        }
        if let MaterialKind::Blend { weight, .. } = &material.kind {
            record.bits |= IS_BLEND;
            if let Texture::Constant(weight) = weight {
                record.weight = grey(*weight);
            }
        }
        if let Some(dispersion) = material.dispersion.as_deref() {
            let row = self.rows.iter().position(|row| row == dispersion);
            record.bits |= row.map_or(0, |row| (row as u32 + 1) << ROW_BITS);
        }
        if let Some(map) = &material.normal_perturbation {
            record.bits |= u32::from(material.reflects_upwards()) * REFLECTS_UPWARDS;
            match map {
                NormalPerturbation::BumpMap { scale, .. } => {
                    record.bits |= HAS_BUMP_MAP;
                    record.scale = *scale;
                }
                NormalPerturbation::NormalMap(_) => record.bits |= HAS_NORMAL_MAP,
                // Such scenes are refused.
                NormalPerturbation::Layers(_) => {}
            }
        }
        for (field, texture) in looked_up(material) {
            self.textures.add(field, texture);
            record.textures += 1;
        }
        if let MaterialKind::Blend { parts, .. } = &material.kind {
            // Its parts' textures follow its own.
            record.parts = std::array::from_fn(|i| {
                let part = self.record(&parts[i]);
                self.records.push(part);
                self.records.len() as u32 - 1
            });
        }
        record
    }

    fn surface(&mut self, material: &bsdf::Material) -> Material {
        let constant = |texture: &Texture| texture.eval(&TexturePoint::default()).to_array();
        let number = |scalar: &Scalar| scalar.eval(&TexturePoint::default());
        let two_sided = u32::from(material.two_sided) * TWO_SIDED;
        let of = |kind: u32, reflectance: &Texture, bits: u32| Material {
            kind,
            reflectance: constant(reflectance),
            bits,
            ..Material::zeroed()
        };
        let dielectric = |kind: u32, eta: f32, tint: &Tint| Material {
            transmittance: constant(&tint.transmittance),
            eta: [eta; 3],
            ..of(kind, &tint.reflectance, TWO_SIDED)
        };
        let facets = |distribution: &Distribution| u32::from(*distribution == Distribution::Beckmann) * IS_BECKMANN;
        let metal = |eta: &Rgb, k: &Rgb, surface: Material| Material {
            eta: eta.min(MAX_INDEX).to_array(),
            k: k.min(MAX_INDEX).to_array(),
            ..surface
        };
        match &material.kind {
            MaterialKind::Diffuse { reflectance } => of(DIFFUSE, reflectance, two_sided),
            MaterialKind::Dielectric { eta, tint } => dielectric(DIELECTRIC, *eta, tint),
            MaterialKind::ThinDielectric { eta, tint } => dielectric(THIN_DIELECTRIC, *eta, tint),
            MaterialKind::Conductor { eta, k, reflectance } => metal(eta, k, of(CONDUCTOR, reflectance, two_sided)),
            MaterialKind::Mirror { reflectance } => of(MIRROR, reflectance, two_sided),
            MaterialKind::RoughConductor {
                distribution,
                alpha,
                eta,
                k,
                reflectance,
            } => {
                let bits = two_sided | facets(distribution);
                let surface = Material {
                    roughness: number(alpha),
                    ..metal(eta, k, of(ROUGH_CONDUCTOR, reflectance, bits))
                };
                match material.mean_fresnel() {
                    None => surface,
                    Some(mean) => Material {
                        transmittance: mean.to_array(),
                        bits: bits | KEEPS_ENERGY,
                        table: self.textures.losses(*distribution),
                        ..surface
                    },
                }
            }
            MaterialKind::RoughDielectric {
                distribution,
                alpha,
                eta,
                tint,
            } => match material.bsdf(&TexturePoint::default()) {
                // With the same index on both sides.
                Bsdf::Null => dielectric(NULL, 1.0, tint),
                _ => {
                    let surface = dielectric(ROUGH_DIELECTRIC, *eta, tint);
                    let (keeps, table) = match material.multiple_scattering {
                        true => (KEEPS_ENERGY, self.textures.losses(*distribution)),
                        false => (0, 0),
                    };
                    Material {
                        roughness: number(alpha),
                        bits: surface.bits | facets(distribution) | keeps,
                        table,
                        ..surface
                    }
                }
            },
            MaterialKind::Plastic {
                reflectance,
                specular_reflectance,
                coat,
            } => Material {
                transmittance: constant(specular_reflectance),
                eta: [coat.eta(); 3],
                metallic: coat.internal(),
                ..of(
                    PLASTIC,
                    reflectance,
                    two_sided | ALL_LOBES | nonlinear(coat.is_nonlinear()),
                )
            },
            MaterialKind::RoughPlastic {
                reflectance,
                specular_reflectance,
                coat,
            } => {
                let base = coat.seen_from_base();
                let bits = two_sided | ALL_LOBES | nonlinear(base.is_nonlinear()) | facets(&coat.distribution());
                Material {
                    transmittance: constant(specular_reflectance),
                    eta: [base.eta(); 3],
                    roughness: coat.alpha(),
                    metallic: base.internal(),
                    table: self.textures.add_numbers(coat.transmittances()),
                    ..of(ROUGH_PLASTIC, reflectance, bits)
                }
            }
            MaterialKind::Principled {
                base_color,
                metallic,
                roughness,
                interface,
                extras,
            } => {
                let lets_through = extras.as_ref().is_some_and(|extras| extras.transmits());
                let (eta, by_specular) = match interface {
                    _ if lets_through => (interface.eta_of_glass(), 0),
                    Interface::Eta(eta) => (*eta, 0),
                    Interface::Specular(specular) => (number(specular), BY_SPECULAR),
                };
                let through = u32::from(lets_through) * LETS_THROUGH;
                let kind = if extras.is_some() { LAYERED } else { PRINCIPLED };
                let (keeps, table) = match material.multiple_scattering {
                    true => (BOUNCES | KEEPS_ENERGY, self.textures.losses(Distribution::Ggx)),
                    false => (0, 0),
                };
                let plain = Material {
                    metallic: number(metallic),
                    roughness: number(roughness),
                    eta: [eta; 3],
                    table,
                    ..of(kind, base_color, two_sided | ALL_LOBES | by_specular | through | keeps)
                };
                match extras {
                    None => plain,
                    Some(extras) => layered(plain, extras),
                }
            }
            MaterialKind::Null => of(NULL, &Texture::Constant(Rgb::ZERO), TWO_SIDED),
            MaterialKind::Blend { .. }
            | MaterialKind::Translucent { .. }
            | MaterialKind::OrenNayar { .. }
            | MaterialKind::Velvet { .. }
            | MaterialKind::Sheen { .. }
            | MaterialKind::Hair { .. } => of(BLACK, &Texture::Constant(Rgb::ZERO), TWO_SIDED),
        }
    }
}

fn nonlinear(is: bool) -> u32 {
    u32::from(is) * IS_NONLINEAR
}

fn layered(plain: Material, extras: &Extras) -> Material {
    let number = |scalar: &Scalar| scalar.eval(&TexturePoint::default());
    Material {
        spec_tint: number(&extras.spec_tint),
        spec_trans: number(&extras.spec_trans),
        flatness: number(&extras.flatness),
        sheen: number(&extras.sheen),
        sheen_tint: number(&extras.sheen_tint),
        clearcoat: number(&extras.clearcoat),
        coat_alpha: number(&extras.clearcoat_gloss),
        ..plain
    }
}

/// A share of rays.
fn grey(c: Rgb) -> f32 {
    bsdf::share_of_rays(&Texture::Constant(c), &TexturePoint::default())
}

/// Textures of the materials on objects, including parts of blends.
pub(super) fn all_looked_up(description: &SceneDescription) -> impl Iterator<Item = &Texture> {
    used(description)
        .flat_map(|material| {
            let mut materials = Vec::new();
            with_parts(material, 0, &mut |material, _| materials.push(material));
            materials
        })
        .flat_map(|material| looked_up(material).into_iter().map(|(_, texture)| texture))
}

/// Varying properties of a material, without its parts; a map comes last.
fn looked_up(material: &bsdf::Material) -> Vec<(Field, &Texture)> {
    let mut all = fields(&material.kind);
    all.extend(material.opacity.iter().map(|opacity| (Field::Opacity, opacity)));
    all.retain(|(_, texture)| !matches!(texture, Texture::Constant(_)));
    let maps = material
        .normal_perturbation
        .iter()
        .flat_map(NormalPerturbation::textures);
    all.extend(maps.map(|texture| (Field::Map, texture)));
    all
}

fn fields(kind: &MaterialKind) -> Vec<(Field, &Texture)> {
    match kind {
        MaterialKind::Diffuse { reflectance }
        | MaterialKind::Mirror { reflectance }
        | MaterialKind::Conductor { reflectance, .. } => vec![(Field::Reflectance, reflectance)],
        MaterialKind::Dielectric { tint, .. } | MaterialKind::ThinDielectric { tint, .. } => tints(tint).to_vec(),
        MaterialKind::RoughConductor { alpha, reflectance, .. } => {
            vec![(Field::Reflectance, reflectance), (Field::Roughness, alpha.texture())]
        }
        MaterialKind::RoughDielectric { alpha, tint, .. } => {
            let mut all = tints(tint).to_vec();
            all.push((Field::Roughness, alpha.texture()));
            all
        }
        MaterialKind::Plastic {
            reflectance,
            specular_reflectance,
            ..
        }
        | MaterialKind::RoughPlastic {
            reflectance,
            specular_reflectance,
            ..
        } => vec![
            (Field::Reflectance, reflectance),
            (Field::Transmittance, specular_reflectance),
        ],
        MaterialKind::Principled {
            base_color,
            metallic,
            roughness,
            interface,
            extras,
        } => {
            let mut all = vec![
                (Field::Reflectance, base_color),
                (Field::Metallic, metallic.texture()),
                (Field::Roughness, roughness.texture()),
            ];
            let lets_through = extras.as_ref().is_some_and(|extras| extras.transmits());
            match interface {
                Interface::Specular(specular) if !lets_through => all.push((Field::Specular, specular.texture())),
                Interface::Specular(_) | Interface::Eta(_) => {}
            }
            if let Some(extras) = extras {
                all.extend([
                    (Field::SpecTint, extras.spec_tint.texture()),
                    (Field::SpecTrans, extras.spec_trans.texture()),
                    (Field::Flatness, extras.flatness.texture()),
                    (Field::Sheen, extras.sheen.texture()),
                    (Field::SheenTint, extras.sheen_tint.texture()),
                    (Field::Clearcoat, extras.clearcoat.texture()),
                    (Field::CoatGloss, extras.clearcoat_gloss.texture()),
                ]);
            }
            all
        }
        MaterialKind::Null
        | MaterialKind::Translucent { .. }
        | MaterialKind::OrenNayar { .. }
        | MaterialKind::Velvet { .. }
        | MaterialKind::Sheen { .. }
        | MaterialKind::Hair { .. } => Vec::new(),
        MaterialKind::Blend { weight, parts: _ } => vec![(Field::Weight, weight)],
    }
}

fn tints(tint: &Tint) -> [(Field, &Texture); 2] {
    [
        (Field::Reflectance, &tint.reflectance),
        (Field::Transmittance, &tint.transmittance),
    ]
}

/// All reasons why devices cannot render a scene's materials, except for texture sizes.
pub(super) fn reasons(description: &SceneDescription) -> Vec<Reason> {
    let mut reasons = Vec::new();
    for ((number, material), user) in (0..).zip(&description.materials).zip(users(description)) {
        let Some(object) = user else {
            continue;
        };
        let of = match description.material_names.get(&number) {
            Some(name) => Of::Material(name.clone()),
            None => Of::Object(object.name.clone()),
        };
        let mut missing = Vec::new();
        with_parts(material, 0, &mut |material, depth| {
            missing.extend(missing_of(material));
            if depth > MOST_BLENDS {
                missing.push(("materials", "so many blends within blends"));
            }
        });
        missing.sort_unstable();
        missing.dedup();
        reasons.extend(missing.into_iter().map(|(field, what)| Reason {
            of: of.clone(),
            field,
            why: Why::Missing(what),
        }));
    }
    reasons
}

const ROUGH_DIFFUSE: &str = "rough diffuse surfaces";
const MICROFIBERS: &str = "sheen of microfibers";

/// Fields, and their values that kernels do not support.
fn missing_of(material: &bsdf::Material) -> Vec<(&'static str, &'static str)> {
    let MaterialDescription {
        kind: _,
        two_sided: _,
        opacity: _,
        normal_perturbation,
        multiple_scattering: _,
        dispersion: _,
        index_outside: _,
        // Belongs to shapes that are refused.
        thin: _,
        anisotropy,
    } = &**material;
    let mut all = Vec::new();
    if let MaterialKind::Translucent { .. } = material.kind {
        all.push(("type", "translucent surfaces"));
    }
    if let MaterialKind::OrenNayar { .. } = material.kind {
        all.push(("roughness", ROUGH_DIFFUSE));
    }
    if let MaterialKind::Velvet { .. } = material.kind {
        all.push(("type", "velvet"));
    }
    if let MaterialKind::Sheen { .. } = material.kind {
        all.push(("type", MICROFIBERS));
    }
    if let Some(NormalPerturbation::Layers(_)) = normal_perturbation {
        all.push(("bump", "bumps of a strength, or over others"));
    }
    if material.subsurface().is_some() {
        all.push(("subsurface", "media beneath surfaces"));
    }
    if let MaterialKind::Principled {
        extras: Some(extras), ..
    } = &material.kind
    {
        let over = [
            (!extras.diffuse_roughness.is_zero(), "diffuse_roughness", ROUGH_DIFFUSE),
            (extras.fuzz.is_some(), "sheen_weight", MICROFIBERS),
            (extras.coat.is_some(), "coat_weight", "clear coats"),
            (extras.film.is_some(), "thin_film_thickness", "thin films"),
            (
                extras.has_specular_color(),
                "specular_color",
                "reflections with a colour of their own",
            ),
        ];
        all.extend(
            over.iter()
                .filter(|(has, ..)| *has)
                .map(|(_, field, what)| (*field, *what)),
        );
    }
    if let MaterialKind::Hair { .. } = material.kind {
        all.push(("type", "hair"));
    }
    if let Some(anisotropy) = anisotropy {
        let field = match anisotropy.stretch {
            Stretch::Across(_) => "alpha_u",
            Stretch::Burley(_) => "anisotropic",
            Stretch::Strength(_) => "anisotropy_strength",
        };
        all.push((field, "microfacets that are rougher in one direction"));
    }
    let are_squared = |texture: &Texture| match texture {
        Texture::VertexColors(Some(times)) => times.reads_colors(),
        _ => false,
    };
    if looked_up(material).iter().any(|(_, texture)| are_squared(texture)) {
        all.push(("reflectance", "colours of vertices times themselves"));
    }
    if (looked_up(material).iter()).any(|(_, texture)| matches!(texture, Texture::Graph(_))) {
        all.push(("textures", "graphs of nodes"));
    }
    all
}
