//! Time.

use crate::guard::guard;
use crate::status::DcdStatus;
use crate::world::{DcdWorld, with};

/// Advances the world by one step of its own length, DcdWorldDef.dt; call it as often as your clock says. The length is the
/// world's and not an argument, since every process that computes the world must use the same.
///
/// What dcd_state_view lent two steps ago is overwritten. Other calls on the world wait until the step is done; views lent
/// before may be read meanwhile.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_BUSY, DCD_ERR_PANIC.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_step(world: DcdWorld) -> DcdStatus {
    guard("dcd_step", || {
        with(world, |world| {
            world.backend.step()?;
            world.events.fill(&world.backend, world.mark);
            world.states.after_step(&world.backend, world.mark);
            Ok(())
        })
    })
}
