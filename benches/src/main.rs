//! The speed and accuracy suite of dcd: what partitioning costs and gains, and where its methods fail.

mod draw;
mod machine;
mod page;
mod results;
mod speed;
mod timing;

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
    /// Step times of regions against one bare Rapier world and against Rapier's own `parallel`, in turn, as ratios.
    #[command(alias = "scaling")]
    Speed(speed::Speed),
    #[command(hide = true)]
    SpeedWorker(speed::SpeedWorker),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().suite {
        Suite::Speed(speed) => speed.run(),
        Suite::SpeedWorker(worker) => worker.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
