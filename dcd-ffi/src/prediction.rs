//! Turns on and off what a client predicts of its own avatars, and counts how well it does.

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::{Out, Sized32};
use crate::registry::{ask, with};
use crate::status::{DcdStatus, Failure};

/// Counts of what a client predicts, and of how often it was wrong. Start from DCD_PREDICTION_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdPrediction {
    /// Size of this struct: sizeof(DcdPrediction).
    pub struct_size: u32,
    /// Number of movable bodies that are predicted now: own avatars and what is near them. 0 where nothing is predicted.
    pub bodies: u32,
    /// Number of steps of the world predicted so far.
    pub ticks: u64,
    /// Number of times that the world told something other than was predicted, and steps were computed again.
    pub replays: u64,
    /// Number of replays by which an own avatar, or what it touches, was shown more than 2 cm off.
    pub corrections: u64,
    /// Largest of these corrections, metres.
    pub largest_correction: f64,
    /// Time that the predictions of the last dcd_view_time took, seconds.
    pub last_frame: f64,
    /// Longest time that the predictions of one dcd_view_time took, seconds.
    pub longest_frame: f64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdPrediction {
    const NAME: &'static str = "DcdPrediction";
}

/// Sets whether a client or participant shows its own avatars, and what they touch, ahead of the world, so that they answer at
/// once. At first it does.
///
/// Once dcd_view_time was called, a client keeps a small world of what is within some metres of its avatars. What is asked of the
/// avatars acts there in the same frame, and names the step for which it is meant (DcdViewTime.predicted), so that nodes do it in
/// just that step. Where states that come are not as predicted, what follows is computed again, and the difference melts away as
/// dcd_view_body says.
///
/// At most 64 bodies are predicted, with what joints tie to them, for at most a second and a half. Assemblies with multibodies are
/// not predicted, nor is anything in a world whose steps are not paced. A local world has nothing to predict.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (a server or a node).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_prediction_set(world: DcdWorld, predicts: bool) -> DcdStatus {
    guard("dcd_prediction_set", || {
        with(world, |world| world.dcd.set_prediction(predicts).map_err(Failure::from))
    })
}

/// Reads what a client predicts, and how often it was wrong; all is 0 where nothing is predicted.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_prediction(world: DcdWorld, out: *mut DcdPrediction) -> DcdStatus {
    guard("dcd_prediction", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let prediction = world.dcd.prediction().unwrap_or_default();
            out.write(DcdPrediction {
                struct_size: size_of::<DcdPrediction>() as u32,
                bodies: prediction.bodies as u32,
                ticks: prediction.ticks,
                replays: prediction.replays,
                corrections: prediction.corrections,
                largest_correction: prediction.largest_correction_m,
                last_frame: prediction.last_frame.as_secs_f64(),
                longest_frame: prediction.longest_frame.as_secs_f64(),
            });
            Ok(())
        })
    })
}
