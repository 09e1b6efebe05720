//! The C API from C: the header in every dialect, the examples, misuse, the exported symbols.

mod header;
mod library;
mod programs;
mod served;
mod toolchain;
