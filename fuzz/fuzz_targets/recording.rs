//! Runs the target `recording`.
#![no_main]

dcd_fuzz::fuzz_by!("recording");
