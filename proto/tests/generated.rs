//! The generated code is kept, so that a build of the program needs no protobuf compiler. It is what the compiler makes
//! of the protocol today.

use std::error::Error;
use std::path::Path;

const PROTOCOL: [&str; 3] = ["farm.proto", "control.proto", "live.proto"];
const GENERATED: &str = "src/generated/beamfarm.v1.rs";

/// What a protobuf compiler written in Rust makes of the protocol.
fn generate() -> Result<String, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let descriptors = protox::compile(PROTOCOL, ["."])?;
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
