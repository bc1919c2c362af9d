//! Whole pictures: against the path tracer, against Mitsuba, and against their own earlier bits.

mod dense_media;
mod devices;
mod faults;
mod golden;
mod mitsuba;
mod panoramas;
mod partition;
mod random_scenes;
mod reference;
mod walls;
