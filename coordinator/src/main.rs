//! The command `beamfarm`.

use std::process::ExitCode;

fn main() -> ExitCode {
    beamfarm_command::command()
}
