//! What stands behind a world handle: the one place that knows the roles.
//!
//! The entry points check and convert; what a role does is decided here, so that a new role is a new variant and the
//! compiler lists what it must answer.

use std::io::Read;

use dcd::net::PeerStats;
use dcd::physics::{BorderView, Queries, Region};
use dcd::protocol::{
    Area, BodyRecord, Found, Handover, JointRecord, Question, Velocity, WorldEvents, WorldPose,
};
use dcd::runtime::{DcdWorld, Stats};
use dcd::space::{BodyId, JointId};
use rapier3d::prelude::*;

use crate::body::{DCD_DYNAMIC, DCD_FIXED, DCD_KINEMATIC, DCD_KINEMATIC_POSE, DcdBodyType, NewBody};
use crate::connection::Network;
use crate::hosted::Hosted;
use crate::served::{Change, Served};
use crate::status::{DCD_ERR_UNSUPPORTED, Failure};
use crate::view::{BodyView, OwnerView, RegionView, StateRow};
use crate::world::{DCD_ROLE_CLIENT, DCD_ROLE_LOCAL, DCD_ROLE_PARTICIPANT, DcdRole};

/// A world by role.
pub(crate) enum Backend {
    /// Computed whole in this process.
    Local(Box<DcdWorld>),
    /// Computed by others, or in part by this process.
    Served(Box<Served>),
    /// Held or computed for others.
    Hosted(Box<Hosted>),
}

impl Backend {
    pub(crate) fn role(&self) -> DcdRole {
        match self {
            Self::Local(_) => DCD_ROLE_LOCAL,
            Self::Served(world) if world.is_participant() => DCD_ROLE_PARTICIPANT,
            Self::Served(_) => DCD_ROLE_CLIENT,
            Self::Hosted(world) => world.role(),
        }
    }

    /// The world that is computed here, or why this role cannot do `what`, and what to do instead.
    pub(crate) fn local(&self, what: &str, instead: &str) -> Result<&DcdWorld, Failure> {
        match self {
            Self::Local(world) => Ok(world),
            Self::Served(world) => Err(world.unsupported(what, instead)),
            Self::Hosted(world) => Err(world.unsupported(what, ONLY_LOCAL)),
        }
    }

    fn local_mut(&mut self, what: &str, instead: &str) -> Result<&mut DcdWorld, Failure> {
        match self {
            Self::Local(world) => Ok(world),
            Self::Served(world) => Err(world.unsupported(what, instead)),
            Self::Hosted(world) => Err(world.unsupported(what, ONLY_LOCAL)),
        }
    }

    /// Whether this role ties bodies together.
    pub(crate) fn check_joints(&self) -> Result<(), Failure> {
        self.local("make, see, drive or destroy joints", NO_JOINTS).map(drop)
    }

    /// A joint of a world that is computed here.
    pub(crate) fn joint(&self, id: JointId) -> Option<JointRecord> {
        let Self::Local(world) = self else { return None };
        world.joint(id)
    }

    /// The joints of a body that is computed here, oldest first.
    pub(crate) fn joints_of(&self, id: BodyId) -> Vec<JointId> {
        let Self::Local(world) = self else { return Vec::new() };
        world.joints_of(id)
    }

    /// What the locked axes of a joint bear: newtons along x, y, z, newton metres about them.
    pub(crate) fn joint_load(&self, id: JointId) -> [f32; 6] {
        let Self::Local(world) = self else { return [0.0; 6] };
        world.joint_load(id).unwrap_or_default()
    }

    /// The number of the client that this process is; 0 in a local world.
    pub(crate) fn client(&self) -> u32 {
        match self {
            Self::Local(_) => 0,
            Self::Served(world) => world.client(),
            Self::Hosted(_) => 0,
        }
    }

    pub(crate) fn dt_s(&self) -> f32 {
        match self {
            Self::Local(world) => world.host().settings().dt_s,
            Self::Served(world) => world.environment().dt_s,
            Self::Hosted(world) => world.dt_s,
        }
    }

    pub(crate) fn gravity(&self) -> [f32; 3] {
        match self {
            Self::Local(world) => world.host().settings().gravity,
            Self::Served(world) => world.environment().gravity,
            Self::Hosted(world) => world.gravity,
        }
    }

    pub(crate) fn tick(&self) -> u64 {
        match self {
            Self::Local(world) => world.tick().0,
            Self::Served(world) => world.tick(),
            Self::Hosted(world) => world.tick(),
        }
    }

    pub(crate) fn step(&mut self) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.step()?),
            Self::Served(world) => world.step(),
            Self::Hosted(world) => world.step(),
        }
    }

    /// What connects it with other processes; nothing in a local world.
    pub(crate) fn network(&self) -> Option<&Network> {
        match self {
            Self::Local(_) => None,
            Self::Served(world) => Some(world.network()),
            Self::Hosted(world) => Some(&world.network),
        }
    }

    /// The same, or why this role cannot do `what`.
    pub(crate) fn networked(&self, what: &str) -> Result<&Network, Failure> {
        self.network().ok_or_else(|| {
            let why = format!("a local world cannot {what}: it has no network; serve it (dcd_server_create)");
            Failure::new(DCD_ERR_UNSUPPORTED, why)
        })
    }

    pub(crate) fn insert(&mut self, body: NewBody) -> Result<BodyId, Failure> {
        let NewBody { pose, body, collider, properties } = body;
        let has_own_sleep = properties.sleep() != USUAL_SLEEP;
        match self {
            Self::Local(world) => {
                let id = world.insert_at(pose, body, vec![collider])?;
                if has_own_sleep {
                    world.update(id, |body| properties.set_thresholds(body))?;
                }
                Ok(id)
            }
            Self::Served(world) if has_own_sleep => Err(world.unsupported(
                "set when its avatars fall asleep",
                "leave sleep_linear, sleep_angular and sleep_after as DCD_BODY_DEF_INIT has them",
            )),
            Self::Served(world) => world.spawn(pose, &body, collider),
            Self::Hosted(world) => Err(world.blind("make bodies")),
        }
    }

    pub(crate) fn remove(&mut self, id: BodyId) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.remove(id)?),
            Self::Served(world) => world.despawn(id),
            Self::Hosted(world) => Err(world.blind("destroy bodies")),
        }
    }

    pub(crate) fn contains(&self, id: BodyId) -> bool {
        match self {
            Self::Local(world) => world.contains(id),
            Self::Served(world) => world.contains(id),
            Self::Hosted(_) => false,
        }
    }

    pub(crate) fn pose(&self, id: BodyId) -> Option<WorldPose> {
        match self {
            Self::Local(world) => world.pose(id),
            Self::Served(world) => world.body(id).map(|body| body.pose),
            Self::Hosted(_) => None,
        }
    }

    pub(crate) fn velocity(&self, id: BodyId) -> Option<Velocity> {
        match self {
            Self::Local(world) => world.velocity(id),
            Self::Served(world) => world.body(id).map(|body| body.velocity),
            Self::Hosted(_) => None,
        }
    }

    /// Pose and velocity, by one look-up.
    pub(crate) fn motion(&self, id: BodyId) -> Option<(WorldPose, Velocity)> {
        match self {
            Self::Local(world) => world.motion(id),
            Self::Served(world) => world.body(id).map(|body| (body.pose, body.velocity)),
            Self::Hosted(_) => None,
        }
    }

    pub(crate) fn user_data(&self, id: BodyId) -> Option<u64> {
        match self {
            Self::Local(world) => world.body(id).map(|body| body.user_data as u64),
            Self::Served(world) => world.user_data(id),
            Self::Hosted(_) => None,
        }
    }

    /// A body with all that is known of it.
    pub(crate) fn record(&self, id: BodyId) -> Option<BodyRecord> {
        match self {
            Self::Local(world) => world.host().record(id),
            Self::Served(world) => world.record(id),
            Self::Hosted(_) => None,
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
                    mass_kg: if body.is_fixed() { 0.0 } else { world.mass_kg(id)? },
                    user_data: body.user_data as u64,
                    owner: world.owner_of(id),
                    outside: false,
                })
            }
            Self::Served(world) => world.body(id),
            Self::Hosted(_) => None,
        }
    }

    /// Avatars that this process hosts, in id order; none in a local world.
    pub(crate) fn own_avatars(&self) -> Vec<BodyId> {
        match self {
            Self::Local(_) | Self::Hosted(_) => Vec::new(),
            Self::Served(world) => world.own_avatars(),
        }
    }

    /// The centre of mass of a body computed here, in world space.
    pub(crate) fn centre_of_mass(&self, id: BodyId) -> Option<[f64; 3]> {
        let Self::Local(world) = self else { return None };
        let (body, pose) = (world.body(id)?, world.pose(id)?);
        let arm = (*body.rotation() * body.local_center_of_mass()).to_array();
        Some(std::array::from_fn(|i| pose.translation[i] + f64::from(arm[i])))
    }

    /// How a body computed here would move after these impulses; infinities and NaN included.
    pub(crate) fn kicked(&self, id: BodyId, push: Vector, turn: Vector) -> Option<Velocity> {
        let Self::Local(world) = self else { return None };
        let body = world.body(id)?;
        let mass = body.mass_properties();
        Some(Velocity {
            linear: (body.linvel() + push * mass.effective_inv_mass).to_array(),
            angular: (body.angvel() + mass.effective_world_inv_inertia * turn).to_array(),
        })
    }

    pub(crate) fn set_pose(&mut self, id: BodyId, pose: WorldPose) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.set_pose(id, pose)?),
            Self::Served(world) => world.jump(id, pose),
            Self::Hosted(world) => Err(world.blind("move bodies")),
        }
    }

    pub(crate) fn set_velocity(&mut self, id: BodyId, velocity: Velocity) -> Result<(), Failure> {
        match self {
            Self::Local(world) => Ok(world.set_velocity(id, velocity)?),
            Self::Served(world) => world.drive(id, velocity),
            Self::Hosted(world) => Err(world.blind("move bodies")),
        }
    }

    pub(crate) fn set_target(&mut self, id: BodyId, pose: WorldPose) -> Result<(), Failure> {
        Ok(self.local_mut(CHANGE_BODY, NO_CHANGE)?.set_next_pose(id, pose)?)
    }

    /// Whether this role changes bodies other than by driving them.
    pub(crate) fn check_changes(&self) -> Result<(), Failure> {
        self.local(CHANGE_BODY, NO_CHANGE).map(drop)
    }

    /// Changes a body by Rapier's setters, in every copy.
    pub(crate) fn update(&mut self, id: BodyId, change: impl FnMut(&mut RigidBody)) -> Result<(), Failure> {
        Ok(self.local_mut(CHANGE_BODY, NO_CHANGE)?.update(id, change)?)
    }

    /// How many colliders a body has; 0 where it is not computed.
    pub(crate) fn parts(&self, id: BodyId) -> usize {
        match self {
            Self::Local(world) => world.body(id).map_or(0, |body| body.colliders().len()),
            Self::Served(_) | Self::Hosted(_) => 0,
        }
    }

    /// Changes one collider of a body by Rapier's setters, in every copy.
    pub(crate) fn update_collider(
        &mut self,
        id: BodyId,
        part: usize,
        change: impl FnMut(&mut Collider),
    ) -> Result<(), Failure> {
        Ok(self.local_mut("change the surface of a body", NO_SURFACE)?.update_collider(id, part, change)?)
    }

    /// Gives a body one more collider, the last.
    pub(crate) fn insert_collider(&mut self, id: BodyId, collider: ColliderBuilder) -> Result<(), Failure> {
        Ok(self.local_mut("change the surface of a body", NO_SURFACE)?.insert_collider(id, collider)?)
    }

    /// Takes a collider from a body.
    pub(crate) fn remove_collider(&mut self, id: BodyId, part: usize) -> Result<(), Failure> {
        Ok(self.local_mut("change the surface of a body", NO_SURFACE)?.remove_collider(id, part)?)
    }

    /// Whether this role changes surfaces of bodies.
    pub(crate) fn check_surfaces(&self) -> Result<(), Failure> {
        self.local("change the surface of a body", NO_SURFACE).map(drop)
    }

    pub(crate) fn insert_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: GenericJoint,
    ) -> Result<JointId, Failure> {
        Ok(self.local_mut("make joints", NO_JOINTS)?.insert_joint(a, b, joint)?)
    }

    pub(crate) fn remove_joint(&mut self, id: JointId) -> Result<(), Failure> {
        Ok(self.local_mut("destroy joints", NO_JOINTS)?.remove_joint(id)?)
    }

    pub(crate) fn update_joint(
        &mut self,
        id: JointId,
        change: impl FnMut(&mut GenericJoint),
    ) -> Result<(), Failure> {
        Ok(self.local_mut("drive joints", NO_JOINTS)?.update_joint(id, change)?)
    }

    /// Whether this role sees the bodies of its world.
    pub(crate) fn check_sees(&self) -> Result<(), Failure> {
        match self {
            Self::Local(_) | Self::Served(_) => Ok(()),
            Self::Hosted(world) => Err(world.blind("see the bodies of its world")),
        }
    }

    /// What is hosted here, or why this role cannot do `what`, and what to do instead.
    pub(crate) fn hosted(&self, what: &str, instead: &str) -> Result<&Hosted, Failure> {
        match self {
            Self::Hosted(world) => Ok(world),
            Self::Served(world) => Err(world.unsupported(what, instead)),
            Self::Local(_) => {
                let why =
                    format!("a local world cannot {what}: it has no network; serve it (dcd_server_create)");
                Err(Failure::new(DCD_ERR_UNSUPPORTED, why))
            }
        }
    }

    /// How many movable bodies there are.
    pub(crate) fn movable(&self) -> usize {
        match self {
            Self::Local(world) => world.host().owned_count(),
            Self::Served(world) => world.movable(),
            Self::Hosted(_) => 0,
        }
    }

    /// Looks at up to `most` movable bodies in id order.
    pub(crate) fn each_state(&self, most: usize, look: impl FnMut(StateRow)) {
        match self {
            Self::Local(world) => {
                let row = |(id, region, handle): (_, &Region, _)| {
                    let (pose, velocity) = region.motion(handle);
                    let body = &region.physics().bodies[handle];
                    StateRow {
                        id,
                        region: region.id(),
                        pose,
                        velocity,
                        user_data: body.user_data as u64,
                        sleeping: body.is_sleeping(),
                        outside: false,
                    }
                };
                world.host().owned_bodies().map(row).take(most).for_each(look);
            }
            Self::Served(world) => world.states().take(most).for_each(look),
            Self::Hosted(_) => {}
        }
    }

    pub(crate) fn events(&self) -> &WorldEvents {
        match self {
            Self::Local(world) => world.events(),
            Self::Served(world) => world.events(),
            Self::Hosted(_) => &NO_EVENTS,
        }
    }

    /// Bodies that came and went, and refusals; who computes the world alone knows them without.
    pub(crate) fn changes(&self) -> &[Change] {
        match self {
            Self::Local(_) | Self::Hosted(_) => &[],
            Self::Served(world) => world.changes(),
        }
    }

    /// Whether the link to the server is gone.
    pub(crate) fn is_lost(&self) -> bool {
        match self {
            Self::Local(_) => false,
            Self::Hosted(world) => world.look().is_err(),
            Self::Served(world) => world.is_lost(),
        }
    }

    /// Bodies that changed owner in the last step, or were heard to in it.
    pub(crate) fn handovers(&self) -> &[Handover] {
        match self {
            Self::Local(world) => world.handovers(),
            Self::Served(world) => world.handovers(),
            Self::Hosted(_) => &[],
        }
    }

    pub(crate) fn stats(&self) -> Stats {
        match self {
            Self::Local(world) => world.stats(),
            Self::Served(world) => world.stats(),
            Self::Hosted(world) => world.stats(),
        }
    }

    /// Messages with states received; none in a local world.
    pub(crate) fn updates(&self) -> u64 {
        match self {
            Self::Local(_) => 0,
            Self::Served(world) => world.updates(),
            Self::Hosted(_) => 0,
        }
    }

    /// What has passed over the network; nothing in a local world.
    pub(crate) fn traffic(&self) -> PeerStats {
        match self {
            Self::Local(_) => PeerStats::default(),
            Self::Served(world) => world.traffic(),
            Self::Hosted(world) => world.traffic(),
        }
    }

    pub(crate) fn state_hash(&self) -> Result<u64, Failure> {
        let instead =
            "it hears of bodies at different ticks; compare hashes of local worlds (dcd_world_create)";
        Ok(self.local("compute the state's hash", instead)?.state_hash())
    }

    /// The world that can be saved, and gone back to.
    pub(crate) fn saved(&self) -> Result<&DcdWorld, Failure> {
        self.local("be saved or loaded", NO_SNAPSHOT)
    }

    /// Makes it the world that these bytes hold.
    pub(crate) fn reload(&mut self, from: impl Read) -> Result<(), Failure> {
        Ok(self.local_mut("be saved or loaded", NO_SNAPSHOT)?.reload(from)?)
    }

    pub(crate) fn region_count(&self) -> usize {
        match self {
            Self::Local(world) => world.regions().len(),
            Self::Served(world) => world.environment().tree.leaf_count(),
            Self::Hosted(world) => world.regions(),
        }
    }

    pub(crate) fn regions(&self) -> Vec<RegionView> {
        match self {
            Self::Local(world) => {
                let view = |region: &Region| RegionView {
                    id: region.id(),
                    node: None,
                    owned: region.owned_count(),
                    replicas: region.replica_count(),
                    min: region.cell().min,
                    max: region.cell().max,
                };
                world.regions().map(view).collect()
            }
            Self::Served(world) => world.regions(),
            Self::Hosted(_) => Vec::new(),
        }
    }

    /// Wants to hear of an area, or of everything.
    pub(crate) fn turn_to(&mut self, area: Option<Area>) -> Result<(), Failure> {
        match self {
            Self::Local(_) => Ok(()),
            Self::Served(world) => world.turn_to(area),
            Self::Hosted(world) => Err(world.blind("have an interest")),
        }
    }

    /// Where regions meet, of a world that is computed here.
    pub(crate) fn borders(&self) -> Result<Vec<BorderView>, Failure> {
        Ok(self
            .local("tell what borders cost", "ask a local world of the same cut and coupling")?
            .host()
            .borders())
    }

    /// Who has authority over a body that is there.
    pub(crate) fn owner(&self, id: BodyId) -> OwnerView {
        let unknown =
            OwnerView { region: None, node: None, by_place: false, holders: 0, here: false, heard: false };
        match self {
            Self::Local(world) => {
                let region = world.owner_of(id);
                OwnerView { region, holders: world.host().holders(id), here: region.is_some(), ..unknown }
            }
            Self::Served(world) => world.owner(id),
            Self::Hosted(_) => unknown,
        }
    }

    /// Asks those who compute the world; the answer comes under this number.
    pub(crate) fn submit(&mut self, question: Question) -> Result<u64, Failure> {
        match self {
            Self::Served(world) => world.submit(question),
            Self::Local(_) | Self::Hosted(_) => unreachable!("only a served world asks others"),
        }
    }

    /// What others have answered, once they have.
    pub(crate) fn answer(&self, number: u64) -> Result<Option<Found>, Failure> {
        match self {
            Self::Served(world) => world.answer(number),
            Self::Local(_) | Self::Hosted(_) => Ok(None),
        }
    }

    /// Nobody fetches the answer any more.
    pub(crate) fn forget(&self, number: u64) {
        if let Self::Served(world) = self {
            world.forget(number);
        }
    }

    /// What there is to ask about the bodies computed here.
    pub(crate) fn queries(&self) -> Result<Queries<'_>, Failure> {
        let instead = "it hears where bodies are and computes nothing; submit what you ask (dcd_rays_submit and the like)";
        Ok(self.local("ask by rays, shapes and points", instead)?.queries())
    }
}

static NO_EVENTS: WorldEvents = WorldEvents { touches: Vec::new(), forces: Vec::new() };
const CHANGE_BODY: &str = "change a body in place";
const NO_CHANGE: &str = "it drives its own avatars by dcd_body_set_velocity and dcd_body_set_pose";
const NO_SURFACE: &str = "give an avatar its own in DcdBodyDef, and other bodies theirs in the scene";
const ONLY_LOCAL: &str = "this is for worlds that one process computes alone (dcd_world_create)";
const NO_SNAPSHOT: &str = "the server keeps the world in its data folder";
const NO_JOINTS: &str = "joints belong to the scene that the server was given";

/// Rapier's thresholds of sleep: m/s, rad/s, seconds.
const USUAL_SLEEP: [f32; 3] = [0.05, 0.5, 0.5];

fn kind_of(body: &RigidBody) -> DcdBodyType {
    match body.body_type() {
        RigidBodyType::Fixed => DCD_FIXED,
        RigidBodyType::Dynamic | RigidBodyType::SoftFrame => DCD_DYNAMIC,
        RigidBodyType::KinematicVelocityBased => DCD_KINEMATIC,
        RigidBodyType::KinematicPositionBased => DCD_KINEMATIC_POSE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_sleep_is_rapiers() {
        let usual = RigidBodyActivation::default();
        let [linear, angular, after] = USUAL_SLEEP;
        assert_eq!((linear, angular), (usual.normalized_linear_threshold, usual.angular_threshold));
        assert_eq!(after, usual.time_until_sleep);
    }
}
