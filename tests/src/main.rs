//! Runs the command line under test, by the same entry point as `dcd/src/bin/dcd.rs`.

use std::process::ExitCode;

fn main() -> ExitCode {
    dcd::cli::main()
}
