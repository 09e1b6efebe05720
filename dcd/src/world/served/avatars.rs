//! Checks a client's avatar before it is sent to the server.

use rapier3d::prelude::*;

use super::Served;
use crate::physics::{ShapeError, ShapeLibrary};
use crate::protocol::{BodyRecord, Check, Controller, WorldPose};
use crate::runtime::check_speed;
use crate::world::author::refused;
use crate::world::error::Error;
use crate::world::remote::Remote;
use crate::world::role::Instead;

impl Served {
    /// Returns the record of the client's next avatar, or the error for which it cannot be inserted.
    pub(super) fn next_avatar(
        &self,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
        controller: Option<Controller<'_>>,
    ) -> Result<BodyRecord, Error> {
        let unsupported = match body.body_type() {
            _ if has_own_sleep(body.activation()) => {
                Some(("set when its avatars fall asleep", Instead::UsualSleep))
            }
            RigidBodyType::Fixed => Some(("make fixed bodies", Instead::FixedInScene)),
            RigidBodyType::KinematicPositionBased => {
                Some(("make bodies that follow poses", Instead::KinematicByVelocity))
            }
            _ => None,
        };
        if let Some((what, instead)) = unsupported {
            return Err(self.unsupported(what, instead));
        }
        self.check_link()?;
        let mut shapes = ShapeLibrary::default();
        let avatar = shapes.describe(self.world.next_avatar(), pose, body, colliders)?;
        let avatar = avatar.with_controller(controller);
        avatar.check().map_err(refused)?;
        check_speed(&avatar, self.speed_limit_m_s())?;
        if !avatar.suits_clients(|hash| shapes.record_of(hash)) {
            return Err(ShapeError::Avatar.into());
        }
        Ok(avatar)
    }
}

/// Returns whether the thresholds of sleep of a body differ from Rapier's defaults, for bodies that can and
/// cannot sleep.
fn has_own_sleep(body: &RigidBodyActivation) -> bool {
    let thresholds = |body: &RigidBodyActivation| {
        (body.normalized_linear_threshold, body.angular_threshold, body.time_until_sleep)
    };
    let usual = [RigidBodyActivation::default(), RigidBodyActivation::cannot_sleep()];
    !usual.iter().any(|usual| thresholds(usual) == thresholds(body))
}
