//! Implements the proxy coupling: the owner computes each body; neighbours hold it as a kinematic ghost,
//! which pushes and is not pushed. Most projects do this, and it is the baseline of the charts. A contact
//! across a border meets infinite mass on both sides, so that elastic bodies gain energy, and a stack's
//! ground feels only what lies on its own side.

use rapier3d::prelude::*;

use super::{Ground, Side, owner};
use crate::physics::ShapeError;
use crate::physics::region::{Ownership, Region};
use crate::protocol::{BodyKind, BorderMessage};

/// Applies the owners' states, and makes kinematic ghosts of the bodies owned elsewhere.
pub(super) fn apply<'a>(
    side: &mut Side,
    inbox: impl Iterator<Item = &'a BorderMessage>,
    ground: Ground<'_>,
) -> Result<(), ShapeError> {
    owner::apply(side, inbox, ground)?;
    let Side { region, border, .. } = side;
    for link in region.ghosts().to_vec() {
        set_kind(region, link.handle, RigidBodyType::KinematicVelocityBased);
    }
    for link in &border.arrived {
        if region.slot(link.handle).role == Ownership::Owner {
            set_kind(region, link.handle, RigidBodyType::Dynamic);
        }
    }
    Ok(())
}

fn set_kind(region: &mut Region, handle: RigidBodyHandle, kind: RigidBodyType) {
    let dynamic = region.slot(handle).traits.kind == BodyKind::Dynamic;
    if dynamic && region.physics().bodies[handle].body_type() != kind {
        region.world_mut().bodies[handle].set_body_type(kind, false);
        region.look_at_ties();
    }
}
