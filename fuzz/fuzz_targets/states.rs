//! Runs the target `states`.
#![no_main]

dcd_fuzz::fuzz_by!("states");
