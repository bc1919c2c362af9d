//! Meshes with the materials that their .obj file names: one object per material.

use super::kept::{Decoded, Kept, MaterialParts, Normals, Pinned, linear_bits};
use super::shape::{Form, Surface, normals, own_map};
use super::{Assets, Parts, Problem, asset_problem, required};
use crate::assets::gltf::{number, numbers, quoted};
use crate::assets::image::Encoding;
use crate::assets::mesh;
use crate::assets::mtl::{self, Map, Material};
use crate::parse::{Fault, ImageFile, MtlRecord, ShapeRecord};
use crate::source;
use crate::values::Spanned;
use beamfarm_image::bundle;
use beamfarm_render::math::Rgb;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::texture::Image;
use glam::DAffine3;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

impl Parts<'_> {
    /// Add a mesh's parts, one for each material that its file names.
    pub(super) fn add_by_mtl(&mut self, record: &ShapeRecord, name: &str) -> Result<(), Problem> {
        let file = required(&record.file, &record.kind, "file")?;
        let mesh = self.assets.mesh(file, 0, false)?;
        let mesh = match &record.toward {
            Some(toward) => self.on_its_way(&mesh, toward, 0)?,
            None => mesh,
        };
        let own = own_map(record)?;
        let parts = self.assets.parts(&mesh, record, &own);
        let used: BTreeSet<&str> = parts.iter().filter_map(|(name, _)| name.as_deref()).collect();
        let (text, from) = self.assets.written(file, &used)?;
        let located = |fault: &Fault| {
            let fault = source::locate(Path::new(from.get_ref()), &text, fault);
            asset_problem(&from, fault.message)
        };
        let piece: MtlRecord = toml::from_str(&text).map_err(|e| located(&e.into()))?;
        let outer = self.materials.enter(&piece.materials, &mut self.assets);
        let outer = outer.map_err(|problem| match problem {
            Problem::Scene(fault) => located(&fault),
            other => other,
        })?;
        let inner = self.materials.leave(outer);
        let mut missing = Vec::new();
        let mut is_seen = false;
        let mut bounds = false;
        for (of, part) in parts.iter() {
            let known = of.as_ref().and_then(|of| inner.get(of));
            let material = match (known, &record.material) {
                (Some(material), _) => *material,
                (None, Some(name)) => self.materials.resolve(name)?,
                (None, None) => self.materials.default(false),
            };
            if let (Some(of), None) = (of, known) {
                missing.push(format!("{of:?}"));
            }
            let form = Form::Mesh(part.clone());
            let material = self.closed_or_diffuse(record, &form, material);
            let boundary = match self.materials.list[material as usize].has(BsdfFlags::BOUNDS_MEDIA) {
                true => self.boundary(record, material)?,
                false => None,
            };
            let form = self.solid(record, form, material, boundary)?;
            bounds |= boundary.is_some();
            let surface = Surface {
                form,
                record,
                emission: of.as_ref().and_then(|of| piece.emission.get(of)),
                material,
                boundary,
            };
            let label = format!("{name}[{}]", of.as_deref().unwrap_or_default());
            let before = [self.objects.len(), self.lights.len()];
            match self.add_surface(&surface, &label) {
                Err(Problem::NoArea(_)) => continue,
                done => done?,
            }
            is_seen = true;
            let (objects, lights) = (before[0]..self.objects.len(), before[1]..self.lights.len());
            self.names.add(&label, &[], None, objects, lights);
        }
        if !is_seen {
            return Err(Problem::NoArea(file.span()));
        }
        if let Some(medium) = record
            .interior
            .as_ref()
            .or(record.exterior.as_ref())
            .filter(|_| !bounds)
        {
            let message = "none of its materials bounds a medium; expected one that light is refracted by (`illum 7`, `d` below 1)";
            return Err(Fault::new(medium.span(), message).into());
        }
        if !missing.is_empty() {
            let list = missing.join(", ");
            let message = format!("its .mtl files lack the materials {list}: these faces have that of the shape");
            self.notes.push(asset_problem(file, message));
        }
        Ok(())
    }
}

/// A note on files whose materials are not used.
pub(super) fn note(shapes: &[ShapeRecord], assets: &mut Assets<'_>) -> Option<String> {
    let mut files = Vec::new();
    for shape in shapes {
        let shape = shape.shape.as_ref().map_or(shape, |inner| inner.get_ref());
        let is_told = shape.mtl.is_some() || shape.material.is_some() || shape.emission.is_some();
        let is_obj = |file: &&Spanned<String>| file.get_ref().to_ascii_lowercase().ends_with(".obj");
        let Some(file) = shape.file.as_ref().filter(is_obj).filter(|_| !is_told) else {
            continue;
        };
        // Unreadable files have been reported as errors by now.
        let has_names = (assets.mesh(file, 0, false)).is_ok_and(|mesh| !mesh.raw.materials.is_empty());
        let name = format!("{:?}", file.get_ref());
        if has_names && !files.contains(&name) {
            files.push(name);
        }
    }
    (!files.is_empty()).then(|| {
        format!(
            "{}: materials of an .mtl file, which are not read: the shape is grey. `mtl = true` on the shape takes them, \
             `material` gives it another one",
            files.join(", ")
        )
    })
}

impl Assets<'_> {
    /// A mesh's parts, with the normals of the whole mesh.
    fn parts(&mut self, mesh: &Arc<Decoded>, record: &ShapeRecord, own: &DAffine3) -> Arc<MaterialParts> {
        let angles = match normals(mesh, record) {
            Normals::Smooth => Some(own),
            Normals::OfFile | Normals::OfFaces => None,
        };
        let Kept { parts, clock, .. } = &mut *self.kept;
        let key = (Pinned(mesh.clone()), angles.map(|own| linear_bits(&own.matrix3)));
        parts.get_or_make(clock, key, || {
            let mut whole = mesh.raw.clone();
            if let Some(own) = angles {
                whole.normals = whole.smooth_normals(own);
            }
            let parts = whole.by_material().into_iter();
            let part = |(name, raw): (Option<&str>, _)| (name.map(str::to_owned), Arc::new(Decoded::new(raw)));
            Arc::new(parts.map(part).collect())
        })
    }

    /// The named materials from the .mtl files of an .obj file, as the text of a scene file piece, and the last of
    /// those files, for errors.
    fn written(&mut self, file: &Spanned<String>, used: &BTreeSet<&str>) -> Result<(String, Spanned<String>), Problem> {
        let lacks = |name: &str, line: usize, lacking: &str| {
            let mut flaw = beamfarm_assets::Flaw::from(format!("the bundle lacks the file \"{lacking}\""));
            flaw.line = Some(line);
            asset_problem(&Spanned::new(file.span(), name.to_owned()), flaw)
        };
        let (source, name) = (self.source, file.get_ref());
        let bytes = source.bytes(&bundle::key(name)).unwrap_or_default();
        let mut text = String::new();
        let mut emission = String::new();
        let mut last = file.clone();
        let mut known = BTreeMap::new();
        for (line, library) in mesh::libraries(bytes) {
            let path = Spanned::new(file.span(), mtl::beside(name, &library));
            let bytes = source.bytes(&bundle::key(path.get_ref()));
            let bytes = bytes.ok_or_else(|| lacks(name, line, path.get_ref()))?;
            for material in mtl::read(bytes).map_err(|flaw| asset_problem(&path, flaw))? {
                if used.contains(material.name.as_str()) {
                    // The first of two materials of one name counts.
                    known.entry(material.name.clone()).or_insert((material, path.clone()));
                }
            }
            last = path;
        }
        for (material, path) in known.values() {
            let mut writer = Writer {
                assets: self,
                path,
                material,
            };
            writer.write(&mut text, &mut emission)?;
        }
        Ok((format!("{text}[emission]\n{emission}"), last))
    }
}

/// Writes a material in the scene file's syntax.
struct Writer<'w, 'a> {
    assets: &'w mut Assets<'a>,
    /// The path of the .mtl file.
    path: &'w Spanned<String>,
    material: &'w Material,
}

impl Writer<'_, '_> {
    fn write(&mut self, text: &mut String, emission: &mut String) -> Result<(), Problem> {
        let material = self.material;
        let name = quoted(&material.name);
        let _ = write!(text, "[materials.{name}]\n{}", self.kind()?);
        if let Some(map) = &material.opacity_map {
            let image = self.image(map, Encoding::Raw)?;
            let is_cut = image.alpha.iter().any(|alpha| *alpha < 1.0);
            let channel = map.channel.unwrap_or(if is_cut { "a" } else { "luminance" });
            let _ = writeln!(
                text,
                "opacity = {}",
                self.lying(map, &format!("raw = true, channel = \"{channel}\""))
            );
        } else if let Some(opacity) = material.opacity.filter(|d| *d < 1.0 && !self.is_glass()) {
            let _ = writeln!(text, "opacity = {}", number(opacity));
        }
        if let Some(map) = &material.normal_map {
            let _ = writeln!(text, "normal_map = {}", self.lying(map, "raw = true"));
        } else if let Some(map) = &material.bump {
            // Programs use the same keyword for normal maps, which are blue.
            let image = self.image(map, Encoding::Raw)?;
            let blue: f64 = image.pixels.iter().map(|p| f64::from(p.z - p.x)).sum();
            let _ = match blue > 0.2 * image.pixels.len() as f64 {
                true => writeln!(text, "normal_map = {}", self.lying(map, "raw = true")),
                false => {
                    let scale = format!("raw = true, scale = {}", number(map.bump));
                    writeln!(text, "bump = {}", self.lying(map, &scale))
                }
            };
        }
        let glow = material.emission.unwrap_or([1.0; 3]);
        let _ = match (&material.emission_map, material.emission) {
            (Some(map), _) if glow != [0.0; 3] => {
                let image = self.lying(map, "");
                writeln!(
                    emission,
                    "{name} = {{ radiance = {image}, scale = {} }}",
                    numbers(&glow)
                )
            }
            (None, Some(_)) if glow != [0.0; 3] => {
                writeln!(emission, "{name} = {{ radiance = {} }}", numbers(&glow))
            }
            _ => Ok(()),
        };
        if !material.left_out.is_empty() {
            let list = material.left_out.join(", ");
            let note = format!("of the material {:?} {list} does not count", material.name);
            self.assets.notes.push((self.path.get_ref().clone(), note));
        }
        Ok(())
    }

    /// Whether it refracts: `illum` 6 or 7, and not opaque. Other materials that are not opaque get an opacity.
    fn is_glass(&self) -> bool {
        let is_clear = self.material.opacity.is_some_and(|d| d < 1.0) && self.material.opacity_map.is_none();
        is_clear && matches!(self.material.illumination, Some(6.0 | 7.0))
    }

    /// Its type, and the fields of that type.
    fn kind(&mut self) -> Result<String, Problem> {
        let material = self.material;
        if self.is_glass() {
            let ior = material.ior.filter(|ior| *ior > 1.0).unwrap_or(1.5);
            let filter = numbers(&material.filter.unwrap_or([1.0; 3]));
            return Ok(format!(
                "type = \"dielectric\"\nior = {}\nspecular_transmittance = {filter}\n",
                number(ior)
            ));
        }
        let specular = material.specular.unwrap_or_default().map(|c| c.min(1.0));
        let is_black = material.diffuse == Some([0.0; 3]) && material.diffuse_map.is_none();
        // Only coloured reflection is left: it is a metal.
        let is_metal = is_black && specular != [0.0; 3] && material.metallic.is_none();
        let base = match is_metal {
            true => numbers(&specular),
            false => self.base()?,
        };
        let is_dull = specular == [0.0; 3] || matches!(material.illumination, Some(0.0 | 1.0));
        if is_dull && material.roughness.is_none() && material.metallic.is_none() {
            return Ok(format!("type = \"diffuse\"\ntwo_sided = true\nreflectance = {base}\n"));
        }
        // The roughness whose microfacet lobe is as wide as the Phong lobe.
        let of_phong = material.shininess.map(|n| libm::pow(2.0 / (n + 2.0), 0.25));
        let roughness = material.roughness.or(of_phong).unwrap_or(0.5);
        let metallic = material.metallic.unwrap_or(if is_metal { 1.0 } else { 0.0 });
        let mean = specular.iter().sum::<f64>() / 3.0;
        Ok(format!(
            "type = \"principled\"\ntwo_sided = true\nbase_color = {base}\nroughness = {}\nmetallic = {}\nspecular = {}\n",
            number(roughness),
            number(metallic),
            number(mean.min(1.0))
        ))
    }

    /// The colour, or an image times the colour.
    fn base(&mut self) -> Result<String, Problem> {
        let material = self.material;
        let Some(map) = &material.diffuse_map else {
            return Ok(numbers(&material.diffuse.unwrap_or([0.5; 3])));
        };
        let channel = map.channel.map(|channel| format!("channel = \"{channel}\""));
        let fields = channel.unwrap_or_default();
        match material.diffuse {
            // Programs write black where only the image counts.
            None | Some([1.0, 1.0, 1.0] | [0.0, 0.0, 0.0]) => Ok(self.lying(map, &fields)),
            Some(factor) => {
                let image = self.image(map, Encoding::Srgb)?;
                let key = (Pinned(image.clone()), factor.map(f64::to_bits));
                let Kept { tinted, clock, .. } = &mut *self.assets.kept;
                let image = tinted.get_or_make(clock, key, || Arc::new(times(&image, factor)));
                let name = format!("{}:{}", self.path.get_ref(), material.name);
                let text = written(&name, map, &fields);
                self.assets.images.insert(bundle::key(&name), image);
                Ok(text)
            }
        }
    }

    fn file(&self, map: &Map) -> String {
        mtl::beside(self.path.get_ref(), &map.file)
    }

    fn lying(&self, map: &Map, fields: &str) -> String {
        written(&self.file(map), map, fields)
    }

    fn image(&mut self, map: &Map, encoding: Encoding) -> Result<Arc<Image>, Problem> {
        let file = ImageFile {
            file: Spanned::new(self.path.span(), self.file(map)),
            layer: None,
        };
        self.assets
            .image(&file, encoding, false)
            .map_err(|problem| match problem {
                Problem::Scene(fault) => {
                    let mut flaw = beamfarm_assets::Flaw::from(fault.message);
                    flaw.line = Some(map.line);
                    asset_problem(self.path, flaw)
                }
                other => other,
            })
    }
}

/// An image as a texture, placed like a map of the .mtl file.
fn written(name: &str, map: &Map, fields: &str) -> String {
    let mut text = format!("{{ image = {}", quoted(name));
    if !fields.is_empty() {
        let _ = write!(text, ", {fields}");
    }
    if map.clamp {
        text.push_str(", wrap = \"clamp\"");
    }
    if map.scale != [1.0; 2] || map.offset != [0.0; 2] {
        let [scale, offset] = [map.scale, map.offset].map(|[u, v]| (number(u), number(v)));
        let _ = write!(
            text,
            ", uv = [{{ scale = [{}, {}, 1.0] }}, {{ translate = [{}, {}, 0.0] }}]",
            scale.0, scale.1, offset.0, offset.1
        );
    }
    text.push_str(" }");
    text
}

fn times(image: &Image, factor: [f64; 3]) -> Image {
    let factor = Rgb::from_array(factor.map(|c| c as f32));
    Image {
        pixels: image.pixels.iter().map(|p| *p * factor).collect(),
        ..image.clone()
    }
}

#[cfg(test)]
mod tests;
