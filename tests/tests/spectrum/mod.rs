//! Dispersion: angles against formulas, colours that mix back to white, passes against the path tracer.

mod angles;
mod pictures;
