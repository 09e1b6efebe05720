//! The speed and accuracy suite of dcd. So far: what partitioning costs and gains.

mod scaling;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(about = "Measures dcd against bare Rapier")]
struct Arguments {
    #[command(subcommand)]
    suite: Suite,
}

#[derive(Subcommand)]
enum Suite {
    /// Step times of a bare Rapier world, one region, and several regions, in turn, as ratios.
    Scaling(scaling::Scaling),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().suite {
        Suite::Scaling(scaling) => scaling.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
