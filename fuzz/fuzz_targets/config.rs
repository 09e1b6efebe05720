//! Runs the target `config`.
#![no_main]

dcd_fuzz::fuzz_by!("config");
