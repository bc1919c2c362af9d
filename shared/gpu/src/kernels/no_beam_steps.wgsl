// Replaces `beam_steps.wgsl` in scenes where no medium's density varies.

fn first_step(path: u32) -> u32 { return 0u; }

fn leave_steps(path: u32, count: u32) {}

fn told_steps() -> u32 { return 0u; }

fn keep_step(place: u32, walk: Walk) {}

fn keep_function(beam: u32, first: u32, count: u32) {}
