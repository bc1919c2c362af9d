//! Light that is split: angles by formulas, colours that come back to white, passes against the path tracer.

#![allow(clippy::unwrap_used)]

mod angles;
mod pictures;
