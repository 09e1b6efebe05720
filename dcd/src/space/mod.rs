//! Divides world space into regions: ids, half-open boxes, the distribution tree, load balancing, allocation
//! of regions to nodes. Pure functions and data.

mod allocation;
mod balance;
mod cell;
mod groups;
mod ids;
mod mix;
mod region_set;
mod tree;
mod viewpoint;

pub use allocation::{Allocation, allocate, reallocate};
pub use balance::{Balance, Burden, Load, Loads, balanced, plan, summarised};
pub use cell::{Axis, Bounds, Cell};
pub(crate) use groups::Groups;
#[cfg(feature = "physics")]
pub(crate) use groups::PlaceGroups;
pub use ids::{BodyId, ClientId, Epoch, GroupId, JointId, NodeId, RegionId, Tick};
pub use mix::{drawn, mixed};
pub use region_set::{MAX_REGIONS, RegionSet};
pub use tree::{DistributionTree, Limits, Renaming, TreeChange, TreeError, Yielding};
pub use viewpoint::Viewpoint;
