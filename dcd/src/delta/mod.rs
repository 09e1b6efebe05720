//! Tells clients the states of bodies in few bytes (delta compression). Numbers are quantised and predicted
//! from a state of the body that the client has acknowledged. A range coder codes the difference under models
//! that adapt (the crate `constriction`).
//!
//! - [`Sender`], one per client of a leader, knows which states the client has. A state within a step or so
//!   of what the client predicts is told as predicted, for about a bit.
//! - [`Receiver`], the client's, keeps what later states may refer to, and acknowledges datagrams.
//! - `OrderedSender` and `OrderedReceiver` are the ends of a link to a relay, which gets everything in order.
//! - `alone` writes states for other groups, in the same form, against nothing.
//!
//! A lost datagram costs bytes only: later ones refer to what was acknowledged. The region that computes a
//! body keeps full precision. A client shows what it was told: positions within 0.75 mm per axis, turns
//! within 4 mrad, speeds within 5 mm/s and 10 mrad/s.

pub(crate) mod alone;
mod coder;
mod free_motion;
mod model;
mod ordered;
mod quantise;
mod receiver;
mod sender;
#[cfg(test)]
mod tests;

pub use coder::Field;
pub use free_motion::FreeMotion;
pub(crate) use free_motion::{LIKE_FALL, UNTOLD_S};
pub(crate) use ordered::{OrderedReceiver, OrderedSender};
pub use receiver::{Receiver, Tally};
pub(crate) use sender::RESTARTS;
pub use sender::Sender;
