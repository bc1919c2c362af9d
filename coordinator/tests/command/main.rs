//! The command as users and scripts run it: real processes.

#![allow(clippy::unwrap_used)]

mod access;
mod bench;
#[cfg(unix)]
mod chaos;
mod complaints;
mod devices;
mod disks;
mod edits;
#[cfg(unix)]
mod frame_farm;
mod frame_files;
mod frames;
mod live;
mod logs;
mod lone_gltf;
mod look;
mod messages;
mod outlook;
mod output;
mod runs;
mod scenes;
mod setup;
mod steering;
mod store;
mod tutorials;
mod versions;
