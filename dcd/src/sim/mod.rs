//! Simulates whole clusters in one thread: the state machines of [`cluster`](crate::cluster) with virtual clocks, a seeded network
//! that loses, delays and cuts, processes that are killed, stopped and slow at any event, and a stand-in for the physics. Every
//! message passes the codec. Same seed, same run.

mod check;
mod clock;
mod deviation;
mod engine;
mod faults;
mod fixtures;
mod host;
mod network;
mod physics;
mod random;
mod records;
mod run;
mod sent;
mod simulate;
mod timeline;
mod trial;
mod world;

pub use check::{Checker, Violation};
pub use clock::Clock;
pub use deviation::{Apart, Comparer, Deviating};
pub use engine::{Engine, Sample};
pub use faults::{
    Fault, FaultProfile, Island, Moment, Planned, ProcessKind, Promise, Schedule, Victim, Ways,
};
pub use fixtures::{sim_body, sim_world};
pub use host::Skew;
pub use network::{Bounds, Cut, NetworkConditions, Path, Traffic, Who};
pub use physics::StandIn;
pub use random::Random;
pub use records::{Flipped, Tape};
pub use sent::{Scope, Sent};
pub use simulate::{Failure, Row, simulate};
pub use timeline::Timeline;
pub use trial::{Outcome, Staleness, TrialConfig, run_trial};
pub use world::{Sim, SimConfig, Tally};

use fixtures::drifting;

#[cfg(test)]
mod tests;
