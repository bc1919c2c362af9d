//! What a farm exchanges and sums: everything about images and jobs that needs neither a network nor the renderer.
//!
//! A pass's [`Film`](film::Film) goes over the wire as a block image ([`exr`]); the [`TreeSum`](merge::TreeSum) of
//! passes gives the average, which [`exr`] and [`png`] write.
//!
//! | question                              | module     |
//! | ------------------------------------- | ---------- |
//! | what is rendered, and how?            | [`job`]    |
//! | how does the radius shrink?           | [`radius`] |
//! | how are passes averaged?              | [`merge`]  |
//! | how large is the bias of the average? | [`bias`]   |
//! | how do two images differ?             | [`metrics`] |
//! | what does a block look like?          | [`look`]   |
//! | how does a screen show radiance?      | [`view`]   |
//! | what would it be without noise?       | [`denoise`] |
//! | which files are read, how much of them? | [`input`] |

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
