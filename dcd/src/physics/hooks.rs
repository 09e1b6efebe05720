//! Lets a user filter and modify contacts while regions step: Rapier's physics hooks, with bodies by id.

use rapier3d::prelude::*;

use super::collider_id::ColliderId;
use super::contact_listener::ContactListener;
use crate::space::RegionId;

/// A program's hooks that filter and modify contacts: Rapier's `PhysicsHooks` with bodies by id. They are
/// called only for colliders with the matching `ActiveHooks`.
///
/// Regions call the hooks at the same time, from several threads, and every region that holds both bodies
/// calls them for its own copies. The answer must therefore not depend on anything that differs between
/// regions or changes from tick to tick, or the regions disagree. Which of the two colliders comes first may
/// differ between regions, too.
pub trait ContactHooks: Send + Sync {
    /// Returns whether two solid colliders touch: `None` if they do not, otherwise whether they push each
    /// other. By default they do.
    fn filter_contact_pair(&self, _pair: &HookedPair<'_>) -> Option<SolverFlags> {
        Some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }

    /// Returns whether a sensor detects another collider. By default it does.
    fn filter_intersection_pair(&self, _pair: &HookedPair<'_>) -> bool {
        true
    }

    /// Changes the contacts that the solver is about to use. `contacts.collider1` is the collider of
    /// `pair.first`. Positions are in the space of a region. The user data of the manifold starts at 0 in
    /// every region that comes to hold both bodies.
    fn modify_solver_contacts(&self, _pair: &HookedPair<'_>, _contacts: &mut ContactModificationContext<'_>) {
    }
}

/// The two colliders for which a hook is called.
#[derive(Clone, Copy)]
pub struct HookedPair<'a> {
    /// The id of the first collider.
    pub first: ColliderId,
    /// The id of the second collider.
    pub second: ColliderId,
    /// Both colliders as they are in the region.
    pub colliders: [&'a Collider; 2],
    /// Their bodies as they are in the region: with a part of the mass where it is split among regions.
    pub bodies: [&'a RigidBody; 2],
    /// The origin of the region's space, in world space, metres.
    pub anchor: [f64; 3],
    /// The region that calls.
    pub(crate) region: RegionId,
}

impl std::fmt::Debug for HookedPair<'_> {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("HookedPair")
            .field("first", &self.first)
            .field("second", &self.second)
            .field("anchor", &self.anchor)
            .finish_non_exhaustive()
    }
}

/// The hooks that a region hands to Rapier: they look up the ids and call the user's hooks.
pub(super) struct Named<'a> {
    pub hooks: &'a dyn ContactHooks,
    pub listener: &'a ContactListener,
    pub anchor: [f64; 3],
    pub region: RegionId,
}

impl Named<'_> {
    fn pair<'b>(
        &self,
        bodies: &'b RigidBodySet,
        colliders: &'b ColliderSet,
        handles: [ColliderHandle; 2],
    ) -> Option<HookedPair<'b>> {
        let [first, second] = handles.map(|handle| {
            let (body, index) = self.listener.name_of(handle)?;
            let collider = colliders.get(handle)?;
            let index = usize::from(index);
            Some((ColliderId { body, index }, collider, bodies.get(collider.parent()?)?))
        });
        let (first, second) = (first?, second?);
        Some(HookedPair {
            first: first.0,
            second: second.0,
            colliders: [first.1, second.1],
            bodies: [first.2, second.2],
            anchor: self.anchor,
            region: self.region,
        })
    }
}

impl PhysicsHooks for Named<'_> {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        match self.pair(context.bodies, context.colliders, [context.collider1, context.collider2]) {
            Some(pair) => self.hooks.filter_contact_pair(&pair),
            None => Some(SolverFlags::COMPUTE_RIGID_IMPULSES),
        }
    }

    fn filter_intersection_pair(&self, context: &PairFilterContext<'_>) -> bool {
        let pair = self.pair(context.bodies, context.colliders, [context.collider1, context.collider2]);
        pair.is_none_or(|pair| self.hooks.filter_intersection_pair(&pair))
    }

    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let handles = [context.collider1, context.collider2];
        if let Some(pair) = self.pair(context.bodies, context.colliders, handles) {
            self.hooks.modify_solver_contacts(&pair, context);
        }
    }
}
