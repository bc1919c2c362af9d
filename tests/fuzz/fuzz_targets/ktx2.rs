#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| beamfarm_harness::fuzz::ktx2(data));
