//! Runs the target `client`.
#![no_main]

dcd_fuzz::fuzz_by!("client");
