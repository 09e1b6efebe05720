//! The command line of dcd; its subcommands live in `dcd::cli`.
use std::process::ExitCode;

fn main() -> ExitCode {
    dcd::cli::main()
}
