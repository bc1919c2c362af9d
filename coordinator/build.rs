//! What this machine does not allow is not tested: such tests are ignored, and said to be.

/// Bit of the capability to mount file systems among those of a process, see capabilities(7).
const CAP_SYS_ADMIN: u32 = 21;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(can_mount)");
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let effective = effective.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok());
    if effective.is_some_and(|bits| bits >> CAP_SYS_ADMIN & 1 == 1) {
        println!("cargo::rustc-cfg=can_mount");
    }
}
