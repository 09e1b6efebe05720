//! Computes a whole world in this process: all regions, on the threads of one machine.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rapier3d::prelude::*;

use super::choice::{Choice, Why};
use super::config::{Partitioning, WorldConfig, WorldError, check_speed, check_viewpoints};
use super::joint_strength::Strengths;
use super::tape::{Copies, Tape};
use crate::fidelity::FidelityReport;
use crate::physics::{
    Handover, HostError, LinkSettings, Ownership, Partition, Queries, Region, RegionHost, StepSettings,
    joint_record,
};
use crate::protocol::{
    BodyRecord, BodyState, BodyTraits, Check, ContactLedger, Controller, Drive, Invalid, JointRecord,
    LinkMotion, Push, ShapeHash, StateHasher, Velocity, WorldEvents, WorldPose,
};
use crate::recording::Operation;
use crate::scene::Scene;
use crate::space::{
    Axis, Balance, BodyId, DistributionTree, Epoch, JointId, RegionId, Tick, TreeError, Viewpoint,
};

/// Statistics of a world so far, as far as its process knows them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Stats {
    /// The number of ticks done.
    pub ticks: u64,
    /// The number of movable bodies.
    pub bodies: usize,
    /// The number of ghosts: copies of bodies in regions that do not own them.
    pub replicas: usize,
    /// The number of changes of owner since the beginning.
    pub transfers: u64,
    /// The wall time of the last step: in a local world that of the tick, in a client of taking in what
    /// arrived, in a node of its last tick; 0 in a server.
    pub last_step: Duration,
    /// The number of copies that Rapier set aside in the last step because their state was not finite.
    pub quarantined: usize,
    /// The number of exchanges of the last tick, of the border that had most; 0 in a world of one region.
    pub exchanges: usize,
    /// The disagreement of the copies of shared bodies at the worst border in the last tick, summed over its
    /// exchanges, m/s: an estimate of the error that borders make. 0 with the couplings `owner` and `proxy`,
    /// which have no consensus.
    pub disagreement_m_s: f32,
}

/// A rigid-body world that this process computes, with one Rapier world per region.
///
/// ```
/// use dcd::runtime::{LocalWorld, WorldConfig};
/// use rapier3d::prelude::*;
///
/// let mut world = LocalWorld::new(WorldConfig { threads: 2, ..WorldConfig::default() })?;
/// world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
/// let ball = world.insert(
///     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 5.0, 0.0)),
///     ColliderBuilder::ball(0.5),
/// )?;
/// for _ in 0..120 {
///     world.step()?;
/// }
/// assert!((world.pose(ball).unwrap().translation[1] - 1.0).abs() < 0.05);
/// # Ok::<(), dcd::runtime::WorldError>(())
/// ```
pub struct LocalWorld {
    pub(super) host: RegionHost,
    pub(super) ledger: ContactLedger,
    pub(super) events: WorldEvents,
    pub(super) next_body: u32,
    pub(super) next_joint: u64,
    pub(super) last_step: Duration,
    pub(super) why: Why,
    pub(super) strengths: Strengths,
    pub(super) tape: Option<Box<Tape>>,
    /// An identity by which the world knows its own checkpoints.
    pub(super) identity: Arc<()>,
}

impl LocalWorld {
    /// Makes an empty world.
    pub fn new(config: WorldConfig) -> Result<Self, WorldError> {
        let tree = config.tree()?;
        Self::with_tree(config, tree)
    }

    fn with_tree(config: WorldConfig, tree: DistributionTree) -> Result<Self, WorldError> {
        config.check()?;
        let why = match config.partitioning {
            Partitioning::Regions(_) | Partitioning::RegionsAcross(..) | Partitioning::Cuts(_) => Why::Asked,
            Partitioning::Auto if tree.leaf_count() > 1 => Why::Spread,
            Partitioning::Auto if config.balance.is_some() => Why::Balance,
            Partitioning::Auto => Why::Exact,
        };
        let partition = Partition::new(tree, config.halo_m);
        let leaves = partition.leaves().to_vec();
        let mut host = RegionHost::new(partition, config.step, config.threads, &leaves)?;
        host.set_balance(config.balance);
        host.set_fidelity(config.fidelity);
        Ok(Self {
            host,
            ledger: ContactLedger::default(),
            events: WorldEvents::default(),
            next_body: 0,
            next_joint: 0,
            last_step: Duration::ZERO,
            why,
            strengths: Strengths::default(),
            tape: None,
            identity: Arc::default(),
        })
    }

    /// Makes a world with everything that a scene holds. The scene's body `i` becomes
    /// `BodyId::persistent(i)`.
    pub fn from_scene(scene: &Scene, config: WorldConfig) -> Result<Self, WorldError> {
        let tree = config.tree_of(scene)?;
        let mut world = Self::with_tree(config, tree)?;
        let (bodies, joints) = scene.records(world.host.shapes_mut()).map_err(HostError::from)?;
        world.next_body = bodies.len() as u32;
        world.next_joint = joints.len() as u64;
        let limit_m_s = world.host.settings().speed_limit_m_s();
        bodies.iter().try_for_each(|body| check_speed(body, limit_m_s))?;
        world.host.insert(bodies, &joints)?;
        world.host.set_viewpoints(scene.viewpoints.clone());
        Ok(world)
    }

    /// Inserts a body with one collider, at the body's own position: in world space, exact near the origin.
    pub fn insert(
        &mut self,
        body: impl Into<RigidBody>,
        collider: ColliderBuilder,
    ) -> Result<BodyId, WorldError> {
        let body = body.into();
        let pose = WorldPose {
            translation: body.translation().to_array().map(f64::from),
            rotation: body.rotation().to_array(),
        };
        self.insert_at(pose, body, [collider])
    }

    /// Inserts a body with any number of colliders at a pose of world space, which replaces the body's own
    /// position.
    pub fn insert_at(
        &mut self,
        pose: WorldPose,
        body: impl Into<RigidBody>,
        colliders: impl AsRef<[ColliderBuilder]>,
    ) -> Result<BodyId, WorldError> {
        self.insert_as(None, pose, &body.into(), colliders.as_ref())
    }

    /// Inserts a body, which may be a character or a vehicle.
    pub(crate) fn insert_as(
        &mut self,
        controller: Option<Controller<'_>>,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<BodyId, WorldError> {
        let id = BodyId::persistent(self.next_body);
        let record = self.host.shapes_mut().describe(id, pose, body, colliders).map_err(HostError::from)?;
        self.insert_record(record.with_controller(controller))
    }

    /// Inserts a body with one collider from the parts of its record; `traits` makes its traits from the hash
    /// of its shape.
    pub(crate) fn insert_recorded(
        &mut self,
        state: BodyState,
        user_data: u128,
        shape: &SharedShape,
        traits: impl FnOnce(ShapeHash) -> Arc<BodyTraits>,
    ) -> Result<BodyId, WorldError> {
        let id = BodyId::persistent(self.next_body);
        let shapes = self.host.shapes_mut();
        let traits = shapes.intern(shape).map(traits).and_then(|traits| shapes.share(traits));
        let traits = traits.map_err(HostError::from)?;
        self.insert_record(BodyRecord { id, epoch: Epoch(0), state, traits, user_data })
    }

    /// Inserts a body whose id is the next one.
    fn insert_record(&mut self, record: BodyRecord) -> Result<BodyId, WorldError> {
        let id = record.id;
        let next = self.next_body.checked_add(1).ok_or(WorldError::Full)?;
        check_speed(&record, self.host.settings().speed_limit_m_s())?;
        let taped = self.tape.is_some().then(|| vec![record.clone()]);
        self.host.attend_new(&record)?;
        self.or_spoil(|world| Ok(world.host.insert_one(record)?))?;
        if let Some(record) = taped {
            self.tape_bodies(record);
        }
        self.next_body = next;
        Ok(id)
    }

    /// Does what may be refused though regions were brought to the present for it: only a snapshot can record
    /// that.
    fn or_spoil<R>(
        &mut self,
        change: impl FnOnce(&mut Self) -> Result<R, WorldError>,
    ) -> Result<R, WorldError> {
        let done = change(self);
        if done.is_err() {
            self.tape_spoilt();
        }
        done
    }

    /// Removes a body with its colliders and joints.
    pub fn remove(&mut self, body: BodyId) -> Result<(), WorldError> {
        self.host.attend(body)?;
        let done = self.host.remove(body);
        self.host.forget_unused_shapes();
        self.tape(done, || Operation::Remove(body));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Takes back the bodies that were inserted last, since the last step, as if they had never been there.
    /// Their ids are used again.
    pub(crate) fn take_back(&mut self, bodies: &[BodyId]) -> Result<(), WorldError> {
        bodies.iter().try_for_each(|&body| self.remove(body))?;
        self.next_body = bodies.first().map_or(self.next_body, |first| first.index());
        Ok(())
    }

    /// Inserts a joint between two bodies.
    pub fn insert_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: impl Into<GenericJoint>,
    ) -> Result<JointId, WorldError> {
        self.tie(a, b, &joint.into(), None)
    }

    /// Makes body `b` a link of the multibody of `a` (Featherstone's reduced coordinates, as Rapier's
    /// multibody joints). The joint cannot come apart.
    pub fn insert_multibody_joint(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: impl Into<GenericJoint>,
        settings: LinkSettings,
    ) -> Result<JointId, WorldError> {
        self.tie(a, b, &joint.into(), Some(settings))
    }

    /// Changes damping, armature, friction and springs of a multibody joint.
    pub fn update_link(&mut self, joint: JointId, settings: &LinkSettings) -> Result<(), WorldError> {
        self.tape_spoilt();
        self.host.attend_joint(joint)?;
        if self.host.update_link(joint, settings) { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    /// Returns the position and velocity of a multibody's link in the coordinates of its joint; `None` before
    /// its first step.
    pub fn link_motion(&self, joint: JointId) -> Option<LinkMotion> {
        self.host.link_motion(joint)
    }

    /// Sets the velocity of a multibody's link by degree of freedom, the linear ones first, m/s and rad/s.
    /// Kinematic links ([`LinkSettings::kinematic`]) keep this velocity.
    pub fn set_link_velocity(&mut self, joint: JointId, velocity: [f32; 6]) -> Result<(), WorldError> {
        if !velocity.iter().all(|v| v.is_finite()) {
            let (what, range) = ("velocity", "six finite numbers");
            return Err(WorldError::Setting { what, value: format!("{velocity:?}"), range });
        }
        self.tape_spoilt();
        self.host.attend_joint(joint)?;
        if self.host.set_link_velocity(joint, velocity) { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    fn tie(
        &mut self,
        a: BodyId,
        b: BodyId,
        joint: &GenericJoint,
        link: Option<LinkSettings>,
    ) -> Result<JointId, WorldError> {
        for body in [a, b] {
            if self.host.record(body).is_none() {
                return Err(WorldError::NoBody(body));
            }
        }
        if [a, b].iter().all(|&body| self.host.immovable(body).is_some()) {
            return Err(WorldError::Setting {
                what: "a joint",
                value: "between two fixed bodies".into(),
                range: "it moves neither, and no region would keep it; make one of them kinematic, and it stays where it is all the same",
            });
        }
        let id = JointId(self.next_joint);
        let link = link.map(|settings| settings.record());
        let record = JointRecord { link, ..joint_record(id, a, b, joint) };
        self.host.attend_ends(&record)?;
        self.or_spoil(|world| Ok(world.host.tie(record.clone())?))?;
        self.tape(true, || Operation::InsertJoint(Box::new(record)));
        self.next_joint += 1;
        Ok(id)
    }

    /// Removes a joint.
    pub fn remove_joint(&mut self, joint: JointId) -> Result<(), WorldError> {
        self.host.attend_joint(joint)?;
        let done = self.host.remove_joint(joint);
        self.tape(done, || Operation::RemoveJoint(joint));
        if done { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    /// Changes a joint in place: its motors, its limits, whether it acts.
    pub fn update_joint(
        &mut self,
        joint: JointId,
        mut change: impl FnMut(&mut GenericJoint),
    ) -> Result<(), WorldError> {
        self.host.attend_joint(joint)?;
        let mut copies = Copies::new(self.tape.is_some());
        let done = self.host.update_joint(joint, |joint| {
            change(joint);
            copies.note(joint);
        });
        self.tape_joint(joint, copies);
        if done { Ok(()) } else { Err(WorldError::NoJoint(joint)) }
    }

    /// Returns a joint as it is now, with its whole motors, however many regions share it.
    pub fn joint(&self, joint: JointId) -> Option<JointRecord> {
        self.host.joint(joint)
    }

    /// Returns the joints of a body, in order of insertion.
    pub fn joints_of(&self, body: BodyId) -> Vec<JointId> {
        self.host.all_joints_of(body).into_keys().collect()
    }

    /// Returns the load on the locked axes of a joint in the last step: newtons along the three axes of its
    /// frame, then newton metres about them.
    pub fn joint_load(&self, joint: JointId) -> Option<[f32; 6]> {
        self.host.joint_load(joint)
    }

    /// Advances the world by one tick.
    pub fn step(&mut self) -> Result<(), WorldError> {
        self.tape_seed();
        let stepped = self.advance();
        if stepped.is_err() {
            self.tape_spoilt();
        }
        stepped
    }

    fn advance(&mut self) -> Result<(), WorldError> {
        let start = Instant::now();
        let early = self.host.take_early_forces();
        self.host.place_beginning()?;
        self.host.step()?;
        self.host.note_tick_time(start.elapsed().as_secs_f64() * 1e3);
        self.ledger.merge(self.host.events(), &mut self.events);
        self.events.add_early(early);
        self.host.clear_events();
        self.strengths.look(&self.host);
        self.last_step = start.elapsed();
        // Regions that follow the times of steps are cut differently in each run. So what they computed is
        // recorded before they are cut, and the new cut as a snapshot. A replay repeats all else by itself.
        let follows_times = self.follows_times();
        let tree = (follows_times && self.is_recorded()).then(|| self.host.partition().tree().clone());
        if follows_times {
            self.tape_step();
        }
        let start = Instant::now();
        for (from, to) in self.host.rebalance()? {
            self.ledger.rename(from, to);
        }
        self.last_step += start.elapsed();
        if !follows_times {
            self.tape_step();
        } else if tree.is_some_and(|tree| tree != *self.host.partition().tree()) {
            self.tape_spoilt();
        }
        Ok(())
    }

    /// Sets the viewpoints of the world, for its [`Fidelity`]. Without any viewpoint all of it is looked at.
    pub fn set_viewpoints(&mut self, viewpoints: &[Viewpoint]) -> Result<(), WorldError> {
        check_viewpoints(viewpoints)?;
        self.host.set_viewpoints(viewpoints.to_vec());
        self.tape(true, || Operation::Look(viewpoints.to_vec()));
        Ok(())
    }

    /// Sets the part of the time that audits may take. Tests use it to check the stated error.
    #[doc(hidden)]
    pub fn set_audited(&mut self, part: f64) {
        self.host.set_audited(part);
    }

    /// Audits every island in every tick, besides the audits by which levels are chosen; see
    /// [`RegionHost::true_error_m_s`].
    #[doc(hidden)]
    pub fn audit_all(&mut self) {
        self.host.audit_all();
    }

    /// Returns what the world's [`Fidelity`] saves and costs; `None` if all is computed in full.
    pub fn fidelity_report(&self) -> Option<FidelityReport> {
        self.host.fidelity_report()
    }

    /// Returns the number of ticks done.
    pub fn tick(&self) -> Tick {
        self.host.tick()
    }

    /// Returns the owner's copy of a movable body, or any copy of an immovable one. Its position is in region
    /// space. Under mass splitting the copy has only its part of the body's mass and of the forces on it.
    /// [`LocalWorld::mass_kg`] returns the whole mass, and [`LocalWorld::update`] shows the whole body.
    pub fn body(&self, body: BodyId) -> Option<&RigidBody> {
        if let Some((region, handle)) = self.host.owned(body) {
            return region.physics().bodies.get(handle);
        }
        self.host.regions().find_map(|region| region.physics().bodies.get(region.handle_of(body)?))
    }

    /// Returns whether the world has a body.
    #[inline]
    pub fn contains(&self, body: BodyId) -> bool {
        self.host.owned(body).is_some() || self.host.immovable(body).is_some()
    }

    /// Returns the pose of a body in world space.
    #[inline]
    pub fn pose(&self, body: BodyId) -> Option<WorldPose> {
        match self.host.owned(body) {
            Some((region, handle)) => Some(region.world_pose(handle)),
            None => self.host.immovable(body).map(|record| record.state.pose),
        }
    }

    /// Returns the mass of a body in kilograms, whole even if several regions share it; 0 for a fixed body.
    pub fn mass_kg(&self, body: BodyId) -> Option<f32> {
        if self.body(body)?.is_fixed() { Some(0.0) } else { self.host.mass_kg(body) }
    }

    /// Returns the velocity of a body; zero for an immovable one.
    #[inline]
    pub fn velocity(&self, body: BodyId) -> Option<Velocity> {
        match self.host.owned(body) {
            Some((region, handle)) => Some(region.velocity(handle)),
            None => self.host.immovable(body).map(|record| record.state.velocity),
        }
    }

    /// Returns [`LocalWorld::pose`] and [`LocalWorld::velocity`] of a body in one look-up.
    #[inline]
    pub fn motion(&self, body: BodyId) -> Option<(WorldPose, Velocity)> {
        match self.host.owned(body) {
            Some((region, handle)) => Some(region.motion(handle)),
            None => self.host.immovable(body).map(|record| (record.state.pose, record.state.velocity)),
        }
    }

    /// Changes a body in place by Rapier's own setters, forces and impulses.
    pub fn update<R>(
        &mut self,
        body: BodyId,
        mut change: impl FnMut(&mut RigidBody) -> R,
    ) -> Result<R, WorldError> {
        self.host.attend(body)?;
        let mut copies = Copies::new(self.tape.is_some());
        let changed = self.host.update(body, |body| {
            let result = change(body);
            copies.note(body);
            result
        });
        match &changed {
            Ok(Some(_)) => self.tape_update(body, copies),
            Ok(None) => {}
            Err(_) => self.tape_spoilt(),
        }
        changed?.ok_or(WorldError::NoBody(body))
    }

    /// Pushes a dynamic body, and wakes it.
    pub fn push(&mut self, push: &Push) -> Result<(), WorldError> {
        push.check().map_err(|Invalid { field, rule }| WorldError::Setting {
            what: field,
            value: format!("{push:?}"),
            range: rule,
        })?;
        self.host.attend(push.body)?;
        let done = self.host.push(push);
        self.tape(done, || Operation::Push(*push));
        if done { Ok(()) } else { Err(WorldError::NoBody(push.body)) }
    }

    /// Adds a collider to a body, as the last of its list.
    pub fn insert_collider(&mut self, body: BodyId, collider: ColliderBuilder) -> Result<(), WorldError> {
        self.tape_spoilt();
        self.host.attend(body)?;
        if self.host.insert_collider(body, &collider)? { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Removes a collider from a body. The colliders after it move up by one.
    pub fn remove_collider(&mut self, body: BodyId, index: usize) -> Result<(), WorldError> {
        let count = self.body(body).ok_or(WorldError::NoBody(body))?.colliders().len();
        self.tape_spoilt();
        self.host.attend(body)?;
        if self.host.remove_collider(body, index)? {
            self.host.forget_unused_shapes();
            return Ok(());
        }
        Err(WorldError::NoCollider { body, index, count })
    }

    /// Changes a collider of a body in place, in all copies, by Rapier's own setters.
    pub fn update_collider<R>(
        &mut self,
        body: BodyId,
        index: usize,
        change: impl FnMut(&mut Collider) -> R,
    ) -> Result<R, WorldError> {
        let count = self.body(body).ok_or(WorldError::NoBody(body))?.colliders().len();
        self.tape_spoilt();
        self.host.attend(body)?;
        let changed = self.host.update_collider(body, index, change);
        self.host.forget_unused_shapes();
        changed?.ok_or(WorldError::NoCollider { body, index, count })
    }

    /// Moves a body to a pose at once.
    pub fn set_pose(&mut self, body: BodyId, pose: WorldPose) -> Result<(), WorldError> {
        if pose.is_valid() && self.contains(body) {
            self.host.attend(body)?;
            self.host.attend_at(pose.translation)?;
        }
        let done = self.or_spoil(|world| Ok(world.host.teleport(body, pose)?))?;
        self.tape(done, || Operation::SetPose(body, pose));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Sets the kinematic target of a position-based kinematic body, which it reaches at the end of the next
    /// tick.
    pub fn set_next_pose(&mut self, body: BodyId, pose: WorldPose) -> Result<(), WorldError> {
        if pose.is_valid() {
            self.host.attend(body)?;
        }
        let done = self.host.send_to(body, pose)?;
        self.tape(done, || Operation::SetNextPose(body, pose));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Sets a body's velocity and wakes it.
    pub fn set_velocity(&mut self, body: BodyId, velocity: Velocity) -> Result<(), WorldError> {
        if !velocity.is_finite() {
            return Err(HostError::NotFinite(body).into());
        }
        let limit_m_s = self.host.settings().speed_limit_m_s();
        if !velocity.is_within(limit_m_s)
            && let Some(mut record) = self.host.record(body)
        {
            record.state.velocity = velocity;
            check_speed(&record, limit_m_s)?;
        }
        self.host.attend(body)?;
        let done = self.host.steer(body, &velocity);
        self.tape(done, || Operation::SetVelocity(body, velocity));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Sets what the driver of a vehicle does from now on, and wakes the vehicle.
    pub(crate) fn drive(&mut self, body: BodyId, drive: &Drive) -> Result<(), WorldError> {
        if self.host.traits(body).is_some_and(|traits| traits.vehicle.is_some()) {
            self.host.attend(body)?;
        }
        let done = self.host.drive(body, drive);
        self.tape(done, || Operation::Drive(body, *drive));
        match done {
            true => Ok(()),
            false if self.contains(body) => Err(WorldError::NoVehicle(body)),
            false => Err(WorldError::NoBody(body)),
        }
    }

    /// Moves the plane of an inner vertex of the distribution tree, between its neighbours on the same axis.
    /// Bodies change owner as if they had crossed the plane by themselves. Sleeping bodies stay with their
    /// region until they wake. Balance may move the plane again.
    pub fn move_plane(&mut self, vertex: RegionId, at: f64) -> Result<(), WorldError> {
        let mut tree = self.host.partition().tree().clone();
        tree.move_plane(vertex, at)?;
        if !tree.is_sound() {
            let axis = tree.cut_of(vertex).map_or(Axis::X, |(axis, _)| axis);
            return Err(TreeError::Plane { axis, at }.into());
        }
        self.host.refit(tree)?;
        self.tape(true, || Operation::MovePlane(vertex, at));
        Ok(())
    }

    /// Sets the load balance, by which the regions follow the load from now on; `None` leaves the regions as
    /// they are.
    pub fn set_balance(&mut self, balance: Option<Balance>) -> Result<(), WorldError> {
        if let Some((what, value, range)) = balance.as_ref().and_then(Balance::fault) {
            return Err(WorldError::Setting { what, value, range });
        }
        self.host.set_balance(balance);
        self.tape_spoilt();
        Ok(())
    }

    /// Sets how the world is stepped from the next tick on. The coupling, exchanges, depth and island limit
    /// must stay as they are; the tolerance may change.
    pub fn set_settings(&mut self, settings: StepSettings) -> Result<(), WorldError> {
        if let Some((what, value, range)) = settings.fault() {
            return Err(WorldError::Setting { what, value, range });
        }
        let of = |all: &StepSettings| (all.coupling, all.exchanges, all.depth, all.island_limit);
        let (asked, present) = (of(&settings), of(&self.host.asked_settings()));
        if asked != present {
            let range = "the coupling, exchanges, depth and island limit that the world has";
            return Err(WorldError::Setting { what: "coupling", value: format!("{asked:?}"), range });
        }
        self.tape_spoilt();
        self.host.catch_up_all()?;
        self.host.set_settings(settings);
        Ok(())
    }

    /// Returns the region that has authority over a movable body.
    pub fn owner_of(&self, body: BodyId) -> Option<RegionId> {
        self.host.owned(body).map(|(region, _)| region.id())
    }

    /// Returns the contacts that began, ended or exceeded their force threshold in the last step, for
    /// colliders with Rapier's `ActiveEvents`.
    pub fn events(&self) -> &WorldEvents {
        &self.events
    }

    /// Returns the bodies that changed owner in the last step, in id order.
    pub fn handovers(&self) -> &[Handover] {
        self.host.handovers()
    }

    /// Returns the interface for rays, shape casts, projections and overlaps, over all regions.
    pub fn queries(&self) -> Queries<'_> {
        self.host.queries()
    }

    /// Returns the id, owner, pose and velocity of every movable body, in id order.
    pub fn states(&self) -> impl Iterator<Item = (BodyId, RegionId, WorldPose, Velocity)> {
        self.host.states()
    }

    /// Returns a hash of the state of all movable bodies: equal for equal worlds, whatever the number of
    /// threads.
    pub fn state_hash(&self) -> u64 {
        let mut hasher = StateHasher::default();
        for (id, _, pose, velocity) in self.states() {
            hasher.add(id, &pose, &velocity);
        }
        hasher.finish()
    }

    /// Returns the wall time of the last step.
    pub fn last_step(&self) -> Duration {
        self.last_step
    }

    /// Returns statistics of the world so far.
    pub fn stats(&self) -> Stats {
        Stats {
            ticks: self.host.tick().0,
            bodies: self.host.owned_count(),
            replicas: self.host.regions().map(Region::replica_count).sum(),
            transfers: self.host.transfers(),
            last_step: self.last_step,
            quarantined: self.host.regions().map(|region| region.quarantined().len()).sum(),
            exchanges: self.host.exchanges_done(),
            disagreement_m_s: self.host.disagreement_m_s(),
        }
    }

    /// Returns how the world is computed (regions, threads, coupling), and the reason for that.
    ///
    /// ```
    /// # use dcd::runtime::{LocalWorld, Why, WorldConfig};
    /// let world = LocalWorld::new(WorldConfig { threads: 2, ..WorldConfig::default() })?;
    /// let chosen = world.chosen();
    /// assert_eq!((chosen.regions, chosen.threads, chosen.why), (1, 2, Why::Exact));
    /// # Ok::<(), dcd::runtime::WorldError>(())
    /// ```
    pub fn chosen(&self) -> Choice {
        Choice {
            regions: self.regions().len(),
            threads: self.host.threads(),
            coupling: self.host.settings().coupling,
            why: self.why,
        }
    }

    /// Returns the regions in rank order, with their Rapier worlds.
    pub fn regions(&self) -> impl ExactSizeIterator<Item = &Region> + Clone {
        self.host.regions()
    }

    /// Returns the host that computes the regions.
    pub fn host(&self) -> &RegionHost {
        &self.host
    }

    pub(super) fn host_mut(&mut self) -> &mut RegionHost {
        &mut self.host
    }

    /// Returns how many regions have authority over a body. It is 1 for every movable body, or something is
    /// wrong.
    pub fn owners_of(&self, body: BodyId) -> usize {
        let owns = |region: &&Region| {
            region
                .handle_of(body)
                .and_then(|handle| region.role_of(handle))
                .is_some_and(|(_, role)| role == Ownership::Owner)
        };
        self.regions().filter(owns).count()
    }
}
