//! The speed and accuracy suite of dcd: what partitioning costs and gains, and how far its results are off.

mod accuracy;
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
    /// Every scene of the suite at 1, 2, 4 and 8 regions, against closed forms and one bare Rapier world.
    Accuracy(accuracy::Accuracy),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().suite {
        Suite::Scaling(scaling) => scaling.run().map(|()| ExitCode::SUCCESS),
        Suite::Accuracy(accuracy) => accuracy.run(),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
