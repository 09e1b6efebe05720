//! Sets how much of a world is computed in full and where it is looked at from, and reads what that saves and costs.

use dcd::{Fidelity, Viewpoint};

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::{self, Out, Sized32, check_point};
use crate::registry::{ask, with};
use crate::status::{DcdStatus, Failure};

/// Fidelity: how much of a world is computed in full. Regions that nobody looks at may be stepped once per two or four steps.
pub type DcdFidelity = u32;

/// The scene's fidelity, else DCD_FIDELITY_OFF.
pub const DCD_FIDELITY_DEFAULT: DcdFidelity = 0;
/// All of the world is computed in full, in every step.
pub const DCD_FIDELITY_OFF: DcdFidelity = 1;
/// As DCD_FIDELITY_TOLERANCE of 0.33 m/s.
pub const DCD_FIDELITY_AUTO: DcdFidelity = 2;
/// What is looked at is computed in full. All else is computed as seldom as keeps the mean error of a body's velocity per step
/// below DcdWorldDef.fidelity_limit, m/s. The result is the same with any number of threads.
pub const DCD_FIDELITY_TOLERANCE: DcdFidelity = 3;
/// As much is computed in full as fits into DcdWorldDef.fidelity_limit, milliseconds per step, what is looked at before all else.
/// It depends on the time that steps take, so no two runs are the same; a recording keeps what was chosen (dcd_record).
pub const DCD_FIDELITY_BUDGET: DcdFidelity = 4;

/// Viewpoint: a place that a world is looked at from.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdViewpoint {
    /// Position, world space, metres.
    pub at: [f64; 3],
    /// Distance that is looked, metres, 0 or more: regions within it are computed in full.
    pub radius: f64,
}

/// Report of what fidelity saved and what it cost, as far as is known. Start from DCD_FIDELITY_REPORT_INIT. The struct may grow at
/// its end.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdFidelityReport {
    /// Size of this struct: sizeof(DcdFidelityReport).
    pub struct_size: u32,
    /// Mean error of a body's velocity per step against a model four times as fine, m/s, by audits of the last steps; 0 before the
    /// first audit, and where all is computed in full.
    pub error: f32,
    /// Lower end of the 95 % confidence interval of `error`, m/s.
    pub low95: f32,
    /// Upper end of the 95 % confidence interval of `error`, m/s; infinite before two audits, and 0 where all is computed in full.
    pub high95: f32,
    /// Time of regions' steps over the time that they would have taken had each been stepped in every step, as reckoned.
    pub share_of_full_time: f64,
    /// Number of audits so far.
    pub audits: u64,
    /// Number of steps that took longer than the budget, since the first second.
    pub overruns: u64,
    /// Numbers of regions that are stepped in every step, in every second one, and in every fourth.
    pub levels: [u32; 3],
    /// Reserved; always 0.
    pub reserved: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdFidelityReport {
    const NAME: &'static str = "DcdFidelityReport";
}

/// Returns what a definition asks for, if it asks. `limit` is checked with it.
pub(crate) fn asked(fidelity: DcdFidelity, limit: f32) -> Result<Option<Fidelity>, Failure> {
    let takes_limit = matches!(fidelity, DCD_FIDELITY_TOLERANCE | DCD_FIDELITY_BUDGET);
    let is_fit = if takes_limit { limit > 0.0 && pointer::is_in_range(limit) } else { limit == 0.0 };
    match fidelity {
        _ if fidelity > DCD_FIDELITY_BUDGET => Err(Failure::argument(format!(
            "fidelity is {fidelity}, the last is {DCD_FIDELITY_BUDGET}; give a DCD_FIDELITY_..."
        ))),
        _ if !is_fit => Err(Failure::argument(format!(
            "fidelity_limit is {limit}; give m/s or milliseconds above 0 with DCD_FIDELITY_TOLERANCE or _BUDGET, else 0"
        ))),
        DCD_FIDELITY_DEFAULT => Ok(None),
        DCD_FIDELITY_OFF => Ok(Some(Fidelity::Off)),
        DCD_FIDELITY_AUTO => Ok(Some(Fidelity::AUTO)),
        DCD_FIDELITY_TOLERANCE => Ok(Some(Fidelity::Tolerance { m_s: limit })),
        _ => Ok(Some(Fidelity::Budget { tick_ms: limit })),
    }
}

/// Sets where a world is looked at from, in place of what was set before. Regions farther away than what is seen from there are
/// stepped less often, as DcdWorldDef.fidelity allows. Call it as often as viewers move.
///
/// - Local world. Without viewpoints, as at first, all of it is looked at.
/// - Server. The viewpoints count some ticks later, on all nodes from the same tick on, and are kept when the server stops. Without
///   viewpoints only clients look.
/// - Source of a server. A world that is served from it (DcdServerDef.source) keeps its fidelity and viewpoints, and is looked at
///   by its clients, too (dcd_interest_set).
///
/// `viewpoints` points to `count` of them, read during the call. It may be null when there are none.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a place out of range, or a radius that is negative or NaN.
/// - DCD_ERR_UNSUPPORTED: a node or a client.
/// - DCD_ERR_NETWORK: the served world has ended.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_viewpoints_set(
    world: DcdWorld,
    viewpoints: *const DcdViewpoint,
    count: usize,
) -> DcdStatus {
    guard("dcd_viewpoints_set", || {
        // SAFETY: the caller vouches for the pointer and the count.
        let given = unsafe { pointer::slice(viewpoints, count, "viewpoints")? };
        for viewpoint in given {
            check_point(&viewpoint.at, "at")?;
            if !(viewpoint.radius >= 0.0 && viewpoint.radius.is_finite()) {
                let radius = viewpoint.radius;
                return Err(Failure::argument(format!("radius is {radius}; give metres, 0 or more")));
            }
        }
        let viewpoints: Vec<_> =
            given.iter().map(|given| Viewpoint { at: given.at, radius_m: given.radius }).collect();
        with(world, |world| world.dcd.set_viewpoints(&viewpoints).map_err(Failure::from))
    })
}

/// Reads what fidelity saves and costs. Where all is computed in full, share_of_full_time is 1 and the rest says nothing. The
/// server of a world says what it was told last, every 60 steps. Nodes and clients do not know, and say the same as where all is
/// computed in full.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_fidelity_report(world: DcdWorld, out: *mut DcdFidelityReport) -> DcdStatus {
    guard("dcd_fidelity_report", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let report = world.dcd.fidelity_report();
            let share_of_full_time = report.map_or(1.0, |report| report.share_of_full_time);
            let report = report.unwrap_or_default();
            out.write(DcdFidelityReport {
                struct_size: size_of::<DcdFidelityReport>() as u32,
                error: report.error_m_s,
                low95: report.low95_m_s,
                high95: report.high95_m_s,
                share_of_full_time,
                audits: report.audits,
                overruns: report.overruns,
                levels: report.levels.map(|count| count as u32),
                reserved: 0,
            });
            Ok(())
        })
    })
}
