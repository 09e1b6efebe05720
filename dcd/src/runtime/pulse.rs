//! Tells whoever watches over a process whether its loop turns, and how it is.

use std::time::Instant;

/// The state of a process in few words.
pub struct Pulse {
    /// When its loop last turned: at least twice per second, but while it builds a large world.
    pub turned: Instant,
    /// For people.
    pub words: String,
}
