//! How does a GPU render a pass, with the same bits on every device? What one device has computed, another device can
//! verify, or a processor with a software driver.
//!
//! A [`Choice`](device::Choice) names a device. [`Tested::open`](self_test::Tested::open) opens it and tests its
//! arithmetic, [`GpuPass::new`](pass::GpuPass::new) uploads a scene and its plan, or says why the device cannot render
//! them, and [`GpuPass::render`](pass::GpuPass::render) renders a pass by its index. Scene, plan and picture are those
//! of `beamfarm_render`.
//!
//! ```text
//! Choice ──────── device, self_test ── Tested ──┐
//! Scene, RenderPlan ── world ── WorldBuffers ───┴── GpuPass (pass)
//!                                                     │
//!                  ┌──────────────────────────────────┴───────┐
//!         photon paths (trace)                           camera paths ── film ── PassImage
//!                  │                                          ▲
//!                  ├── beams: pieces, a hierarchy ── gather ──┤
//!                  └── photons: a hierarchy ─────── estimate ─┘
//! ```
//!
//! The first pass of a job, on the best device there is:
//!
//! ```
//! use beamfarm_gpu::device::Choice;
//! use beamfarm_gpu::pass::GpuPass;
//! use beamfarm_gpu::self_test::Tested;
//! use beamfarm_render::plan::RenderPlan;
//! use beamfarm_render::plan::engine::PassImage;
//! use beamfarm_render::world::Scene;
//!
//! fn first_pass(scene: &Scene, plan: &RenderPlan) -> beamfarm_gpu::error::Result<PassImage> {
//!     let tested = Tested::open(&Choice::Best)?;
//!     GpuPass::new(&tested, scene, plan)?.render(0)
//! }
//! ```
//!
//! | question                                          | module             |
//! | ------------------------------------------------- | ------------------ |
//! | which devices are there, and what do they run?    | [`device`]         |
//! | does a device compute correctly?                  | [`self_test`]      |
//! | how does a kernel become a device's program?      | [`spirv`]          |
//! | which kernels are there?                          | [`kernels`]        |
//! | what do a kernel's functions give on a processor? | [`twin`]           |
//! | how are random numbers addressed?                 | [`sampler`]        |
//! | how are numbers summed, and keys sorted?          | [`scan`], [`sort`] |
//! | how is a hierarchy over boxes built?              | [`hierarchy`]      |
//! | how many workgroups run?                          | [`sizes`]          |
//! | how is a scene laid out on the device?            | [`world`]          |
//! | where do photons go, and what do they store?      | [`trace`]          |
//! | what do photon beams contribute along a ray?      | [`beams`]          |
//! | what do surface photons contribute at a point?    | [`photons`]        |
//! | how is a pass rendered?                           | [`pass`]           |
//!
//! # What a kernel may do
//!
//! Kernels are written in WGSL, which alone does not give the same bits on all devices: drivers contract `a * b + c`
//! into one operation, flush denormal numbers to zero, divide by multiplying with a reciprocal, and have their own
//! `exp`, `sin` and `dot`. So [`spirv`] forbids contraction, requests IEEE 754 denormal numbers, signed zeros,
//! infinities, NaN and rounding to nearest, and rejects whatever is still inexact. Not all devices accept these
//! requests: [`self_test`] decides whether one computes correctly.
//!
//! - Floats are added, subtracted, multiplied, negated and compared, go through `abs`, `floor`, `ceil`, `trunc` and
//!   `round`, are chosen by `select`, and are converted from and to integers within range.
//! - No `/`, `sqrt`, `exp`, `sin` and the like, no `dot`, `length`, `normalize`, `mix`, `fma`, no matrices. Our own
//!   functions, built from the operations above, replace them.
//! - No `!=` of floats: it is compiled to a comparison that is false for NaN. Use `!(a == b)`.
//! - No `min`, `max`, `clamp` and `sign` of floats either: devices differ for zeros and NaN. Use `select`.
//! - Nothing whose order is random: no atomic floats, and no use of the value that an atomic operation returns. Sums
//!   of integers by atomic operations are the same in any order.
//! - Nothing that some devices lack or do differently: floats of 16 or 64 bits, integers of 64 bits, subgroups,
//!   images, ray queries.
//! - Integers are shifted by less than 32 bits. Buffers are not read out of bounds, though no device fails on it.
//! - Loops iterate fewer than 2^16 times, all loops of a thread together: software drivers silently end them there.
//! - A kernel is written for one pass. A pass's own buffers are in group 1, all others in group 0: [`spirv`] makes
//!   workgroups with number `z` along the third axis use the part of pass `z`, so that a dispatch serves several
//!   passes.
//! - Workgroup memory is written before it is read; nothing else clears it.
//! - Constants are written as numbers: the compiler evaluates constant expressions.
//! - The bits of a NaN mean nothing: a kernel does not store one where it is read as anything else.

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
