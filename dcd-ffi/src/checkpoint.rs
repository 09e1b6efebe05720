//! Keeps local worlds in memory and goes back to them: rollback.

use crate::guard::guard;
use crate::handle::stale;
use crate::ids::{DcdCheckpointId, DcdWorld};
use crate::pointer::Out;
use crate::registry::{Kept, World, with};
use crate::status::{DcdStatus, Failure};

/// Keeps a local world in memory as it is now, to go back to: for rollback, where a game computes some ticks again with inputs that
/// came late. `out` receives the checkpoint. dcd_checkpoint_destroy frees it, and dcd_world_destroy frees all of its world.
///
/// Little is copied here. The next step copies the regions that it changes, each on its own thread, and none that rests. A
/// checkpoint takes as much memory as what has changed since.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (a served world, which dcd_snapshot_save_file saves).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_checkpoint_create(world: DcdWorld, out: *mut DcdCheckpointId) -> DcdStatus {
    guard("dcd_checkpoint_create", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        with(world, |world| {
            let kept = keep(world)?;
            let slot = world.checkpoints.insert(kept);
            out.write(world.mark.checkpoint(slot));
            Ok(())
        })
    })
}

/// Keeps the world anew as it is now, in place of what the checkpoint kept before. A game with rollback has one checkpoint per tick
/// that it may go back, and uses them in turn.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_checkpoint_save(world: DcdWorld, checkpoint: DcdCheckpointId) -> DcdStatus {
    guard("dcd_checkpoint_save", || {
        with(world, |world| {
            let slot = slot_of(world, checkpoint)?;
            let kept = keep(world)?;
            world.checkpoints.get_mut(slot).map(|former| *former = kept).ok_or_else(|| missing(checkpoint))
        })
    })
}

/// Goes back to a checkpoint of this world, as often as wanted. From there the world goes on to the same bits.
///
/// - What goes back. All is as it was then: bodies, joints, regions, settings, dcd_state_view and dcd_events.
/// - What stays. Threads, shapes and hooks stay as they are now, and so do other checkpoints, later ones too. A recording of the
///   world goes on from here.
/// - Changes between steps. What was changed between the last step and the checkpoint is changed: dcd_state_view shows it so, and
///   the material of a body that was destroyed is 0 in dcd_events.
/// - Ids. Ids of bodies and joints that were given since are given again, in the same order, so that computing a tick again gives
///   the same ones. Forget the ids that were given since.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also for a checkpoint of another world).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_checkpoint_restore(world: DcdWorld, checkpoint: DcdCheckpointId) -> DcdStatus {
    guard("dcd_checkpoint_restore", || {
        with(world, |world| {
            let slot = slot_of(world, checkpoint)?;
            let kept = world.checkpoints.get(slot).ok_or_else(|| missing(checkpoint))?;
            world.dcd.rewind(&kept.world)?;
            world.events.go_back(&kept.events, &world.dcd, world.mark);
            world.show_states();
            Ok(())
        })
    })
}

/// Destroys a checkpoint; its world stays as it is.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (also when destroyed twice).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_checkpoint_destroy(world: DcdWorld, checkpoint: DcdCheckpointId) -> DcdStatus {
    guard("dcd_checkpoint_destroy", || {
        with(world, |world| {
            let slot = slot_of(world, checkpoint)?;
            world.checkpoints.remove(slot).map(drop).ok_or_else(|| missing(checkpoint))
        })
    })
}

fn keep(world: &mut World) -> Result<Kept, Failure> {
    Ok(Kept { world: world.dcd.checkpoint()?, events: world.events.keep() })
}

fn slot_of(world: &World, checkpoint: DcdCheckpointId) -> Result<u64, Failure> {
    let slot = world.mark.checkpoint_slot(checkpoint)?;
    world.checkpoints.get(slot).map(|_| slot).ok_or_else(|| missing(checkpoint))
}

fn missing(checkpoint: DcdCheckpointId) -> Failure {
    stale("checkpoint", checkpoint.v)
}
