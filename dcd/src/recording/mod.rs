//! Records what a process was given, and computes it again from that, bit for bit, to see what happened and
//! where two runs part.
//!
//! State machines and physics have no clock and no randomness of their own. A recording holds everything that
//! went into them, with its time, and a digest of every region after every tick (`digest`). A replay gives
//! the same to machines of its own and compares the digests. The file is a row of chunks with checksums
//! (`file`): a crash cuts off its end, and damages nothing else.

mod acts;
mod diff;
mod digest;
mod entries;
mod entry;
mod error;
mod file;
mod local;
mod maker;
mod node;
mod open;
mod physics;
mod recorded_server;
mod recorder;
mod replay;
mod replayed;
mod ring;
mod server;
#[cfg(test)]
mod tests;

pub use diff::{Difference, difference};
pub use digest::{BodyBits, Changed, FIELDS, digest, find_changed};
pub use error::RecordingError;
pub use file::{Background, Cut, Reader};
pub use local::{LocalPhysics, Operation};
pub use maker::Maker;
pub use node::tick_of;
pub use open::{Computers, last_tick, open};
pub use physics::{Physics, Readout, digests_of};
pub use recorded_server::RecordedServer;
pub use recorder::Recorder;
pub use replay::{Mismatch, Replay};
pub use replayed::{Flip, Replayed, Settled, Who};
pub use server::Sent;
