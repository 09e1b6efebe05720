//! Defines the filter of the bodies and colliders that a query may find.

use rapier3d::prelude::*;

use crate::physics::collider_id::ColliderId;
use crate::physics::region::Region;
use crate::space::BodyId;

/// A filter that a query asks about each collider that it comes near. It looks up only what it needs to know.
pub(super) trait Lets {
    /// Returns whether this collider of a body may be found.
    fn lets(
        &self,
        region: &Region,
        parent: RigidBodyHandle,
        handle: ColliderHandle,
        collider: &Collider,
    ) -> bool;
}

/// A filter of what a query may find: Rapier's `QueryFilter` with bodies by id. The default lets everything
/// be found, sensors too.
///
/// ```
/// # use dcd::physics::{BodyFilter, WorldRay};
/// # use dcd::runtime::{LocalWorld, WorldConfig};
/// # use rapier3d::prelude::*;
/// # let mut world = LocalWorld::new(WorldConfig::default())?;
/// let wall = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(1.0, 1.0, 1.0))?;
/// let player = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(2.0).friction(0.25))?;
/// let ray = WorldRay::new([9.0, 0.0, 0.0], [-1.0, 0.0, 0.0]);
/// let seen = |filter: BodyFilter<'_>| world.queries().cast_ray(&ray, &filter).map(|hit| hit.unwrap().body);
/// assert_eq!(seen(BodyFilter { exclude_bodies: &[player], ..BodyFilter::default() })?, wall);
/// assert_eq!(seen(BodyFilter { flags: QueryFilterFlags::EXCLUDE_DYNAMIC, ..BodyFilter::default() })?, wall);
/// let slippery = |_, collider: &Collider| collider.friction() < 0.5;
/// assert_eq!(seen(BodyFilter { predicate: Some(&slippery), ..BodyFilter::default() })?, player);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Default)]
pub struct BodyFilter<'a> {
    /// The kinds of bodies and colliders that are left out.
    pub flags: QueryFilterFlags,
    /// Collision groups: only colliders whose groups match these are found, by the test modes of both. `None`
    /// lets all be found.
    pub groups: Option<InteractionGroups>,
    /// Bodies that are left out, for example the one on whose behalf the query is made.
    pub exclude_bodies: &'a [BodyId],
    /// Colliders that are left out.
    pub exclude_colliders: &'a [ColliderId],
    /// A predicate, called last, that says whether a collider of a body may be found. The collider's position
    /// may be that of the last step, and is in region space.
    #[allow(clippy::type_complexity)]
    pub predicate: Option<&'a dyn Fn(BodyId, &Collider) -> bool>,
}

impl std::fmt::Debug for BodyFilter<'_> {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("BodyFilter")
            .field("flags", &self.flags)
            .field("groups", &self.groups)
            .field("exclude_bodies", &self.exclude_bodies)
            .field("exclude_colliders", &self.exclude_colliders)
            .field("has_predicate", &self.predicate.is_some())
            .finish_non_exhaustive()
    }
}

impl Lets for BodyFilter<'_> {
    fn lets(
        &self,
        region: &Region,
        parent: RigidBodyHandle,
        handle: ColliderHandle,
        collider: &Collider,
    ) -> bool {
        let Some((body, _)) = region.role_of(parent) else { return false };
        let world = region.physics();
        let excluded = |id: &ColliderId| {
            id.body == body && world.bodies[parent].colliders().get(id.index) == Some(&handle)
        };
        self.flags.test(&world.bodies, collider)
            && self.groups.is_none_or(|groups| collider.collision_groups().test(groups))
            && !self.exclude_bodies.contains(&body)
            && !self.exclude_colliders.iter().any(excluded)
            && self.predicate.is_none_or(|lets| lets(body, collider))
    }
}

impl From<QueryFilterFlags> for BodyFilter<'_> {
    fn from(flags: QueryFilterFlags) -> Self {
        Self { flags, ..Self::default() }
    }
}

impl From<InteractionGroups> for BodyFilter<'_> {
    fn from(groups: InteractionGroups) -> Self {
        Self { groups: Some(groups), ..Self::default() }
    }
}
