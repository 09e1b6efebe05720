//! Joins the parts into things that run: a local world; with `net`, a server, a node and a client.

mod device;
mod local;

pub use device::{DeviceError, PhysicsDevice};
pub use local::{DcdWorld, Partitioning, Stats, WorldConfig, WorldError};
