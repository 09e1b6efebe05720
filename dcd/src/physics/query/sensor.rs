//! Finds the bodies that are inside a sensor.

use rapier3d::prelude::*;

use super::{BodyFilter, Queries, QueryError};
use crate::physics::{ColliderId, convert};
use crate::protocol::WorldPose;
use crate::space::BodyId;

impl Queries<'_> {
    /// Returns the movable bodies whose solid colliders overlap a sensor, in order of ids; `None` if there is
    /// no such collider, or it is no sensor. Each body counts where its own region has it, so that no border
    /// makes a difference.
    pub(crate) fn inside(&self, sensor: ColliderId) -> Result<Option<Vec<BodyId>>, QueryError> {
        let held = || self.host.regions().find_map(|region| Some((region, region.handle_of(sensor.body)?)));
        let Some((region, handle)) = self.host.owned(sensor.body).or_else(held) else { return Ok(None) };
        let world = region.physics();
        let body = &world.bodies[handle];
        let collider = body.colliders().get(sensor.index).map(|&collider| &world.colliders[collider]);
        let Some(collider) = collider.filter(|collider| collider.is_sensor()) else { return Ok(None) };
        // Rapier's collider hears only in the next step that its body was disabled or enabled.
        let is_enabled =
            region.slot(handle).traits.colliders.get(sensor.index).is_some_and(|own| own.enabled);
        if !(body.is_enabled() && is_enabled) {
            return Ok(Some(Vec::new()));
        }
        // The collider's own pose is that of the last step.
        let place = collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
        let filter = BodyFilter {
            flags: QueryFilterFlags::EXCLUDE_FIXED | QueryFilterFlags::EXCLUDE_SENSORS,
            groups: Some(collider.collision_groups()),
            exclude_bodies: &[sensor.body],
            ..BodyFilter::default()
        };
        let pose: WorldPose = convert::world_from_region(region.anchor(), &(*body.position() * place));
        let found = self.intersect_shape(collider.shape(), &pose, &filter)?;
        let mut bodies: Vec<_> = found.into_iter().map(|collider| collider.body).collect();
        bodies.dedup();
        Ok(Some(bodies))
    }
}
