//! Maps from uniform numbers to distributions: each sampler beside its density.
