//! Measures a world: energy, momentum, contacts, the force on the ground, owners of bodies, the hash of its
//! state.
//!
//! The same formulas serve a bare Rapier world and a world of regions. Both are a list of [`View`]s, each a
//! Rapier world and the bodies for which it answers. Measuring changes nothing.

mod census;
mod contacts;
mod motion;
mod points;

use rapier3d::prelude::*;

use super::convert;
use super::host::RegionHost;
use super::region::{Ownership, Region};
use crate::protocol::{StateHasher, Velocity, WorldPose};
use crate::space::{BodyId, RegionId};

pub use census::Census;
pub use contacts::ContactSample;
pub(crate) use contacts::drawn_force_n;
pub use points::ContactPoint;

/// A Rapier world to be measured, and which of its bodies it answers for.
#[derive(Clone, Copy)]
pub enum View<'a> {
    /// A bare Rapier world, which answers for everything. The body with Rapier's index `i` is
    /// `BodyId::persistent(i)`, as in [`Scene::bare_world`](crate::scene::Scene::bare_world).
    Bare(&'a PhysicsWorld),
    /// A region: it answers for the bodies that it owns.
    Region(&'a Region),
}

/// A world that can be measured: a bare Rapier world, or the regions of a host.
///
/// ```
/// use dcd::physics::Measured;
/// use dcd::scene::{Params, Scene};
///
/// let mut world = Scene::named("tower", &Params::new())?.bare_world();
/// for _ in 0..60 {
///     world.step();
/// }
/// assert_eq!(world.contacts().pairs, 10);
/// assert!((world.contacts().ground_force_ratio().unwrap() - 1.0).abs() < 0.01);
/// # Ok::<(), dcd::scene::SceneError>(())
/// ```
pub trait Measured {
    /// Returns the Rapier worlds that make up this world.
    fn views(&self) -> Vec<View<'_>>;

    /// Returns the kinetic energy (of translation and rotation) and the potential energy of all enabled
    /// dynamic bodies, joules: Σ ½ m v² + ½ ω·Iω − s m g·x, with the gravity scale s and the centre of mass
    /// x. The potential is zero at the world's origin, for Earth's gravity at y = 0.
    fn energy_j(&self) -> f64 {
        self.views().into_iter().map(motion::energy_j).sum()
    }

    /// Returns the momentum Σ m v of all enabled dynamic bodies, in kg m/s.
    fn momentum_kgms(&self) -> [f64; 3] {
        self.views()
            .into_iter()
            .map(motion::momentum_kgms)
            .fold([0.0; 3], |sum, part| std::array::from_fn(|i| sum[i] + part[i]))
    }

    /// Samples the contacts of the last step, each counted by the one region that answers for it.
    fn contacts(&self) -> ContactSample {
        self.views().into_iter().map(contacts::sample).fold(ContactSample::default(), ContactSample::and)
    }

    /// Returns how deep each pair of touching colliders overlaps, metres, in no order; 0 for a pair that does
    /// not overlap. Each pair is counted once, by the region that answers for it.
    fn penetrations_m(&self) -> Vec<f64> {
        self.views().into_iter().flat_map(contacts::penetrations_m).collect()
    }

    /// Counts how often each movable body is owned.
    fn census(&self) -> Census {
        Census::of(&self.views())
    }

    /// Returns the bodies that Rapier set aside in the last step because their state was not finite: once for
    /// each copy, the owner's or a ghost.
    fn quarantined(&self) -> Vec<BodyId> {
        let of = |view: View<'_>| {
            let handles = view.physics().quarantine().bodies();
            handles.iter().filter_map(|&handle| view.name(handle)).collect::<Vec<_>>()
        };
        self.views().into_iter().flat_map(of).collect()
    }

    /// Returns every movable body in id order: id, owner, pose, velocity.
    fn states(&self) -> Vec<(BodyId, RegionId, WorldPose, Velocity)> {
        let of = |view| {
            View::owned(view).map(move |(id, body)| (id, view.region(), view.pose(body), velocity(body)))
        };
        let mut states: Vec<_> = self.views().into_iter().flat_map(of).collect();
        states.sort_by_key(|(id, ..)| *id);
        states
    }

    /// Returns a hash of the state of all movable bodies: equal worlds have equal hashes. If a body has two
    /// owners, the first owner's copy counts.
    fn state_hash(&self) -> u64 {
        let mut states = self.states();
        states.dedup_by_key(|(id, ..)| *id);
        let mut hasher = StateHasher::default();
        for (id, _, pose, velocity) in states {
            hasher.add(id, &pose, &velocity);
        }
        hasher.finish()
    }
}

impl Measured for PhysicsWorld {
    fn views(&self) -> Vec<View<'_>> {
        vec![View::Bare(self)]
    }
}

impl Measured for RegionHost {
    fn views(&self) -> Vec<View<'_>> {
        self.regions().map(View::Region).collect()
    }
}

impl<'a> View<'a> {
    /// Returns the Rapier world.
    pub fn physics(self) -> &'a PhysicsWorld {
        match self {
            Self::Bare(world) => world,
            Self::Region(region) => region.physics(),
        }
    }

    /// Returns the origin (anchor) of the view's space, in world space, metres.
    pub fn anchor(self) -> [f64; 3] {
        match self {
            Self::Bare(_) => [0.0; 3],
            Self::Region(region) => region.anchor(),
        }
    }

    /// Returns the id of the view's region; a bare world counts as the root of the tree.
    pub fn region(self) -> RegionId {
        match self {
            Self::Bare(_) => RegionId(0),
            Self::Region(region) => region.id(),
        }
    }

    /// Returns the id of the body behind a handle.
    pub fn name(self, handle: RigidBodyHandle) -> Option<BodyId> {
        match self {
            Self::Bare(_) => Some(BodyId::persistent(handle.into_raw_parts().0)),
            Self::Region(region) => region.role_of(handle).map(|(id, _)| id),
        }
    }

    /// Returns whether the view answers for a body; never for an immovable one.
    pub fn owns(self, handle: RigidBodyHandle) -> bool {
        match self {
            Self::Bare(world) => world.bodies.get(handle).is_some_and(|body| !body.is_fixed()),
            Self::Region(region) => region.role_of(handle).is_some_and(|(_, role)| role == Ownership::Owner),
        }
    }

    /// Returns whether the view's contacts of a dynamic body with another one, or with what is fixed, are
    /// those that count. In a region they are if it leads the body and holds the other one; without such a
    /// region, those of the region that reports the contact count, mostly the body's owner.
    fn solves(self, handle: RigidBodyHandle, other: Option<RigidBodyHandle>) -> bool {
        match self {
            Self::Bare(_) => self.owns(handle),
            Self::Region(region) => region.solves(handle, other),
        }
    }

    /// Returns the movable bodies for which the view answers.
    pub fn owned(self) -> impl Iterator<Item = (BodyId, &'a RigidBody)> {
        self.owned_handles().filter_map(move |(handle, body)| Some((self.name(handle)?, body)))
    }

    /// Returns the number of parts into which mass splitting divides the mass of a body. Regions that share
    /// the body have one part each.
    pub fn parts(self, handle: RigidBodyHandle) -> f64 {
        match self {
            Self::Bare(_) => 1.0,
            Self::Region(region) => region.share_of(handle) as f64,
        }
    }

    /// Returns whether the copy of the body here is one of those that bear its weight.
    fn counts(self, handle: RigidBodyHandle) -> bool {
        match self {
            Self::Bare(_) => true,
            Self::Region(region) => region.counts(handle),
        }
    }

    /// Returns the length of the step in which the contacts of this body were solved last, in seconds.
    fn solved_dt_s(self, handle: RigidBodyHandle) -> f32 {
        match self {
            Self::Bare(world) => world.integration_parameters.dt,
            Self::Region(region) => region.solved_dt_s(handle),
        }
    }

    fn owned_handles(self) -> impl Iterator<Item = (RigidBodyHandle, &'a RigidBody)> {
        self.physics().bodies.iter().filter(move |(handle, _)| self.owns(*handle))
    }

    fn pose(self, body: &RigidBody) -> WorldPose {
        convert::world_from_region(self.anchor(), body.position())
    }
}

fn velocity(body: &RigidBody) -> Velocity {
    convert::velocity_of(body)
}

#[cfg(test)]
mod tests;
