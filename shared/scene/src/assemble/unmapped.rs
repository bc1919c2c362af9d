//! Notes on textures and tangents on meshes without UVs.

use super::Parts;
use beamfarm_render::world::bsdf::BsdfFlags;
use beamfarm_render::world::geometry::{Mesh, Object, Shape};
use std::fmt::Write;

/// How many meshes a note names.
const NAMED: usize = 3;

/// A note on textured meshes without UVs, if there are any.
pub(super) fn note(parts: &Parts<'_>) -> Option<String> {
    let is_textured = |object: &Object| {
        let emits = object
            .light
            .is_some_and(|light| parts.lights[light as usize].reads_uv());
        parts.materials.list[object.material as usize].has(BsdfFlags::READS_UV) || emits
    };
    list(parts, is_textured).map(|list| {
        format!(
            "{list}: a texture, but no UV: every triangle shows the same half of it, its corners being at (0, 0), \
             (1, 0) and (0, 1), as in Mitsuba. Expected a mesh with UV"
        )
    })
}

/// A note on meshes without UVs whose material needs tangents, if there are any.
pub(super) fn note_of_tangents(parts: &Parts<'_>) -> Option<String> {
    let lies_along_u = |object: &Object| parts.materials.list[object.material as usize].lies_along_u();
    list(parts, lies_along_u).map(|list| {
        format!(
            "{list}: a roughness that differs by direction, but no UV: which direction is which is left to chance. \
             Expected a mesh with UV, or a `tangent` around an axis"
        )
    })
}

/// The names of meshes without UVs, of objects that need them.
fn list(parts: &Parts<'_>, wants_uv: impl Fn(&Object) -> bool) -> Option<String> {
    let mut meshes: Vec<(&Mesh, &str)> = Vec::new();
    for object in &parts.objects {
        if let Shape::Mesh { mesh, .. } = &object.shape
            && mesh.uvs.is_empty()
            && wants_uv(object)
            // Copies are adjacent.
            && !meshes.last().is_some_and(|(last, _)| std::ptr::eq(*last, &**mesh))
        {
            meshes.push((mesh, &object.name));
        }
    }
    let named: Vec<String> = meshes.iter().take(NAMED).map(|(_, name)| format!("{name:?}")).collect();
    let mut list = named.join(", ");
    if let Some(more @ 1..) = meshes.len().checked_sub(NAMED) {
        let _ = write!(list, " and {more} more");
    }
    (!meshes.is_empty()).then_some(list)
}

#[cfg(test)]
mod tests {
    use beamfarm_image::bundle::Bundle;

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    fn notes(obj: &str, shapes: &str) -> Vec<String> {
        let text = format!(
            "image = {{ width = 8, height = 6 }}\n\
             camera = {{ origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }}\n\
             [materials.plain]\ntype = \"diffuse\"\n\
             [materials.floor]\ntype = \"diffuse\"\nreflectance = {{ checkerboard = [0.2, 0.4] }}\n\
             [materials.mixed]\ntype = \"blend\"\nmaterials = [\"plain\", \"floor\"]\nweight = 0.5\n\
             [[lights]]\ntype = \"point\"\nposition = [0, 9, 0]\npower = 1\n{shapes}"
        );
        let mut bundle = Bundle {
            scene: "a.toml".into(),
            ..Bundle::default()
        };
        bundle.files.insert("a.toml".into(), text.into());
        bundle.files.insert("a.obj".into(), obj.to_owned().into());
        crate::load(&bundle).unwrap().notes
    }

    #[test]
    fn a_texture_without_uv_is_told_of() {
        let mesh = |more: &str| format!("[[shapes]]\ntype = \"mesh\"\nfile = \"a.obj\"\n{more}\n");
        let shining = "emission = { radiance = { checkerboard = [0.2, 0.4] } }";
        for textured in ["material = \"floor\"", "material = \"mixed\"", shining] {
            let said = notes(TRIANGLE, &mesh(textured));
            assert!(
                matches!(&said[..], [only] if only.contains("\"shapes[0]\": a texture, but no UV")),
                "{said:?}"
            );
            let mapped = TRIANGLE.replace("f 1 2 3", "vt 0 0\nf 1/1 2/1 3/1");
            assert!(notes(&mapped, &mesh(textured)).is_empty());
        }
        for plain in ["material = \"plain\"", "emission = { radiance = 2 }"] {
            assert!(notes(TRIANGLE, &mesh(plain)).is_empty());
        }
        let brushed = |more: &str| {
            let materials = format!(
                "[materials.brushed]\ntype = \"principled\"\nanisotropic = 0.5\n{more}\n\
                 [materials.half]\ntype = \"blend\"\nmaterials = [\"plain\", \"brushed\"]\nweight = 0.5\n"
            );
            notes(TRIANGLE, &(materials + &mesh("material = \"half\"")))
        };
        let said = brushed("");
        assert!(
            matches!(&said[..], [only] if only.contains("\"shapes[0]\": a roughness that differs by direction")),
            "{said:?}"
        );
        assert!(brushed("tangent = \"around_y\"").is_empty());
        let many: String = (0..5)
            .map(|i| mesh(&format!("material = \"floor\"\ntransform = [{{ scale = {} }}]", i + 1)))
            .collect();
        let said = notes(TRIANGLE, &many);
        assert!(
            matches!(&said[..], [only] if only.contains("\"shapes[2]\" and 2 more: ")),
            "{said:?}"
        );
    }
}
