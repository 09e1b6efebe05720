//! Runs the target `rules`.
#![no_main]

dcd_fuzz::fuzz_by!("rules");
