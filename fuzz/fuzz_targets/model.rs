//! Runs the target `model`.
#![no_main]

dcd_fuzz::fuzz_by!("model");
