//! Runs the target `snapshot`.
#![no_main]

dcd_fuzz::fuzz_by!("snapshot");
