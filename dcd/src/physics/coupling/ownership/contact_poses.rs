//! Remembers in which poses the bodies of an island lay when their contacts were found, for a region that is
//! sent the whole island.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::{Pose, RigidBodyHandle};

use super::desired::splits;
use crate::physics::coupling::{Border, Moment};
use crate::physics::region::{BodyRef, Region};
use crate::space::{BodyId, RegionSet};

/// The poses in which bodies of islands that are sent to another region lay when their contacts were found:
/// that region must find these alike.
#[derive(Clone, Debug, Default)]
pub(super) struct ContactPoses {
    /// The islands that were looked at, by their first member.
    seen: BTreeSet<BodyId>,
    pub of: BTreeMap<BodyId, Pose>,
}

impl ContactPoses {
    /// Looks at the island of a body that is sent to the regions `to`, unless it has done so before. It
    /// leaves out split islands, whose copies count at once and must be where the island is, and islands of
    /// which a part is there already.
    pub(super) fn look(
        &mut self,
        region: &Region,
        border: &Border,
        moment: Moment<'_>,
        body: RigidBodyHandle,
        to: RegionSet,
    ) {
        let Some(island) = border.islands.of(body).filter(|island| self.seen.insert(island.members[0].id))
        else {
            return;
        };
        let goes = |link: &BodyRef| {
            let is_new = region.slot(link.handle).holders.intersection(to).is_empty();
            is_new && !splits(border, moment, link.id, link.handle)
        };
        let goes_whole = !island.big && !island.large && island.pressed && !island.spans();
        if goes_whole && island.members.iter().all(goes) {
            let lay = region.contact_poses(&island.members, moment.tick);
            self.of.extend(lay.into_iter().map(|(handle, pose)| (region.slot(handle).id, pose)));
        }
    }
}
