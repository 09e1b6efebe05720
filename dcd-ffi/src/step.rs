//! Advances worlds by one step, on the calling thread or in the background.

use std::time::Duration;

use crate::guard::guard;
use crate::handle::stale;
use crate::ids::DcdWorld;
use crate::registry::{World, cell, with};
use crate::status::DcdStatus;

/// Timeout of dcd_step_wait that waits until the step is done, however long it takes.
pub const DCD_FOREVER: u64 = u64::MAX;

/// Advances the world by one step of its own length, DcdWorldInfo.dt. Call it as often as the program's clock says. The length is
/// the world's and not an argument, since every process that computes the world must use the same.
///
/// A served world advances by itself. There the call sends what was asked of avatars, takes in what has come since the last call,
/// and returns without waiting for anything.
///
/// The arrays that dcd_state_view lent two steps ago are overwritten. Other calls on the world wait until the step is done; views
/// lent before may be read meanwhile.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY, DCD_ERR_PANIC.
/// - DCD_ERR_NETWORK: the link to the server is gone, or the world has ended. The last state stays readable, and what came before
///   the loss is in dcd_events.
/// - DCD_ERR_IO: a server could not write its folder, and has stopped; or its world has ended and its recording is not whole.
///
/// After DCD_ERR_NETWORK or DCD_ERR_IO each later step says so again, and what is known can still be read.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_step(world: DcdWorld) -> DcdStatus {
    guard("dcd_step", || with(world, World::step))
}

/// Begins what dcd_step does, on a thread of the library, and returns at once. dcd_step_wait says what became of it. Meanwhile the
/// program may draw what dcd_state_view lent, which stays as it is until the step after this one. Every other call on the world
/// waits until the step is done, and then sees its result.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY (a step was begun and dcd_step_wait has not told of it yet), DCD_ERR_LIMIT
/// (no thread), DCD_ERR_PANIC.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_step_begin(world: DcdWorld) -> DcdStatus {
    guard("dcd_step_begin", || cell(world)?.begin().unwrap_or_else(|| Err(stale("world", world.v))))
}

/// Waits until the step that dcd_step_begin began is done, but not longer than `timeout_ns` nanoseconds: 0 only looks, DCD_FOREVER
/// has no limit. Returns what dcd_step would have, once for each step that was begun.
///
/// Errors: those of dcd_step, DCD_ERR_TIMEOUT (the step is not done), DCD_ERR_ARGUMENT (no step was begun).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_step_wait(world: DcdWorld, timeout_ns: u64) -> DcdStatus {
    guard("dcd_step_wait", || {
        let timeout = (timeout_ns != DCD_FOREVER).then(|| Duration::from_nanos(timeout_ns));
        cell(world)?.wait(timeout)
    })
}
