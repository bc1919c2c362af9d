//! Faces in the same place, of which a ray meets either one.

use beamfarm_render::math::Vec3;
use beamfarm_render::world::bsdf::{BsdfFlags, Material};
use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
use beamfarm_render::world::rules::Rules;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Arc;

/// So many pairs are named.
const NAMED: usize = 3;

/// Triangles of one object: of `object`, as it stands there, or of all that share its mesh, in its own space.
struct Set<'o> {
    object: u32,
    mesh: &'o Arc<Mesh>,
    /// What differs between sets whose triangles are not in the same place whatever their numbers.
    salt: u64,
}

/// What to say of them, if there are any. Not looked at: what emits, and boundaries between media, which lie on each other
/// on purpose; what rules tell apart is not in each other's way.
pub(super) fn note(objects: &[Object], materials: &[Material], rules: Option<&Rules>) -> Option<String> {
    let class = |object: u32| rules.map_or(0, |rules| rules.class[object as usize]);
    let mut sets = Vec::new();
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
            sets.push(Set {
                object: number,
                mesh,
                salt: mixed(class(number).into()),
            });
            continue;
        }
        // Copies: each mesh by itself, and those in one place.
        let address = Arc::as_ptr(mesh) as usize;
        let map = placement.render_from_object.to_cols_array().map(f32::to_bits);
        let first = *placed.entry((address, map, class(number))).or_insert(number);
        if first != number {
            *pairs.entry((first, number)).or_default() += mesh.triangles.len();
        }
        if known.insert(address) {
            sets.push(Set {
                object: number,
                mesh,
                salt: mixed(1 << 63 | number as u64),
            });
        }
    }
    add_pairs(&sets, &mut pairs);
    said(objects, pairs)
}

fn bounds_media(material: &Material) -> bool {
    material.has(BsdfFlags::BOUNDS_MEDIA | BsdfFlags::NULL)
}

/// Add those of triangles with the same corners, bit for bit, whichever way round.
fn add_pairs(sets: &[Set<'_>], pairs: &mut BTreeMap<(u32, u32), usize>) {
    let hashes: Vec<Vec<u64>> = sets.iter().map(hashes).collect();
    let mut all = hashes.concat();
    all.par_sort_unstable();
    let doubled: BTreeSet<u64> = all
        .windows(2)
        .filter(|two| two[0] == two[1])
        .map(|two| two[0])
        .collect();
    if doubled.is_empty() {
        return;
    }
    let mut found: BTreeMap<(u64, [[u32; 3]; 3]), u32> = BTreeMap::new();
    for (set, hashes) in sets.iter().zip(&hashes) {
        for (triangle, hash) in set.mesh.triangles.iter().zip(hashes) {
            if !doubled.contains(hash) {
                continue;
            }
            let mut corners = triangle.map(|v| bits(set.mesh.positions[v as usize]));
            corners.sort_unstable();
            let first = *found.entry((set.salt, corners)).or_insert(NONE);
            if first == NONE {
                found.insert((set.salt, corners), set.object);
            } else {
                *pairs.entry((first, set.object)).or_default() += 1;
            }
        }
    }
}

/// No object.
const NONE: u32 = u32::MAX;

/// Zero has one sign.
fn bits(p: Vec3) -> [u32; 3] {
    (p + 0.0).to_array().map(f32::to_bits)
}

/// A number of each triangle that does not depend on the order of its corners.
fn hashes(set: &Set<'_>) -> Vec<u64> {
    let of_vertex = |p: &Vec3| {
        let [x, y, z] = bits(*p).map(u64::from);
        mixed(mixed(x << 32 | y) ^ z)
    };
    let vertices: Vec<u64> = set.mesh.positions.par_iter().map(of_vertex).collect();
    let of_triangle = |t: &[u32; 3]| {
        let sum = t
            .iter()
            .fold(set.salt, |sum, v| sum.wrapping_add(vertices[*v as usize]));
        mixed(sum)
    };
    set.mesh.triangles.par_iter().map(of_triangle).collect()
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

fn said(objects: &[Object], pairs: BTreeMap<(u32, u32), usize>) -> Option<String> {
    let name = |object: u32| &objects[object as usize].name;
    // Parts of one thing have one name.
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

    /// Two triangles side by side.
    const SHEET: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n";
    /// One of them, the other way round and from another corner, with a zero of the other sign.
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
        only(&copies(&(at(0.0) + &at(2.0) + &at(2.0))), "\"crowd\" on itself (2)");
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

    #[test]
    fn zz_temporary_time() {
        use beamfarm_render::world::geometry::{Mesh, Object, Placement, Shape};
        use beamfarm_render::math::Vec3;
        let side = 708u32;
        let position = |i: u32| Vec3::new((i % side) as f32 * 0.37, (i / side) as f32 * 0.91, (i.wrapping_mul(2_654_435_761) >> 20) as f32);
        let mesh = Mesh {
            positions: (0..side * side).map(position).collect(),
            triangles: (0..(side - 1) * (side - 1)).flat_map(|i| { let a = i / (side - 1) * side + i % (side - 1); [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]] }).collect(),
            ..Mesh::default()
        };
        let count = mesh.triangles.len();
        let objects = [Object { name: "m".into(), shape: Shape::Mesh { mesh: std::sync::Arc::new(mesh), placement: Placement::IDENTITY }, material: 0, boundary: None, light: None, priority: None, space: None }];
        let materials = [beamfarm_render::world::bsdf::Material::new(beamfarm_render::world::bsdf::MaterialKind::Null, true)];
        let materials2 = [beamfarm_render::world::bsdf::Material::new(beamfarm_render::world::bsdf::MaterialKind::Mirror { reflectance: beamfarm_render::world::texture::Texture::Constant(Vec3::ONE) }, true)];
        for _ in 0..5 {
            let begun = std::time::Instant::now();
            assert!(super::note(&objects, &materials2, None).is_none());
            println!("TIME {count} {:?}", begun.elapsed());
        }
        let begun = std::time::Instant::now();
        assert!(super::note(&objects, &materials, None).is_none());
        println!("TIME nothing {:?}", begun.elapsed());
        let Shape::Mesh { mesh, .. } = &objects[0].shape else { panic!() };
        let begun = std::time::Instant::now();
        std::hint::black_box(mesh.is_closed());
        println!("TIME is_closed {:?}", begun.elapsed());
    }
}
