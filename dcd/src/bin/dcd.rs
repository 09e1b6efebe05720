//! Runs the command line of dcd; its subcommands live in `dcd::cli`.
use std::process::ExitCode;

/// The allocator of the program, which keeps the memory pages that a step gives back. The system's allocator
/// returns them to the kernel, which clears them for the next step.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    dcd::cli::main()
}
