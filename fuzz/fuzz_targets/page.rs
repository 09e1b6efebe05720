//! Runs the target `page`.
#![no_main]

dcd_fuzz::fuzz_by!("page");
