//! Runs the target `scene`.
#![no_main]

dcd_fuzz::fuzz_by!("scene");
