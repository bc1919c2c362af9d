//! Photon paths of a pass on a device.
//!
//! | question                                      | module, kernels                    |
//! | --------------------------------------------- | ---------------------------------- |
//! | what does a path depend on beside the scene?  | [`TraceTables`]; `trace_plan.wgsl` |
//! | how wide is a photon's share of the light?    | `footprint.wgsl`                   |

mod plan;
#[cfg(test)]
mod tests;

pub use plan::{TraceBuffers, TracePlan, TraceTables, TracedLight, TracedMedium, TracedObject};
