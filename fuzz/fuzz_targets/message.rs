//! Runs the target `message`.
#![no_main]

dcd_fuzz::fuzz_by!("message");
