// Replaces `volumes.wgsl` in scenes where no medium's density varies.

const VARIES = false;
const MOST_WALKS: u32 = 1u;

fn is_varying(medium: u32) -> bool { return false; }
