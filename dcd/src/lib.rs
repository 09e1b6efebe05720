#![doc = include_str!("../ARCHITECTURE.md")]
#![forbid(unsafe_code)]

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
