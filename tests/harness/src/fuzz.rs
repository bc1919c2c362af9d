//! Readers of untrusted bytes, one function each: the bodies of the fuzz targets in `tests/fuzz`, which the test `fuzz`
//! runs on their seeds and on mutations of them.
//!
//! A reader may refuse its input; it must not panic, overflow the stack, take more memory than its input allows, or run
//! for long.

pub mod farm;

pub use farm::{control, give_back, submit};

use beamfarm_image::bundle::Bundle;
use beamfarm_image::exr::{decode_block, decode_rgb};
use beamfarm_image::job::Block;
use beamfarm_image::layer::{Layer, LightGroup};
use beamfarm_proto::{Grant, Job, wire};
use beamfarm_scene::{ImportOptions, SceneFile, read_bundle};
use prost::Message;
use rand_core::Rng;
use rand_pcg::Pcg32;

/// A fuzz target.
#[derive(Clone, Copy)]
pub struct Target {
    /// Name of the function, of the binary in `tests/fuzz`, and of the folder of its seeds.
    pub name: &'static str,
    /// Reads an input.
    pub run: fn(&[u8]),
}

/// All of them.
pub const TARGETS: &[Target] = &[
    Target {
        name: "block",
        run: block,
    },
    Target {
        name: "control",
        run: farm::control,
    },
    Target { name: "exr", run: exr },
    Target {
        name: "give_back",
        run: farm::give_back,
    },
    Target {
        name: "gltf",
        run: gltf,
    },
    Target { name: "hdr", run: hdr },
    Target {
        name: "jpeg",
        run: jpeg,
    },
    Target {
        name: "ktx2",
        run: ktx2,
    },
    Target {
        name: "mitsuba",
        run: mitsuba,
    },
    Target { name: "obj", run: obj },
    Target { name: "ply", run: ply },
    Target { name: "png", run: png },
    Target {
        name: "scene",
        run: scene,
    },
    Target {
        name: "submit",
        run: farm::submit,
    },
    Target { name: "vdb", run: vdb },
    Target { name: "vol", run: vol },
    Target {
        name: "webp",
        run: webp,
    },
    Target {
        name: "wire",
        run: wire,
    },
];

const VIEW: &str = "image = { width = 8, height = 8 }
camera = { origin = [0, 0, 5], target = [0, 0, 0], fov = 40 }
";

/// Loads a scene of `text` that has `file`.
fn load(text: &str, name: &str, file: &[u8]) {
    let bundle = Bundle {
        scene: "scene.toml".into(),
        files: [("scene.toml", text.as_bytes()), (name, file)]
            .map(|(name, bytes)| (name.to_string(), bytes.to_vec()))
            .into(),
    };
    // Whether it is refused does not matter.
    let _ = beamfarm_scene::load(&bundle);
}

fn mesh(name: &str, data: &[u8]) {
    let text = format!("{VIEW}[[shapes]]\ntype = \"mesh\"\nfile = \"{name}\"");
    load(&text, name, data);
}

fn image(name: &str, data: &[u8]) {
    let text = format!("{VIEW}[[lights]]\ntype = \"environment\"\nimage = \"{name}\"");
    load(&text, name, data);
}

fn volume(name: &str, data: &[u8]) {
    let text = format!(
        "{VIEW}[media.smoke]\ntype = \"heterogeneous\"\nsigma_a = 1\nsigma_s = 1\ndensity = {{ file = \"{name}\" }}"
    );
    load(&text, name, data);
}

/// A scene file with a mesh, a picture and a volume.
pub fn scene(data: &[u8]) {
    const FILES: [(&str, &[u8]); 3] = [
        ("a.ply", include_bytes!("../../fuzz/seeds/ply/square_ascii.ply")),
        ("a.png", include_bytes!("../../fuzz/seeds/png/rgb.png")),
        ("a.vol", include_bytes!("../../data/volumes/grid.vol")),
    ];
    let mut bundle = Bundle {
        scene: "scene.toml".into(),
        files: FILES.map(|(name, bytes)| (name.to_string(), bytes.to_vec())).into(),
    };
    bundle.files.insert("scene.toml".into(), data.to_vec());
    let _ = beamfarm_scene::load(&bundle);
}

/// A glTF file and its camera.
pub fn gltf(data: &[u8]) {
    let gltf = "[[gltf]]\nfile = \"a.glb\"\n";
    load(&format!("{VIEW}{gltf}"), "a.glb", data);
    let camera = "image = { width = 8, height = 8 }\ncamera = { gltf = \"a.glb\" }\n";
    load(camera, "a.glb", data);
    // Which files are next to it.
    if let Ok(folder) = tempfile::tempdir() {
        let scene = folder.path().join("scene.toml");
        let written = std::fs::write(&scene, format!("{VIEW}{gltf}"))
            .and_then(|()| std::fs::write(folder.path().join("a.glb"), data));
        if written.is_ok() {
            let _ = read_bundle(&scene);
            let file = SceneFile::read(&folder.path().join("a.glb"), &ImportOptions::default());
            let _ = file.and_then(|file| file.load());
        }
    }
}

/// A Mitsuba scene.
pub fn mitsuba(data: &[u8]) {
    if let Ok(folder) = tempfile::tempdir() {
        let scene = folder.path().join("scene.xml");
        if std::fs::write(&scene, data).is_ok() {
            let file = SceneFile::read(&scene, &ImportOptions::default());
            let _ = file.and_then(|file| file.load());
        }
    }
}

/// A PLY mesh.
pub fn ply(data: &[u8]) {
    mesh("a.ply", data);
}

/// An OBJ mesh.
pub fn obj(data: &[u8]) {
    mesh("a.obj", data);
}

/// A PNG picture, with its checksums corrected.
pub fn png(data: &[u8]) {
    let mut data = data.to_vec();
    let mut at = 8;
    while let Some(length) = data.get(at..).and_then(|rest| rest.first_chunk()) {
        let end = (at + 8).saturating_add(u32::from_be_bytes(*length) as usize);
        let Some(chunk) = data.get(at + 4..end) else {
            break;
        };
        let sum = crc32(chunk).to_be_bytes();
        match data.get_mut(end..end + 4) {
            Some(given) => given.copy_from_slice(&sum),
            None => break,
        }
        at = end + 4;
    }
    image("a.png", &data);
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

/// A JPEG picture.
pub fn jpeg(data: &[u8]) {
    image("a.jpg", data);
}

/// A WebP picture.
pub fn webp(data: &[u8]) {
    image("a.webp", data);
}

/// A KTX2 texture of Basis Universal.
pub fn ktx2(data: &[u8]) {
    image("a.ktx2", data);
}

/// A picture in Radiance's format.
pub fn hdr(data: &[u8]) {
    image("a.hdr", data);
}

/// An OpenEXR picture: a texture, and an image to compare with.
pub fn exr(data: &[u8]) {
    image("a.exr", data);
    let _ = decode_rgb(data);
}

/// An OpenVDB volume.
pub fn vdb(data: &[u8]) {
    volume("a.vdb", data);
}

/// A Mitsuba volume.
pub fn vol(data: &[u8]) {
    volume("a.vol", data);
}

/// A block image from a worker, 5 x 4 pixels, for a job without layers and for one with [`layers`].
pub fn block(data: &[u8]) {
    let _ = decode_block(data, 5, 4, &[]);
    let _ = decode_block(data, 5, 4, &layers());
}

/// Layers of a job.
pub fn layers() -> [Layer; 2] {
    [Layer::Depth, Layer::Light(LightGroup::named("key"))]
}

/// A message of the farm; the first byte selects its type.
pub fn wire(data: &[u8]) {
    let Some((kind, data)) = data.split_first() else {
        return;
    };
    match kind % 4 {
        0 => {
            if let Ok(reply) = wire::RegisterReply::decode(data) {
                let _ = reply.job.map(Job::try_from);
            }
        }
        1 => {
            let _ = wire::LeaseReply::decode(data).map(Grant::try_from);
        }
        2 => {
            if let Ok(wire::SubmitRequest {
                part: Some(wire::submit_request::Part::Header(header)),
            }) = wire::SubmitRequest::decode(data)
            {
                let _ = header.block.map(Block::try_from);
            }
        }
        // Only numbers and text are read from these.
        _ => {
            let _ = wire::RegisterRequest::decode(data);
            let _ = wire::FetchFileRequest::decode(data);
            let _ = wire::FileChunk::decode(data);
            let _ = wire::Heartbeat::decode(data);
            let _ = wire::Notice::decode(data);
            let _ = wire::LeaseRequest::decode(data);
            let _ = wire::SubmitReply::decode(data);
            let _ = wire::FailRequest::decode(data);
            let _ = wire::FailReply::decode(data);
            let _ = wire::GiveBackRequest::decode(data);
            let _ = wire::GiveBackReply::decode(data);
            // Requests of clients that steer.
            let _ = wire::StatusRequest::decode(data);
            let _ = wire::StatusReply::decode(data);
            let _ = wire::CancelRequest::decode(data);
            let _ = wire::CancelReply::decode(data);
            let _ = wire::PauseRequest::decode(data);
            let _ = wire::PauseReply::decode(data);
            let _ = wire::ResumeRequest::decode(data);
            let _ = wire::ResumeReply::decode(data);
            let _ = wire::ExtendRequest::decode(data);
            let _ = wire::ExtendReply::decode(data);
            let _ = wire::WriteNowRequest::decode(data);
            let _ = wire::WriteNowReply::decode(data);
        }
    }
}

/// Numbers at which sizes, counts and indices tend to go wrong.
const INTERESTING: [u64; 16] = [
    0,
    1,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x10000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fc0_0000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];

/// Significant tokens of text formats.
const TEXT: [&str; 16] = [
    "-1",
    "0",
    "1e39",
    "nan",
    "4294967296",
    "99999999999999999999",
    "inf",
    "\n",
    " ",
    "\"",
    "[",
    "]",
    "{",
    "}",
    ".",
    "\0",
];

/// A damaged copy: up to four changes, each of which flips a byte, cuts, doubles or inserts a piece (also from
/// `other`), truncates the end, or puts in a number.
pub fn mutate(seed: &[u8], other: &[u8], random: &mut Pcg32) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    let mut below = |n: usize| random.next_u32() as usize % n.max(1);
    for _ in 0..=below(4) {
        let at = below(bytes.len() + 1);
        let end = (at + 1 + below(16)).min(bytes.len());
        match below(16) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            // A long piece, so that whole blocks repeat.
            3 => {
                let piece = bytes[at..(at + below(512)).min(bytes.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            4 => {
                let from = below(other.len() + 1);
                let piece = &other[from..(from + 1 + below(256)).min(other.len())];
                bytes.splice(at..end, piece.iter().copied());
            }
            5 | 6 => {
                let word = TEXT[below(TEXT.len())];
                // In place of a number in the text.
                let number = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-');
                let after = bytes[at..].iter().take_while(|b| number(b)).count();
                bytes.splice(at..at + after, word.bytes());
            }
            7..=10 => {
                let number = INTERESTING[below(INTERESTING.len())];
                let size = [1, 2, 4, 8][below(4)];
                let put = match below(2) {
                    0 => number.to_le_bytes()[..size].to_vec(),
                    _ => number.to_be_bytes()[8 - size..].to_vec(),
                };
                for (byte, new) in bytes[at..].iter_mut().zip(put) {
                    *byte = new;
                }
            }
            _ => {
                let bit = 1 << below(8);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= bit;
                }
            }
        }
    }
    bytes
}
