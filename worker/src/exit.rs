//! Exit codes of `beamfarm` and `beamfarm-worker`, as their help lists them.

/// Done. Also after a signal, if the image so far was written or the worker delivered its pass.
pub const DONE: u8 = 0;
/// The machine failed: a file cannot be written, a port is taken, a worker's rendering hangs, or a device is missing,
/// unusable or fails.
pub const IO: u8 = 1;
/// Wrong usage (also clap's code for it), a scene or image that cannot be used, or a feature that the program was built
/// without.
pub const USAGE: u8 = 2;
/// The worker, or a command that queries a coordinator, cannot reach it, or lost it and did not find it again. Retry
/// later.
pub const UNREACHABLE: u8 = 3;
/// Stopped before the first pass was complete: there is nothing to write.
pub const NOTHING: u8 = 4;
/// The job failed: a pass cannot be rendered, workers keep dying, or two machines disagree about a pass. The image up
/// to then was written, if there is one.
pub const FAILED: u8 = 5;
/// The coordinator refused the worker: another version, another test picture, or wrong results; or the worker lacks the
/// job's engine, or a device that it was to offer. Retrying is pointless.
pub const REFUSED: u8 = 6;
/// With `--preemptible`: a signal stopped it before the job ended. Retry elsewhere (EX_TEMPFAIL of sysexits.h).
pub const PREEMPTED: u8 = 75;

/// The list for `--help`.
pub const HELP: &str = "\
Exit codes:
  0  done; also after SIGINT or SIGTERM when what was complete has been written
  1  a file or the network: an image or the job folder cannot be written, a port
     is taken, another coordinator uses the job folder; a worker whose rendering
     hangs; a device that is not there, cannot be used or fails
  2  wrong usage, or a scene, image or job folder that cannot be used, or what the
     program was built without
  3  the coordinator cannot be reached; worth another try
  4  stopped before the first pass was complete: at most a coarse picture was written
  5  the job failed (a pass cannot be rendered, workers keep dying, two machines
     disagree about a pass); the passes before it were written, if any
  6  worker: refused by the coordinator (another version, a machine that computes
     other bits, wrong results), without the job's engine, or without the device
     that it was to offer; not worth another try
  75 with --preemptible: stopped by a signal before the job was over
  130, 143  killed by a second SIGINT or SIGTERM";
