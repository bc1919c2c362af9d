//! What a farm exchanges and sums: what is in a pass's image, how are passes averaged, what is known of the average?
//! The crate needs neither a network nor the renderer.
//!
//! A pass is a [`Film`](film::Film) with layers, in a [`Node`](merge::Node) that covers a [`Block`](job::Block) of
//! passes. Nodes travel as block images ([`exr::encode_block`], [`exr::decode_block`]). The entrance is
//! [`TreeSum`](merge::TreeSum): it takes nodes in any order and gives the [`Average`](merge::Average), which
//! [`exr::write_image`] and [`png::write_png`] write.
//!
//! ```text
//! Film ── Node::leaf ── Node ── block image ── Node ── TreeSum::insert ── TreeSum ── Average ─┬─ EXR, PNG, JPEG
//!         (worker)              (the wire)             (coordinator)                          ├─ error, bias
//!                                                                                             └─ denoised picture
//! ```
//!
//! ```
//! use beamfarm_image::film::Film;
//! use beamfarm_image::merge::{Node, TreeSum};
//!
//! let mut sum = TreeSum::new(4, 3);
//! for pass_index in [1, 0] {
//!     let mut film = Film::new(4, 3);
//!     film.pixels.fill([pass_index as f32; 3]);
//!     sum.insert(Node::leaf(pass_index, film))?;
//! }
//! let average = sum.average().expect("pass 0 is there");
//! assert_eq!((average.passes, average.beauty.pixels[0]), (2, [0.5; 3]));
//! # Ok::<(), beamfarm_image::merge::MergeError>(())
//! ```
//!
//! | question                                   | module      |
//! | ------------------------------------------ | ----------- |
//! | what is rendered, and how?                 | [`job`]     |
//! | how does the radius shrink?                | [`radius`]  |
//! | how are passes averaged?                   | [`merge`]   |
//! | how large is the bias of the average?      | [`bias`]    |
//! | how do two images differ?                  | [`metrics`] |
//! | what does a block look like?               | [`look`]    |
//! | how does a screen show radiance?           | [`view`]    |
//! | what would the picture be without noise?   | [`denoise`] |
//! | which files are read, and how much of them? | [`input`]  |

pub mod atomic;
pub mod bias;
pub mod bundle;
pub mod denoise;
pub mod error;
pub mod exr;
pub mod film;
pub mod input;
pub mod job;
pub mod jpeg;
pub mod layer;
pub mod look;
pub mod matte;
pub mod merge;
pub mod metrics;
pub mod png;
pub mod radius;
pub mod view;
