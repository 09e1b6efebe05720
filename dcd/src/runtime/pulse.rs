//! Reports to those who watch a process whether its loop turns, and how the process is.

use std::time::Instant;

/// The state of a process in a few words.
pub struct Pulse {
    /// The time at which the process's loop last turned. It turns at least twice per second, except while it
    /// builds a large world.
    pub turned: Instant,
    /// The state in words, for people.
    pub words: String,
}
