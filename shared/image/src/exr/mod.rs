//! EXR in and out: block images on the wire, final images on disk.

mod block;
mod header;
mod image;

pub use block::{BlockMeta, decode_block, encode_block, encoded_size};
pub use image::{
    ImageMeta, Maker, Names, Provenance, check_claims, decode_rgb, encode_image, node_hash, node_hashes, pixel_hash,
    read_rgb, read_standard_error, without_panic, write_image,
};
