use super::*;
use beamfarm_render::world::medium::bricks::Bricks;
use glam::{DVec3, IVec3};

fn file(name: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/volumes/");
    std::fs::read(format!("{folder}{name}")).unwrap()
}

fn text(name: &str) -> String {
    String::from_utf8(file(name)).unwrap()
}

fn numbers<T: std::str::FromStr<Err: std::fmt::Debug>>(words: &[&str]) -> Vec<T> {
    words.iter().map(|w| w.parse().unwrap()).collect()
}

fn vdb(bytes: &[u8]) -> Result<RawDensity, Flaw> {
    read("a.vdb", bytes, None)
}

fn message(result: Result<RawDensity, Flaw>) -> String {
    result.unwrap_err().message
}

fn samples(core: &Core) -> impl Iterator<Item = (IVec3, f32)> {
    (0..512).map(move |i| {
        let value = match core {
            Core::Constant(value) => *value,
            Core::Samples(values) => values[i as usize],
        };
        (IVec3::new(i & 7, i >> 3 & 7, i >> 6), value)
    })
}

fn value(raw: &RawDensity, at: IVec3) -> f32 {
    let wanted = at & 7;
    let core = raw.cores.get(&(at >> 3i32).to_array());
    core.map_or(0.0, |core| samples(core).find(|(at, _)| *at == wanted).unwrap().1)
}

/// The same hash of all samples as in `write_vdb.cpp`.
fn hash(raw: &RawDensity) -> u64 {
    let mut sum = 0u64;
    for (brick, core) in &raw.cores {
        for (at, value) in samples(core).filter(|(_, value)| *value != 0.0) {
            let mut h = u64::from(value.to_bits());
            for axis in (at + IVec3::from(*brick) * 8).to_array() {
                h = (h ^ u64::from(axis as u32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            }
            sum = sum.wrapping_add(h ^ h >> 32);
        }
    }
    sum
}

/// Every sample and every grid's transform equals OpenVDB's.
#[test]
fn openvdb_files_are_read_as_openvdb_does() {
    let expected = text("expected.txt");
    let sections = expected.split("grid ").skip(1);
    let mut count = 0;
    for section in sections {
        let mut lines = section.lines().map(|l| l.split(' ').collect::<Vec<_>>());
        let [file_name, grid] = lines.next().unwrap()[..] else {
            panic!("{section}");
        };
        let name = format!("{file_name}.vdb");
        let raw = read(&name, &file(&name), Some(grid)).unwrap();
        for line in lines {
            let place = || IVec3::from_slice(&numbers(&line[1..4]));
            match line[0] {
                "box" => {
                    let (low, high) = (place(), IVec3::from_slice(&numbers(&line[4..7])));
                    assert_eq!(raw.samples, [low - 1, high + 1], "{name}");
                    assert_eq!(raw.domain, raw.samples.map(|s| s.as_dvec3()));
                }
                "hash" => assert_eq!(hash(&raw), numbers::<u64>(&line[1..])[0], "{name}"),
                "value" => {
                    let expected: f32 = numbers(&line[4..])[0];
                    assert_eq!(value(&raw, place()), expected, "{name} at {}", place());
                }
                "world" => {
                    let expected = DVec3::from_slice(&numbers(&line[4..]));
                    let got = raw.to_object.transform_point3(place().as_dvec3());
                    let error = (got - expected).length();
                    assert!(error <= 1e-13 * (1.0 + expected.length()), "{name}: {got}, {expected}");
                }
                _ => panic!("{line:?}"),
            }
        }
        Bricks::new(&raw).unwrap();
        count += 1;
    }
    assert_eq!(count, 19);
}

#[test]
fn mitsuba_files_are_read_as_mitsuba_does() {
    let raw = read("GRID.VOL", &file("grid.vol"), None).unwrap();
    assert_eq!(raw.samples, [IVec3::ZERO, IVec3::new(9, 4, 2)]);
    let corners = raw.domain.map(|p| raw.to_object.transform_point3(p));
    assert!(corners[0].length() < 1e-15 && (corners[1] - 1.0).length() < 1e-15);
    let bricks = Bricks::new(&raw).unwrap();
    let mut count = 0;
    for line in text("expected_vol.txt").lines() {
        let line: Vec<f64> = numbers(&line.split(' ').collect::<Vec<_>>());
        let point = DVec3::from_slice(&line);
        let got = bricks.density(bricks.to_object().inverse().transform_point3(point).as_vec3());
        assert!((f64::from(got) - line[3]).abs() < 2e-6, "{got}, {line:?}");
        count += 1;
    }
    assert_eq!(count, 60);
}

#[test]
fn the_grid_that_is_meant_is_read() {
    let several = file("several.vdb");
    let pick = |name| read("several.vdb", &several, name);
    assert_eq!(hash(&pick(None).unwrap()), hash(&pick(Some("density")).unwrap()));
    assert_ne!(
        hash(&pick(Some("heat[0]")).unwrap()),
        hash(&pick(Some("heat[1]")).unwrap())
    );
    let heat = vdb(&file("only_heat.vdb")).unwrap();
    assert_eq!(hash(&heat), hash(&pick(Some("heat[0]")).unwrap()));
    for (name, reason) in [
        (
            "heat",
            "it has several grids \"heat\". Its grids: \"wind\" of type Tree_vec3s_5_4_3, \"heat[0]\" of",
        ),
        ("fuel", "it has no grid \"fuel\". Its grids: \"wind\""),
        (
            "wind",
            "the grid \"wind\": its type is Tree_vec3s_5_4_3; expected Tree_float_5_4_3",
        ),
        ("id", "the grid \"id\": its type is Tree_int32_5_4_3"),
    ] {
        let message = message(pick(Some(name)));
        assert!(message.contains(reason), "{message}");
    }
    let no_floats = message(vdb(&file("no_floats.vdb")));
    assert!(
        no_floats.contains("it has no grid of floats. Its grids: \"wind\" of"),
        "{no_floats}"
    );
    let unusable = message(vdb(&file("unusable.vdb")));
    assert!(
        unusable.contains("no grid \"density\", but several that could be meant"),
        "{unusable}"
    );
    let unnamed = message(read("grid.vol", &file("grid.vol"), Some("density")));
    assert!(unnamed.contains("has no name"), "{unnamed}");
    let unknown = message(read("grid.nvdb", &[], None));
    assert!(unknown.contains("expected .vdb or .vol"), "{unknown}");
}

#[test]
fn grids_that_are_no_densities_say_why() {
    let bytes = file("unusable.vdb");
    for (name, reason) in [
        ("empty", "the grid \"empty\": it is empty"),
        ("level set", "it is a level set"),
        ("background", "its background is 0.5; expected 0"),
        ("frustum", "its transform is a frustum"),
        ("root tile", "a tile of value 1 at (8192, 0, 0), 4096 samples"),
        ("many tiles", "its tiles cover more than 4000000 blocks"),
    ] {
        let message = message(read("a.vdb", &bytes, Some(name)));
        assert!(message.contains(reason), "{message}");
    }
    let stream = message(vdb(&file("stream.vdb")));
    assert!(stream.contains("written as a stream"), "{stream}");
}

/// Offset after a text.
fn after(bytes: &[u8], text: &str) -> usize {
    let at = bytes.windows(text.len()).position(|w| w == text.as_bytes());
    at.unwrap() + text.len()
}

fn patched(bytes: &[u8], patches: &[(usize, &[u8])]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (at, patch) in patches {
        bytes[*at..*at + patch.len()].copy_from_slice(patch);
    }
    bytes
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(*bytes[at..].first_chunk().unwrap())
}

#[test]
fn versions_other_than_222_to_225_are_refused() {
    let bytes = file("zip.vdb");
    let with = |version: u32| vdb(&patched(&bytes, &[(8, &version.to_le_bytes())]));
    for version in 222..=225 {
        assert_eq!(hash(&with(version).unwrap()), hash(&vdb(&bytes).unwrap()));
    }
    for version in [0, 221, 226, u32::MAX] {
        let message = message(with(version));
        let reason = format!("version {version} of the OpenVDB format is unsupported; expected 222 to 225");
        assert_eq!(message, reason);
    }
}

/// A half grid, which OpenVDB has since version 13; made here from a float grid saved as half.
#[test]
fn grids_of_halves_are_read() {
    let bytes = file("half.vdb");
    let kind = after(&bytes, "Tree_float_5_4_3_HalfFloat");
    let old = "Tree_float_5_4_3_HalfFloat".len();
    let new = b"Tree_half_5_4_3";
    let positions = kind + 4;
    let mut half = bytes[..kind - old - 4].to_vec();
    half.extend((new.len() as u32).to_le_bytes());
    half.extend(new);
    half.extend([0; 4]);
    let shift = (old - new.len()) as u64;
    // The background takes two bytes less.
    for (i, shift) in [shift, shift + 2, shift + 2].into_iter().enumerate() {
        half.extend((u64_at(&bytes, positions + 8 * i) - shift).to_le_bytes());
    }
    let background = after(&bytes, "ScaleTranslateMap") + 6 * 24 + 4;
    half.extend(&bytes[positions + 24..background]);
    half.extend(&bytes[background + 2..]);
    let raw = vdb(&patched(&half, &[(8, &[225])])).unwrap();
    assert_eq!(hash(&raw), hash(&vdb(&bytes).unwrap()));
}

/// An offset in a file, the bytes to write there, and the resulting message.
type Lie<'a> = (usize, &'a [u8], &'a str);

const HUGE: [u8; 4] = u32::MAX.to_le_bytes();
const BILLIONS: [u8; 4] = (1u32 << 31).to_le_bytes();
const TERABYTES: [u8; 8] = (1u64 << 42).to_le_bytes();

fn are_refused(bytes: &[u8], lies: &[Lie<'_>], read: impl Fn(&[u8]) -> Result<RawDensity, Flaw>) {
    for (at, patch, reason) in lies {
        let message = message(read(&patched(bytes, &[(*at, patch)])));
        assert!(message.contains(reason), "{message}, not {reason}");
    }
}

/// False headers are refused before anything of the claimed size is allocated.
#[test]
fn claims_of_headers_are_not_believed() {
    let bytes = file("blosc.vdb");
    let name = 65;
    let positions = after(&bytes, "Tree_float_5_4_3") + 4;
    let header = u64_at(&bytes, positions) as usize;
    let tree = after(&bytes, "UniformScaleMap") + 5 * 24;
    let class = after(&bytes, "fog volume") - 14;
    let lies: &[Lie<'_>] = &[
        (0, b"VDB ", "not an OpenVDB file"),
        (20, &[0], "written as a stream"),
        (57, &HUGE, "4294967295 metadata are claimed at byte 57"),
        (61, &BILLIONS, "2147483648 grids are claimed at byte 61"),
        (61, &2u32.to_le_bytes(), "ends within the description of a grid"),
        (
            name,
            &BILLIONS,
            "the file ends within the description of a grid: 2147483648 bytes expected at byte 69",
        ),
        (positions, &TERABYTES, "its header should be at byte 4398046511104"),
        (positions + 8, &TERABYTES, "its leaves' values should be at byte"),
        (
            positions + 8,
            &u64::MAX.to_le_bytes(),
            "should be at byte 18446744073709551615",
        ),
        (
            positions + 16,
            &TERABYTES,
            "the end of the grid \"density\" should be at byte",
        ),
        (
            positions + 16,
            &8u64.to_le_bytes(),
            "is said to end at byte 8, before its begin",
        ),
        (header, &[8], "its compression has flags 0x8"),
        (header, &HUGE, "its compression has flags 0xffffffff"),
        (header + 4, &HUGE, "4294967295 metadata are claimed"),
        (class, &HUGE, "the file ends within the metadata: 4294967295 bytes"),
        (tree - 5 * 24 - 3, b"Mop", "unsupported kind \"UniformScaleMop\""),
        (tree - 5 * 24 - 19, &HUGE, "the file ends within the grid's transform"),
    ];
    are_refused(&bytes, lies, vdb);

    let bytes = file("affine.vdb");
    let last = after(&bytes, "AffineMap") + 15 * 8;
    for number in [0.0, 1.001, f64::NAN] {
        let message = message(vdb(&patched(&bytes, &[(last, &number.to_le_bytes())])));
        let reason = format!("row 3 (from zero) of its matrix ends with {number}; expected 1");
        assert!(message.contains(&reason), "{message}");
    }
}

/// The same for nodes and chunks.
#[test]
fn claims_of_nodes_are_not_believed() {
    let bytes = file("blosc.vdb");
    let positions = after(&bytes, "Tree_float_5_4_3") + 4;
    let blocks = u64_at(&bytes, positions + 8) as usize;
    let tree = after(&bytes, "UniformScaleMap") + 5 * 24;
    let leaf = blocks + 64;
    let lies: &[Lie<'_>] = &[
        (tree, &BILLIONS, "its tree has -2147483648 buffers"),
        (tree + 4, &f32::NAN.to_le_bytes(), "its background is NaN"),
        (tree + 8, &BILLIONS, "2147483648 tiles of the root are claimed"),
        (tree + 12, &HUGE, "4294967295 nodes of the root are claimed"),
        (tree + 16, &[1], "expected multiples of 4096"),
        (tree + 16, &i32::MIN.to_le_bytes(), "up to 268435456"),
        (tree + 28, &[0xff; 4096], "the node at byte"),
        (tree + 28 + 8192, &[7], "inactive values of kind 7; expected 0 to 6"),
        (leaf, &[255], "inactive values of kind 255"),
        (
            leaf + 1,
            &TERABYTES,
            "the file ends within a node's values: 4398046511104 bytes",
        ),
        (
            leaf + 1,
            &i64::MIN.to_le_bytes(),
            "holds 9223372036854775808 bytes; expected",
        ),
        (
            leaf + 1,
            &i64::MAX.to_le_bytes(),
            "the file ends within a node's values",
        ),
        (leaf + 1, &0u64.to_le_bytes(), "holds 0 bytes; expected"),
        (leaf + 9, &[3], "has format version 3; expected 2"),
        (leaf + 9 + 4, &BILLIONS, "and holds 2147483648; expected"),
        (leaf + 9 + 12, &BILLIONS, "it takes 2147483648 bytes and holds"),
    ];
    are_refused(&bytes, lies, vdb);
}

#[test]
fn claims_of_mitsuba_volumes_are_not_believed() {
    let bytes = file("grid.vol");
    let lies: &[Lie<'_>] = &[
        (0, b"VOX", "not a Mitsuba volume"),
        (3, &[2], "version 2 of the format"),
        (4, &[3], "encoding 3 is unsupported; expected 1"),
        (8, &[0], "the grid is 0 x 5 x 3"),
        (8, &BILLIONS, "the grid is -2147483648 x 5 x 3"),
        (
            8,
            &[0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0],
            "takes 1125899906842624 bytes; 600 follow",
        ),
        (8, &[9], "takes 540 bytes; 600 follow"),
        (20, &[2], "the grid has 2 channels; expected 1 or 3"),
        (20, &[3], "samples of 3 channels takes 1800 bytes; 600 follow"),
    ];
    are_refused(&bytes, lies, |bytes| read("a.vol", bytes, None));
}

const FILES: [&str; 19] = [
    "blosc.vdb",
    "blosc_unmasked.vdb",
    "zip.vdb",
    "zip_unmasked.vdb",
    "uncompressed.vdb",
    "half.vdb",
    "half_zip.vdb",
    "double.vdb",
    "double_half.vdb",
    "sparse.vdb",
    "tiles.vdb",
    "affine.vdb",
    "inactive.vdb",
    "inactive_half.vdb",
    "several.vdb",
    "only_heat.vdb",
    "unusable.vdb",
    "no_floats.vdb",
    "grid.vol",
];

#[test]
fn truncated_files_are_refused() {
    for name in FILES {
        let bytes = file(name);
        for length in (0..bytes.len()).step_by(97).chain([bytes.len() - 1]) {
            assert!(read(name, &bytes[..length], None).is_err(), "{name}: {length}");
        }
    }
}

/// Damaged files are refused or read as something else, without a panic or excessive memory.
#[test]
fn damage_does_not_panic() {
    for name in FILES {
        crate::damage::damage(&[file(name)], |bytes| {
            if let Ok(raw) = read(name, bytes, None) {
                let cores = raw.cores.values();
                let stored = cores.filter(|c| matches!(c, Core::Samples(_))).count();
                assert!(64 * stored <= bytes.len(), "{name}: {stored}");
            }
        });
    }
}
