//! The C API of dcd.
