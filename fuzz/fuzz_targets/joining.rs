//! Runs the target `joining`.
#![no_main]

dcd_fuzz::fuzz_by!("joining");
