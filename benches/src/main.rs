//! Runs the speed and accuracy suite of dcd: what partitioning costs and gains, how far its results are off,
//! and where its methods fail.

mod accuracy;
mod bandwidth;
mod c_api;
mod child;
mod clients;
mod consistency;
mod draw;
mod fan_out;
mod faults;
mod fidelity;
mod floods;
mod machine;
mod maps;
mod output;
mod page;
#[cfg(feature = "peers")]
mod peers;
mod prediction;
mod recording;
mod results;
mod scale;
mod thesis;
mod timing;
mod usage;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// The allocator, the same as in the program `dcd`.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

#[derive(Parser)]
#[command(about = "Measures dcd against bare Rapier")]
struct Arguments {
    #[command(subcommand)]
    suite: Suite,
}

#[derive(Subcommand)]
enum Suite {
    /// Every scene of the suite at 1, 2, 4 and 8 regions, against closed forms and one bare Rapier world.
    Accuracy(accuracy::Accuracy),
    /// What it costs to tell a client of a scene: bytes by field, over networks that delay and lose.
    Bandwidth(bandwidth::Bandwidth),
    /// What calls of the C API cost, how long joining takes, and how large a program that links it becomes.
    CApi(c_api::CApi),
    /// Compares what a client shows of a served world with the truth, over good and bad networks; with bytes
    /// and staleness.
    Clients(clients::Clients),
    /// Measures how much faster a world is on 2 to 16 cores: in one region, and cut into several.
    Cores(scale::Cores),
    /// How far groups of nodes, and members of one group, are from one another over time, and the bytes
    /// between them.
    Consistency(consistency::Consistency),
    /// What many clients cost a world: time between ticks, processor time by thread, bytes; a server, two
    /// nodes and clients in real processes.
    FanOut(fan_out::FanOut),
    #[command(hide = true)]
    FanOutProcess(fan_out::FanOutProcess),
    /// Whole clusters in virtual time under every kind of fault, a thousand seeds each.
    Faults(faults::Faults),
    /// Measures what it saves and costs to compute less where nobody looks; puts stated errors beside true
    /// ones.
    Fidelity(fidelity::Fidelities),
    /// What hostile peers cost a world: floods of handshakes, datagrams and junk, and peers that read
    /// nothing; memory, ticks, joins.
    Floods(floods::Floods),
    #[command(hide = true)]
    FloodProcess(floods::FloodProcess),
    /// The same boxes in bare Rapier, Rapier's `parallel`, Box3D, Jolt and dcd: time beside penetration,
    /// energy and sag.
    #[cfg(feature = "peers")]
    Peers(peers::Peers),
    /// How well a client predicts its own avatars, over good and bad networks: corrections, jumps and time
    /// per frame.
    Prediction(prediction::Predictions),
    /// Measures what recording a world costs: time per step and bytes per second.
    Recording(recording::Recording),
    /// Scenes of 180 to 40,000 bodies with bodies at every border: time and error of the same settings in the
    /// same row.
    Scale(scale::Scale),
    #[command(hide = true)]
    ScaleWorker(scale::ScaleWorker),
    /// The experiments of the thesis of 2006 again: a server and 1 to 32 participants, theirs and ours side
    /// by side.
    Thesis(thesis::Thesis),
    #[command(hide = true)]
    ThesisParticipant(thesis::ThesisParticipant),
    /// Heat maps of where couplings fail, beside one bare Rapier world.
    Maps(maps::Maps),
}

/// The stack of each thread of rayon's pool. A thread that waits for parts of a step takes another case up
/// meanwhile, on the same stack: with the 2 MB of the default, `maps` overflowed it. Memory that is not used
/// is not taken.
const STACK_BYTES: usize = 256 << 20;

fn main() -> ExitCode {
    rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES).build_global().expect("nobody has begun one yet");
    let done = |()| ExitCode::SUCCESS;
    let result = match Arguments::parse().suite {
        Suite::Accuracy(accuracy) => accuracy.run(),
        Suite::Bandwidth(bandwidth) => bandwidth.run().map(done),
        Suite::CApi(c_api) => c_api.run(),
        Suite::Clients(clients) => clients.run().map(done),
        Suite::Consistency(consistency) => consistency.run().map(done),
        Suite::Cores(cores) => cores.run().map(done),
        Suite::FanOut(fan_out) => fan_out.run(),
        Suite::FanOutProcess(process) => process.run().map(done),
        Suite::Faults(faults) => faults.run(),
        Suite::Fidelity(fidelity) => fidelity.run().map(done),
        Suite::Floods(floods) => floods.run(),
        Suite::FloodProcess(process) => process.run().map(done),
        #[cfg(feature = "peers")]
        Suite::Peers(peers) => peers.run().map(done),
        Suite::Prediction(prediction) => prediction.run().map(done),
        Suite::Recording(recording) => recording.run().map(done),
        Suite::Scale(scale) => scale.run().map(done),
        Suite::ScaleWorker(worker) => worker.run().map(done),
        Suite::Thesis(thesis) => thesis.run().map(done),
        Suite::ThesisParticipant(participant) => participant.run().map(done),
        Suite::Maps(maps) => maps.run().map(done),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error}");
        ExitCode::FAILURE
    })
}
