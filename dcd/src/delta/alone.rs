//! Writes states so that each part can be read alone, for readers that are told by way of others and
//! acknowledge nothing.

use std::time::Duration;

use super::free_motion::FreeMotion;
use super::receiver::Receiver;
use super::sender::Sender;
use crate::protocol::{CodecError, Part, SharedState};
use crate::space::Tick;

/// The only series, and its only batch.
const SERIES: u32 = 0;
const BATCH: u32 = 1;

/// Writes states, in id order, into as few parts of at most `limit` bytes as possible; without states, one
/// empty part.
pub(crate) fn write(states: &[SharedState], limit: usize) -> Vec<Vec<u8>> {
    if states.is_empty() {
        return vec![Vec::new()];
    }
    let parts = Sender::new(FreeMotion::NONE, SERIES).pack(Tick(0), Tick(0), states, true, limit);
    parts.into_iter().map(|part| part.states).collect()
}

/// Reads the states of a part.
pub(crate) fn read(states: &[u8]) -> Result<Vec<SharedState>, CodecError> {
    if states.is_empty() {
        return Ok(Vec::new());
    }
    let mut receiver = Receiver::default();
    receiver.set_motion(FreeMotion::NONE);
    let part = Part { series: SERIES, batch: BATCH, number: 0, states: states.to_vec() };
    receiver.take_in(Duration::ZERO, Tick(0), &part, true)
}
