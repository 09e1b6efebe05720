//! Runs the target `leader`.
#![no_main]

dcd_fuzz::fuzz_by!("leader");
