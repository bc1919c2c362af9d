//! Passes on GPUs, with the same bits on every device: what one device has computed, another can check, or a processor
//! by a driver in software.
//!
//! | question                                      | module             |
//! | --------------------------------------------- | ------------------ |
//! | which devices are there, and what do they do? | [`device`]         |
//! | does a device compute as it should?           | [`self_test`]      |
//! | how does a kernel become a device's program?  | [`spirv`]          |
//! | which kernels are there?                      | [`kernels`]        |
//! | what are a kernel's functions on a processor? | [`twin`]           |
//! | how are random numbers addressed?             | [`sampler`]        |
//! | how are numbers summed up, and keys sorted?   | [`scan`], [`sort`] |
//! | how is a hierarchy over boxes built?          | [`hierarchy`]      |
//! | how many workgroups run?                      | [`sizes`]          |
//! | what of a scene is on the device?             | [`world`]          |
//! | where do photons go, and what do they leave?  | [`trace`]          |
//! | what do photon beams bring along a ray?       | [`beams`]          |
//! | what do photons on surfaces bring to a point? | [`photons`]        |
//! | how is a pass rendered?                       | [`pass`]           |
//!
//! # What a kernel may do
//!
//! Kernels are written in WGSL. By itself that gives other bits on each device: drivers contract `a * b + c` into one
//! operation, flush denormal numbers to zero, divide by way of a reciprocal, and have their own `exp`, `sin` and `dot`.
//! So [`spirv`] forbids contraction, asks devices for denormal numbers, signed zeros, infinities and NaN as IEEE 754
//! has them and for rounding to nearest, and refuses what is not exact even so. Not all devices can be asked: whether
//! one computes as it should is for [`self_test`] to say.
//!
//! - Floats are added, subtracted, multiplied, negated and compared, go through `abs`, `floor`, `ceil`, `trunc` and
//!   `round`, are chosen by `select`, and are converted from and to integers within range.
//! - No `/`, `sqrt`, `exp`, `sin` and the like, no `dot`, `length`, `normalize`, `mix`, `fma`, no matrices. There are
//!   functions of our own instead, which are made of the above.
//! - No `!=` of floats: it is compiled to what is false for NaN. `!(a == b)` is not.
//! - No `min`, `max`, `clamp` and `sign` of floats either: devices differ in zeros and NaN. `select` says which is
//!   meant.
//! - Nothing whose order is by chance: no atomic floats, and no use of what an atomic operation returns. Sums of
//!   integers by atomic operations are the same in any order.
//! - Nothing that not every device has, or has alike: floats of 16 or 64 bits, integers of 64 bits, subgroups, images,
//!   ray queries.
//! - Integers are shifted by less than 32 bits; what a buffer has not is not read, though no device fails on it.
//! - Loops have fewer than 2^16 turns, those of all loops of a thread together: drivers in software end them there,
//!   without a word.
//! - A kernel is written for one pass. Buffers that a pass has for itself are of group 1, all others of group 0:
//!   [`spirv`] has workgroups of number `z` along the third axis use the part of pass `z`, so that a dispatch serves
//!   several.
//! - Memory of a workgroup is written before it is read; nothing else clears it.
//! - Constants are written as numbers. What is computed of constants is computed by the compiler.
//! - Bits of a NaN mean nothing: a kernel does not store them where they are read as anything else.

pub mod beams;
pub mod device;
pub mod error;
pub mod hierarchy;
pub mod kernels;
pub mod pass;
pub mod photons;
pub mod sampler;
pub mod scan;
pub mod self_test;
pub mod sine;
pub mod sizes;
pub mod sort;
pub mod spirv;
#[cfg(test)]
mod testing;
pub mod trace;
pub mod twin;
pub mod world;
