//! Records local worlds to files, or their last seconds in memory.

use std::ffi::c_char;
use std::time::Duration;

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer;
use crate::registry::with;
use crate::status::{DcdStatus, Failure};

/// Begins to record a local world to a file. The recording holds a snapshot of the world as it is now, what is done to it from now
/// on, and a digest of each region after each step. From that, `dcd replay FILE` computes the world again, bit for bit, and `dcd
/// diff` finds where two recordings differ.
///
/// - Writing. A thread of the library writes the file. A crash loses the last tenth of a second. A file that is there is replaced,
///   unless another recording is being written to it.
/// - Former recording. A recording that was going on ends. If that one is not whole, the call says so (DCD_ERR_IO) and begins none:
///   repeat it then.
/// - End. dcd_record_stop tells whether all is written. dcd_world_destroy ends a recording too, but can only log that it is not
///   whole: call dcd_record_stop first.
///
/// Servers, nodes and participants are recorded from their beginning, by `record_path` of DcdServerDef, DcdNodeDef and
/// DcdParticipantDef.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_record(world: DcdWorld, path: *const c_char) -> DcdStatus {
    guard("dcd_record", || {
        // SAFETY: the caller vouches for the text.
        let path = unsafe { pointer::text(path, "path")? };
        with(world, |world| Ok(world.dcd.record_to(path)?))
    })
}

/// Begins to record a local world in memory, for "what happened just now?". It keeps at least the last `seconds` of the world by
/// the clock on the wall, about twice as much at most; dcd_record_keep writes them. Each stretch of so many seconds begins with a
/// snapshot. A recording that was going on ends as by dcd_record.
///
/// Errors: DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (`seconds` that are not above 0 and up to 86,400), DCD_ERR_IO (the recording before is
/// not whole), DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_record_last(world: DcdWorld, seconds: f32) -> DcdStatus {
    guard("dcd_record_last", || {
        if !(seconds > 0.0 && seconds <= 86_400.0) {
            return Err(Failure::argument(format!(
                "seconds is {seconds}; give some above 0 and up to 86400"
            )));
        }
        with(world, |world| Ok(world.dcd.record_last(Duration::from_secs_f32(seconds))?))
    })
}

/// Writes to a file what dcd_record_last has kept, and goes on recording. A file that is there is replaced once the new one is
/// whole. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes and folders are refused.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO, DCD_ERR_ARGUMENT (nothing is recorded in memory), DCD_ERR_UNSUPPORTED (in a
/// served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_record_keep(world: DcdWorld, path: *const c_char) -> DcdStatus {
    guard("dcd_record_keep", || {
        // SAFETY: the caller vouches for the text.
        let path = unsafe { pointer::text(path, "path")? };
        with(world, |world| Ok(world.dcd.keep_recording(path)?))
    })
}

/// Ends the recording of a local world, and waits until it is written. It does nothing where nothing is recorded, and in a served
/// world.
///
/// Errors: DCD_ERR_STALE_ID, DCD_ERR_IO (a part of the recording could not be written: the file ends there).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_record_stop(world: DcdWorld) -> DcdStatus {
    guard("dcd_record_stop", || with(world, |world| Ok(world.dcd.stop_recording()?)))
}
