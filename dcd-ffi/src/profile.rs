//! Reads what the last step of a world took: times by phase, and what was computed.

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::{Out, Sized32};
use crate::registry::ask;
use crate::status::DcdStatus;

/// Time that the last step took, in seconds by phase, and what was computed in it. These are sums over all regions, which compute
/// side by side, so times may be more than DcdStats.last_step. Start from DCD_PROFILE_INIT. The struct may grow at its end.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdProfile {
    /// Size of this struct: sizeof(DcdProfile).
    pub struct_size: u32,
    /// Reserved; always 0.
    pub reserved: u32,
    /// Time of Rapier's steps, all phases, seconds.
    pub rapier: f64,
    /// Time of finding pairs whose boxes touch, seconds; 0, as the next four are, in a library that was built without the feature
    /// `profiler`.
    pub broad_phase: f64,
    /// Time of finding contacts, seconds.
    pub narrow_phase: f64,
    /// Time of keeping islands, and of putting bodies to sleep, seconds.
    pub islands: f64,
    /// Time of solving contacts and joints, and of moving bodies, seconds.
    pub solver: f64,
    /// Time of sweeping fast bodies, seconds.
    pub ccd: f64,
    /// Time of exchanging messages between regions, seconds: wall time.
    pub border: f64,
    /// Number of pairs of colliders near enough for contacts. Pairs that regions share count in each, as in all that follows.
    pub contact_pairs: u64,
    /// Number of points of contact that were solved.
    pub contacts: u64,
    /// Number of bodies that were awake.
    pub awake: u64,
    /// Number of joints, awake or not.
    pub joints: u64,
    /// Number of islands that are awake now: groups of bodies that touch or are tied.
    pub islands_awake: u64,
    /// Memory that bodies, colliders, contacts and joints take, roughly, bytes. That of shapes, and of what is kept for the next
    /// step, does not count.
    pub memory: u64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdProfile {
    const NAME: &'static str = "DcdProfile";
}

/// Reads what the last dcd_step of a local world took by phase, and what there is now. Times are 0 before the first step, and for
/// regions that rested.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_UNSUPPORTED: in a served world. There dcd_stats has the wall time of taking in what came, and the bytes of the
///   network.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_profile(world: DcdWorld, out: *mut DcdProfile) -> DcdStatus {
    guard("dcd_profile", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let profile = world.dcd.profile()?;
            out.write(DcdProfile {
                struct_size: size_of::<DcdProfile>() as u32,
                reserved: 0,
                rapier: profile.rapier.as_secs_f64(),
                broad_phase: profile.broad_phase.as_secs_f64(),
                narrow_phase: profile.narrow_phase.as_secs_f64(),
                islands: profile.islands.as_secs_f64(),
                solver: profile.solver.as_secs_f64(),
                ccd: profile.ccd.as_secs_f64(),
                border: profile.border.as_secs_f64(),
                contact_pairs: profile.contact_pairs as u64,
                contacts: profile.contacts as u64,
                awake: profile.awake as u64,
                joints: profile.joints as u64,
                islands_awake: profile.islands_awake as u64,
                memory: profile.memory_bytes as u64,
            });
            Ok(())
        })
    })
}
