//! Runs the target `directory`.
#![no_main]

dcd_fuzz::fuzz_by!("directory");
