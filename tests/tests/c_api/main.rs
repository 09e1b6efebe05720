//! Tests the C API from C: the header in every dialect, the examples, misuse, the exported symbols, the
//! package, and compatibility with older programs.

mod abi;
mod covered;
mod drawn;
mod header;
mod library;
mod long;
mod packaging;
mod programs;
mod served;
mod strips;
mod surface;
mod table;
mod toolchain;
