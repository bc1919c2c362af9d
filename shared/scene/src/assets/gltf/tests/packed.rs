//! A wavy sheet with an image, packed in every way by another encoder (glTF-Transform 4.5) and compared with the
//! unpacked file.

use super::super::{Choice, Piece, There, read};
use super::{file, load_with};
use crate::assets::Flaw;
use crate::assets::mesh::RawMesh;
use beamfarm_render::math::Rgb;
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};

macro_rules! seed {
    ($name:literal) => {
        include_bytes!(concat!("../../../../../../tests/fuzz/seeds/gltf/", $name, ".glb"))
    };
}

fn read_glb(bytes: &[u8]) -> Result<Piece, Flaw> {
    let there = There {
        world_from_file: &DAffine3::IDENTITY,
        seconds: None,
    };
    let choice = Choice {
        materials: true,
        lights: true,
        light_unit: None,
    };
    read("a.glb", bytes, &|_| None, there, choice)
}

fn piece(bytes: &[u8]) -> Piece {
    read_glb(bytes).unwrap_or_else(|flaw| panic!("{}", flaw.message))
}

fn sheet(piece: &Piece) -> &RawMesh {
    assert_eq!(piece.meshes.len(), 1);
    piece.meshes.values().next().unwrap()
}

/// Position in a bounding box of side 2, normal, texture coordinates and colour.
type Corner = [f64; 11];

/// The corners of all triangles.
fn triangles(mesh: &RawMesh) -> Vec<[Corner; 3]> {
    let low = mesh.positions.iter().copied().reduce(DVec3::min).unwrap();
    let high = mesh.positions.iter().copied().reduce(DVec3::max).unwrap();
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).max_element());
    let corner = |i: u32| {
        let i = i as usize;
        let (p, n) = ((mesh.positions[i] - middle) / half, mesh.normals[i].normalize());
        let (uv, c) = (mesh.uvs[i], mesh.colors[i].to_array().map(f64::from));
        [p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y, c[0], c[1], c[2]]
    };
    mesh.triangles.iter().map(|t| t.map(corner)).collect()
}

/// The distance between the corners of two triangles, whichever corner comes first.
fn apart(a: &[Corner; 3], b: &[Corner; 3]) -> f64 {
    let turned = |by: usize| {
        let corners = (0..3).flat_map(|i| a[i].iter().zip(&b[(i + by) % 3]));
        corners.fold(0.0f64, |most, (a, b)| most.max((a - b).abs()))
    };
    (0..3).map(turned).fold(f64::INFINITY, f64::min)
}

#[test]
fn packed_meshes_are_those_unpacked() {
    let plain = piece(seed!("plain"));
    let expected = triangles(sheet(&plain));
    for (name, bytes) in [
        ("edgebreaker", &seed!("draco_edgebreaker")[..]),
        ("sequential", seed!("draco_sequential")),
        ("quantized", seed!("meshopt_quantized")),
        ("filtered", seed!("meshopt_filtered")),
    ] {
        let packed = piece(bytes);
        let mut found = triangles(sheet(&packed));
        assert_eq!(found.len(), expected.len(), "{name}");
        for triangle in &expected {
            let (i, off) = (0..found.len())
                .map(|i| (i, apart(triangle, &found[i])))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            // Normals have at least eight bits.
            assert!(off < 0.012, "{name}: {off}");
            found.swap_remove(i);
        }
        assert_eq!(packed.notes, plain.notes, "{name}");
    }
}

/// A GLB file with changed JSON and otherwise the same bytes.
fn with_json(glb: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut json: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    change(&mut json);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &glb[20 + length..];
    let mut made = glb[..8].to_vec();
    made.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    made.extend((text.len() as u32).to_le_bytes());
    made.extend(&glb[16..20]);
    made.extend(text);
    made.extend(rest);
    made
}

/// Accessors only describe what Draco packed: several attributes may name the same one, and each keeps its own data.
#[test]
fn attributes_that_draco_packed_may_name_one_accessor() {
    let glb = seed!("draco_edgebreaker");
    let normals_by_positions = with_json(glb, |json| {
        let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
        attributes["NORMAL"] = attributes["POSITION"].clone();
        attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"].clone();
        let packed = &mut json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"];
        packed["TEXCOORD_1"] = packed["POSITION"].clone();
    });
    let (plain, shared) = (piece(glb), piece(&normals_by_positions));
    let (plain, shared) = (triangles(sheet(&plain)), triangles(sheet(&shared)));
    let off = plain.iter().zip(&shared).map(|(a, b)| apart(a, b));
    assert!(off.fold(0.0, f64::max) < 1e-9 && plain.len() == shared.len());
}

/// Unknown chunks and trailing bytes are ignored; truncation is an error.
#[test]
fn other_chunks_are_ignored() {
    let glb = seed!("plain");
    let plain = triangles(sheet(&piece(glb)));
    let mut longer = glb.to_vec();
    longer.extend(4u32.to_le_bytes());
    longer.extend(b"ODD\0four");
    let length = longer.len() as u32;
    longer[8..12].copy_from_slice(&length.to_le_bytes());
    longer.extend(b"behind");
    assert_eq!(triangles(sheet(&piece(&longer))), plain);
    let cut = read_glb(&glb[..glb.len() - 9]);
    let claimed = format!("it has {} bytes; {} are claimed", glb.len() - 9, glb.len());
    assert!(cut.is_err_and(|flaw| flaw.message.contains(&claimed)));
    for length in 0..glb.len().min(64) {
        assert!(read_glb(&glb[..length]).is_err());
    }
}

#[test]
fn packed_pictures_are_those_unpacked() {
    let plain = piece(seed!("plain"));
    for (name, bytes, near) in [
        ("WebP", &seed!("webp")[..], 0.0),
        ("UASTC", seed!("ktx2_uastc"), 0.01),
        ("ETC1S", seed!("ktx2_etc1s"), 0.06),
    ] {
        let packed = piece(bytes);
        assert_eq!(packed.images.len(), plain.images.len(), "{name}");
        for (file, image) in &packed.images {
            let other = &plain.images[file];
            assert_eq!(
                (image.width, image.height),
                (other.width, other.height),
                "{name}: {file}"
            );
            let off = |(a, b): (&Rgb, &Rgb)| (*a - *b).abs().element_sum() / 3.0;
            let pairs = image.pixels.iter().zip(&other.pixels);
            let mean = pairs.map(off).sum::<f32>() / image.pixels.len() as f32;
            assert!(mean <= near, "{name}: {file}: {mean}");
        }
        assert_eq!(packed.text, plain.text, "{name}");
        assert_eq!(packed.notes, plain.notes, "{name}");
    }
}

#[test]
fn what_is_packed_wrongly_is_named() {
    let packed = |extension: Value| {
        let mut file = file(json!({ "extensionsUsed": ["KHR_meshopt_compression"] }));
        file["bufferViews"][0]["extensions"] = json!({ "KHR_meshopt_compression": extension });
        load_with(&file, "").unwrap_err()
    };
    let view = |name: &str, value: Value| {
        let mut view = json!({
            "buffer": 0, "byteLength": 40, "byteStride": 12, "count": 4, "mode": "ATTRIBUTES", "filter": "NONE"
        });
        view[name] = value;
        packed(view)
    };
    for (error, words) in [
        (
            packed(json!({ "buffer": 0 })),
            "buffer view 0, packed by meshopt: missing field",
        ),
        (
            view("mode", json!("STRIPS")),
            "the mode \"STRIPS\"; expected ATTRIBUTES, TRIANGLES or INDICES",
        ),
        (
            view("filter", json!("SHARP")),
            "the filter \"SHARP\", which is not known",
        ),
        (
            view("byteStride", json!(13)),
            "4 Attributes of 13 bytes with the filter None cannot be",
        ),
        (
            view("byteLength", json!(4000)),
            "buffer view 0 reaches beyond its buffer",
        ),
        (view("buffer", json!(7)), "buffer view 0 reaches beyond its buffer"),
        (
            view("count", json!(4)),
            "its packed elements begin with neither 0xa0 nor 0xa1",
        ),
    ] {
        assert!(error.contains(words), "{words}: {error}");
    }

    let draco = |extension: Value| {
        let mut file = file(json!({ "extensionsUsed": ["KHR_draco_mesh_compression"] }));
        file["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_draco_mesh_compression": extension });
        load_with(&file, "").unwrap_err()
    };
    let error = draco(json!({ "bufferView": 0, "attributes": { "POSITION": 0 } }));
    assert!(error.contains("not a sound mesh of Draco: "), "{error}");
    let error = draco(json!({ "bufferView": 9, "attributes": { "POSITION": 0 } }));
    assert!(
        error.contains("its mesh by Draco is in buffer view 9, which is not there"),
        "{error}"
    );
}

/// A blend scatters light through; metal transmits none.
#[test]
fn sheets_scatter_light_through() {
    let with = |pbr: Value, through: Value| {
        let mut file = file(json!({ "materials": [{ "pbrMetallicRoughness": pbr }] }));
        file["materials"][0]["extensions"] = json!({ "KHR_materials_diffuse_transmission": through });
        piece(file.to_string().as_bytes())
    };
    let half = json!({ "diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [0.2, 0.4, 1.0] });
    let leaf = with(json!({ "metallicFactor": 0.0 }), half.clone());
    for line in [
        "weight = 0.5",
        "type = \"translucent\"",
        "transmittance = [0.2, 0.4, 1.0]",
        "reflectance = 0.0",
    ] {
        assert!(leaf.text.contains(line), "{line}: {}", leaf.text);
    }
    assert!(
        leaf.notes
            .iter()
            .any(|note| note.contains("is a blend with translucent")),
        "{:?}",
        leaf.notes
    );
    let metal = with(json!({}), half);
    assert!(!metal.text.contains("translucent"), "{}", metal.text);
    let none = with(json!({ "metallicFactor": 0.0 }), json!({}));
    assert!(
        !none.text.contains("translucent") && none.notes.is_empty(),
        "{}",
        none.text
    );
}
