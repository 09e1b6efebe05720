//! Sets the area of interest of a client, the part of a served world that it is told of, and how many bytes that may cost.

use dcd::protocol::{Area, WORLD_REACH_M};

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::{self, check_point};
use crate::registry::with;
use crate::status::{DcdStatus, Failure};

/// Sets the area of interest of a client or participant: what it hears of from now on. These are bodies whose origin is within
/// `radius` metres of `centre` (world space), its own avatars, and bodies whose origin is within 8 m of these. Some bodies a little
/// beyond the radius are told of too.
///
/// - Everything. A radius of 0 or less, or of infinity, is everything, as at first. `centre` may be null then.
/// - Savings. An interest saves bytes and time where the world is large, and more where the client joins with one
///   (DcdClientDef.interest_radius).
/// - Long bodies. A long body whose origin is farther off may touch an avatar, and only the contact is reported (dcd_events). Give
///   a radius that has the origins of such bodies in it.
/// - Moving it. Call it as often as needed: as long as the centre stays within a twentieth of the radius of where it was said last,
///   nothing is sent.
/// - Bodies outside. They stay valid, at the place and velocity where they were heard of last, with DCD_STATE_OUTSIDE in
///   DcdStateView.flags and with DcdBodyInfo.outside. That they are removed or touch avatars of this process is reported all the
///   same. So is that they appear, unless the client joined with an interest.
/// - Queries. What is submitted is answered from the whole world (dcd_cast_rays_submit).
/// - Leaving and entering. What leaves the area is told so. What comes in, by its own motion or as the interest moves over it, is
///   told within a few steps, also when it rests by then. It counts as outside until then.
///
/// A local world shows everything all the same. The interest lasts until it is set again or the world is destroyed.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a centre that is out of range, or a radius that is NaN.
/// - DCD_ERR_NETWORK: the link is gone.
/// - DCD_ERR_UNSUPPORTED: a server or a node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_interest_set(world: DcdWorld, centre: *const f64, radius: f64) -> DcdStatus {
    guard("dcd_interest_set", || {
        let area = if radius.is_nan() {
            return Err(Failure::argument("radius is NaN; give metres, or 0 for everything"));
        } else if radius <= 0.0 || radius == f64::INFINITY {
            None
        } else {
            // SAFETY: the caller vouches for three numbers.
            let centre = unsafe { pointer::read(centre.cast::<[f64; 3]>(), "centre")? };
            check_point(&centre, "centre")?;
            Some(Area { centre, radius_m: radius.min(WORLD_REACH_M) })
        };
        with(world, |world| world.dcd.set_interest(area).map_err(Failure::from))
    })
}

/// Limits what a client or participant is sent of bodies, in bytes per second with all headers but IP's; 0: as many as the link
/// carries, as at first.
///
/// Where there is not room for all bodies, those are told first that are most wrong here, as seen from the process's avatars, and
/// for longest. What is not told for a while is shown going on as it did, for two seconds at most (dcd_view_time). Below some 2,000
/// bytes per second little is told but that time goes on. For players at home 16,000 (128 kbit/s) suits some hundred moving bodies
/// near them. `dcd client --bandwidth` says what the bytes of a world are for.
///
/// A local world knows all. The limit lasts until it is set again or the world is destroyed.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_NETWORK (the link is gone), DCD_ERR_UNSUPPORTED (a server or a node).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_bandwidth_set(world: DcdWorld, bytes_per_second: u32) -> DcdStatus {
    guard("dcd_bandwidth_set", || {
        let limit = (bytes_per_second > 0).then_some(bytes_per_second);
        with(world, |world| world.dcd.set_bandwidth(limit).map_err(Failure::from))
    })
}
