//! Lights: what they emit, and how they are sampled, against closed forms and against each other.

mod beams;
mod choice;
mod direct;
mod emission;
mod environment;
mod large_ground;
mod pattern;
mod setup;
mod shares;
mod sizes;
mod soft;
mod two_sides;
