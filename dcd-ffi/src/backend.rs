//! What stands behind a world handle: the one place that knows the roles.
//!
//! The entry points check and convert; what a role does is decided here, so that a new role is a new variant and the
//! compiler lists what it must answer.

use dcd::protocol::{Velocity, WorldEvents, WorldPose};
use dcd::runtime::{DcdWorld, Stats};
use dcd::space::{BodyId, JointId, RegionId};
use rapier3d::prelude::*;

use crate::body::{DCD_DYNAMIC, DCD_FIXED, DCD_KINEMATIC, DcdBodyType};
use crate::status::Failure;
use crate::world::{DCD_ROLE_LOCAL, DcdRole};

/// A world by role.
pub(crate) enum Backend {
    /// Computed whole in this process.
    Local(Box<DcdWorld>),
}

/// A body as far as C asks about it.
pub(crate) struct BodyView {
    pub pose: WorldPose,
    pub velocity: Velocity,
    pub kind: DcdBodyType,
    pub sleeping: bool,
    pub mass_kg: f32,
    pub user_data: u64,
    /// `None` for an immovable body.
    pub owner: Option<RegionId>,
}

/// A movable body after a step.
pub(crate) struct StateRow {
    pub id: BodyId,
    pub region: RegionId,
    pub pose: WorldPose,
    pub velocity: Velocity,
    pub user_data: u64,
    pub sleeping: bool,
}

/// A region of the world.
pub(crate) struct RegionView {
    pub id: RegionId,
    pub owned: usize,
    pub replicas: usize,
    pub min: [f64; 3],
    pub max: [f64; 3],
}

/// A ray and what it does not see.
pub(crate) struct RayQuery {
    pub origin: [f64; 3],
    pub direction: [f32; 3],
    pub max_m: f32,
    pub mask: u32,
    pub exclude: Option<BodyId>,
}

/// What a ray met.
pub(crate) struct RayAnswer {
    pub body: BodyId,
    pub point: [f64; 3],
    pub normal: [f32; 3],
    pub distance_m: f32,
}

impl Backend {
    pub(crate) fn role(&self) -> DcdRole {
        match self {
            Self::Local(_) => DCD_ROLE_LOCAL,
        }
    }

    pub(crate) fn dt_s(&self) -> f32 {
        match self {
            Self::Local(world) => world.host().settings().dt_s,
        }
    }

    pub(crate) fn gravity(&self) -> [f32; 3] {
        match self {
            Self::Local(world) => world.host().settings().gravity,
        }
    }

    pub(crate) fn tick(&self) -> u64 {
        match self {
            Self::Local(world) => world.tick().0,
        }
    }

    pub(crate) fn step(&mut self) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.step()?),
        }
    }

    pub(crate) fn insert(
        &mut self,
        pose: WorldPose,
        body: RigidBodyBuilder,
        collider: ColliderBuilder,
    ) -> Result<BodyId, Failure> {
        match self {
            Self::Local(world) => Ok(world.insert_at(pose, body, vec![collider])?),
        }
    }

    pub(crate) fn remove(&mut self, id: BodyId) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.remove(id)?),
        }
    }

    pub(crate) fn contains(&self, id: BodyId) -> bool {
        match self {
            Self::Local(world) => world.body(id).is_some(),
        }
    }

    pub(crate) fn pose(&self, id: BodyId) -> Option<WorldPose> {
        match self {
            Self::Local(world) => world.pose(id),
        }
    }

    pub(crate) fn velocity(&self, id: BodyId) -> Option<Velocity> {
        match self {
            Self::Local(world) => world.velocity(id),
        }
    }

    pub(crate) fn user_data(&self, id: BodyId) -> Option<u64> {
        match self {
            Self::Local(world) => world.body(id).map(|body| body.user_data as u64),
        }
    }

    pub(crate) fn body(&self, id: BodyId) -> Option<BodyView> {
        match self {
            Self::Local(world) => {
                let body = world.body(id)?;
                Some(BodyView {
                    pose: world.pose(id)?,
                    velocity: world.velocity(id)?,
                    kind: kind_of(body),
                    sleeping: body.is_sleeping(),
                    mass_kg: if body.is_fixed() { 0.0 } else { body.mass() },
                    user_data: body.user_data as u64,
                    owner: world.owner_of(id),
                })
            }
        }
    }

    /// The centre of mass of a body, in world space.
    pub(crate) fn centre_of_mass(&self, id: BodyId) -> Option<[f64; 3]> {
        match self {
            Self::Local(world) => {
                let (body, pose) = (world.body(id)?, world.pose(id)?);
                let arm = (*body.rotation() * body.local_center_of_mass()).to_array();
                Some(std::array::from_fn(|i| pose.translation[i] + f64::from(arm[i])))
            }
        }
    }

    /// How a body would move after these impulses; infinities and NaN included.
    pub(crate) fn kicked(&self, id: BodyId, push: Vector, turn: Vector) -> Option<Velocity> {
        match self {
            Self::Local(world) => {
                let body = world.body(id)?;
                let mass = body.mass_properties();
                Some(Velocity {
                    linear: (body.linvel() + push * mass.effective_inv_mass).to_array(),
                    angular: (body.angvel() + mass.effective_world_inv_inertia * turn).to_array(),
                })
            }
        }
    }

    pub(crate) fn set_pose(&mut self, id: BodyId, pose: WorldPose) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.set_pose(id, pose)?),
        }
    }

    pub(crate) fn set_velocity(&mut self, id: BodyId, velocity: Velocity) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.set_velocity(id, velocity)?),
        }
    }

    /// Changes a body by Rapier's setters, in every copy.
    pub(crate) fn update(&mut self, id: BodyId, change: impl FnMut(&mut RigidBody)) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.update(id, change)?),
        }
    }

    pub(crate) fn insert_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: GenericJoint,
    ) -> Result<JointId, Failure> {
        match self {
            Self::Local(world) => Ok(world.insert_joint(a, b, joint)?),
        }
    }

    pub(crate) fn remove_joint(&mut self, id: JointId) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.remove_joint(id)?),
        }
    }

    pub(crate) fn update_joint(
        &mut self,
        id: JointId,
        change: impl FnMut(&mut GenericJoint),
    ) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.update_joint(id, change)?),
        }
    }

    /// How many movable bodies there are.
    pub(crate) fn movable(&self) -> usize {
        match self {
            Self::Local(world) => world.host().owned_count(),
        }
    }

    /// Every movable body in id order.
    pub(crate) fn states(&self) -> impl Iterator<Item = StateRow> {
        match self {
            Self::Local(world) => world.states().map(|(id, region, pose, velocity)| {
                let body = world.body(id);
                StateRow {
                    id,
                    region,
                    pose,
                    velocity,
                    user_data: body.map_or(0, |body| body.user_data as u64),
                    sleeping: body.is_some_and(RigidBody::is_sleeping),
                }
            }),
        }
    }

    /// Every movable body with its owner, in id order.
    pub(crate) fn owners(&self) -> impl Iterator<Item = (BodyId, RegionId)> {
        match self {
            Self::Local(world) => world.states().map(|(id, region, ..)| (id, region)),
        }
    }

    pub(crate) fn events(&self) -> &WorldEvents {
        match self {
            Self::Local(world) => world.events(),
        }
    }

    /// Bodies that changed owner in a step, ever.
    pub(crate) fn transfers(&self) -> u64 {
        match self {
            Self::Local(world) => world.host().transfers(),
        }
    }

    pub(crate) fn stats(&self) -> Stats {
        match self {
            Self::Local(world) => world.stats(),
        }
    }

    pub(crate) fn state_hash(&self) -> u64 {
        match self {
            Self::Local(world) => world.state_hash(),
        }
    }

    pub(crate) fn region_count(&self) -> usize {
        match self {
            Self::Local(world) => world.regions().len(),
        }
    }

    pub(crate) fn regions(&self) -> impl Iterator<Item = RegionView> {
        match self {
            Self::Local(world) => world.regions().iter().map(|region| RegionView {
                id: region.id(),
                owned: region.owned_count(),
                replicas: region.replica_count(),
                min: region.cell().min,
                max: region.cell().max,
            }),
        }
    }

    /// The first body that a ray meets and does not overlook.
    pub(crate) fn cast_ray(&self, ray: &RayQuery) -> Option<RayAnswer> {
        match self {
            Self::Local(world) => crate::query::cast_locally(world, ray),
        }
    }
}

fn kind_of(body: &RigidBody) -> DcdBodyType {
    match (body.is_fixed(), body.is_dynamic()) {
        (true, _) => DCD_FIXED,
        (false, true) => DCD_DYNAMIC,
        (false, false) => DCD_KINEMATIC,
    }
}
