//! Lists the regions and borders of a world, and reads which region and node own a body.

use dcd::World as Dcd;
use dcd::physics::BorderView;

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{Out, Room, Sized32};
use crate::registry::{ask, find};
use crate::status::{DcdStatus, Failure};
use crate::types::DCD_NO_REGION;

/// A region: a box of the world whose bodies one Rapier world computes. Outer faces lie at infinity.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdRegionInfo {
    /// Its number in the tree of regions; numbers need not be dense.
    pub region: u32,
    /// Bodies that it owns; in a served world, of those that are known, by what dcd_body_owner says.
    pub bodies: u32,
    /// Ghosts that it holds: copies of bodies that its neighbours own; 0 in a served world.
    pub replicas: u32,
    /// The node that computes it, as the server numbers nodes from 1, as last told: it may have changed hands some milliseconds
    /// ago. DCD_NO_NODE in a local world, and while nobody computes.
    pub node: u32,
    /// Lowest corner, inside, metres.
    pub min: [f64; 3],
    /// Highest corner, outside, metres.
    pub max: [f64; 3],
}

/// As the node of a region or an owner where there is none.
pub const DCD_NO_NODE: u32 = u32::MAX;

/// In DcdOwner.flags: this process computes the region that owns the body.
pub const DCD_OWNER_HERE: u32 = 1;
/// In DcdOwner.flags: nobody has told yet who owns the body, which may not have moved since this process joined. The region is
/// the one that it is in: its owner but for moments at borders, and while islands or joints tie it to one in another.
pub const DCD_OWNER_BY_PLACE: u32 = 4;
/// In DcdOwner.flags: what this world shows of the body was heard from others, and is some milliseconds old.
pub const DCD_OWNER_HEARD: u32 = 2;

/// The owner of a body: the region with authority over it. Start from DCD_OWNER_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdOwner {
    /// sizeof(DcdOwner).
    pub struct_size: u32,
    /// Its region, as in DcdRegionInfo; DCD_NO_REGION for a fixed body, which every region near it has, and for an avatar that
    /// has not appeared yet. In a served world, the one that owned the body when it was last heard of: exactly, unless
    /// DCD_OWNER_BY_PLACE is set.
    pub region: u32,
    /// The node that computes the region, as DcdRegionInfo.node.
    pub node: u32,
    /// Regions that hold the body, its owner included; 0 in a served world, where it is not told.
    pub holders: u32,
    /// DCD_OWNER_… bits. In a participant both may be set.
    pub flags: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdOwner {
    const NAME: &'static str = "DcdOwner";
}

/// A border between two regions.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBorderInfo {
    /// The region of the lower number, as in DcdRegionInfo.
    pub a: u32,
    /// The other.
    pub b: u32,
    /// Movable bodies that both hold, whoever owns them.
    pub bodies: u32,
    /// How often the two come to consensus in the next step; with DCD_COUPLING_AUTO as often as the border came to need.
    pub exchanges: u32,
    /// Contact hops across the border within which bodies live in both regions, at the side where it is more; 0 with
    /// DCD_COUPLING_OWNER and _PROXY.
    pub depth: u32,
    /// How far the copies of a body were from agreement here in the last step, summed over its exchanges, m/s; an estimate of
    /// the error that the border makes. 0 with DCD_COUPLING_OWNER and _PROXY.
    pub disagreement: f32,
}

/// Lists the regions into `out`, which has `cap` entries, and their number into `count`. With `cap` 0 `out` may be null, to
/// ask for the number. A server and a node list none: dcd_world_info has their number. In a served world that follows its load they change as it runs: ask again now and then.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_regions(
    world: DcdWorld,
    out: *mut DcdRegionInfo,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_regions", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            out.fill(world.dcd.regions().into_iter().map(|region| DcdRegionInfo {
                region: region.id.0,
                bodies: region.owned as u32,
                replicas: region.replicas as u32,
                node: region.node.map_or(DCD_NO_NODE, |node| node.0),
                min: region.cell.min,
                max: region.cell.max,
            }))
        })
    })
}

/// Lists the borders into `out`, which has `cap` entries, and their number into `count`, in order of (a, b): of each two
/// regions that have a face in common or hold the same body. With `cap` 0 `out` may be null, to ask for the number.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (then `count` is written all the same and `out` is not),
/// DCD_ERR_UNSUPPORTED in a served world, whatever the role: ask a local one of the same cut and coupling.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_borders(
    world: DcdWorld,
    out: *mut DcdBorderInfo,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_borders", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| out.fill(borders(&world.dcd)?.into_iter()))
    })
}

fn borders(world: &Dcd) -> Result<Vec<DcdBorderInfo>, Failure> {
    let info = |border: BorderView| DcdBorderInfo {
        a: border.a.0,
        b: border.b.0,
        bodies: border.bodies as u32,
        exchanges: border.exchanges as u32,
        depth: border.depth as u32,
        disagreement: border.disagreement_m_s,
    };
    Ok(world.borders()?.into_iter().map(info).collect())
}

/// Reads who owns a body: nobody, if it is fixed (DCD_NO_REGION, DCD_NO_NODE, without DCD_OWNER_HERE).
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED for a node. A server is told no owner: DCD_NO_REGION.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_owner(world: DcdWorld, body: DcdBodyId, out: *mut DcdOwner) -> DcdStatus {
    guard("dcd_body_owner", || {
        // SAFETY: the caller vouches for the pointer.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            let owner = world.dcd.owner(find(world, body)?);
            let flag = |is: bool, bit: u32| if is { bit } else { 0 };
            out.write(DcdOwner {
                struct_size: size_of::<DcdOwner>() as u32,
                region: owner.region.map_or(DCD_NO_REGION, |region| region.0),
                node: owner.node.map_or(DCD_NO_NODE, |node| node.0),
                holders: owner.holders as u32,
                flags: flag(owner.here, DCD_OWNER_HERE)
                    | flag(owner.heard, DCD_OWNER_HEARD)
                    | flag(owner.by_place, DCD_OWNER_BY_PLACE),
            });
            Ok(())
        })
    })
}
