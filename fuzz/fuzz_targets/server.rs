//! Runs the target `server`.
#![no_main]

dcd_fuzz::fuzz_by!("server");
