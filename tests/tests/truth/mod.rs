//! Whole pictures: against the path tracer, Mitsuba and their own bits of before.

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
