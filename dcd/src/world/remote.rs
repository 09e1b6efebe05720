//! Defines the trait `Remote`: the methods of a world that other processes compute.

use std::time::Duration;

use super::bodies::{CHANGE_BODY, CHANGE_SURFACE};
use super::error::Error;
#[cfg(feature = "net")]
use super::network::Network;
use super::role::{Instead, Role, Unsupported};
use super::view::{Body, BodyChange, MovableBody, Owner, RegionInfo};
use crate::fidelity::FidelityReport;
#[cfg(feature = "net")]
use crate::net::PeerStats;
use crate::physics::StepSettings;
use crate::playback::{Motion, ViewTime};
#[cfg(feature = "net")]
use crate::prediction::Prediction;
use crate::protocol::{
    Area, BodyRecord, Controller, Drive, Handover, JointRecord, Push, Query, QueryResult, ShapeHash,
    ShapeRecord, Velocity, WorldEvents, WorldPose,
};
#[cfg(feature = "net")]
use crate::runtime::WorldError;
use crate::runtime::{LocalWorld, Stats};
use crate::space::{BodyId, ClientId, DistributionTree, JointId, Tick, Viewpoint};
use rapier3d::prelude::*;

/// What a server can do, and no other role but a local world.
pub(super) const SAVE: &str = "be saved or loaded";

/// A world in a role other than [`Role::Local`]. The default methods are those of a server or node, which
/// shows nothing of its world.
pub(super) trait Remote: Send + Sync {
    fn role(&self) -> Role;
    /// Returns the newest tick received.
    fn tick(&self) -> Tick;
    fn dt_s(&self) -> f32;
    fn gravity(&self) -> [f32; 3];
    fn speed_limit_m_s(&self) -> f32;
    /// Returns the settings by which the world is stepped, if this role knows them.
    fn settings(&self) -> Result<StepSettings, Error>;
    /// Sends inputs and takes in what has arrived, without waiting.
    fn step(&mut self) -> Result<(), Error>;
    /// Waits for what the next step would take in; returns whether it arrived.
    fn poll(&self, timeout: Duration) -> bool;
    fn is_lost(&self) -> bool;
    fn stats(&self) -> Stats;
    fn fidelity_report(&self) -> Option<FidelityReport> {
        None
    }
    /// Sets the viewpoints: what is seen from them is computed in full.
    fn set_viewpoints(&self, _viewpoints: &[Viewpoint]) -> Result<(), Error> {
        Err(self.unsupported("be looked at from viewpoints", Instead::SayInterest))
    }
    fn region_count(&self) -> usize;
    #[cfg(feature = "net")]
    fn network(&self) -> &Network;
    #[cfg(feature = "net")]
    fn traffic(&self) -> PeerStats;

    /// Returns the error that this role cannot do `what`, with a remedy.
    fn unsupported(&self, what: &'static str, instead: Instead) -> Error {
        Unsupported { role: self.role(), what, instead }.into()
    }

    /// Returns an error if this role does not see the bodies of its world.
    fn sees(&self, what: &'static str) -> Result<(), Error> {
        Err(self.unsupported(what, Instead::JoinAsClient))
    }

    /// Returns the error for what only a local world can do. `instead` is the remedy for clients and
    /// participants.
    fn compute(&self, what: &'static str, _instead: Instead) -> Error {
        self.unsupported(what, Instead::ComputeAlone)
    }

    fn client(&self) -> Option<ClientId> {
        None
    }

    fn insert(
        &mut self,
        _pose: WorldPose,
        _body: &RigidBody,
        _colliders: &[ColliderBuilder],
        _controller: Option<Controller<'_>>,
    ) -> Result<BodyId, Error> {
        Err(self.unsupported("make bodies", Instead::JoinAsClient))
    }

    /// Returns an error if a body cannot be inserted, in a role where others hear at once of an insertion.
    fn can_insert(
        &self,
        _pose: WorldPose,
        _body: &RigidBody,
        _colliders: &[ColliderBuilder],
    ) -> Result<(), Error> {
        Ok(())
    }

    /// Takes back the bodies that were inserted last, since the last step, as if they had never been there.
    fn take_back(&mut self, bodies: &[BodyId]) -> Result<(), Error> {
        bodies.iter().try_for_each(|&id| self.remove(id))
    }

    /// Returns an error if this process may not remove a body that is there.
    fn can_remove(&self, _id: BodyId) -> Result<(), Error> {
        Err(self.unsupported("destroy bodies", Instead::JoinAsClient))
    }

    fn remove(&mut self, _id: BodyId) -> Result<(), Error> {
        Err(self.unsupported("destroy bodies", Instead::JoinAsClient))
    }

    fn set_pose(&mut self, _id: BodyId, _pose: WorldPose) -> Result<(), Error> {
        Err(self.unsupported("move bodies", Instead::JoinAsClient))
    }

    fn set_velocity(&mut self, _id: BodyId, _velocity: Velocity) -> Result<(), Error> {
        Err(self.unsupported("move bodies", Instead::JoinAsClient))
    }

    /// Sets what the driver of a vehicle does from now on.
    fn drive(&mut self, _id: BodyId, _drive: Drive) -> Result<(), Error> {
        Err(self.unsupported("drive bodies", Instead::JoinAsClient))
    }

    /// Returns an error if this role cannot apply forces and impulses.
    fn pushes_bodies(&self) -> Result<(), Error> {
        Err(self.compute("push bodies by force", Instead::PushByAvatars))
    }

    fn push(&mut self, _push: &Push) -> Result<(), Error> {
        Err(self.compute("push bodies by force", Instead::PushByAvatars))
    }

    /// Returns an error if this role cannot change bodies in place.
    fn changes_bodies(&self) -> Result<(), Error> {
        Err(self.unsupported(CHANGE_BODY, Instead::DriveAvatars))
    }

    /// Returns an error if this role cannot change colliders.
    fn changes_colliders(&self) -> Result<(), Error> {
        Err(self.unsupported(CHANGE_SURFACE, Instead::ShapeAtBirth))
    }

    fn update(&mut self, _id: BodyId, _change: &mut dyn FnMut(&mut RigidBody)) -> Result<(), Error> {
        self.changes_bodies()
    }

    fn update_collider(
        &mut self,
        _id: BodyId,
        _index: usize,
        _change: &mut dyn FnMut(&mut Collider),
    ) -> Result<(), Error> {
        self.changes_colliders()
    }

    /// Stops a server and keeps its world.
    #[cfg(feature = "net")]
    fn suspend(&mut self) -> Result<(), Error> {
        Err(self.unsupported("be suspended", Instead::ServerKeeps))
    }

    /// Returns an error if this role cannot save and load the world.
    fn can_be_saved(&self) -> Result<(), Error> {
        Err(self.compute(SAVE, Instead::ServerKeeps))
    }

    /// Returns a copy of the world as it is after one tick.
    fn saved(&self) -> Result<LocalWorld, Error> {
        Err(self.compute(SAVE, Instead::ServerKeeps))
    }

    /// Replaces the world by a copy of a local one.
    fn replace(&mut self, _world: &LocalWorld) -> Result<(), Error> {
        Err(self.compute(SAVE, Instead::ServerKeeps))
    }

    /// Returns an error if this role cannot make joints.
    fn ties_bodies(&self) -> Result<(), Error> {
        Err(self.compute("make, see, drive or destroy joints", Instead::JointsInScene))
    }

    fn insert_joint(&mut self, _a: BodyId, _b: BodyId, _joint: &GenericJoint) -> Result<JointId, Error> {
        Err(self.compute("make joints", Instead::JointsInScene))
    }

    fn remove_joint(&mut self, _id: JointId) -> Result<(), Error> {
        Err(self.compute("destroy joints", Instead::JointsInScene))
    }

    fn update_joint(
        &mut self,
        _id: JointId,
        _change: &mut dyn FnMut(&mut GenericJoint),
    ) -> Result<(), Error> {
        Err(self.compute("drive joints", Instead::JointsInScene))
    }

    fn joint(&self, _id: JointId) -> Option<JointRecord> {
        None
    }

    fn joints_of(&self, _body: BodyId) -> Vec<JointId> {
        Vec::new()
    }

    fn set_interest(&mut self, _area: Option<Area>) -> Result<(), Error> {
        Err(self.unsupported("have an interest", Instead::JoinAsClient))
    }

    fn set_bandwidth(&mut self, _bytes_per_s: Option<u32>) -> Result<(), Error> {
        Err(self.unsupported("limit what it is sent", Instead::JoinAsClient))
    }

    fn set_prediction(&mut self, _predicts: bool) -> Result<(), Error> {
        Err(self.unsupported("predict avatars", Instead::JoinAsClient))
    }

    #[cfg(feature = "net")]
    fn prediction(&self) -> Option<Prediction> {
        None
    }

    fn submit(&mut self, _question: Query) -> Result<u64, Error> {
        Err(self.compute("ask by rays, shapes and points", Instead::SubmitQuery))
    }

    fn answer(&mut self, _number: u64) -> Result<Option<QueryResult>, Error> {
        Ok(None)
    }

    fn forget(&mut self, _number: u64) {}

    fn contains(&self, _id: BodyId) -> bool {
        false
    }

    fn motion(&self, _id: BodyId) -> Option<(WorldPose, Velocity)> {
        None
    }

    /// Returns the ticks to show now.
    fn view_time(&mut self) -> ViewTime {
        ViewTime::new(self.tick().0 as f64, self.tick().0 as f64)
    }

    /// Returns how a body is shown at a tick.
    fn motion_at(&self, id: BodyId, _tick: f64) -> Option<Motion> {
        self.motion(id).map(|(pose, velocity)| Motion { pose, velocity })
    }

    fn movable_bodies_at(&self, _time: &ViewTime) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        self.movable_bodies()
    }

    fn body(&self, _id: BodyId) -> Option<Body> {
        None
    }

    fn user_data(&self, _id: BodyId) -> Option<u128> {
        None
    }

    fn record(&self, _id: BodyId) -> Option<BodyRecord> {
        None
    }

    /// Returns a shape of a body that is known here.
    fn shape(&self, _hash: ShapeHash) -> Option<ShapeRecord> {
        None
    }

    /// Visits every fixed body in id order.
    fn for_each_fixed(&self, _look: &mut dyn FnMut(BodyId, &WorldPose)) {}

    /// Returns all joints that this role knows.
    fn joints(&self) -> Vec<JointRecord> {
        Vec::new()
    }

    /// Returns the distribution tree, as far as it is known; `None` for a node.
    fn tree(&self) -> Option<DistributionTree> {
        None
    }

    fn owner(&self, _id: BodyId) -> Owner {
        Owner::default()
    }

    fn movable_bodies(&self) -> Box<dyn Iterator<Item = MovableBody> + '_> {
        Box::new(std::iter::empty())
    }

    fn movable_count(&self) -> usize {
        0
    }

    fn own_avatars(&self) -> Vec<BodyId> {
        Vec::new()
    }

    fn events(&self) -> &WorldEvents {
        const { &WorldEvents { touches: Vec::new(), forces: Vec::new() } }
    }

    fn handovers(&self) -> &[Handover] {
        &[]
    }

    fn changes(&self) -> &[BodyChange] {
        &[]
    }

    fn regions(&self) -> Vec<RegionInfo> {
        Vec::new()
    }

    /// Returns the number of messages with states of bodies received.
    fn updates(&self) -> u64 {
        0
    }

    #[cfg(feature = "net")]
    fn server(&self) -> Option<&crate::runtime::ServerProcess> {
        None
    }

    /// Returns the address at which the process listens.
    #[cfg(feature = "net")]
    fn address(&self) -> Option<std::net::SocketAddr> {
        None
    }

    /// Returns the address of the metrics endpoint.
    #[cfg(feature = "net")]
    fn metrics_address(&self) -> Option<std::net::SocketAddr> {
        None
    }
}

/// Returns an error unless `known` is the record of a vehicle.
#[cfg(feature = "net")]
pub(super) fn check_vehicle(id: BodyId, known: Option<&BodyRecord>) -> Result<(), Error> {
    match known {
        Some(body) if body.traits.vehicle.is_none() => Err(WorldError::NoVehicle(id).into()),
        Some(_) => Ok(()),
        None => Err(WorldError::NoBody(id).into()),
    }
}
