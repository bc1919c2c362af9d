//! Light that is split: angles by formulas, colours that come back to white, passes against the path tracer.

mod angles;
mod pictures;
