//! Simulates whole clusters in one thread, from one seed: the same seed gives the same run.
//!
//! The state machines of [`cluster`](crate::cluster) run with virtual clocks. A seeded network loses, delays
//! and cuts. Processes are killed, stopped and slowed at any event. The physics is a stand-in, or Rapier
//! itself. Every message passes the codec.

mod check;
mod clock;
mod config;
#[cfg(feature = "physics")]
mod contact;
mod deviation;
mod engine;
mod faults;
mod fixtures;
mod heard;
mod host;
mod network;
mod physics;
mod random;
#[cfg(feature = "physics")]
mod rapier;
mod records;
mod run;
mod sent;
mod simulate;
mod spoilt;
mod tally;
mod timeline;
mod trial;
mod watch;
mod world;

pub use check::{Checker, Violation};
pub use clock::Clock;
pub use config::SimConfig;
#[cfg(feature = "physics")]
pub use contact::ContactScene;
pub use deviation::{Apart, Comparer, Deviating};
pub use engine::{Engine, Mechanics, Sample};
pub use faults::{
    Fault, FaultProfile, Island, Moment, Planned, ProcessKind, Promise, Schedule, Victim, Ways,
};
#[cfg(test)]
pub(crate) use fixtures::sim_collider;
pub use fixtures::{sim_body, sim_world};
pub use host::Skew;
pub use network::{Bounds, Cut, NetworkConditions, Path, Traffic, Who};
pub use physics::StandIn;
pub use random::Random;
#[cfg(feature = "physics")]
pub use rapier::RapierEngine;
pub use records::{Flipped, Tape};
pub use sent::{Scope, Sent};
pub use simulate::{Failure, Row, simulate};
pub use spoilt::Spoilt;
pub use tally::Tally;
pub use timeline::Timeline;
pub use trial::{Outcome, Staleness, TrialConfig, run_trial};
pub use watch::{Course, Look, Quantity, Ruler, Strain, Watch};
pub use world::Sim;

use fixtures::drifting;

#[cfg(test)]
mod tests;
