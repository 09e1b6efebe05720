//! Lists the regions and borders of a world, and reads which region and node own a body.

use dcd::World as Dcd;
use dcd::physics::BorderView;

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{Out, Room, Sized32};
use crate::registry::{ask, find};
use crate::status::{DcdStatus, Failure};
use crate::types::DCD_NO_REGION;

/// Region: a box of the world whose bodies one Rapier world computes. Outer faces lie at infinity.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdRegionInfo {
    /// Number of the region in the tree of regions. Numbers need not be dense.
    pub region: u32,
    /// Number of bodies that the region owns. In a served world, of those that are known, by what dcd_body_owner says.
    pub bodies: u32,
    /// Number of ghosts that the region holds, copies of bodies that its neighbours own; 0 in a served world.
    pub ghosts: u32,
    /// Number of the node that computes the region, as the server numbers nodes from 1, as last told: the region may have changed
    /// hands some milliseconds ago. DCD_NO_NODE in a local world, and while nobody computes it.
    pub node: u32,
    /// Lowest corner, which is inside the region, metres.
    pub min: [f64; 3],
    /// Highest corner, which is outside the region, metres.
    pub max: [f64; 3],
}

/// Number of the node of a region or an owner where there is none.
pub const DCD_NO_NODE: u32 = u32::MAX;

/// In DcdOwner.flags: this process computes the region that owns the body.
pub const DCD_OWNER_HERE: u32 = 1;
/// In DcdOwner.flags: nobody has told yet who owns the body, which may not have moved since this process joined. The region is the
/// one that the body is in. That is its owner except for moments at borders, and while islands or joints tie the body to one in
/// another region.
pub const DCD_OWNER_BY_PLACE: u32 = 4;
/// In DcdOwner.flags: what this world shows of the body was heard from others, and is some milliseconds old.
pub const DCD_OWNER_HEARD: u32 = 2;

/// Owner of a body: the region with authority over it. Start from DCD_OWNER_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdOwner {
    /// Size of this struct: sizeof(DcdOwner).
    pub struct_size: u32,
    /// Region that owns the body, as in DcdRegionInfo. DCD_NO_REGION for a fixed body, which every region near it has, and for an
    /// avatar that has not appeared yet. In a served world, the region that owned the body when it was last heard of: exactly,
    /// unless DCD_OWNER_BY_PLACE is set.
    pub region: u32,
    /// Number of the node that computes the region, as DcdRegionInfo.node.
    pub node: u32,
    /// Number of regions that hold the body, its owner included; 0 in a served world, where it is not told.
    pub holders: u32,
    /// DCD_OWNER_… bits. In a participant, DCD_OWNER_HERE and DCD_OWNER_HEARD may both be set.
    pub flags: u32,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdOwner {
    const NAME: &'static str = "DcdOwner";
}

/// Border between two regions.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdBorderInfo {
    /// Region of the lower number, as in DcdRegionInfo.
    pub a: u32,
    /// Region of the higher number.
    pub b: u32,
    /// Number of movable bodies that both regions hold, whoever owns them.
    pub bodies: u32,
    /// Number of exchanges by which the two regions come to consensus in the next step; with DCD_COUPLING_AUTO as many as the
    /// border came to need.
    pub exchanges: u32,
    /// Number of contact hops across the border within which bodies live in both regions, at the side where it is more; 0 with
    /// DCD_COUPLING_OWNER and DCD_COUPLING_PROXY.
    pub depth: u32,
    /// Disagreement here in the last step: how far the copies of a body were from agreement, summed over the step's exchanges, m/s.
    /// It is an estimate of the error that the border makes. 0 with DCD_COUPLING_OWNER and DCD_COUPLING_PROXY.
    pub disagreement: f32,
}

/// Lists the regions. Writes them to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null,
/// to ask for the number.
///
/// A server and a node list none: dcd_world_info has their number. In a served world that follows its load, regions change as it
/// runs: ask again now and then.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
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
                ghosts: region.ghosts as u32,
                node: region.node.map_or(DCD_NO_NODE, |node| node.0),
                min: region.cell.min,
                max: region.cell.max,
            }))
        })
    })
}

/// Lists the borders, in order of (a, b): one for each two regions that have a face in common or hold the same body. Writes them to
/// `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the number.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_SMALL_BUFFER: `count` is written all the same, `out` is not.
/// - DCD_ERR_UNSUPPORTED: in a served world, whatever the role. Ask a local one of the same cut and coupling.
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

/// Reads who owns a body. Nobody owns a fixed body (DCD_NO_REGION, DCD_NO_NODE, without DCD_OWNER_HERE). A server is told no owner:
/// DCD_NO_REGION.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_UNSUPPORTED (a node).
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
