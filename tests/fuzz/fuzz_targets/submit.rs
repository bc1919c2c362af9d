#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| beamfarm_tests::fuzz::submit(data));
