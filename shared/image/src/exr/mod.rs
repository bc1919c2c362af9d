//! EXR in and out: block images on the wire, final images on disk.

mod block;
mod cryptomatte;
mod denoised;
mod hash;
mod header;
mod image;
mod read;
mod sketch;

pub use block::{BlockMeta, decode_block, encode_block, encoded_size};
pub use cryptomatte::Names;
pub use denoised::{DenoiseLayers, DenoisedMeta, write_denoised};
pub use hash::{node_hash, node_hashes, pixel_hash};
pub use image::{ImageMeta, MadeOf, Maker, Provenance, encode_image, write_image};
pub use read::{
    check_claims, decode_rgb, headers, not_read, read_channels, read_rgb, read_standard_error, without_panic,
};
pub use sketch::{SketchMeta, write_sketch};
