//! Whole clusters in one thread: the machines of [`cluster`](crate::cluster) with a virtual clock, a seeded network, crashes
//! at any event, and a stand-in for the physics. Every message passes the codec. Same seed, same run.

mod check;
mod fixtures;
mod network;
mod physics;
mod random;
mod world;

pub use check::{Checker, Violation};
pub use fixtures::{sim_body, sim_world};
pub use physics::StandIn;
pub use random::Random;
pub use world::{Sim, SimConfig};

use fixtures::drifting;

#[cfg(test)]
mod tests;
