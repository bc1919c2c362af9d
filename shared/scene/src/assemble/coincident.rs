//! Coincident faces: which of them a ray hits is arbitrary.

use beamfarm_render::world::bsdf::{BsdfFlags, Material};
use beamfarm_render::world::geometry::{Faces, Object, Placement, Shape, coincident};
use beamfarm_render::world::rules::Rules;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;

/// How many pairs the note names.
const NAMED: usize = 3;

/// A note on coincident faces, if there are any. Emitters and boundaries between media are skipped, since these
/// coincide on purpose. Objects that rules tell apart do not conflict either.
pub(super) fn note(objects: &[Object], materials: &[Material], rules: Option<&Rules>) -> Option<String> {
    let class = |object: u32| rules.map_or(0, |rules| rules.class[object as usize]);
    let mut all = Vec::new();
    let mut pairs: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    let mut placed = BTreeMap::new();
    let mut known = BTreeSet::new();
    for (number, object) in (0..).zip(objects) {
        let Shape::Mesh { mesh, placement } = &object.shape else {
            continue;
        };
        if object.light.is_some() || object.boundary.is_some() || bounds_media(&materials[object.material as usize]) {
            continue;
        }
        if *placement == Placement::IDENTITY {
            let space = class(number).into();
            all.push(Faces {
                object: number,
                mesh,
                space,
            });
            continue;
        }
        // Copies: check each mesh once within itself, and report copies that share a placement.
        let address = Arc::as_ptr(mesh) as usize;
        let map = placement.render_from_object.to_cols_array().map(f32::to_bits);
        let first = *placed.entry((address, map, class(number))).or_insert(number);
        if first != number {
            *pairs.entry((first, number)).or_default() += mesh.triangles.len();
        }
        if known.insert(address) {
            let space = 1 << 63 | u64::from(number);
            all.push(Faces {
                object: number,
                mesh,
                space,
            });
        }
    }
    for (pair, count) in coincident(&all) {
        *pairs.entry(pair).or_default() += count;
    }
    said(objects, pairs)
}

fn bounds_media(material: &Material) -> bool {
    material.has(BsdfFlags::BOUNDS_MEDIA | BsdfFlags::NULL)
}

fn said(objects: &[Object], pairs: BTreeMap<(u32, u32), usize>) -> Option<String> {
    let name = |object: u32| &objects[object as usize].name;
    // Parts of one object share a name.
    let mut by_name: BTreeMap<(&String, &String), usize> = BTreeMap::new();
    for ((first, other), count) in &pairs {
        *by_name.entry((name(*first), name(*other))).or_default() += count;
    }
    let count: usize = by_name.values().sum();
    let mut most: Vec<_> = by_name.into_iter().collect();
    most.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let named = most
        .iter()
        .take(NAMED)
        .map(|((first, other), count)| match first == other {
            true => format!("{first:?} on itself ({count})"),
            false => format!("{other:?} on {first:?} ({count})"),
        });
    let mut list = named.collect::<Vec<_>>().join(", ");
    if let Some(more @ 1..) = most.len().checked_sub(NAMED) {
        let _ = write!(list, " and {more} more pairs");
    }
    let lie = match count {
        1 => "1 triangle lies exactly where another one is".to_owned(),
        _ => format!("{count} triangles lie exactly where others are"),
    };
    (count > 0).then(|| format!("{lie}, and which of both is seen there is left to chance: {list}"))
}

#[cfg(test)]
mod tests {
    use beamfarm_image::bundle::Bundle;

    /// Two adjacent triangles.
    const SHEET: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";
    /// One of those triangles, reversed and starting at another corner, with a zero of the other sign.
    const FLAP: &str = "v 0 1 0\nv 1 0 -0.0\nv 0 0 0\nv 2 2 2\nf 2 3 1\n";

    fn notes(shapes: &str) -> Vec<String> {
        let text = format!(
            "image = {{ width = 8, height = 6 }}\n\
             camera = {{ origin = [0, 0, 9], target = [0, 0, 0], fov = 40 }}\n\
             [materials.wall]\ntype = \"diffuse\"\n[materials.glass]\ntype = \"dielectric\"\nior = 1.5\n\
             [[lights]]\ntype = \"point\"\nposition = [0, 9, 0]\npower = 1\n{shapes}"
        );
        let mut bundle = Bundle {
            scene: "a.toml".into(),
            ..Bundle::default()
        };
        bundle.files.insert("a.toml".into(), text.into());
        let twice = SHEET.to_owned() + "f 3 1 2\nf 4 3 2\nf 1 3 2\n";
        for (name, obj) in [("sheet", SHEET), ("flap", FLAP), ("twice", &twice)] {
            bundle.files.insert(format!("{name}.obj"), obj.to_owned().into());
        }
        let notes = crate::load(&bundle).unwrap().notes;
        notes
            .into_iter()
            .filter(|note| note.contains("left to chance"))
            .collect()
    }

    fn shape(name: &str, more: &str) -> String {
        let file = name.split(' ').next().unwrap();
        format!("[[shapes]]\nname = \"{name}\"\ntype = \"mesh\"\nfile = \"{file}.obj\"\n{more}\n")
    }

    #[track_caller]
    fn only(found: &[String], words: &str) {
        assert!(matches!(found, [only] if only.contains(words)), "{found:?}");
    }

    #[test]
    fn faces_in_one_place_are_told_of() {
        let moved = "transform = [{ translate = [0.3, 0, 0] }]";
        assert!(notes(&(shape("sheet", "") + &shape("flap", moved))).is_empty());
        only(
            &notes(&(shape("sheet", "") + &shape("flap", ""))),
            "1 triangle lies exactly where another one is, and which of both is seen there is left to chance: \"flap\" on \
             \"sheet\" (1)",
        );
        only(
            &notes(&(shape("sheet", moved) + &shape("sheet b", moved) + &shape("twice", ""))),
            "5 triangles lie exactly where others are, and which of both is seen there is left to chance: \"twice\" on itself \
             (3), \"sheet b\" on \"sheet\" (2)",
        );
    }

    #[test]
    fn copies_in_one_place_are_told_of() {
        let copies = |places: &str| {
            notes(&format!(
                "[[shapes]]\nname = \"crowd\"\ntype = \"instances\"\n\
                 shape = {{ type = \"mesh\", file = \"sheet.obj\" }}\ntransforms = [{places}]\n"
            ))
        };
        let at = |x: f64| format!("[{{ translate = [{x}, 0, 0] }}], ");
        assert!(copies(&(at(0.0) + &at(2.0) + &at(4.0))).is_empty());
        only(
            &copies(&(at(0.0) + &at(2.0) + &at(2.0))),
            "\"crowd[2]\" on \"crowd[1]\" (2)",
        );
    }

    #[test]
    fn lamps_and_boundaries_may_lie_on_others() {
        for other in ["material = \"glass\"\nboundary = false", "emission = { radiance = 1 }"] {
            assert!(
                notes(&(shape("sheet", "material = \"wall\"") + &shape("flap", other))).is_empty(),
                "{other}"
            );
        }
    }
}
