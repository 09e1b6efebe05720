//! Joins the parts into things that run: a local world; with `net`, a server, a node and a client.

mod local;
pub mod measure;

pub use local::{DcdWorld, Partitioning, Stats, WorldConfig, WorldError};
