//! Reads the counters of a world, as a struct or as text, and hashes its state to one number.

use std::ffi::c_char;
use std::fmt::Write;

use dcd::World as Dcd;

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::{Out, Room, Sized32};
use crate::registry::ask;
use crate::status::DcdStatus;

/// Counters of a world. Start from DCD_STATS_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdStats {
    /// Size of this struct: sizeof(DcdStats).
    pub struct_size: u32,
    /// Number of regions that the world is cut into.
    pub regions: u32,
    /// Number of steps done; in a served world, the newest step heard of.
    pub ticks: u64,
    /// Number of movable bodies.
    pub bodies: u64,
    /// Number of ghosts: copies of bodies in regions that do not own them; 0 in a served world.
    pub ghosts: u64,
    /// Number of times that a body changed owner in a step, ever; 0 in a served world.
    pub transfers: u64,
    /// Number of copies set aside because their numbers were not finite; 0 unless something is wrong, and in a served world.
    pub quarantined: u64,
    /// Number of messages with states of bodies received, ever; 0 in a local world.
    pub updates: u64,
    /// Bytes received, without those of QUIC itself; 0 in a local world. A tenth of a second old.
    pub bytes_in: u64,
    /// Bytes sent, without those of QUIC itself; 0 in a local world.
    pub bytes_out: u64,
    /// Bytes of UDP received: those of bytes_in, and what QUIC adds; 0 in a local world. It is what a link is charged for, but for
    /// 28 (IPv6: 48) bytes of headers per packet.
    pub udp_bytes_in: u64,
    /// Bytes of UDP sent: those of bytes_out, and what QUIC adds; 0 in a local world.
    pub udp_bytes_out: u64,
    /// Round trip to the slowest peer, seconds; 0 in a local world.
    pub rtt: f64,
    /// Wall time of the last step, seconds; in a served world, of taking in what had come.
    pub last_step: f64,
    /// Disagreement at the worst border in the last step: how far copies of a body in different regions were from agreement, summed
    /// over its exchanges, m/s. It is an estimate of the error that borders make. 0 with DCD_COUPLING_OWNER and DCD_COUPLING_PROXY,
    /// and in a served world.
    pub disagreement: f32,
    /// Number of exchanges between regions in the last step, at the border that took most; 0 in a world of one region and in a
    /// served one.
    pub exchanges: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdStats {
    const NAME: &'static str = "DcdStats";
}

/// Reads the counters of a world.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_stats(world: DcdWorld, out: *mut DcdStats) -> DcdStatus {
    guard("dcd_stats", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let (stats, traffic) = (world.dcd.stats(), world.dcd.traffic());
            out.write(DcdStats {
                struct_size: size_of::<DcdStats>() as u32,
                regions: world.dcd.region_count() as u32,
                ticks: stats.ticks,
                bodies: stats.bodies as u64,
                ghosts: stats.ghosts as u64,
                transfers: stats.transfers,
                quarantined: stats.quarantined as u64,
                updates: world.dcd.updates(),
                bytes_in: traffic.bytes_in,
                bytes_out: traffic.bytes_out,
                udp_bytes_in: traffic.udp_bytes_in,
                udp_bytes_out: traffic.udp_bytes_out,
                rtt: traffic.rtt.as_secs_f64(),
                last_step: stats.last_step.as_secs_f64(),
                disagreement: stats.disagreement_m_s,
                exchanges: stats.exchanges as u32,
            });
            Ok(())
        })
    })
}

/// Writes the counters as text for people, one per line, to `buf` of `cap` bytes with a NUL, and its size with NUL to `needed`.
/// With `cap` 0, `buf` may be null, to ask for the size.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_stats_text(
    world: DcdWorld,
    buf: *mut c_char,
    cap: usize,
    needed: *mut usize,
) -> DcdStatus {
    guard("dcd_stats_text", || {
        // SAFETY: the caller vouches for `cap` bytes and for `needed`.
        let out = unsafe { Room::new(buf.cast::<u8>(), cap, needed, ["buf", "needed"])? };
        ask(world, |world| {
            let mut text = describe(&world.dcd).into_bytes();
            text.push(0);
            out.fill(text.into_iter())
        })
    })
}

/// Checks what must hold in a local world between two steps, for tests and reports of bugs: that each body has one owner, that
/// owners and regions agree on who holds what, that parts of masses add up, and that numbers are finite. It costs a look at every
/// body.
///
/// Writes what does not hold, one finding per line, to `buf` of `cap` bytes with a NUL, and the size with NUL to `needed`. The size
/// is 1 as long as all is well. With `cap` 0, `buf` may be null, to ask for the size.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not),
/// DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_validate(
    world: DcdWorld,
    buf: *mut c_char,
    cap: usize,
    needed: *mut usize,
) -> DcdStatus {
    guard("dcd_validate", || {
        // SAFETY: the caller vouches for `cap` bytes and for `needed`.
        let out = unsafe { Room::new(buf.cast::<u8>(), cap, needed, ["buf", "needed"])? };
        ask(world, |world| {
            let found = world.dcd.validate()?;
            let text: String = found.iter().map(|finding| format!("{finding}\n")).collect();
            out.fill(text.bytes().chain([0]).collect::<Vec<_>>().into_iter())
        })
    })
}

/// Hashes the pose and velocity of every movable body to one number. Equal worlds have equal numbers, whatever the number of
/// threads.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_state_hash(world: DcdWorld, out: *mut u64) -> DcdStatus {
    guard("dcd_state_hash", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::new(out, "out")? };
        ask(world, |world| {
            out.write(world.dcd.state_hash()?);
            Ok(())
        })
    })
}

fn describe(world: &Dcd) -> String {
    let (stats, traffic) = (world.stats(), world.traffic());
    let mut text = String::new();
    let rows = [
        ("ticks", stats.ticks),
        ("regions", world.region_count() as u64),
        ("bodies", stats.bodies as u64),
        ("ghosts", stats.ghosts as u64),
        ("transfers", stats.transfers),
        ("quarantined", stats.quarantined as u64),
        ("exchanges", stats.exchanges as u64),
        ("updates", world.updates()),
        ("bytes in", traffic.bytes_in),
        ("bytes out", traffic.bytes_out),
        ("UDP in", traffic.udp_bytes_in),
        ("UDP out", traffic.udp_bytes_out),
    ];
    for (name, value) in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name:<12} {value}");
    }
    if let Some(chosen) = world.chosen() {
        let _ = writeln!(text, "{:<12} {}", "threads", chosen.threads);
        let _ = writeln!(text, "{:<12} {}", "regions by", chosen.why);
    }
    let _ = writeln!(text, "{:<12} {:.6} m/s", "disagreement", stats.disagreement_m_s);
    let _ = writeln!(text, "{:<12} {:.3} ms", "round trip", traffic.rtt.as_secs_f64() * 1e3);
    let _ = writeln!(text, "{:<12} {:.3} ms", "last step", stats.last_step.as_secs_f64() * 1e3);
    text
}
