#![doc = include_str!("../ARCHITECTURE.md")]
#![forbid(unsafe_code)]

/// The Rapier that regions are made of: use this one, so that its builders fit.
#[cfg(feature = "physics")]
pub use rapier3d;

pub mod cluster;
pub mod protocol;
pub mod space;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "net")]
pub mod net;
#[cfg(feature = "physics")]
pub mod physics;
#[cfg(feature = "physics")]
pub mod runtime;
#[cfg(feature = "physics")]
pub mod scene;
pub mod sim;

/// Runs the Rust code of the README.
#[cfg(all(doctest, feature = "physics"))]
#[doc = include_str!("../../README.md")]
struct Readme;
