//! The speed and accuracy suite of dcd.
fn main() {}
