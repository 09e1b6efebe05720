//! Shows worlds between their steps: which time to show now, and how bodies are at it.

use dcd::ViewTime;

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out, Sized32, check_reserved};
use crate::registry::{self, ask, find, with};
use crate::state::DcdStateView;
use crate::status::{DcdStatus, Failure};
use crate::types::{DcdPose, DcdVelocity};

/// Ticks to show now. A fraction is a time between two ticks: 7.5 is halfway from the world after step 7 to that after step 8.
/// Start from DCD_VIEW_TIME_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdViewTime {
    /// Size of this struct: sizeof(DcdViewTime).
    pub struct_size: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
    /// Tick that the world is at, as far as known. What is shown at it is extrapolated. For own avatars use `predicted`.
    pub now: f64,
    /// Tick whose states have come by now, a little ago. Use it for all else. It goes forward evenly, unless ticks are counted
    /// anew: where a speculative tick is taken back, or the world goes back to a save.
    pub shown: f64,
    /// Tick that applies what an own avatar is asked now, where a client predicts (dcd_prediction_set). Own avatars, with what they
    /// touch, are shown at it. Otherwise it is the same as `now`.
    pub predicted: f64,
    /// Bound on the error of `now` that comes from clocks, seconds. It is below 0 until it is known, where no network is between,
    /// and in a participant, which counts the way of what it is told as nothing.
    pub clock_error: f64,
    /// Time from an input to the first state that shows it, seconds: the median of the last ones. It is below 0 before the first.
    pub input_delay: f64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdViewTime {
    const NAME: &'static str = "DcdViewTime";
}

/// Returns the ticks to show now. Call it once per frame, from any thread.
///
/// - Served world. States come some times per second, late, unevenly, and not all of them. `shown` is as little behind the world as
///   that allows, and goes forward evenly. From the first call on, a client pings the node that tells it of the world, and keeps
///   the states that it was told last.
/// - Local world. `shown` goes from one step to the next as time goes by since the last dcd_step. From the first call on, steps
///   keep how awake bodies were before, some 50 ns each.
/// - Server. It shows its world as it was heard of last.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_view_time(world: DcdWorld, out: *mut DcdViewTime) -> DcdStatus {
    guard("dcd_view_time", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        with(world, |world| {
            world.dcd.sees("see the bodies of its world")?;
            let time = world.dcd.view_time();
            out.write(DcdViewTime {
                struct_size: size_of::<DcdViewTime>() as u32,
                reserved: 0,
                now: time.now,
                shown: time.shown,
                predicted: time.predicted,
                clock_error: time.clock_error_s.unwrap_or(-1.0),
                input_delay: time.input_delay_s.unwrap_or(-1.0),
            });
            Ok(())
        })
    })
}

/// Reads how a body is shown at a tick: its pose and velocity. `pose` or `velocity` may be null.
///
/// Between known states, positions follow cubic Hermite splines, or two straight lines where the velocities tell of an impact;
/// rotations follow SLERP. Beyond the last state the body goes on, and comes to a stop within a quarter of a second. Where a later
/// state contradicts what was shown at the last dcd_view_time, the difference melts away within 0.2 s, and 0.1 s more per metre;
/// above 3 m the body jumps. Before the first dcd_view_time, and for a server, the result is that of dcd_body_get.
/// Errors: DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a tick that is no finite number).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_view_body(
    world: DcdWorld,
    body: DcdBodyId,
    tick: f64,
    pose: *mut DcdPose,
    velocity: *mut DcdVelocity,
) -> DcdStatus {
    guard("dcd_view_body", || {
        // SAFETY: the caller vouches for what is not null.
        let (pose, velocity) =
            unsafe { (Out::optional(pose, "pose")?, Out::optional(velocity, "velocity")?) };
        check_tick(tick)?;
        ask(world, |world| {
            let id = find(world, body)?;
            let shown = world.dcd.motion_at(id, tick).ok_or_else(|| registry::missing(world, body))?;
            pose.into_iter().for_each(|pose| pose.write(shown.0.into()));
            velocity.into_iter().for_each(|velocity| velocity.write(shown.1.into()));
            Ok(())
        })
    })
}

/// Lends every movable body as it is shown, as dcd_state_view lends them as they are. Own avatars, with what they touch, are shown
/// at time->predicted, all others at time->shown. What comes near goes from the one to the other within a second. Set both to the
/// same where an own avatar is to be shown with the others. `tick` of the view is that of the newest state.
///
/// The arrays are the library's: do not write or free them. They keep their content until the next dcd_view_state of this world.
/// The memory stays readable until the world is destroyed.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT (ticks that are no finite numbers), DCD_ERR_UNSUPPORTED
/// (a node).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_view_state(
    world: DcdWorld,
    time: *const DcdViewTime,
    out: *mut DcdStateView,
) -> DcdStatus {
    guard("dcd_view_state", || {
        // SAFETY: the caller vouches for both pointers.
        let (time, out) = unsafe { (checked(time)?, Out::sized(out, "out")?) };
        with(world, |world| {
            world.dcd.sees("see the bodies of its world")?;
            out.write(world.states.show(&world.dcd, world.mark, &time));
            Ok(())
        })
    })
}

/// Returns a time to show that a program gives, checked.
///
/// # Safety
/// As [`pointer::read_sized`].
pub(crate) unsafe fn checked(time: *const DcdViewTime) -> Result<ViewTime, Failure> {
    // SAFETY: the caller upholds the same contract.
    let time = unsafe { pointer::read_sized(time, "time")? };
    check_reserved(time.reserved)?;
    [time.now, time.shown, time.predicted].into_iter().try_for_each(check_tick)?;
    Ok(ViewTime::new(time.now, time.shown).predicting(time.predicted))
}

fn check_tick(tick: f64) -> Result<(), Failure> {
    if tick.is_finite() {
        return Ok(());
    }
    Err(Failure::argument(format!("tick {tick} is no time; take one from dcd_view_time")))
}
