//! Lends the events of the last step to C.

use super::DcdEventView;
use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::Out;
use crate::registry::with;
use crate::status::DcdStatus;

/// Lends the events of the last step; nothing before the first. Call it once per step: a step without it loses its events, and the
/// messages that came.
///
/// The arrays are the library's, and live as those of dcd_state_view do.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_events(world: DcdWorld, out: *mut DcdEventView) -> DcdStatus {
    guard("dcd_events", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        with(world, |world| {
            out.write(world.events.view());
            Ok(())
        })
    })
}
