//! Runs the target `member`.
#![no_main]

dcd_fuzz::fuzz_by!("member");
