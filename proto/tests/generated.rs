//! The generated code is kept, so that a build of the program needs no protobuf compiler. It is what the compiler makes
//! of the protocol today.

use beamfarm_proto::{FileHash, PROTOCOL};
use std::error::Error;
use std::path::Path;

const FILES: [&str; 3] = ["farm.proto", "control.proto", "live.proto"];
const GENERATED: &str = "src/generated/beamfarm.v1.rs";

/// What a protobuf compiler written in Rust makes of the protocol.
fn generate() -> Result<String, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let descriptors = protox::compile(FILES, ["."])?;
    let config = tonic_prost_build::configure().bytes(".").out_dir(folder.path());
    config.emit_rerun_if_changed(false).compile_fds(descriptors)?;
    Ok(std::fs::read_to_string(folder.path().join("beamfarm.v1.rs"))?)
}

#[test]
fn the_generated_code_is_that_of_the_protocol() -> Result<(), Box<dyn Error>> {
    let kept = std::fs::read_to_string(GENERATED)?;
    let same = kept == generate()?;
    let command = "cargo test -p beamfarm-proto --test generated -- --ignored write";
    assert!(
        same,
        "proto/{GENERATED} is of another protocol; make it anew: {command}"
    );
    Ok(())
}

#[test]
#[ignore = "writes the generated code anew"]
fn write_the_generated_code() -> Result<(), Box<dyn Error>> {
    Ok(std::fs::write(Path::new(GENERATED), generate()?)?)
}

/// The version of the protocol, and a hash of its messages without their comments.
const NUMBERED: (u32, &str) = (1, "9a2a757da2511ce523829b15adc1358e998f531fb87358f103b894860fe9779a");

/// Who changes a message says whether programs of before understand it.
#[test]
fn a_change_of_messages_is_a_decision() -> Result<(), Box<dyn Error>> {
    let mut messages = String::new();
    for file in FILES {
        for line in std::fs::read_to_string(file)?.lines() {
            messages += line.split("//").next().unwrap_or_default().trim();
        }
    }
    assert_eq!(
        (PROTOCOL, &*FileHash::of(messages.as_bytes()).to_string()),
        NUMBERED,
        "messages have changed: raise PROTOCOL if programs of before would misunderstand them, and name both here"
    );
    Ok(())
}
