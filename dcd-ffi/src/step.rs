//! Time.

use crate::guard::guard;
use crate::status::DcdStatus;
use crate::world::{DcdWorld, with};

/// Advances the world by one step of its own length, DcdWorldInfo.dt; call it as often as your clock says. The length is the
/// world's and not an argument, since every process that computes the world must use the same.
///
/// A served world advances by itself: there the call sends what was asked of avatars, takes in what has come since the last
/// call, and returns without waiting for anything.
///
/// What dcd_state_view lent two steps ago is overwritten. Other calls on the world wait until the step is done; views lent
/// before may be read meanwhile.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY, DCD_ERR_PANIC, DCD_ERR_NETWORK once the link to the server is gone or
/// the world has ended (the last state stays readable, and what came before the loss is in dcd_events).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_step(world: DcdWorld) -> DcdStatus {
    guard("dcd_step", || {
        with(world, |world| {
            let stepped = world.backend.step();
            world.events.fill(&world.backend, world.mark);
            world.states.after_step(&world.backend, world.mark);
            stepped
        })
    })
}
