//! The command line under test: the same entry point as `dcd/src/bin/dcd.rs`.
use std::process::ExitCode;

fn main() -> ExitCode {
    dcd::cli::main()
}
