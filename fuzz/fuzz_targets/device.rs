//! Runs the target `device`.
#![no_main]

dcd_fuzz::fuzz_by!("device");
